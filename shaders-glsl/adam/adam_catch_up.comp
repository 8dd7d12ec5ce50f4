// SPDX-License-Identifier: MIT OR Apache-2.0
// Purpose   gives one buffer of the Gaussians in view the steps of dense Adam that they missed while they were not.
// Equation  k steps without a gradient: m <- b1^k m, v <- b2^k v, x <- x - m / sqrt(v) sum_j lr_j sqrt(c2_j) / c1_j r^j with
//           r = b1 / sqrt(b2). The host tabulates the endless sums F(s) from the step after s on: F(s) - r^k F(s + k).
// Grid      one thread per active Gaussian of the group, or per Gaussian of it (`all`).
// Numerics  a step is right to 2e-5 of itself; log tau stops at its floor at the end, not on the way. Nothing moves when the
//           frame failed.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_KHR_shader_subgroup_ballot : require
#include "types.glsl"
#include "unfolded.glsl"
#include "grid.glsl"
#include "adam.glsl"

layout(local_size_x = 64) in;

// n: Gaussians of the group; until: the step to catch up to; is_last: the last buffer of the group, which notes the step.
layout(push_constant) uniform Push {
    uint group;
    uint first;
    uint n;
    uint all;
    uint kind;
    uint planes;
    uint until;
    uint is_last;
    float log2_beta1;
    float log2_beta2;
} pc;
layout(set = 0, binding = 0) restrict readonly buffer FrameStatus { Status status; };
layout(set = 0, binding = 1) uniform Adam { AdamParams adam; };
layout(set = 0, binding = 2) restrict readonly buffer Ranges { uvec2 ranges[]; };
layout(set = 0, binding = 3) restrict readonly buffer ActiveId { uint active_id[]; };
// Three per step: F in the order of the rates of AdamParams.
layout(set = 0, binding = 4) restrict readonly buffer Sums { vec4 sums[]; };
layout(set = 0, binding = 5) restrict buffer Parameter { vec4 parameter[]; };
layout(set = 0, binding = 6) restrict buffer Moments { vec4 moments[]; };
layout(set = 0, binding = 7) restrict buffer State { vec4 state[]; };

void main() {
    const uint kind = unfolded(pc.kind);
    const uint planes = unfolded(pc.planes);
    const bool is_all = unfolded(pc.all) != 0u;
    const uvec2 range = is_all ? uvec2(0u, pc.n) : ranges[pc.group];
    const uint at = range.x + linear_thread(gl_WorkGroupSize.x);
    if (at >= range.y || status.failed != 0u) return;
    const uint i = is_all ? at : active_id[at] - pc.first;
    const vec4 own = state[i];
    const uint from = uint(own.w);
    if (from >= pc.until) return;
    const float k = float(pc.until - from);
    const float fade1 = exp2(k * pc.log2_beta1);
    // Not 0 however many they are: an infinite second moment stays so and gives steps of 0.
    const float fade2 = max(exp2(k * pc.log2_beta2), 1e-37);
    const float r_k = exp2(k * (pc.log2_beta1 - 0.5 * pc.log2_beta2));
    const uint key = moments_key(pc.until, pc.first + i);
    float residual = own.z;
    for (uint p = 0u; p < planes; ++p) {
        const uint a = 3u * from;
        const uint b = 3u * pc.until;
        const vec4 sum = plane_rates(sums[a], sums[a + 1u], sums[a + 2u], kind, p)
            - r_k * plane_rates(sums[b], sums[b + 1u], sums[b + 2u], kind, p);
        const uint at_moments = moments_index(i, planes, p);
        const uint place = plane_index(i, planes, p);
        READ_MOMENTS(moments, at_moments, m, v)
        const vec4 change = -sum * m / (sqrt(v) + adam.eps);
        parameter[planes == 1u ? i : place] = moved(adam, kind, p, parameter[planes == 1u ? i : place], change, residual);
        WRITE_MOMENTS(moments, at_moments, m * fade1, v * fade2, key, plane_number(kind, p))
    }
    if (kind == MOTION) state[i].z = residual;
    if (unfolded(pc.is_last) != 0u) state[i].w = float(pc.until);
}
