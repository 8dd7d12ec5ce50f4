// SPDX-License-Identifier: MIT OR Apache-2.0
// Purpose   replaces each value by the sum of all before it.
// Equation  none (reduce-then-scan prefix sum).
// Grid      one workgroup per block of 1,024 values, 8 consecutive ones per thread.
// Numerics  u32.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_KHR_shader_subgroup_arithmetic : require
#include "grid.glsl"
#include "args.glsl"

layout(local_size_x = 128) in;

layout(set = 0, binding = 0) restrict readonly buffer Count { uint count[]; };
layout(set = 0, binding = 1) restrict readonly buffer Partials { uint partials[]; };
layout(set = 0, binding = 2) restrict buffer Values { uint values[]; };

shared uint sh_sums[32];

void main() {
    const uint block = linear_group();
    const uint n = count[0];
    const uint first = block * SCAN_BLOCK + gl_LocalInvocationIndex * 8u;
    uint own[8];
    uint sum = 0u;
    for (uint k = 0u; k < 8u; ++k) {
        own[k] = first + k < n ? values[first + k] : 0u;
        sum += own[k];
    }
    const uint before = subgroupExclusiveAdd(sum);
    if (gl_SubgroupInvocationID == gl_SubgroupSize - 1u) sh_sums[gl_SubgroupID] = before + sum;
    barrier();
    uint running = before + (block < div_ceil(n, SCAN_BLOCK) ? partials[block] : 0u);
    for (uint s = 0u; s < gl_SubgroupID; ++s) running += sh_sums[s];
    for (uint k = 0u; k < 8u; ++k) {
        if (first + k < n) values[first + k] = running;
        running += own[k];
    }
}
