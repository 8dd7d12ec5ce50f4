// SPDX-License-Identifier: MIT OR Apache-2.0
// Purpose   counts the 8-bit digits of each block of 2,048 keys, digit-major, and those of all keys.
// Equation  none (LSD radix sort; stable by construction in sort_scatter).
// Grid      one workgroup per block.
// Numerics  integers only. `histogram` is zero at the start.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "grid.glsl"
#include "args.glsl"

layout(local_size_x = 64) in;

layout(push_constant) uniform Push { uint shift; } pc;
layout(set = 0, binding = 0) restrict readonly buffer Count { uint count[]; };
layout(set = 0, binding = 1) restrict readonly buffer Keys { uint keys[]; };
layout(set = 0, binding = 2) restrict writeonly buffer Digits { uint digits[]; };
layout(set = 0, binding = 3) restrict buffer Histogram { uint histogram[]; };

shared uint sh_digits[256];

void main() {
    const uint lane = gl_LocalInvocationIndex;
    const uint block = linear_group();
    const uint n = count[0];
    const uint n_blocks = div_ceil(n, SORT_BLOCK);
    for (uint d = lane; d < 256u; d += 64u) sh_digits[d] = 0u;
    barrier();
    for (uint k = 0u; k < SORT_BLOCK / 64u; ++k) {
        const uint i = block * SORT_BLOCK + k * 64u + lane;
        if (i < n) atomicAdd(sh_digits[(keys[i] >> pc.shift) & 255u], 1u);
    }
    barrier();
    if (block < n_blocks) {
        for (uint d = lane; d < 256u; d += 64u) {
            const uint c = sh_digits[d];
            digits[d * n_blocks + block] = c;
            if (c > 0u) atomicAdd(histogram[d], c);
        }
    }
}
