// SPDX-License-Identifier: MIT OR Apache-2.0
// Purpose   filters the derivatives of SSIM along the columns and forms the cotangent of the colour.
// Equation  L = (1 - lambda) mean|x - y| + lambda (1 - mean S); dS/dx = f(dE[x]) + 2 x f(dE[xx]) + y f(dE[xy]).
// Grid      one thread per RUN pixels of a column.
// Writes    d_image: the colour's cotangent, and 0 for alpha.
// Numerics  the absolute error has derivative 0 at 0; where the mask hides a pixel everything is 0.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "grid.glsl"
#include "ssim.glsl"

layout(local_size_x = 64) in;

// The weights hold lambda, and the number of channels and visible pixels that the means are over.
layout(push_constant) uniform Push { uint width; uint height; float l1_weight; float ssim_weight; } pc;
layout(set = 0, binding = 0) restrict readonly buffer Filtered { vec4 filtered[]; };
layout(set = 0, binding = 1) restrict readonly buffer Image { vec4 image[]; };
layout(set = 0, binding = 2) restrict readonly buffer Truth { uint truth[]; };
layout(set = 0, binding = 3) restrict writeonly buffer DImage { vec4 d_image[]; };

void main() {
    const uint runs = div_ceil(pc.height, RUN);
    const uint i = linear_thread(gl_WorkGroupSize.x);
    if (i >= runs * pc.width) return;
    const uint column = i % pc.width;
    const uint first = (i / pc.width) * RUN;
    vec4 p0[RUN];
    vec4 p1[RUN];
    float p2[RUN];
    for (uint k = 0u; k < RUN; ++k) {
        p0[k] = p1[k] = vec4(0.0);
        p2[k] = 0.0;
    }
    const uint places = div_ceil(pc.height, STRIDE);
    for (uint t = FIRST_PLACE; t < 2u * SSIM_RADIUS + RUN; t += STRIDE) {
        const int place = (int(first + t) - int(SSIM_RADIUS)) / int(STRIDE);
        const bool inside = first + t >= SSIM_RADIUS && place < int(places);
        const uint at = 3u * (uint(clamp(place, 0, int(places) - 1)) * pc.width + column);
        const vec4 a0 = filtered[at];
        const vec4 a1 = filtered[at + 1u];
        const float a2 = filtered[at + 2u].x;
        for (uint k = 0u; k < RUN; ++k) {
            if (t >= k && t - k <= 2u * SSIM_RADIUS) {
                const float w = inside ? SSIM_WINDOW[t - k] : 0.0;
                p0[k] += w * a0;
                p1[k] += w * a1;
                p2[k] += w * a2;
            }
        }
    }
    for (uint k = 0u; k < RUN; ++k) {
        if (first + k < pc.height) {
            const uint pixel = (first + k) * pc.width + column;
            const vec4 y = unpack_truth(truth[pixel]);
            const vec3 x = visible_color(image[pixel].xyz, y);
            precise vec3 d_ssim = p0[k].xyz + (2.0 * x * vec3(p0[k].w, p1[k].xy) + y.xyz * vec3(p1[k].zw, p2[k]));
            const vec3 d = pc.l1_weight * sign(x - y.xyz) - pc.ssim_weight * d_ssim;
            d_image[pixel] = vec4(y.w * d, 0.0);
        }
    }
}
