// SPDX-License-Identifier: MIT OR Apache-2.0
// Purpose   counts the digits of each block of 2,048 keys, and those of each range of blocks.
// Equation  none (LSD radix sort; stable by construction in sort_scatter and sort_exchange).
// Grid      one workgroup per block.
// Numerics  integers only. `range_counts` is zero at the start.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "grid.glsl"
#include "args.glsl"
#include "sort.glsl"

layout(local_size_x = 256) in;

layout(push_constant) uniform Push { uint shift; uint mask; } pc;
layout(set = 0, binding = 0) restrict readonly buffer Count { uint count[]; };
layout(set = 0, binding = 1) restrict readonly buffer Keys { uint keys[]; };
layout(set = 0, binding = 2) restrict writeonly buffer BlockCounts { uint block_counts[]; };
layout(set = 0, binding = 3) restrict buffer RangeCounts { uint range_counts[]; };

shared uint sh_counts[DIGITS];

void main() {
    const uint thread = gl_LocalInvocationIndex;
    const uint block = linear_group();
    const uint n = count[0];
    const uint n_blocks = div_ceil(n, SORT_BLOCK);
    sh_counts[thread] = 0u;
    barrier();
    for (uint k = 0u; k < SORT_BLOCK / DIGITS; ++k) {
        const uint i = block * SORT_BLOCK + k * DIGITS + thread;
        if (i < n) atomicAdd(sh_counts[(keys[i] >> pc.shift) & pc.mask], 1u);
    }
    barrier();
    if (block < n_blocks) {
        const uint own = sh_counts[thread];
        block_counts[block * DIGITS + thread] = own;
        if (own > 0u) atomicAdd(range_counts[block / range_blocks(n_blocks) * DIGITS + thread], own);
    }
}
