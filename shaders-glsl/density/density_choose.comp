// SPDX-License-Identifier: MIT OR Apache-2.0
// Purpose   lets the Gaussians that are pulled hardest grow, as many as the budget allows.
// Equation  n = min(max_gaussians - n_kept, ceil(growth n_kept)), never negative.
// Grid      one thread per rank.
// Writes    the flag GROWS, and two entries instead of one.
// Numerics  the product in f32, as in the reference; each flat index has one rank, so one thread.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "grid.glsl"
#include "density.glsl"

layout(local_size_x = 64) in;

layout(push_constant) uniform Push { uint n; uint max_gaussians; float growth; } pc;
layout(set = 0, binding = 0) restrict readonly buffer Keys { uint keys[]; };
layout(set = 0, binding = 1) restrict readonly buffer Order { uint order[]; };
layout(set = 0, binding = 2) restrict readonly buffer Counters { uint counters[]; };
layout(set = 0, binding = 3) restrict buffer Flags { uint flags[]; };
layout(set = 0, binding = 4) restrict writeonly buffer Entries { uint entries[]; };

void main() {
    const uint rank = linear_thread(gl_WorkGroupSize.x);
    if (rank >= pc.n) return;
    const uint n_kept = counters[N_KEPT];
    const uint budget = pc.max_gaussians - min(pc.max_gaussians, n_kept);
    const uint growth = uint(min(ceil(pc.growth * float(n_kept)), 4e9));
    if (keys[rank] == 0xffffffffu || rank >= min(budget, growth)) return;
    const uint i = order[rank];
    flags[i] |= GROWS;
    entries[i] = 2u;
}
