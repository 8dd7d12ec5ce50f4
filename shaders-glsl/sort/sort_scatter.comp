// SPDX-License-Identifier: MIT OR Apache-2.0
// Purpose   moves each key and its value to its place by one digit, stably, on subgroups of 4 to 16 lanes.
// Equation  place = keys with a smaller digit + with this digit in earlier blocks + in earlier subgroups + rank in the subgroup.
// Grid      one workgroup per block of 2,048 keys; each subgroup owns a contiguous run of them.
// Numerics  integers only.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_KHR_shader_subgroup_arithmetic : require
#extension GL_KHR_shader_subgroup_shuffle : require
#extension GL_KHR_memory_scope_semantics : require
#include "grid.glsl"
#include "args.glsl"
#include "sort.glsl"
#include "sort_round.glsl"

layout(local_size_x = 64) in;

// Digits of a thread, side by side.
const uint OWN = DIGITS / 64u;

shared uint sh_places[16u * DIGITS];
shared uint sh_sums[16];

void main() {
    const uint thread = gl_LocalInvocationIndex;
    const uint block = linear_group();
    const uint n = count[0];
    const uint n_blocks = div_ceil(n, SORT_BLOCK);
    const uint lane = gl_SubgroupInvocationID;
    const uint n_subgroups = 64u / gl_SubgroupSize;
    const uint run = SORT_BLOCK / n_subgroups;
    const uint first = block * SORT_BLOCK + gl_SubgroupID * run;
    const uint own = gl_SubgroupID * DIGITS;
    for (uint k = thread; k < n_subgroups * DIGITS; k += 64u) sh_places[k] = 0u;
    uint all = 0u;
    uint places[OWN];
    for (uint d = 0u; d < OWN; ++d) {
        const uvec2 sums = counts_of(OWN * thread + d, block, n_blocks);
        places[d] = all + sums.y;
        all += sums.x;
    }
    uint smaller = subgroupExclusiveAdd(all);
    if (lane == gl_SubgroupSize - 1u) sh_sums[gl_SubgroupID] = smaller + all;
    barrier();
    for (uint s = 0u; s < n_subgroups; ++s) smaller += s < gl_SubgroupID ? sh_sums[s] : 0u;
    for (uint k = 0u; k < SORT_BLOCK / 64u; ++k) {
        const uint i = first + k * gl_SubgroupSize + lane;
        if (i < n) atomicAdd(sh_places[own + digit_of(keys_in[i])], 1u);
    }
    barrier();
    for (uint d = 0u; d < OWN; ++d) {
        uint place = smaller + places[d];
        for (uint s = 0u; s < n_subgroups; ++s) {
            const uint at = s * DIGITS + OWN * thread + d;
            const uint n_here = sh_places[at];
            sh_places[at] = place;
            place += n_here;
        }
    }
    barrier();
    for (uint k = 0u; k < SORT_BLOCK / 64u; ++k) {
        const uint i = first + k * gl_SubgroupSize + lane;
        const bool valid = i < n;
        const uint key = valid ? keys_in[i] : 0u;
        const uint digit = digit_of(key);
        // The lanes with the same digit, one by one: a CPU driver's ballot costs as much as a dozen shuffles.
        const uint compared = valid ? digit : DIGITS;
        uint rank = 0u;
        uint n_peers = 1u;
        for (uint j = 1u; j < gl_SubgroupSize; ++j) {
            const bool same = subgroupShuffleXor(compared, j) == compared;
            n_peers += uint(same);
            rank += uint(same && (lane ^ j) < lane);
        }
        const uint place = sh_places[own + digit];
        subgroup_shared_barrier();
        if (valid) {
            keys_out[place + rank] = key;
            values_out[place + rank] = value_of(i);
            if (rank == 0u) sh_places[own + digit] = place + n_peers;
        }
        subgroup_shared_barrier();
    }
}
