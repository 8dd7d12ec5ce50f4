// Sums of gradients over the images of a step, in 64 bits of fixed point (fixed.glsl): they have the same bits in whatever order
// images are added, and on however many machines.
//
// They lie in twice the planes of the parameters: 2p the low words, 2p + 1 the high words of plane p. The constant band has a
// fourth number, which no gradient needs: how hard the centre was pulled, and in how many images.

// A gradient of 1. Beyond +-2^54 / BATCH_SCALE, which is +-16, it counts as that; 512 such gradients fit.
const float BATCH_SCALE = 1125899906842624.0;  // 2^50
const float BATCH_LARGEST = 18014397435740160.0;  // the float below 2^54
// A pull of 1; one beyond PULL_LARGEST counts as that. Above bit PULL_BITS is the number of images: at most 64, so a sum of pulls
// stays below it.
const float PULL_SCALE = 1099511627776.0;  // 2^40
const float PULL_LARGEST = 32.0;
const uint PULL_BITS = 52u;

// a + b of two words, low word first, in two's complement.
uvec2 sum_of(uvec2 a, uvec2 b) {
    const uint low = a.x + b.x;
    return uvec2(low, a.y + b.y + uint(low < a.x));
}

// The gradient g, which is finite, as it is summed.
uvec2 batch_word(float g) {
    return to_fixed(clamp(g * BATCH_SCALE, -BATCH_LARGEST, BATCH_LARGEST));
}

// The pull on a centre, below 0 where the image does not count.
uvec2 pull_word(float pull) {
    uvec2 word = to_fixed(clamp(pull, 0.0, PULL_LARGEST) * PULL_SCALE);
    word.y += 1u << (PULL_BITS - 32u);
    return pull < 0.0 ? uvec2(0u) : word;
}

// Sum of the pulls, and their number.
vec2 pulls_of(uvec2 word) {
    const uint count = word.y >> (PULL_BITS - 32u);
    word.y -= count << (PULL_BITS - 32u);
    return vec2(from_fixed(word) * (1.0 / PULL_SCALE), float(count));
}
