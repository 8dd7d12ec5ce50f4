// SPDX-License-Identifier: MIT OR Apache-2.0
// Purpose   carries the cotangent of a pool back to the greatest value of each window.
// Equation  dx[q] += sum over windows p that chose q of dy[p].
// Grid      one thread per input pixel and four channels; a pixel lies in up to four windows.
// Writes    d_features: the sum with what is there, 0 where the features are not above 0 (the ReLU before the pool).
// Numerics  the windows are added in a fixed order.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "grid.glsl"

layout(local_size_x = 64) in;

layout(push_constant) uniform Push { uint width; uint height; uint planes; uint out_width; uint out_height; } pc;
layout(set = 0, binding = 0) restrict readonly buffer Features { vec4 features[]; };
layout(set = 0, binding = 1) restrict readonly buffer Choices { uint choices[]; };
layout(set = 0, binding = 2) restrict readonly buffer DPooled { vec4 d_pooled[]; };
layout(set = 0, binding = 3) restrict buffer DFeatures { vec4 d_features[]; };

void main() {
    const uint i = linear_thread(gl_WorkGroupSize.x);
    if (i >= pc.width * pc.height * pc.planes) return;
    const uint pixel = i / pc.planes;
    const uvec2 at = uvec2(pixel % pc.width, pixel / pc.width);
    vec4 d = d_features[i];
    for (uint k = 0u; k < 4u; ++k) {
        // Windows begin at even pixels: one holds the pixel as its first or second, another may as its third.
        const uvec2 back = uvec2(k % 2u, k / 2u);
        const uvec2 window = at / 2u - back;
        const uvec2 tap = at % 2u + 2u * back;
        // Before the first window the difference wraps around.
        const bool inside = all(lessThan(window, uvec2(pc.out_width, pc.out_height))) && all(lessThan(tap, uvec2(3u)));
        const uint source = inside ? (window.y * pc.out_width + window.x) * pc.planes + i % pc.planes : 0u;
        const uvec4 choice = uvec4(choices[source]) >> uvec4(0u, 8u, 16u, 24u) & 255u;
        const vec4 value = d_pooled[source];
        d += mix(vec4(0.0), value, equal(choice, uvec4(inside ? 3u * tap.y + tap.x : 255u)));
    }
    d_features[i] = mix(vec4(0.0), d, greaterThan(features[i], vec4(0.0)));
}
