// SPDX-License-Identifier: MIT OR Apache-2.0
// Purpose   replaces each value by the sum of all before it and gives the sum of all, which saturates at 2^32 - 1. GATHERED: of
//           the values that a list of indices names, the tiles of each Gaussian, and writes the sums in the list's order; turns
//           their sum, the number of intersections, into grids, and reports an overflow.
// Equation  none (reduce-then-scan prefix sum; each block adds up the sums of those before it, which are few).
// Grid      one workgroup per block of 1,024 values, 8 consecutive ones per thread; at least one, which gives the total.
// Numerics  u32; the total is summed in halves, so an overflow is reported and never wraps. On overflow every later grid is empty,
//           so nothing is drawn from a truncated list.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_KHR_shader_subgroup_arithmetic : require
#include "types.glsl"
#include "grid.glsl"
#include "args.glsl"

layout(local_size_x = 128) in;

layout(set = 0, binding = 0) restrict readonly buffer Count { uint count[]; };
layout(set = 0, binding = 1) restrict readonly buffer Partials { uint partials[]; };
#ifdef GATHERED
layout(set = 0, binding = 2) restrict readonly buffer Index { uint index[]; };
layout(set = 0, binding = 3) restrict readonly buffer Table { uint table[]; };
layout(set = 0, binding = 4) restrict writeonly buffer Sums { uint sums[]; };
layout(set = 0, binding = 5) restrict writeonly buffer Total { uint total[]; };
layout(set = 0, binding = 6) restrict buffer Args { uvec4 args[]; };
layout(set = 0, binding = 7) restrict writeonly buffer EmitArgs { uvec4 emit_args[]; };
layout(set = 0, binding = 8) restrict buffer FrameStatus { Status status; };
layout(push_constant) uniform Push { uint capacity; } pc;
#define VALUE(i) table[index[i]]
#else
layout(set = 0, binding = 2) restrict buffer Sums { uint sums[]; };
layout(set = 0, binding = 3) restrict writeonly buffer Total { uint total[]; };
#define VALUE(i) sums[i]
#endif

// By subgroup: of this block; of the blocks before; the halves of all, which cannot wrap.
shared uint sh_own[32];
shared uint sh_before[32];
shared uint sh_high[32];
shared uint sh_low[32];

// The sum of all as it counts from here on.
uint finished(uint n) {
#ifdef GATHERED
    const bool fits = n <= pc.capacity && status.failed == 0u;
    status.n_intersections = n;
    status.capacity_intersections = pc.capacity;
    if (n > pc.capacity) status.failed |= FAILED_INTERSECTIONS;
    const uint used = fits ? n : 0u;
    emit_args[0] = fits ? args[ARGS_THREADS] : fold(0u);
    args[ARGS_THREADS] = fold(div_ceil(used, 64u));
    args[ARGS_SORT] = fold(div_ceil(used, SORT_BLOCK));
    return used;
#else
    return n;
#endif
}

void main() {
    const uint lane = gl_LocalInvocationIndex;
    const uint block = linear_group();
    const uint n = count[0];
    const uint n_blocks = div_ceil(n, SCAN_BLOCK);
    const bool is_last = block + 1u == max(n_blocks, 1u);
    uint blocks_before = 0u;
    for (uint b = lane; b < min(block, n_blocks); b += 128u) blocks_before += partials[b];
    uint high = 0u;
    uint low = 0u;
    for (uint b = lane; b < (is_last ? n_blocks : 0u); b += 128u) {
        const uint value = partials[b];
        high += value >> 16u;
        low += value & 0xffffu;
    }
    const uint first = block * SCAN_BLOCK + lane * 8u;
    uint own[8];
    uint sum = 0u;
    for (uint k = 0u; k < 8u; ++k) {
        own[k] = first + k < n ? VALUE(first + k) : 0u;
        sum += own[k];
    }
    const uint before = subgroupExclusiveAdd(sum);
    const uint subgroup_before = subgroupAdd(blocks_before);
    const uint subgroup_high = subgroupAdd(high);
    const uint subgroup_low = subgroupAdd(low);
    if (gl_SubgroupInvocationID == gl_SubgroupSize - 1u) {
        sh_own[gl_SubgroupID] = before + sum;
        sh_before[gl_SubgroupID] = subgroup_before;
        sh_high[gl_SubgroupID] = subgroup_high;
        sh_low[gl_SubgroupID] = subgroup_low;
    }
    barrier();
    uint running = before;
    for (uint s = 0u; s < 128u / gl_SubgroupSize; ++s) {
        running += sh_before[s];
        if (s < gl_SubgroupID) running += sh_own[s];
    }
    for (uint k = 0u; k < 8u; ++k) {
        if (first + k < n) sums[first + k] = running;
        running += own[k];
    }
    if (is_last && lane == 0u) {
        uint all_high = 0u;
        uint all_low = 0u;
        for (uint s = 0u; s < 128u / gl_SubgroupSize; ++s) {
            all_high += sh_high[s];
            all_low += sh_low[s];
        }
        total[0] = finished(all_high + (all_low >> 16u) > 0xffffu ? 0xffffffffu : (all_high << 16u) + all_low);
    }
}
