// SPDX-License-Identifier: MIT OR Apache-2.0
// Purpose   measures the rate at which scattered rows of 64 bytes come in, each lane its own, as splats do.
// Equation  sum_i = the sum of the four vec4 of ROWS rows; the rows of all threads are a permutation.
// Grid      one thread per sum.
// Numerics  exact for small integers.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "grid.glsl"

layout(local_size_x = 64) in;

const uint ROWS = 4u;
// Odd: a multiple modulo a power of two is a permutation.
const uint SCATTER = 2654435761u;

layout(push_constant) uniform Push { uint n; uint mask; } pc;
layout(set = 0, binding = 0) restrict readonly buffer Rows { vec4 rows[]; };
layout(set = 0, binding = 1) restrict writeonly buffer Sums { vec4 sums[]; };

void main() {
    const uint i = linear_thread(64u);
    if (i >= pc.n) return;
    vec4 sum = vec4(0.0);
    for (uint k = 0u; k < ROWS; ++k) {
        const uint row = ((ROWS * i + k) * SCATTER) & pc.mask;
        sum += rows[4u * row] + rows[4u * row + 1u] + rows[4u * row + 2u] + rows[4u * row + 3u];
    }
    sums[i] = sum;
}
