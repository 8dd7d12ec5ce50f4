// SPDX-License-Identifier: MIT OR Apache-2.0
// Purpose   sums each block of 1,024 values, or of those that a list of indices names (GATHERED).
// Equation  none (reduce-then-scan prefix sum).
// Grid      one workgroup per block.
// Numerics  u32, wrapping inside a block: the callers' blocks cannot reach 2^32 (checked where the values are made).
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_KHR_shader_subgroup_arithmetic : require
#include "grid.glsl"
#include "args.glsl"

layout(local_size_x = 128) in;

layout(set = 0, binding = 0) restrict readonly buffer Count { uint count[]; };
#ifdef GATHERED
layout(set = 0, binding = 1) restrict readonly buffer Index { uint index[]; };
layout(set = 0, binding = 2) restrict readonly buffer Table { uint table[]; };
layout(set = 0, binding = 3) restrict writeonly buffer Partials { uint partials[]; };
#define VALUE(i) table[index[i]]
#else
layout(set = 0, binding = 1) restrict readonly buffer Values { uint values[]; };
layout(set = 0, binding = 2) restrict writeonly buffer Partials { uint partials[]; };
#define VALUE(i) values[i]
#endif

shared uint sh_sums[32];

void main() {
    const uint block = linear_group();
    const uint lane = gl_LocalInvocationIndex;
    const uint n = count[0];
    uint sum = 0u;
    for (uint k = 0u; k < 8u; ++k) {
        const uint i = block * SCAN_BLOCK + k * 128u + lane;
        if (i < n) sum += VALUE(i);
    }
    const uint total = subgroupAdd(sum);
    if (gl_SubgroupInvocationID == 0u) sh_sums[gl_SubgroupID] = total;
    barrier();
    if (lane == 0u && block < div_ceil(n, SCAN_BLOCK)) {
        uint all = 0u;
        for (uint s = 0u; s < 128u / gl_SubgroupSize; ++s) all += sh_sums[s];
        partials[block] = all;
    }
}
