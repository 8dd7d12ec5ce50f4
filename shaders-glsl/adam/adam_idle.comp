// SPDX-License-Identifier: MIT OR Apache-2.0
// Purpose   one step of dense Adam on one buffer of the Gaussians that the frame did not see.
// Equation  as in adam.glsl, with no gradient but the regularisers': the moments fade, and what is left of the first moves.
// Grid      one thread per vec4 of the buffer.
// Numerics  a component whose rate is 0 keeps its bits; v = infinity gives a step of 0. Nothing moves when the frame failed.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "types.glsl"
#include "grid.glsl"
#include "adam.glsl"

layout(local_size_x = 64) in;

// n: Gaussians of the group; first: flat index of its first; kind and planes: see adam.glsl.
layout(push_constant) uniform Push { uint n; uint first; uint kind; uint planes; } pc;
layout(set = 0, binding = 0) restrict readonly buffer FrameStatus { Status status; };
layout(set = 0, binding = 1) uniform Adam { AdamParams adam; };
layout(set = 0, binding = 2) restrict readonly buffer Bits { uint bits[]; };
layout(set = 0, binding = 3) restrict buffer Parameter { vec4 parameter[]; };
layout(set = 0, binding = 4) restrict buffer Moments { vec4 moments[]; };
layout(set = 0, binding = 5) restrict buffer State { vec4 state[]; };

void main() {
    const uint t = linear_thread(gl_WorkGroupSize.x);
    const uint i = t / (32u * pc.planes) * 32u + (t & 31u);
    const uint p = (t >> 5u) % pc.planes;
    if (i >= pc.n || status.failed != 0u) return;
    const uint flat_index = pc.first + i;
    // A loop, not a branch: lavapipe leaves it when no lane needs it, and walks through every branch.
    for (uint due = ~bits[flat_index >> 5u] >> (flat_index & 31u) & 1u; due > 0u; --due) {
        const uint at = plane_index(i, 2u * pc.planes, 2u * p);
        const vec4 x = parameter[t];
        vec4 m = moments[at];
        vec4 v = moments[at + 32u];
        const vec4 rate = plane_rates(adam.rates0, adam.rates1, adam.rates2, pc.kind, p);
        const vec4 change = adam_change(adam, rate, regulariser(adam, pc.kind, p, x), m, v);
        float residual = pc.kind == MOTION ? state[i].z : 0.0;
        parameter[t] = moved(adam, pc.kind, p, x, change, residual);
        moments[at] = m;
        moments[at + 32u] = v;
        if (pc.kind == MOTION) state[i].z = residual;
    }
}
