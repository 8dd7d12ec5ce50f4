// SPDX-License-Identifier: MIT OR Apache-2.0
// Purpose   one step of dense Adam on the Gaussians that the frame did not see.
// Equation  as in adam.glsl, with no gradient but the regularisers': the moments fade, and what is left of the first moves.
// Grid      one thread per idle Gaussian of the group. A buffer that the group lacks is bound to another, and not touched.
// Numerics  a component whose rate is 0 keeps its bits; v = infinity gives a step of 0. Nothing moves when the frame failed.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_KHR_shader_subgroup_ballot : require
#include "types.glsl"
#include "unfolded.glsl"
#include "grid.glsl"
#include "adam.glsl"

layout(local_size_x = 64) in;

// n: Gaussians of the group; first: flat index of its first; is_dynamic: 1 where it has motion, else 0.
layout(push_constant) uniform Push { uint group; uint n; uint first; uint is_dynamic; uint degree; } pc;
layout(set = 0, binding = 0) restrict readonly buffer FrameStatus { Status status; };
layout(set = 0, binding = 1) uniform Adam { AdamParams adam; };
layout(set = 0, binding = 2) restrict readonly buffer Ranges { uvec2 ranges[]; };
layout(set = 0, binding = 3) restrict readonly buffer IdleId { uint idle_id[]; };
layout(set = 0, binding = 4) restrict buffer Geometry { vec4 geometry[]; };
layout(set = 0, binding = 5) restrict buffer Sh0 { vec4 sh0[]; };
layout(set = 0, binding = 6) restrict buffer Motion { vec4 motion[]; };
layout(set = 0, binding = 7) restrict buffer Sh1 { vec4 sh1[]; };
layout(set = 0, binding = 8) restrict buffer Sh2 { vec4 sh2[]; };
layout(set = 0, binding = 9) restrict buffer Sh3 { vec4 sh3[]; };
layout(set = 0, binding = 10) restrict buffer MomentsGeometry { vec4 moments_geometry[]; };
layout(set = 0, binding = 11) restrict buffer MomentsSh0 { vec4 moments_sh0[]; };
layout(set = 0, binding = 12) restrict buffer MomentsMotion { vec4 moments_motion[]; };
layout(set = 0, binding = 13) restrict buffer MomentsSh1 { vec4 moments_sh1[]; };
layout(set = 0, binding = 14) restrict buffer MomentsSh2 { vec4 moments_sh2[]; };
layout(set = 0, binding = 15) restrict buffer MomentsSh3 { vec4 moments_sh3[]; };
layout(set = 0, binding = 16) restrict buffer State { vec4 state[]; };

// Planes of a buffer, none where the group lacks it. The loop is one that lavapipe skips; an `if` is not.
#define STEP(parameter, moments, kind, planes)                                                                     \
    for (uint p = 0u; p < (planes); ++p) {                                                                         \
        const uint place = plane_index(i, planes, p);                                                              \
        const uint at_moments = moments_index(i, planes, p);                                                       \
        const vec4 x = parameter[place];                                                                           \
        READ_MOMENTS(moments, at_moments, m, v)                                                                    \
        const vec4 rate = plane_rates(adam.position_opacity_rotation_scale,                                        \
            adam.t_scale_velocity_t_center_sh0, adam.sh1_sh2_sh3, kind, p, pace);                                  \
        const vec4 change = adam_change(adam, rate, regulariser(adam, kind, p, x), m, v);                          \
        parameter[place] = moved(adam, kind, p, x, change, residual);                                              \
        WRITE_MOMENTS(moments, at_moments, m, v, key, plane_number(kind, p))                                       \
    }

void main() {
    const uvec2 seen = ranges[pc.group];
    const uint at = linear_thread(gl_WorkGroupSize.x);
    const uint n_idle = div_ceil(pc.n, 128u) * 128u - (seen.y - seen.x);
    if (at >= n_idle || status.failed != 0u) return;
    // Those before the group's first in the list: all flat indices below it but the active ones.
    const uint i = idle_id[pc.first - seen.x + at] - pc.first;
    if (i >= pc.n) return;
    const uint is_dynamic = unfolded(pc.is_dynamic);
    const uint degree = unfolded(pc.degree);
    const uint key = moments_key(uint(adam.step), pc.first + i);
    float residual = is_dynamic > 0u ? state[i].z : 0.0;
    const float pace = position_pace(adam, exp(geometry[plane_index(i, 3u, 2u)].xyz));
    STEP(geometry, moments_geometry, GEOMETRY, 3u)
    STEP(sh0, moments_sh0, SH_0_BUFFER, 1u)
    STEP(motion, moments_motion, MOTION, is_dynamic)
    STEP(sh1, moments_sh1, SH_1_BUFFER, degree > 0u ? 3u : 0u)
    STEP(sh2, moments_sh2, SH_1_BUFFER + 1u, degree > 1u ? 4u : 0u)
    STEP(sh3, moments_sh3, SH_1_BUFFER + 2u, degree > 2u ? 6u : 0u)
    if (is_dynamic > 0u) state[i].z = residual;
}
