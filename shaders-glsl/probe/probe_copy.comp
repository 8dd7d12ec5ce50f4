// SPDX-License-Identifier: MIT OR Apache-2.0
// Purpose   measures the bandwidth of streaming copies.
// Equation  target_i = source_i.
// Grid      one thread per vec4.
// Numerics  none.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "grid.glsl"

layout(local_size_x = 64) in;

layout(push_constant) uniform Push { uint n; } pc;
layout(set = 0, binding = 0) restrict readonly buffer Source { vec4 source[]; };
layout(set = 0, binding = 1) restrict writeonly buffer Target { vec4 target[]; };

void main() {
    const uint i = linear_thread(64u);
    if (i >= pc.n) return;
    target[i] = source[i];
}
