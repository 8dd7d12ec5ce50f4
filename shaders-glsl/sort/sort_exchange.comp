// SPDX-License-Identifier: MIT OR Apache-2.0
// Purpose   moves each key and its value to its place by one digit, stably, on subgroups of 32 or 64 lanes.
// Equation  place = keys with a smaller digit + with this digit in earlier blocks + in earlier subgroups + rank in the subgroup.
// Grid      one workgroup per block of 2,048 keys; each subgroup owns a contiguous run of them.
// Numerics  integers only. Keys are read once, ordered in shared memory, and written in runs of one digit; then values likewise.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_KHR_shader_subgroup_arithmetic : require
#extension GL_KHR_shader_subgroup_ballot : require
#extension GL_KHR_memory_scope_semantics : require
#include "grid.glsl"
#include "args.glsl"
#include "sort.glsl"
#include "sort_round.glsl"

// As many as digits.
layout(local_size_x = 256) in;

// Keys of a thread.
const uint OWN = SORT_BLOCK / DIGITS;
// Most subgroups of a workgroup.
const uint SUBGROUPS = 8u;

// Counts of each subgroup's digits, and later their places in the block; then the block's keys in their new order; then the values.
shared uint sh_room[SORT_BLOCK];
// By digit: from a place in the block to one among all.
shared uint sh_base[DIGITS];
shared uvec2 sh_sums[SUBGROUPS];

void main() {
    const uint thread = gl_LocalInvocationIndex;
    const uint block = linear_group();
    const uint n = count[0];
    const uint n_blocks = div_ceil(n, SORT_BLOCK);
    const uint lane = gl_SubgroupInvocationID;
    const uint first = block * SORT_BLOCK + gl_SubgroupID * OWN * gl_SubgroupSize + lane;
    const uint own = gl_SubgroupID * DIGITS;
    // What lies past the end is the last of the largest digit, and so the last of all.
    uint keys[OWN];
    uint values[OWN];
    for (uint k = 0u; k < OWN; ++k) {
        const uint i = first + k * gl_SubgroupSize;
        keys[k] = i < n ? keys_in[i] : 0xffffffffu;
        values[k] = i < n ? value_of(i) : 0u;
        sh_room[k * DIGITS + thread] = 0u;
    }
    const uvec2 counts = counts_of(thread, block, n_blocks);
    barrier();

    // Ranks among those of the same digit in the subgroup.
    const uvec2 below = lane < 32u ? uvec2((1u << lane) - 1u, 0u) : uvec2(0xffffffffu, (1u << (lane - 32u)) - 1u);
    uint places[OWN];
    for (uint k = 0u; k < OWN; ++k) {
        const uint digit = digit_of(keys[k]);
        uvec2 peers = subgroupBallot(true).xy;
        for (uint b = 0u; b < 8u; ++b) {
            const bool set = ((digit >> b) & 1u) != 0u;
            const uvec2 ones = subgroupBallot(set).xy;
            peers &= set ? ones : ~ones;
        }
        const uint rank = bitCount(peers.x & below.x) + bitCount(peers.y & below.y);
        const uint before = sh_room[own + digit];
        places[k] = before + rank;
        subgroup_shared_barrier();
        if (rank == 0u) sh_room[own + digit] = before + bitCount(peers.x) + bitCount(peers.y);
        subgroup_shared_barrier();
    }
    barrier();

    // Places of each digit, and of each subgroup's.
    uint n_earlier[SUBGROUPS];
    uint n_here = 0u;
    for (uint s = 0u; s < SUBGROUPS; ++s) {
        n_earlier[s] = n_here;
        n_here += sh_room[s * DIGITS + thread];
    }
    uvec2 smaller = uvec2(subgroupExclusiveAdd(n_here), subgroupExclusiveAdd(counts.x));
    if (lane == gl_SubgroupSize - 1u) sh_sums[gl_SubgroupID] = smaller + uvec2(n_here, counts.x);
    barrier();
    for (uint s = 0u; s < DIGITS / gl_SubgroupSize; ++s) smaller += s < gl_SubgroupID ? sh_sums[s] : uvec2(0u);
    sh_base[thread] = smaller.y + counts.y - smaller.x;
    for (uint s = 0u; s < SUBGROUPS; ++s) sh_room[s * DIGITS + thread] = smaller.x + n_earlier[s];
    barrier();
    for (uint k = 0u; k < OWN; ++k) places[k] += sh_room[own + digit_of(keys[k])];
    barrier();

    for (uint k = 0u; k < OWN; ++k) sh_room[places[k]] = keys[k];
    barrier();
    const uint n_own = min(n - min(block * SORT_BLOCK, n), SORT_BLOCK);
    uint to[OWN];
    for (uint k = 0u; k < OWN; ++k) {
        const uint at = k * DIGITS + thread;
        const uint key = sh_room[at];
        to[k] = sh_base[digit_of(key)] + at;
        if (at < n_own) keys_out[to[k]] = key;
    }
    barrier();
    for (uint k = 0u; k < OWN; ++k) sh_room[places[k]] = values[k];
    barrier();
    for (uint k = 0u; k < OWN; ++k) {
        const uint at = k * DIGITS + thread;
        if (at < n_own) values_out[to[k]] = sh_room[at];
    }
}
