// SPDX-License-Identifier: MIT OR Apache-2.0
// Purpose   filters the derivatives of SSIM along the rows.
// Equation  the window is symmetric, so its adjoint is itself.
// Grid      one thread per RUN pixels of a row of places; from places, of which one stands for STRIDE pixels, to all pixels
//           of their rows.
// Numerics  plain sums in a fixed order.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "grid.glsl"
#include "ssim.glsl"

layout(local_size_x = 64) in;

layout(push_constant) uniform Push { uint width; uint height; } pc;
layout(set = 0, binding = 0) restrict readonly buffer Partials { vec4 partials[]; };
layout(set = 0, binding = 1) restrict writeonly buffer Filtered { vec4 filtered[]; };

void main() {
    const uint runs = div_ceil(pc.width, RUN);
    const uint i = linear_thread(gl_WorkGroupSize.x);
    if (i >= runs * div_ceil(pc.height, STRIDE)) return;
    const uint row = i / runs;
    const uint first = (i % runs) * RUN;
    vec4 p0[RUN];
    vec4 p1[RUN];
    float p2[RUN];
    for (uint k = 0u; k < RUN; ++k) {
        p0[k] = p1[k] = vec4(0.0);
        p2[k] = 0.0;
    }
    const uint places = div_ceil(pc.width, STRIDE);
    for (uint t = FIRST_PLACE; t < 2u * SSIM_RADIUS + RUN; t += STRIDE) {
        const int place = (int(first + t) - int(SSIM_RADIUS)) / int(STRIDE);
        const bool inside = first + t >= SSIM_RADIUS && place < int(places);
        const uint at = 3u * (row * places + uint(clamp(place, 0, int(places) - 1)));
        const vec4 a0 = partials[at];
        const vec4 a1 = partials[at + 1u];
        const float a2 = partials[at + 2u].x;
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
        if (first + k < pc.width) {
            const uint at = 3u * (row * pc.width + first + k);
            filtered[at] = p0[k];
            filtered[at + 1u] = p1[k];
            filtered[at + 2u] = vec4(p2[k], 0.0, 0.0, 0.0);
        }
    }
}
