// SPDX-License-Identifier: MIT OR Apache-2.0
// Purpose   draws for every dead and every new Gaussian a living one whose place it takes, with odds like its opacity.
// Equation  the last i whose weights before it sum to at most u, u uniform below the sum of all (3DGS-MCMC, Kheradmand
//           et al. 2024).
// Grid      one thread per flat index, then one per new Gaussian.
// Writes    the target of each; the number of copies of each living one. `copies` is zero at the start.
// Numerics  integers only. Weight 0 is never drawn while the sum is not 0; the host checks that someone lives.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_KHR_shader_subgroup_ballot : require
#include "unfolded.glsl"
#include "grid.glsl"
#include "random.glsl"
#include "density.glsl"

layout(local_size_x = 64) in;

layout(push_constant) uniform Push { uint n; uint n_new; uint key; } pc;
layout(set = 0, binding = 0) restrict readonly buffer Flags { uint flags[]; };
layout(set = 0, binding = 1) restrict readonly buffer Before { uint before[]; };
layout(set = 0, binding = 2) restrict readonly buffer Total { uint total[]; };
layout(set = 0, binding = 3) restrict writeonly buffer Targets { uint targets[]; };
layout(set = 0, binding = 4) restrict buffer Copies { uint copies[]; };

void main() {
    const uint i = linear_thread(gl_WorkGroupSize.x);
    if (i >= pc.n + pc.n_new) return;
    const uint u = multiply_high(random_bits(pc.key, i, 0u), total[0]);
    uint drawn = 0u;
    for (uint span = 1u << uint(findMSB(unfolded(pc.n))); span > 0u; span >>= 1u) {
        const uint at = drawn + span;
        if (at < pc.n && before[min(at, pc.n - 1u)] <= u) drawn = at;
    }
    const bool draws = i >= pc.n || (flags[min(i, pc.n - 1u)] & (EXISTS | KEPT)) == EXISTS;
    targets[i] = draws ? drawn : i;
    if (draws) atomicAdd(copies[drawn], 1u);
}
