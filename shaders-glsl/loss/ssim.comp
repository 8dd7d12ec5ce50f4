// SPDX-License-Identifier: MIT OR Apache-2.0
// Purpose   filters the moments of picture and truth, forms SSIM and its derivatives, and sums 1 - SSIM and the absolute error.
// Equation  E[x], E[y], E[x x + y y], E[x y] under SSIM's window (SPEC 4);
//           S = (2 mx my + C1)(2 sxy + C2) / ((mx^2 + my^2 + C1)(sxx + syy + C2)); L1 = |x - y|.
// Grid      a workgroup per tile of RUN rows of places. A place stands for STRIDE x STRIDE pixels, at the first of which SSIM is
//           taken.
// Writes    partials: nine planes of places: of each channel dS/dE[x], dS/dE[xx], dS/dE[xy]; sums: (1 - S, L1, squared error) per
//           workgroup, summed over places, pixels and channels in a fixed order.
// Numerics  SSIM asks for the sum of the variances alone: sxx + syy = E[xx + yy] - (mx^2 + my^2) is clamped at 0, with zero
//           derivative there. Where x = y the sum of the squares is twice the product, bit for bit.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "grid.glsl"
#include "ssim.glsl"

// SSIM may be taken at every STRIDE-th pixel of every STRIDE-th row alone; its gradient reaches all pixels.
#ifndef STRIDE
#define STRIDE 1u
#endif
#define NUMBERS vec4
#define APART STRIDE
#define EVERY 1u
#define PLACE(CHANNEL, COLUMN) (3u * (COLUMN) + (CHANNEL))
#include "ssim_filter.glsl"

layout(local_size_x = 128) in;

layout(push_constant) uniform Push { uint width; uint height; } pc;
layout(set = 0, binding = 0) restrict readonly buffer Image { vec4 image[]; };
layout(set = 0, binding = 1) restrict readonly buffer Truth { uint truth[]; };
layout(set = 0, binding = 2) restrict writeonly buffer Partials { float partials[]; };
layout(set = 0, binding = 3) restrict writeonly buffer Sums { vec4 sums[]; };

// A channel of a pixel of picture and truth; zeros outside.
vec2 pair_at(int x, int y, uint channel) {
    const bool inside = x >= 0 && x < int(pc.width) && y >= 0 && y < int(pc.height);
    const uint pixel = inside ? uint(y) * pc.width + uint(x) : 0u;
    const uint word = truth[pixel];
    precise vec2 unit = vec2(uvec2(word >> 8u * channel, word >> 24u) & 255u) * (1.0 / 255.0);
    return inside ? vec2(mix(unit.x, image[pixel][channel], unit.y), unit.x) : vec2(0.0);
}

vec4 moments_of(vec2 pair) {
    precise vec2 squares = pair * pair;
    precise float product = pair.x * pair.y;
    precise float both = squares.x + squares.y;
    return vec4(pair, both, product);
}

void filter_down(uint thread, uvec2 first, out vec4 sum[RUN]) {
    const uint channel = thread % 3u;
    const int x = int(first.x + thread / 3u) - int(SSIM_RADIUS);
    const int y = int(first.y) - int(SSIM_RADIUS);
#define MOMENTS(T) moments_of(pair_at(x, y + int(T), channel))
    FILTER(MOMENTS)
}

// A derivative of the three channels, whose planes are three apart.
void put(uint at, uint n_places, vec3 d) {
    partials[at] = d.x;
    partials[at + 3u * n_places] = d.y;
    partials[at + 6u * n_places] = d.z;
}

// SSIM of a place from its moments, with the derivatives; 1 - S summed over the channels.
float similarity(vec4 red, vec4 green, vec4 blue, uint place, uint n_places) {
    const vec3 mx = vec3(red.x, green.x, blue.x);
    const vec3 my = vec3(red.y, green.y, blue.y);
    precise vec3 means = mx * mx + my * my;
    precise vec3 variances = vec3(red.z, green.z, blue.z) - means;
    // Where the variances are rounding, so is the covariance.
    const vec3 varies = vec3(greaterThan(variances, vec3(0.0)));
    precise vec3 sxy = varies * (vec3(red.w, green.w, blue.w) - mx * my);
    precise vec3 c = means + SSIM_C1;
    precise vec3 d = max(variances, vec3(0.0)) + SSIM_C2;
    // By their distance from 1, which is exactly 0 where picture and truth are equal: a quotient of two equal numbers need not be 1.
    precise vec3 p = 1.0 - (means - 2.0 * mx * my) / c;
    precise vec3 q = 1.0 - (d - (2.0 * sxy + SSIM_C2)) / d;
    precise vec3 s = p * q;
    // With d and sxy held, then through d = E[xx + yy] - mx^2 - my^2 + C2 and sxy = E[xy] - mx my. Bracketed so that
    // everything cancels to 0, bit for bit, where picture and truth are equal.
    precise vec3 by_d = varies / d;
    precise vec3 d_exx = -(s * by_d);
    precise vec3 d_exy = 2.0 * (p * by_d);
    precise vec3 d_mx = 2.0 * (my * q - mx * s) / c - (2.0 * mx * d_exx + my * d_exy);
    put(place, n_places, d_mx);
    put(place + n_places, n_places, d_exx);
    put(place + 2u * n_places, n_places, d_exy);
    return (1.0 - s.x) + (1.0 - s.y) + (1.0 - s.z);
}

// The absolute and the squared error of a pixel; none outside.
vec2 error_at(uvec2 at) {
    const bool inside = at.x < pc.width && at.y < pc.height;
    const uint pixel = inside ? at.y * pc.width + at.x : 0u;
    const vec4 y = unpack_truth(truth[pixel]);
    const vec3 error = abs(visible_color(image[pixel].xyz, y) - y.xyz);
    return inside ? vec2(error.x + error.y + error.z, dot(error, error)) : vec2(0.0);
}

void main() {
    const uint thread = gl_LocalInvocationIndex;
    const uvec2 places = uvec2(div_ceil(pc.width, STRIDE), div_ceil(pc.height, STRIDE));
    const uvec2 tiles = uvec2(div_ceil(places.x, ACROSS), div_ceil(places.y, RUN));
    const uint tile = linear_group();
    const uvec2 first = uvec2(tile % tiles.x * ACROSS, tile / tiles.x * RUN);
    vec4 down[RUN];
    filter_down(thread, STRIDE * first, down);
    filter_across(thread, down);
    vec3 own = vec3(0.0);
    for (uint k = 0u; k < ACROSS * RUN / 128u; ++k) {
        const uint i = 128u * k + thread;
        const uvec2 at = first + uvec2(i % ACROSS, i / ACROSS);
        if (at.x < places.x && at.y < places.y) {
            const uint place = at.y * places.x + at.x;
            own.x += similarity(filtered(0u, i), filtered(1u, i), filtered(2u, i), place, places.x * places.y);
            for (uint q = 0u; q < STRIDE * STRIDE; ++q) own.yz += error_at(STRIDE * at + uvec2(q % STRIDE, q / STRIDE));
        }
    }
    barrier();
    sh[thread] = vec4(own, 0.0);
    barrier();
    if (thread < 16u) {
        for (uint k = 1u; k < 8u; ++k) sh[thread] += sh[thread + 16u * k];
    }
    barrier();
    if (thread == 0u && tile < tiles.x * tiles.y) {
        for (uint k = 1u; k < 16u; ++k) sh[0] += sh[k];
        sums[tile] = sh[0];
    }
}
