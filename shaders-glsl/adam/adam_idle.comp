// SPDX-License-Identifier: MIT OR Apache-2.0
// Purpose   one step of dense Adam on one buffer of the Gaussians that the frame did not see.
// Equation  as in adam.glsl, with no gradient but the regularisers': the moments fade, and what is left of the first moves.
// Grid      one thread per idle Gaussian of the group.
// Numerics  a component whose rate is 0 keeps its bits; v = infinity gives a step of 0. Nothing moves when the frame failed.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_KHR_shader_subgroup_ballot : require
#include "types.glsl"
#include "unfolded.glsl"
#include "grid.glsl"
#include "adam.glsl"

layout(local_size_x = 64) in;

// n: Gaussians of the group; first: flat index of its first; kind and planes: see adam.glsl.
layout(push_constant) uniform Push { uint group; uint n; uint first; uint kind; uint planes; } pc;
layout(set = 0, binding = 0) restrict readonly buffer FrameStatus { Status status; };
layout(set = 0, binding = 1) uniform Adam { AdamParams adam; };
layout(set = 0, binding = 2) restrict readonly buffer Ranges { uvec2 ranges[]; };
layout(set = 0, binding = 3) restrict readonly buffer IdleId { uint idle_id[]; };
layout(set = 0, binding = 4) restrict buffer Parameter { vec4 parameter[]; };
layout(set = 0, binding = 5) restrict buffer Moments { vec4 moments[]; };
layout(set = 0, binding = 6) restrict buffer State { vec4 state[]; };

void main() {
    const uvec2 seen = ranges[pc.group];
    const uint at = linear_thread(gl_WorkGroupSize.x);
    const uint n_idle = div_ceil(pc.n, 128u) * 128u - (seen.y - seen.x);
    if (at >= n_idle || status.failed != 0u) return;
    // Those before the group's first in the list: all flat indices below it but the active ones.
    const uint i = idle_id[pc.first - seen.x + at] - pc.first;
    if (i >= pc.n) return;
    const uint kind = unfolded(pc.kind);
    const uint planes = unfolded(pc.planes);
    const uint key = moments_key(uint(adam.step), pc.first + i);
    float residual = kind == MOTION ? state[i].z : 0.0;
    for (uint p = 0u; p < planes; ++p) {
        const uint place = planes == 1u ? i : plane_index(i, planes, p);
        const uint at_moments = moments_index(i, planes, p);
        const vec4 x = parameter[place];
        READ_MOMENTS(moments, at_moments, m, v)
        const vec4 rate = plane_rates(adam.rates0, adam.rates1, adam.rates2, kind, p);
        const vec4 change = adam_change(adam, rate, regulariser(adam, kind, p, x), m, v);
        parameter[place] = moved(adam, kind, p, x, change, residual);
        WRITE_MOMENTS(moments, at_moments, m, v, key, plane_number(kind, p))
    }
    if (kind == MOTION) state[i].z = residual;
}
