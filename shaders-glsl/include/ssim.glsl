// The window of SSIM (SPEC 4): 11 taps of a Gaussian of sigma 1.5, normalised; zero padding.

const uint SSIM_RADIUS = 5u;
const float SSIM_WINDOW[11] = float[11](0.0010283801, 0.0075987581, 0.0360007721, 0.1093606895, 0.2130055377,
    0.2660117249, 0.2130055377, 0.1093606895, 0.0360007721, 0.0075987581, 0.0010283801);

const float SSIM_C1 = 0.0001;
const float SSIM_C2 = 0.0009;

// A training image's pixel: RGB and the mask in the top byte, 8 bits each.
// Decoded by a product, which every device rounds alike, unlike a division; 255 gives exactly 1.
vec4 unpack_truth(uint word) {
    precise vec4 unit = vec4(uvec4(word, word >> 8u, word >> 16u, word >> 24u) & 255u) * (1.0 / 255.0);
    return unit;
}

// What the losses compare with the truth: where the mask hides a pixel the truth itself, which has no error there.
vec3 visible_color(vec3 rendered, vec4 truth) { return mix(truth.xyz, rendered, truth.w); }
