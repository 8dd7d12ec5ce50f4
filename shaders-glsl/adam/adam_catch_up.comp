// SPDX-License-Identifier: MIT OR Apache-2.0
// Purpose   gives the Gaussians in view the steps of dense Adam that they missed while they were not.
// Equation  k steps without a gradient: m <- b1^k m, v <- b2^k v, x <- x - m / sqrt(v) sum_j lr_j sqrt(c2_j) / c1_j r^j with
//           r = b1 / sqrt(b2). The host tabulates the endless sums F(s) from the step after s on: F(s) - r^k F(s + k).
// Grid      one thread per active Gaussian of the group, or per Gaussian of it (`all`). A buffer that the group lacks is bound to
//           another, and not touched.
// Numerics  a step is right to 2e-5 of itself; log tau stops at its floor at the end, not on the way, and positions have the pace of
//           the size before the first missed step. Nothing moves when the frame failed.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_KHR_shader_subgroup_ballot : require
#include "types.glsl"
#include "unfolded.glsl"
#include "grid.glsl"
#include "adam.glsl"

layout(local_size_x = 64) in;

// n: Gaussians of the group; is_dynamic: 1 where it has motion, else 0; until: the step to catch up to.
layout(push_constant) uniform Push {
    uint group;
    uint first;
    uint n;
    uint all;
    uint is_dynamic;
    uint degree;
    uint until;
    float log2_beta1;
    float log2_beta2;
} pc;
layout(set = 0, binding = 0) restrict readonly buffer FrameStatus { Status status; };
layout(set = 0, binding = 1) uniform Adam { AdamParams adam; };
layout(set = 0, binding = 2) restrict readonly buffer Ranges { uvec2 ranges[]; };
layout(set = 0, binding = 3) restrict readonly buffer ActiveId { uint active_id[]; };
// Three per step: F in the order of the rates of AdamParams.
layout(set = 0, binding = 4) restrict readonly buffer Sums { vec4 sums[]; };
layout(set = 0, binding = 5) restrict buffer Geometry { vec4 geometry[]; };
layout(set = 0, binding = 6) restrict buffer Sh0 { vec4 sh0[]; };
layout(set = 0, binding = 7) restrict buffer Motion { vec4 motion[]; };
layout(set = 0, binding = 8) restrict buffer Sh1 { vec4 sh1[]; };
layout(set = 0, binding = 9) restrict buffer Sh2 { vec4 sh2[]; };
layout(set = 0, binding = 10) restrict buffer Sh3 { vec4 sh3[]; };
layout(set = 0, binding = 11) restrict buffer MomentsGeometry { vec4 moments_geometry[]; };
layout(set = 0, binding = 12) restrict buffer MomentsSh0 { vec4 moments_sh0[]; };
layout(set = 0, binding = 13) restrict buffer MomentsMotion { vec4 moments_motion[]; };
layout(set = 0, binding = 14) restrict buffer MomentsSh1 { vec4 moments_sh1[]; };
layout(set = 0, binding = 15) restrict buffer MomentsSh2 { vec4 moments_sh2[]; };
layout(set = 0, binding = 16) restrict buffer MomentsSh3 { vec4 moments_sh3[]; };
layout(set = 0, binding = 17) restrict buffer State { vec4 state[]; };

// Planes of a buffer, none where the group lacks it. The loop is one that lavapipe skips; an `if` is not.
#define STEP(parameter, moments, kind, planes)                                                                     \
    for (uint p = 0u; p < (planes); ++p) {                                                                         \
        const vec4 sum = plane_rates(sums[a], sums[a + 1u], sums[a + 2u], kind, p, pace)                           \
            - r_k * plane_rates(sums[b], sums[b + 1u], sums[b + 2u], kind, p, pace);                               \
        const uint place = plane_index(i, planes, p);                                                              \
        const uint at_moments = moments_index(i, planes, p);                                                       \
        READ_MOMENTS(moments, at_moments, m, v)                                                                    \
        const vec4 change = -sum * m / (sqrt(v) + adam.eps);                                                       \
        parameter[place] = moved(adam, kind, p, parameter[place], change, residual);                               \
        WRITE_MOMENTS(moments, at_moments, m * fade1, v * fade2, key, plane_number(kind, p))                       \
    }

void main() {
    const bool is_all = unfolded(pc.all) != 0u;
    const uint is_dynamic = unfolded(pc.is_dynamic);
    const uint degree = unfolded(pc.degree);
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
    const uint a = 3u * from;
    const uint b = 3u * pc.until;
    float residual = own.z;
    const float pace = position_pace(adam, exp(geometry[plane_index(i, 3u, 2u)].xyz));
    STEP(geometry, moments_geometry, GEOMETRY, 3u)
    STEP(sh0, moments_sh0, SH_0_BUFFER, 1u)
    STEP(motion, moments_motion, MOTION, is_dynamic)
    STEP(sh1, moments_sh1, SH_1_BUFFER, degree > 0u ? 3u : 0u)
    STEP(sh2, moments_sh2, SH_1_BUFFER + 1u, degree > 1u ? 4u : 0u)
    STEP(sh3, moments_sh3, SH_1_BUFFER + 2u, degree > 2u ? 6u : 0u)
    if (is_dynamic > 0u) state[i].z = residual;
    state[i].w = float(pc.until);
}
