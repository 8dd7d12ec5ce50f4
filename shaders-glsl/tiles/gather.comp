// SPDX-License-Identifier: MIT OR Apache-2.0
// Purpose   reads a table in the order of a list of indices.
// Equation  out[i] = table[index[i]].
// Grid      one thread per item.
// Numerics  integers only.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "grid.glsl"

layout(local_size_x = 64) in;

layout(set = 0, binding = 0) restrict readonly buffer Count { uint count[]; };
layout(set = 0, binding = 1) restrict readonly buffer Index { uint index[]; };
layout(set = 0, binding = 2) restrict readonly buffer Table { uint table[]; };
layout(set = 0, binding = 3) restrict writeonly buffer Gathered { uint gathered[]; };

void main() {
    const uint i = linear_thread(gl_WorkGroupSize.x);
    if (i < count[0]) gathered[i] = table[index[i]];
}
