// SPDX-License-Identifier: MIT OR Apache-2.0
// Purpose   adds the pixels' gradients of the background.
// Equation  dL/dbackground = sum of T_N dL/dcolor.
// Grid      64 workgroups.
// Writes    partials, three vec4 per workgroup: the third; the others are left alone.
// Numerics  interleaved partial sums in a fixed order: the same bits in every run.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "grid.glsl"

layout(local_size_x = 64) in;

layout(push_constant) uniform Push { uint n; } pc;
layout(set = 0, binding = 0) restrict readonly buffer Tail { uvec2 tail[]; };
layout(set = 0, binding = 1) restrict readonly buffer DImage0 { vec4 d_image0[]; };
layout(set = 0, binding = 2) restrict writeonly buffer Partials { vec4 partials[]; };

shared vec4 sh_sums[64];

void main() {
    const uint lane = gl_LocalInvocationIndex;
    const uint group = linear_group();
    vec4 sum = vec4(0.0);
    for (uint i = group * 64u + lane; i < pc.n; i += 4096u) {
        sum += vec4(d_image0[i].xyz, 0.0) * uintBitsToFloat(tail[i].x);
    }
    sh_sums[lane] = sum;
    barrier();
    if (lane == 0u && group < 64u) {
        sum = vec4(0.0);
        for (uint k = 0u; k < 64u; ++k) sum += sh_sums[k];
        partials[3u * group + 2u] = sum;
    }
}
