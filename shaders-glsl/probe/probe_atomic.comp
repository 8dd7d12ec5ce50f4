// SPDX-License-Identifier: MIT OR Apache-2.0
// Purpose   measures the rate of atomic additions to scattered rows of 64 bytes, 16 neighbours to a row.
// Equation  each thread adds one to TERMS words.
// Grid      one thread per TERMS additions.
// Numerics  exact: integers.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "grid.glsl"

layout(local_size_x = 64) in;

const uint TERMS = 8u;
// Odd: a multiple modulo a power of two is a permutation.
const uint SCATTER = 2654435761u;

layout(push_constant) uniform Push { uint n; uint mask; } pc;
layout(set = 0, binding = 0) restrict readonly buffer Term { uint term[]; };
layout(set = 0, binding = 1) restrict buffer Words { uint words[]; };

void main() {
    const uint i = linear_thread(64u);
    if (i >= pc.n) return;
    const uint one = term[0];
    for (uint k = 0u; k < TERMS; ++k) {
        const uint row = ((TERMS * (i >> 4u) + k) * SCATTER) & pc.mask;
        atomicAdd(words[16u * row + (i & 15u)], one);
    }
}
