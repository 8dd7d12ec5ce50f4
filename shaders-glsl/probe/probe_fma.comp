// SPDX-License-Identifier: MIT OR Apache-2.0
// Purpose   measures the rate of fused multiply-adds.
// Equation  x <- a x + b, STEPS times a round, in eight independent chains; the sum of the chains.
// Grid      one thread per sum.
// Numerics  with a = b = 1, and below 2^24, exact whether fused or not. a and b come from memory, so that no compiler
//           folds them.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_KHR_shader_subgroup_ballot : require
#include "grid.glsl"
#include "unfolded.glsl"

layout(local_size_x = 64) in;

const uint STEPS = 16u;

layout(push_constant) uniform Push { uint rounds; } pc;
layout(set = 0, binding = 0) restrict readonly buffer Factors { vec4 factors[]; };
layout(set = 0, binding = 1) restrict writeonly buffer Sums { float sums[]; };

void main() {
    const vec4 a = vec4(factors[0].x);
    const vec4 b = vec4(factors[0].y);
    vec4 x = vec4(0.0, 1.0, 2.0, 3.0) + float(gl_LocalInvocationIndex);
    vec4 y = x + 4.0;
    const uint rounds = unfolded(pc.rounds);
    for (uint round = 0u; round < rounds; ++round) {
        for (uint step = 0u; step < STEPS; ++step) {
            x = fma(x, a, b);
            y = fma(y, a, b);
        }
    }
    sums[linear_thread(64u)] = dot(x + y, vec4(1.0));
}
