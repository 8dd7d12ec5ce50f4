// SPDX-License-Identifier: MIT OR Apache-2.0
// Purpose   lists the marked Gaussians of a group in index order, and the others if asked for.
// Equation  none (stream compaction: rank = scanned count of the block + bits below).
// Grid      one thread per Gaussian, 128 per workgroup: of the listed blocks, or of all.
// Numerics  integers only; nothing is written past the capacity.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_KHR_shader_subgroup_ballot : require
#extension GL_KHR_shader_subgroup_shuffle : require
#include "unfolded.glsl"
#include "grid.glsl"

layout(local_size_x = 128) in;

// n: Gaussians of the group, with its gap where the others are asked for. first: flat index of its first.
layout(push_constant) uniform Push { uint n; uint first; uint capacity; uint is_listed; uint wants_idle; } pc;
layout(set = 0, binding = 0) restrict readonly buffer Bits { uint bits[]; };
layout(set = 0, binding = 1) restrict readonly buffer Offsets { uint offsets[]; };
layout(set = 0, binding = 2) restrict writeonly buffer ActiveId { uint active_id[]; };
layout(set = 0, binding = 3) restrict writeonly buffer IdleId { uint idle_id[]; };
layout(set = 0, binding = 4) restrict readonly buffer Live { uint live[]; };
layout(set = 0, binding = 5) restrict readonly buffer LiveArgs { uint live_args[]; };
#include "live.glsl"

void main() {
    const uint block = block_at(linear_group(), div_ceil(pc.n, 128u), pc.is_listed);
    // Whole workgroups: the lanes of the last one lend a word each to those that have a Gaussian.
    if (block == NO_BLOCK) return;
    const uint own = block * 128u + gl_LocalInvocationIndex;
    const uint i = pc.first + own;
    const uint word = i >> 5u;
    const uint first_word = (i >> 7u) << 2u;
    // The block's four words: a lane loads one, and all lanes get them.
    const uint loaded = bits[first_word + (gl_SubgroupInvocationID & 3u)];
    uint rank = offsets[i >> 7u];
    uint mask = 0u;
    for (uint w = 0u; w < 4u; ++w) {
        const uint here = subgroupShuffle(loaded, w);
        rank += first_word + w < word ? bitCount(here) : 0u;
        mask = first_word + w == word ? here : mask;
    }
    if (own >= pc.n) return;
    rank += bitCount(mask & ((1u << (i & 31u)) - 1u));
    const bool marked = ((mask >> (i & 31u)) & 1u) != 0u;
    if (marked && rank < pc.capacity) active_id[rank] = i;
    if (!marked && unfolded(pc.wants_idle) != 0u) idle_id[i - rank] = i;
}
