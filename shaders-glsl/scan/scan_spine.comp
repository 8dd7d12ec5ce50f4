// SPDX-License-Identifier: MIT OR Apache-2.0
// Purpose   scans the block sums and gives the total, which saturates at 2^32 - 1.
// Equation  none (reduce-then-scan prefix sum).
// Grid      one workgroup, which walks over the blocks 128 at a time.
// Numerics  u32; a carry out of the running total is kept, so an overflow is reported and never wraps.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_KHR_shader_subgroup_arithmetic : require
#include "grid.glsl"
#include "args.glsl"

layout(local_size_x = 128) in;

layout(set = 0, binding = 0) restrict readonly buffer Count { uint count[]; };
layout(set = 0, binding = 1) restrict buffer Partials { uint partials[]; };
layout(set = 0, binding = 2) restrict writeonly buffer Total { uint total[]; };

shared uint sh_sums[32];

void main() {
    const uint lane = gl_LocalInvocationIndex;
    const uint n_blocks = div_ceil(count[0], SCAN_BLOCK);
    uint running = 0u;
    bool saturated = false;
    for (uint first = 0u; first < n_blocks; first += 128u) {
        const uint i = first + lane;
        const uint value = i < n_blocks ? partials[i] : 0u;
        const uint before = subgroupExclusiveAdd(value);
        if (gl_SubgroupInvocationID == gl_SubgroupSize - 1u) sh_sums[gl_SubgroupID] = before + value;
        barrier();
        uint base = running;
        uint step_total = 0u;
        for (uint s = 0u; s < 128u / gl_SubgroupSize; ++s) {
            if (s < gl_SubgroupID) base += sh_sums[s];
            step_total += sh_sums[s];
        }
        if (i < n_blocks) partials[i] = base + before;
        saturated = saturated || running + step_total < running;
        running += step_total;
        barrier();
    }
    if (lane == 0u) total[0] = saturated ? 0xffffffffu : running;
}
