// SPDX-License-Identifier: MIT OR Apache-2.0
// Purpose   scans the block sums and gives the total, which saturates at 2^32 - 1.
// Equation  none (reduce-then-scan prefix sum).
// Grid      one workgroup, which walks over the blocks 128 at a time.
// Numerics  u32; the total is summed in halves, so an overflow is reported and never wraps.
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
shared uint sh_high[32];
shared uint sh_low[32];

void main() {
    const uint lane = gl_LocalInvocationIndex;
    const uint n_subgroups = 128u / gl_SubgroupSize;
    const uint n_blocks = div_ceil(count[0], SCAN_BLOCK);
    uint running = 0u;
    // Halves of this thread's sums, whose total cannot wrap.
    uint high = 0u;
    uint low = 0u;
    for (uint first = 0u; first < n_blocks; first += 128u) {
        const uint i = first + lane;
        const uint value = i < n_blocks ? partials[i] : 0u;
        high += value >> 16u;
        low += value & 0xffffu;
        const uint before = subgroupExclusiveAdd(value);
        if (gl_SubgroupInvocationID == gl_SubgroupSize - 1u) sh_sums[gl_SubgroupID] = before + value;
        barrier();
        uint base = running;
        for (uint s = 0u; s < n_subgroups; ++s) {
            if (s < gl_SubgroupID) base += sh_sums[s];
            running += sh_sums[s];
        }
        if (i < n_blocks) partials[i] = base + before;
        barrier();
    }
    const uint subgroup_high = subgroupAdd(high);
    const uint subgroup_low = subgroupAdd(low);
    if (gl_SubgroupInvocationID == 0u) {
        sh_high[gl_SubgroupID] = subgroup_high;
        sh_low[gl_SubgroupID] = subgroup_low;
    }
    barrier();
    if (lane == 0u) {
        uint all_high = 0u;
        uint all_low = 0u;
        for (uint s = 0u; s < n_subgroups; ++s) {
            all_high += sh_high[s];
            all_low += sh_low[s];
        }
        total[0] = all_high + (all_low >> 16u) > 0xffffu ? 0xffffffffu : (all_high << 16u) + all_low;
    }
}
