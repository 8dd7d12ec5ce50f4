// SPDX-License-Identifier: MIT OR Apache-2.0
// Purpose   moves each key and its value to its place by one 8-bit digit, stably.
// Equation  place = place of the first of (digit, block) + count in earlier subgroups + rank inside the subgroup.
// Grid      one workgroup per block of 2,048 keys; each subgroup owns a contiguous run of them.
// Numerics  integers only. SUBGROUPS is the most subgroups that 64 threads can hold on the device.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_KHR_shader_subgroup_ballot : require
#extension GL_KHR_shader_subgroup_shuffle : require
#extension GL_KHR_memory_scope_semantics : require
#include "grid.glsl"
#include "args.glsl"

layout(local_size_x = 64) in;

layout(push_constant) uniform Push { uint shift; } pc;
layout(set = 0, binding = 0) restrict readonly buffer Count { uint count[]; };
layout(set = 0, binding = 1) restrict readonly buffer Digits { uint digits[]; };
layout(set = 0, binding = 2) restrict readonly buffer KeysIn { uint keys_in[]; };
layout(set = 0, binding = 3) restrict readonly buffer ValuesIn { uint values_in[]; };
layout(set = 0, binding = 4) restrict writeonly buffer KeysOut { uint keys_out[]; };
layout(set = 0, binding = 5) restrict writeonly buffer ValuesOut { uint values_out[]; };

shared uint sh_places[SUBGROUPS * 256];

// Orders the shared memory of a subgroup alone: subgroupBarrier() orders buffers too, for which NVK empties a cache twice a lap.
void subgroup_shared_barrier() {
    controlBarrier(gl_ScopeSubgroup, gl_ScopeSubgroup, gl_StorageSemanticsShared, gl_SemanticsAcquireRelease);
}

void main() {
    const uint block = linear_group();
    const uint n = count[0];
    const uint n_blocks = div_ceil(n, SORT_BLOCK);
    const uint lane = gl_SubgroupInvocationID;
    const uint run = SORT_BLOCK * gl_SubgroupSize / 64u;
    const uint first = block * SORT_BLOCK + gl_SubgroupID * run;
    const uint own = gl_SubgroupID * 256u;
    for (uint k = gl_LocalInvocationIndex; k < 64u / gl_SubgroupSize * 256u; k += 64u) sh_places[k] = 0u;
    barrier();
    for (uint k = 0u; k < SORT_BLOCK / 64u; ++k) {
        const uint i = first + k * gl_SubgroupSize + lane;
        if (i < n) atomicAdd(sh_places[own + ((keys_in[i] >> pc.shift) & 255u)], 1u);
    }
    barrier();
    for (uint d = gl_LocalInvocationIndex; d < 256u; d += 64u) {
        uint place = block < n_blocks ? digits[d * n_blocks + block] : 0u;
        for (uint s = 0u; s < 64u / gl_SubgroupSize; ++s) {
            const uint c = sh_places[s * 256u + d];
            sh_places[s * 256u + d] = place;
            place += c;
        }
    }
    barrier();
#if SUBGROUPS <= 2
    const uvec2 below = lane < 32u ? uvec2((1u << lane) - 1u, 0u) : uvec2(0xffffffffu, (1u << (lane - 32u)) - 1u);
#endif
    for (uint k = 0u; k < SORT_BLOCK / 64u; ++k) {
        const uint i = first + k * gl_SubgroupSize + lane;
        const bool valid = i < n;
        const uint key = valid ? keys_in[i] : 0u;
        const uint digit = (key >> pc.shift) & 255u;
        uint rank = 0u;
        uint n_peers = 1u;
#if SUBGROUPS > 2
        // The lanes with the same digit, one by one: a CPU driver's ballot costs as much as a dozen shuffles.
        const uint compared = valid ? digit : 256u;
        for (uint j = 1u; j < gl_SubgroupSize; ++j) {
            const bool same = subgroupShuffleXor(compared, j) == compared;
            n_peers += uint(same);
            rank += uint(same && (lane ^ j) < lane);
        }
#else
        // The lanes with the same digit, bit by bit.
        uvec2 peers = subgroupBallot(valid).xy;
        for (uint b = 0u; b < 8u; ++b) {
            const bool set = ((digit >> b) & 1u) != 0u;
            const uvec2 ones = subgroupBallot(set).xy;
            peers &= set ? ones : ~ones;
        }
        rank = bitCount(peers.x & below.x) + bitCount(peers.y & below.y);
        n_peers = bitCount(peers.x) + bitCount(peers.y);
#endif
        const uint place = sh_places[own + digit];
        subgroup_shared_barrier();
        if (valid) {
            keys_out[place + rank] = key;
            values_out[place + rank] = values_in[i];
            if (rank == 0u) sh_places[own + digit] = place + n_peers;
        }
        subgroup_shared_barrier();
    }
}
