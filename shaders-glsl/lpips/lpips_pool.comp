// SPDX-License-Identifier: MIT OR Apache-2.0
// Purpose   takes the greatest of each 3 x 3 window, two pixels apart, and keeps which it was.
// Equation  y[p] = max over t of x[2 p + t]; what lies outside does not count.
// Grid      one thread per output pixel and four channels.
// Writes    pooled; choices: place in the window, 0 to 8 by row, a byte per channel.
// Numerics  of equal values the first is chosen.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "grid.glsl"

layout(local_size_x = 64) in;

layout(push_constant) uniform Push { uint width; uint height; uint planes; uint out_width; uint out_height; } pc;
layout(set = 0, binding = 0) restrict readonly buffer Features { vec4 features[]; };
layout(set = 0, binding = 1) restrict writeonly buffer Pooled { vec4 pooled[]; };
layout(set = 0, binding = 2) restrict writeonly buffer Choices { uint choices[]; };

void main() {
    const uint i = linear_thread(gl_WorkGroupSize.x);
    if (i >= pc.out_width * pc.out_height * pc.planes) return;
    const uint pixel = i / pc.planes;
    const uvec2 first = 2u * uvec2(pixel % pc.out_width, pixel / pc.out_width);
    const uint corner = (first.y * pc.width + first.x) * pc.planes + i % pc.planes;
    vec4 best = features[corner];
    uvec4 choice = uvec4(0u);
    for (uint k = 1u; k < 9u; ++k) {
        const uvec2 tap = uvec2(k % 3u, k / 3u);
        const bool inside = first.x + tap.x < pc.width && first.y + tap.y < pc.height;
        const vec4 value = features[corner + (inside ? (tap.y * pc.width + tap.x) * pc.planes : 0u)];
        const bvec4 better = greaterThan(value, best);
        best = mix(best, value, better);
        choice = mix(choice, uvec4(k), better);
    }
    pooled[i] = best;
    choices[i] = choice.x | choice.y << 8u | choice.z << 16u | choice.w << 24u;
}
