// SPDX-License-Identifier: MIT OR Apache-2.0
// Purpose   lists the blocks of 128 dynamic Gaussians of which one may live at the view's time, and empties the others.
// Equation  first <= t <= last, of the block (bound.comp).
// Grid      one thread per block of a group.
// Writes    live: the blocks, in any order; live_args: a workgroup for each, as fold() has it, on top of zeros; bits and counts
//           of the blocks that are not listed.
// Numerics  integers that order as floats do.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_KHR_shader_subgroup_ballot : require
#extension GL_KHR_shader_subgroup_arithmetic : require
#extension GL_KHR_shader_subgroup_shuffle : require
#include "types.glsl"
#include "grid.glsl"
#include "time_key.glsl"

layout(local_size_x = 128) in;

// n: blocks of the group. first: its first block in the flat index.
layout(push_constant) uniform Push { uint n; uint first; } pc;
layout(set = 0, binding = 0) uniform View { ViewParams view; };
layout(set = 0, binding = 1) restrict readonly buffer Life { uvec2 life[]; };
layout(set = 0, binding = 2) restrict writeonly buffer Live { uint live[]; };
layout(set = 0, binding = 3) restrict buffer LiveArgs { uint live_args[]; };
layout(set = 0, binding = 4) restrict writeonly buffer Bits { uint bits[]; };
layout(set = 0, binding = 5) restrict writeonly buffer Counts { uint counts[]; };

void main() {
    const uint block = linear_thread(gl_WorkGroupSize.x);
    const bool exists = block < pc.n;
    const uvec2 ends = life[min(block, pc.n - 1u)];
    const bool lives = exists && time_key(-view.time) <= ends.x && time_key(view.time) <= ends.y;
    const uint rank = subgroupExclusiveAdd(uint(lives));
    const uint n_live = subgroupAdd(uint(lives));
    uint first = 0u;
    if (gl_SubgroupInvocationID == 0u && n_live > 0u) {
        first = atomicAdd(live_args[3], n_live);
        const uvec4 grid = fold(first + n_live);
        atomicMax(live_args[0], grid.x);
        atomicMax(live_args[1], grid.y);
        atomicMax(live_args[2], grid.z);
    }
    first = subgroupShuffle(first, 0u);
    if (lives) live[first + rank] = block;
    if (exists && !lives) {
        for (uint w = 0u; w < 4u; ++w) bits[4u * (pc.first + block) + w] = 0u;
        counts[pc.first + block] = 0u;
    }
}
