// SPDX-License-Identifier: MIT OR Apache-2.0
// Purpose   measures the bandwidth of streaming copies.
// Equation  target_i = source_i.
// Grid      one workgroup per PARTS times 64 vec4: what a thread costs to start is spread over several.
// Numerics  none.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "grid.glsl"

layout(local_size_x = 64) in;

const uint PARTS = 8u;

layout(push_constant) uniform Push { uint n; } pc;
layout(set = 0, binding = 0) restrict readonly buffer Source { vec4 source[]; };
layout(set = 0, binding = 1) restrict writeonly buffer Target { vec4 target[]; };

void main() {
    const uint first = 64u * PARTS * linear_group() + gl_LocalInvocationIndex;
    for (uint k = 0u; k < PARTS; ++k) {
        const uint i = first + 64u * k;
        if (i < pc.n) target[i] = source[i];
    }
}
