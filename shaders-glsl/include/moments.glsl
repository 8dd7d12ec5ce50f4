// Adam's moments of the planes of a parameter buffer, in blocks as the parameters are (plane_index of grid.glsl).
//
// As floats they lie in twice the planes: 2p the first, 2p + 1 the second of plane p. With MOMENTS_16 in as many planes as the
// parameters: a word holds the first moment above, as bfloat16 (8 bits of exponent, 7 of mantissa), and below it the second,
// which is never negative, without its sign (8 of exponent, 8 of mantissa). Both have the range of floats, so neither needs a
// scale: a half would lose the square of a gradient below 2e-4. A step is computed before its moments are rounded.

// The numbers of moment words of a Gaussian: what is drawn for each is different.
struct Draw { uint step; uint index; uint plane; };

#ifdef MOMENTS_16
#include "random.glsl"

const uint LARGEST_BITS = 0x7f7fffffu;
const uint INFINITY_BITS = 0x7f800000u;

// Magnitudes plus `noise`, which is below the last bit that is kept: cut off there, the mean is the magnitude itself (stochastic
// rounding, Gupta et al. 2015). To the nearest would not do: a step changes a second moment by a thousandth at most, which is
// less than half its last bit, so it would never move. What is finite stays so, 0 stays 0; what is not becomes infinity.
uvec4 noisy(uvec4 magnitude, uvec4 noise) {
    return mix(min(magnitude + noise, uvec4(LARGEST_BITS)), uvec4(INFINITY_BITS), greaterThanEqual(magnitude, uvec4(INFINITY_BITS)));
}

vec4 packed_moments(vec4 m, vec4 v, Draw draw) {
    const uint first = 4u * draw.plane;
    const uvec4 bits = uvec4(random_bits(draw.step, draw.index, first), random_bits(draw.step, draw.index, first + 1u),
        random_bits(draw.step, draw.index, first + 2u), random_bits(draw.step, draw.index, first + 3u));
    const uvec4 m_bits = floatBitsToUint(m);
    const uvec4 upper = noisy(m_bits & 0x7fffffffu, bits & 0xffffu) & 0xffff0000u;
    const uvec4 lower = noisy(floatBitsToUint(v) & 0x7fffffffu, bits >> 17u) >> 15u;
    return uintBitsToFloat((m_bits & 0x80000000u) | upper | lower);
}

vec4 first_moments(vec4 words) { return uintBitsToFloat(floatBitsToUint(words) & 0xffff0000u); }
vec4 second_moments(vec4 words) { return uintBitsToFloat((floatBitsToUint(words) & 0xffffu) << 15u); }

uint moments_index(uint i, uint planes, uint p) { return plane_index(i, planes, p); }

#define READ_MOMENTS(moments, at, m, v) vec4 m = first_moments(moments[at]), v = second_moments(moments[at]);
#define WRITE_MOMENTS(moments, at, m, v, draw) moments[at] = packed_moments(m, v, draw);
#else
uint moments_index(uint i, uint planes, uint p) { return plane_index(i, 2u * planes, 2u * p); }

#define READ_MOMENTS(moments, at, m, v) vec4 m = moments[at], v = moments[at + 32u];
#define WRITE_MOMENTS(moments, at, m, v, draw) { moments[at] = m; moments[at + 32u] = v; }
#endif
