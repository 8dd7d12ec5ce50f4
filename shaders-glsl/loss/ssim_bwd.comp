// SPDX-License-Identifier: MIT OR Apache-2.0
// Purpose   filters the derivatives of SSIM and forms the cotangent of the colour.
// Equation  L = (1 - lambda) mean|x - y| + lambda (1 - mean S); dS/dx = f(dE[x]) + 2 x f(dE[xx]) + y f(dE[xy]). The window is
//           symmetric, so its adjoint is itself.
// Grid      a workgroup per tile of RUN rows of pixels; a place stands for STRIDE x STRIDE of them.
// Writes    d_image: the colour's cotangent, and 0 for alpha.
// Numerics  the absolute error has derivative 0 at 0; where the mask hides a pixel everything is 0. Plain sums in a fixed order.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "grid.glsl"
#include "ssim.glsl"

#ifndef STRIDE
#define STRIDE 1u
#endif
#define NUMBERS vec3
#define APART 1u
#define EVERY STRIDE
#define PLACE(CHANNEL, COLUMN) ((CHANNEL) * COLUMNS + (COLUMN))
#include "ssim_filter.glsl"

layout(local_size_x = 128) in;

// The weights hold lambda, and the number of channels and visible pixels that the means are over.
layout(push_constant) uniform Push { uint width; uint height; float l1_weight; float ssim_weight; } pc;
layout(set = 0, binding = 0) restrict readonly buffer Partials { float partials[]; };
layout(set = 0, binding = 1) restrict readonly buffer Image { vec4 image[]; };
layout(set = 0, binding = 2) restrict readonly buffer Truth { uint truth[]; };
layout(set = 0, binding = 3) restrict writeonly buffer DImage { vec4 d_image[]; };

// The three derivatives of a channel at a place; zeros outside.
vec3 partials_at(int x, int y, uint channel, ivec2 places) {
    const bool inside = x >= 0 && x < places.x && y >= 0 && y < places.y;
    const uint n = uint(places.x * places.y);
    const uint at = 3u * channel * n + (inside ? uint(y * places.x + x) : 0u);
    return inside ? vec3(partials[at], partials[at + n], partials[at + 2u * n]) : vec3(0.0);
}

void filter_down(uint thread, uvec2 first, out vec3 sum[RUN]) {
    const uint channel = min(thread / COLUMNS, 2u);
    const ivec2 places = ivec2(div_ceil(pc.width, STRIDE), div_ceil(pc.height, STRIDE));
    const int x = int(first.x / STRIDE + thread % COLUMNS) - int(SSIM_RADIUS / STRIDE);
    const int y = int(first.y / STRIDE) - int(SSIM_RADIUS / STRIDE);
#define PARTIALS(T) partials_at(x, y + int(T), channel, places)
    FILTER(PARTIALS)
}

void main() {
    const uint thread = gl_LocalInvocationIndex;
    const uint across = div_ceil(pc.width, TILE_COLUMNS);
    const uvec2 first = uvec2(linear_group() % across * TILE_COLUMNS, linear_group() / across * RUN);
    vec3 down[RUN];
    filter_down(thread, first, down);
    filter_across(thread, down);
    for (uint k = 0u; k < ACROSS * RUN / 128u; ++k) {
        const uint i = 128u * k + thread;
        const uvec2 at = first + uvec2(i % ACROSS, i / ACROSS);
        if (at.x < pc.width && at.y < pc.height) {
            const uint pixel = at.y * pc.width + at.x;
            const vec4 y = unpack_truth(truth[pixel]);
            const vec3 x = visible_color(image[pixel].xyz, y);
            // By derivative, not by channel.
            const mat3 d_moments = transpose(mat3(filtered(0u, i), filtered(1u, i), filtered(2u, i)));
            precise vec3 d_ssim = d_moments[0] + (2.0 * x * d_moments[1] + y.xyz * d_moments[2]);
            const vec3 d = pc.l1_weight * sign(x - y.xyz) - pc.ssim_weight * d_ssim;
            d_image[pixel] = vec4(y.w * d, 0.0);
        }
    }
}
