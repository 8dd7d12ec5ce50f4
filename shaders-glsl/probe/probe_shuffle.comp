// SPDX-License-Identifier: MIT OR Apache-2.0
// Purpose   measures the rate of shuffles within a subgroup.
// Equation  x_lane <- x_(lane + 1), STEPS times a round, in four independent chains.
// Grid      one thread per uvec4; the subgroups are whole.
// Numerics  exact.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_KHR_shader_subgroup_ballot : require
#extension GL_KHR_shader_subgroup_shuffle : require
#include "grid.glsl"
#include "unfolded.glsl"

layout(local_size_x = 64) in;

const uint STEPS = 16u;

layout(push_constant) uniform Push { uint rounds; } pc;
layout(set = 0, binding = 0) restrict readonly buffer Starts { uvec4 starts[]; };
layout(set = 0, binding = 1) restrict writeonly buffer Turned { uvec4 turned[]; };

void main() {
    const uint next = (gl_SubgroupInvocationID + 1u) % gl_SubgroupSize;
    uvec4 x = starts[gl_LocalInvocationIndex];
    const uint rounds = unfolded(pc.rounds);
    for (uint round = 0u; round < rounds; ++round) {
        for (uint step = 0u; step < STEPS; ++step) {
            x = uvec4(subgroupShuffle(x.x, next), subgroupShuffle(x.y, next), subgroupShuffle(x.z, next),
                subgroupShuffle(x.w, next));
        }
    }
    turned[linear_thread(64u)] = x;
}
