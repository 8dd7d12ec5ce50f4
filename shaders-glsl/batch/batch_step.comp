// SPDX-License-Identifier: MIT OR Apache-2.0
// Purpose   a step of Adam along gradients that were summed over the images of a step, which are zero again afterwards.
// Equation  as in adam.glsl, with g = sum / 2^50; the statistics of density control as in project_bwd.comp.
// Grid      one thread per Gaussian of the group. A buffer that the group lacks is bound to another, and not touched.
// Reads     sums of batch_add, and which Gaussians have been active: of the others the sums are zero.
// Writes    parameters, moments and state (density statistics, t_center's residual, step); sums.
// Numerics  a component whose rate is 0 keeps its bits; v = infinity gives a step of 0. Nothing moves when a frame failed.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_KHR_shader_subgroup_ballot : require
#include "types.glsl"
#include "unfolded.glsl"
#include "grid.glsl"
#include "adam.glsl"
#include "finite.glsl"
#include "fixed.glsl"
#include "batch.glsl"

layout(local_size_x = 64) in;

// n: Gaussians of the group; first: flat index of its first; is_dynamic: 1 where it has motion, else 0.
layout(push_constant) uniform Push { uint n; uint first; uint is_dynamic; uint degree; } pc;
layout(set = 0, binding = 0) restrict readonly buffer FrameStatus { Status status; };
layout(set = 0, binding = 1) uniform Adam { AdamParams adam; };
layout(set = 0, binding = 2) restrict readonly buffer Touched { uint touched[]; };
layout(set = 0, binding = 3) restrict buffer Geometry { vec4 geometry[]; };
layout(set = 0, binding = 4) restrict buffer Sh0 { vec4 sh0[]; };
layout(set = 0, binding = 5) restrict buffer Motion { vec4 motion[]; };
layout(set = 0, binding = 6) restrict buffer Sh1 { vec4 sh1[]; };
layout(set = 0, binding = 7) restrict buffer Sh2 { vec4 sh2[]; };
layout(set = 0, binding = 8) restrict buffer Sh3 { vec4 sh3[]; };
layout(set = 0, binding = 9) restrict buffer MomentsGeometry { vec4 moments_geometry[]; };
layout(set = 0, binding = 10) restrict buffer MomentsSh0 { vec4 moments_sh0[]; };
layout(set = 0, binding = 11) restrict buffer MomentsMotion { vec4 moments_motion[]; };
layout(set = 0, binding = 12) restrict buffer MomentsSh1 { vec4 moments_sh1[]; };
layout(set = 0, binding = 13) restrict buffer MomentsSh2 { vec4 moments_sh2[]; };
layout(set = 0, binding = 14) restrict buffer MomentsSh3 { vec4 moments_sh3[]; };
layout(set = 0, binding = 15) restrict buffer State { vec4 state[]; };
layout(set = 0, binding = 16) restrict buffer SumsGeometry { uvec4 sums_geometry[]; };
layout(set = 0, binding = 17) restrict buffer SumsSh0 { uvec4 sums_sh0[]; };
layout(set = 0, binding = 18) restrict buffer SumsMotion { uvec4 sums_motion[]; };
layout(set = 0, binding = 19) restrict buffer SumsSh1 { uvec4 sums_sh1[]; };
layout(set = 0, binding = 20) restrict buffer SumsSh2 { uvec4 sums_sh2[]; };
layout(set = 0, binding = 21) restrict buffer SumsSh3 { uvec4 sums_sh3[]; };

vec4 gradient_of(uvec4 low, uvec4 high) {
    return vec4(from_fixed(uvec2(low.x, high.x)), from_fixed(uvec2(low.y, high.y)), from_fixed(uvec2(low.z, high.z)),
        from_fixed(uvec2(low.w, high.w))) * (1.0 / BATCH_SCALE);
}

// Planes of a buffer, none where the group lacks it. The loop is one that lavapipe skips; an `if` is not.
#define STEP(parameter, moments, sums, kind, planes, is_gradient)                                                  \
    for (uint p = 0u; p < (planes); ++p) {                                                                         \
        const uint place = plane_index(i, planes, p);                                                              \
        const uint at_moments = moments_index(i, planes, p);                                                       \
        const uint at_sums = plane_index(i, 2u * (planes), 2u * p);                                                \
        const vec4 g = gradient_of(sums[at_sums], sums[at_sums + 32u]) * (is_gradient);                            \
        if (was_active) {                                                                                          \
            sums[at_sums] = uvec4(0u);                                                                             \
            sums[at_sums + 32u] = uvec4(0u);                                                                       \
        }                                                                                                          \
        const vec4 x = parameter[place];                                                                           \
        READ_MOMENTS(moments, at_moments, m, v)                                                                    \
        const vec4 rate = plane_rates(adam.position_opacity_rotation_scale,                                        \
            adam.t_scale_velocity_t_center_sh0, adam.sh1_sh2_sh3, kind, p, pace);                                  \
        const vec4 change = adam_change(adam, rate, g + regulariser(adam, kind, p, x), m, v);                      \
        parameter[place] = moved(adam, kind, p, x, change, residual);                                              \
        WRITE_MOMENTS(moments, at_moments, m, v, key, plane_number(kind, p))                                       \
    }

void main() {
    const uint i = linear_thread(gl_WorkGroupSize.x);
    if (i >= pc.n || status.failed != 0u) return;
    const bool was_active = (touched[i >> 5] >> (i & 31u) & 1u) != 0u;
    const uint is_dynamic = unfolded(pc.is_dynamic);
    const uint degree = unfolded(pc.degree);
    const uint key = moments_key(uint(adam.step), pc.first + i);
    vec4 own = state[i];
    const uint at_pull = plane_index(i, 2u, 0u);
    own.xy += pulls_of(uvec2(sums_sh0[at_pull].w, sums_sh0[at_pull + 32u].w));
    float residual = own.z;
    const float pace = position_pace(adam, exp(geometry[plane_index(i, 3u, 2u)].xyz));
    STEP(geometry, moments_geometry, sums_geometry, GEOMETRY, 3u, vec4(1.0))
    STEP(sh0, moments_sh0, sums_sh0, SH_0_BUFFER, 1u, vec4(1.0, 1.0, 1.0, 0.0))
    STEP(motion, moments_motion, sums_motion, MOTION, is_dynamic, vec4(1.0))
    STEP(sh1, moments_sh1, sums_sh1, SH_1_BUFFER, degree > 0u ? 3u : 0u, vec4(1.0))
    STEP(sh2, moments_sh2, sums_sh2, SH_1_BUFFER + 1u, degree > 1u ? 4u : 0u, vec4(1.0))
    STEP(sh3, moments_sh3, sums_sh3, SH_1_BUFFER + 2u, degree > 2u ? 6u : 0u, vec4(1.0))
    own.zw = vec2(residual, was_active ? adam.step : own.w);
    state[i] = own;
}
