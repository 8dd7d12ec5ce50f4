// Adam's moments of the planes of a parameter buffer, in blocks as the parameters are (plane_index of grid.glsl).
//
// As floats they lie in twice the planes: 2p the first, 2p + 1 the second of plane p. With MOMENTS_16 in as many planes as the
// parameters: a word holds the first moment above, as bfloat16 (8 bits of exponent, 7 of mantissa), and below it the second,
// which is never negative, without its sign (8 of exponent, 8 of mantissa). Both have the range of floats, so neither needs a
// scale: a half would lose the square of a gradient below 2e-4. A step is computed before its moments are rounded.

#ifdef MOMENTS_16
#include "random.glsl"

const uint LARGEST_BITS = 0x7f7fffffu;
const uint INFINITY_BITS = 0x7f800000u;

// Magnitudes plus `noise`, which is below the last bit that is kept: cut off there, the mean is the magnitude itself (stochastic
// rounding, Gupta et al. 2015). To the nearest would not do: a second moment falls by a thousandth in a step, about half its
// last bit at most, and would stand still. What is finite stays so, 0 stays 0; what is not becomes infinity.
uvec4 noisy(uvec4 magnitude, uvec4 noise) {
    return mix(min(magnitude + noise, uvec4(LARGEST_BITS)), uvec4(INFINITY_BITS), greaterThanEqual(magnitude, uvec4(INFINITY_BITS)));
}

// What is drawn from for the moments of the Gaussian of flat index `index` at step `step`.
uint moments_key(uint step, uint index) { return random_key(step, index); }

vec4 packed_moments(vec4 m, vec4 v, uint key, uint plane) {
    const uint draw = 4u * plane + key;
    const uvec4 bits = uvec4(permute(draw), permute(draw + 1u), permute(draw + 2u), permute(draw + 3u));
    const uvec4 m_bits = floatBitsToUint(m);
    const uvec4 upper = noisy(m_bits & 0x7fffffffu, bits & 0xffffu) & 0xffff0000u;
    const uvec4 lower = noisy(floatBitsToUint(v) & 0x7fffffffu, bits >> 17u) >> 15u;
    return uintBitsToFloat((m_bits & 0x80000000u) | upper | lower);
}

vec4 first_moments(vec4 words) { return uintBitsToFloat(floatBitsToUint(words) & 0xffff0000u); }
vec4 second_moments(vec4 words) { return uintBitsToFloat((floatBitsToUint(words) & 0xffffu) << 15u); }

uint moments_index(uint i, uint planes, uint p) { return plane_index(i, planes, p); }

#define READ_MOMENTS(moments, at, m, v) vec4 m = first_moments(moments[at]), v = second_moments(moments[at]);
#define WRITE_MOMENTS(moments, at, m, v, key, plane) moments[at] = packed_moments(m, v, key, plane);
#else
uint moments_index(uint i, uint planes, uint p) { return plane_index(i, 2u * planes, 2u * p); }
uint moments_key(uint step, uint index) { return 0u; }

#define READ_MOMENTS(moments, at, m, v) vec4 m = moments[at], v = moments[at + 32u];
#define WRITE_MOMENTS(moments, at, m, v, key, plane) { moments[at] = m; moments[at + 32u] = v; }
#endif
