// SPDX-License-Identifier: MIT OR Apache-2.0
// Purpose   measures the rate of exp2.
// Equation  x <- 2^-x, STEPS times a round, in eight independent chains; their mean.
// Grid      one thread per mean.
// Numerics  the chain contracts by 0.44 a step to the x that solves x = 2^-x: errors do not add up.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_KHR_shader_subgroup_ballot : require
#include "grid.glsl"
#include "unfolded.glsl"

layout(local_size_x = 64) in;

const uint STEPS = 16u;

layout(push_constant) uniform Push { uint rounds; } pc;
layout(set = 0, binding = 0) restrict readonly buffer Starts { vec4 starts[]; };
layout(set = 0, binding = 1) restrict writeonly buffer Means { float means[]; };

void main() {
    vec4 x = starts[0];
    vec4 y = starts[1] + float(gl_LocalInvocationIndex);
    const uint rounds = unfolded(pc.rounds);
    for (uint round = 0u; round < rounds; ++round) {
        for (uint step = 0u; step < STEPS; ++step) {
            x = exp2(-x);
            y = exp2(-y);
        }
    }
    means[linear_thread(64u)] = dot(x + y, vec4(0.125));
}
