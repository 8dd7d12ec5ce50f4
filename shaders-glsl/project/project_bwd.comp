// SPDX-License-Identifier: MIT OR Apache-2.0
// Purpose   carries each active Gaussian's sums back to its parameters; with ADAM it moves them there and then.
// Equation  the adjoint of project.comp: dL/dC = -M^T H M with H the whitened moments, then through V = J R Rot(q) diag(s).
// Grid      one thread per active Gaussian of the group.
// Reads     slots of the blend, added in order, or sums that were accumulated (`is_summed`).
// Writes    gradients in the layout of the parameters, by group-local index; others keep the zeros they were cleared to. The fourth
//           number of the constant band is how hard the centre is pulled, -1 where that does not count.
//           ADAM: parameters, moments and state (density statistics, t_center's residual, step). d_camera, if asked for:
//           (rotation of the camera about its own axes, time) and (translation along them, 0) of each active Gaussian.
// Numerics  clamps have zero derivative outside; a gradient that is not finite is written as zero, or moves nothing, and is
//           counted. Nothing moves when the frame failed.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_KHR_shader_subgroup_ballot : require
#include "types.glsl"
#include "unfolded.glsl"
#include "grid.glsl"
#include "finite.glsl"
#include "unit.glsl"
#include "camera.glsl"
#include "temporal.glsl"
#include "sh.glsl"
#include "sh_bwd.glsl"
#include "rotation.glsl"
#include "conic.glsl"
#include "splat.glsl"
#ifdef ADAM
#include "adam.glsl"
#endif

layout(local_size_x = 64) in;

layout(push_constant) uniform Push { uint group; uint first; uint is_summed; uint wants_camera; } pc;
layout(set = 0, binding = 0) uniform View { ViewParams view; };
layout(set = 0, binding = 1) restrict readonly buffer Ranges { uvec2 ranges[]; };
layout(set = 0, binding = 2) restrict readonly buffer ActiveId { uint active_id[]; };
layout(set = 0, binding = 4) restrict readonly buffer Splats { vec4 splats[]; };
layout(set = 0, binding = 5) restrict readonly buffer TileCounts { uint tile_counts[]; };
layout(set = 0, binding = 6) restrict readonly buffer SlotFirst { uint slot_first[]; };
layout(set = 0, binding = 7) restrict readonly buffer DSlots { vec2 d_slots[]; };
layout(set = 0, binding = 8) restrict buffer NBad { uint n_bad[]; };
layout(set = 0, binding = 9) restrict readonly buffer FrameStatus { Status status; };
layout(set = 0, binding = 10) restrict writeonly buffer DCamera { vec4 d_camera[]; };
// One interface for all variants: what a variant does not need is bound to something else and not touched.
#ifdef ADAM
layout(set = 0, binding = 3) restrict buffer Geometry { vec4 geometry[]; };
layout(set = 0, binding = 11) restrict buffer Sh0 { vec4 sh0[]; };
layout(set = 0, binding = 12) restrict buffer Motion { vec4 motion[]; };
layout(set = 0, binding = 13) restrict buffer Sh1 { vec4 sh1[]; };
layout(set = 0, binding = 14) restrict buffer Sh2 { vec4 sh2[]; };
layout(set = 0, binding = 15) restrict buffer Sh3 { vec4 sh3[]; };
layout(set = 0, binding = 16) restrict buffer MomentsGeometry { vec4 moments_geometry[]; };
layout(set = 0, binding = 17) restrict buffer MomentsSh0 { vec4 moments_sh0[]; };
layout(set = 0, binding = 18) restrict buffer MomentsMotion { vec4 moments_motion[]; };
layout(set = 0, binding = 19) restrict buffer MomentsSh1 { vec4 moments_sh1[]; };
layout(set = 0, binding = 20) restrict buffer MomentsSh2 { vec4 moments_sh2[]; };
layout(set = 0, binding = 21) restrict buffer MomentsSh3 { vec4 moments_sh3[]; };
layout(set = 0, binding = 22) restrict buffer State { vec4 state[]; };
layout(set = 0, binding = 23) uniform Adam { AdamParams adam; };

// Moves plane `p` of `params` (at `at`) along gradient g.
#define PUT(params, moments, at, kind, planes, p, g) {                                     \
        const uint place = at;                                                             \
        const uint at_moments = moments_index(i, planes, p);                               \
        const vec4 x = params[place];                                                      \
        READ_MOMENTS(moments, at_moments, m, v)                                            \
        const vec4 rate = plane_rates(adam.position_opacity_rotation_scale,                \
            adam.t_scale_velocity_t_center_sh0, adam.sh1_sh2_sh3, kind, p, pace);          \
        const vec4 change = adam_change(adam, rate, g + regulariser(adam, kind, p, x), m, v); \
        params[place] = moved(adam, kind, p, x, change, residual);                         \
        WRITE_MOMENTS(moments, at_moments, m, v, moments_key(uint(adam.step), pc.first + i), plane_number(kind, p)) \
    }
#define PUT_GEOMETRY(p, g) PUT(geometry, moments_geometry, plane_index(i, 3u, p), GEOMETRY, 3u, p, g)
#define PUT_SH0(g, pull) PUT(sh0, moments_sh0, i, SH_0_BUFFER, 1u, 0u, g)
#define PUT_MOTION(g) PUT(motion, moments_motion, i, MOTION, 1u, 0u, g)
#define PUT_SH1(p, g) PUT(sh1, moments_sh1, plane_index(i, 3u, p), SH_1_BUFFER, 3u, p, g)
#define PUT_SH2(p, g) PUT(sh2, moments_sh2, plane_index(i, 4u, p), SH_1_BUFFER + 1u, 4u, p, g)
#define PUT_SH3(p, g) PUT(sh3, moments_sh3, plane_index(i, 6u, p), SH_1_BUFFER + 2u, 6u, p, g)
#else
layout(set = 0, binding = 3) restrict readonly buffer Geometry { vec4 geometry[]; };
layout(set = 0, binding = 11) restrict readonly buffer Motion { vec4 motion[]; };
layout(set = 0, binding = 12) restrict readonly buffer Sh1 { vec4 sh1[]; };
layout(set = 0, binding = 13) restrict readonly buffer Sh2 { vec4 sh2[]; };
layout(set = 0, binding = 14) restrict readonly buffer Sh3 { vec4 sh3[]; };
layout(set = 0, binding = 15) restrict writeonly buffer DGeometry { vec4 d_geometry[]; };
layout(set = 0, binding = 16) restrict writeonly buffer DSh0 { vec4 d_sh0[]; };
layout(set = 0, binding = 17) restrict writeonly buffer DMotion { vec4 d_motion[]; };
layout(set = 0, binding = 18) restrict writeonly buffer DSh1 { vec4 d_sh1[]; };
layout(set = 0, binding = 19) restrict writeonly buffer DSh2 { vec4 d_sh2[]; };
layout(set = 0, binding = 20) restrict writeonly buffer DSh3 { vec4 d_sh3[]; };

#define PUT_GEOMETRY(p, g) d_geometry[plane_index(i, 3u, p)] = g;
#define PUT_SH0(g, pull) d_sh0[i] = vec4((g).xyz, pull);
#define PUT_MOTION(g) d_motion[i] = g;
#define PUT_SH1(p, g) d_sh1[plane_index(i, 3u, p)] = g;
#define PUT_SH2(p, g) d_sh2[plane_index(i, 4u, p)] = g;
#define PUT_SH3(p, g) d_sh3[plane_index(i, 6u, p)] = g;
#endif

// The gradient of the unit direction through the bands above the first.
vec3 d_bands(uint i, vec3 dir, vec3 g) {
    vec3 d_dir = vec3(0.0);
#if SH_DEGREE >= 1
    const uint b1 = plane_index(i, 3u, 0u);
    d_dir += sh_band1_d_dir(sh1[b1], sh1[b1 + 32u], sh1[b1 + 64u], g);
#endif
#if SH_DEGREE >= 2
    const uint b2 = plane_index(i, 4u, 0u);
    d_dir += sh_band2_d_dir(sh2[b2], sh2[b2 + 32u], sh2[b2 + 64u], sh2[b2 + 96u], dir, g);
#endif
#if SH_DEGREE >= 3
    const uint b3 = plane_index(i, 6u, 0u);
    d_dir += sh_band3_d_dir(sh3[b3], sh3[b3 + 32u], sh3[b3 + 64u], sh3[b3 + 96u], sh3[b3 + 128u], sh3[b3 + 160u], dir, g);
#endif
    return d_dir;
}

// Gives the bands above the first their gradients.
void put_bands(uint i, vec3 dir, vec3 g) {
    float residual = 0.0;
    const float pace = 1.0;
#if SH_DEGREE >= 1
    const vec3 p0 = -SH_1 * dir.y * g, p1 = SH_1 * dir.z * g, p2 = -SH_1 * dir.x * g;
    PUT_SH1(0u, vec4(p0, p1.x))
    PUT_SH1(1u, vec4(p1.yz, p2.xy))
    PUT_SH1(2u, vec4(p2.z, 0.0, 0.0, 0.0))
#endif
#if SH_DEGREE >= 2
    const float[5] y2 = sh_basis2(dir);
    PUT_SH2(0u, vec4(y2[0] * g, y2[1] * g.x))
    PUT_SH2(1u, vec4(y2[1] * g.yz, y2[2] * g.xy))
    PUT_SH2(2u, vec4(y2[2] * g.z, y2[3] * g))
    PUT_SH2(3u, vec4(y2[4] * g, 0.0))
#endif
#if SH_DEGREE >= 3
    const float[7] y3 = sh_basis3(dir);
    PUT_SH3(0u, vec4(y3[0] * g, y3[1] * g.x))
    PUT_SH3(1u, vec4(y3[1] * g.yz, y3[2] * g.xy))
    PUT_SH3(2u, vec4(y3[2] * g.z, y3[3] * g))
    PUT_SH3(3u, vec4(y3[4] * g, y3[5] * g.x))
    PUT_SH3(4u, vec4(y3[5] * g.yz, y3[6] * g.xy))
    PUT_SH3(5u, vec4(y3[6] * g.z, 0.0, 0.0, 0.0))
#endif
}

void main() {
    const uvec2 range = ranges[pc.group];
    const uint at = range.x + linear_thread(gl_WorkGroupSize.x);
    // A frame that will be replayed leaves no trace, not in the statistics either.
    if (at >= range.y || status.failed != 0u) return;
    const uint i = active_id[at] - pc.first;

    vec2 sum[6] = vec2[6](vec2(0.0), vec2(0.0), vec2(0.0), vec2(0.0), vec2(0.0), vec2(0.0));
    const uint n_tiles = tile_counts[at];
    const bool is_summed = unfolded(pc.is_summed) != 0u;
    const uint begin = 6u * (is_summed ? at : slot_first[at]);
    const uint n_slots = is_summed ? min(n_tiles, 1u) : n_tiles;
    for (uint k = 0u; k < n_slots; ++k) {
        for (uint c = 0u; c < 6u; ++c) sum[c] += d_slots[begin + 6u * k + c];
    }
    const vec4 s0 = splats[SPLAT_PLANES * at];
    const vec4 s1 = splats[SPLAT_PLANES * at + 1u];
    const vec4 s2 = splats[SPLAT_PLANES * at + 2u];
    const vec4 m = vec4(s0.zw, s1.xy);
    const vec2 d_xy = -2.0 * vec2(m.x * sum[1].y + m.z * sum[2].x, m.y * sum[1].y + m.w * sum[2].x);
    const float d_opacity_t = sum[2].y;
    // The colour's clamp at 0 has no derivative below.
    const vec3 d_color = vec3(sum[3], sum[4].x) * vec3(greaterThan(s2.xyz, vec3(0.0)));
    const float d_z = sum[4].y;

    // The projection again, as project.comp has it.
    const vec4 mean_opacity = geometry[plane_index(i, 3u, 0u)];
    const vec4 scale_t = geometry[plane_index(i, 3u, 2u)];
    vec3 mean = mean_opacity.xyz;
    vec3 later = mean;
    const float base = sigmoid(mean_opacity.w);
#ifdef DYNAMIC
    const vec4 v = motion[i];
    mean = mean_at(mean, v, view.time);
    later = mean + view.background.w * v.xyz;
    const float weight = temporal_weight(v.w, scale_t.w, view.time);
#else
    const float weight = 1.0;
#endif
    const vec3 p = to_camera(view, mean);
    const vec2 uv = p.xy / p.z;
    const vec2 uv_j = clamp(uv, view.clamp_uv.xz, view.clamp_uv.yw);
    const vec2 f_z = view.intrinsics.xy / p.z;
    float inverse_length;
    const vec4 q = unit_quaternion(geometry[plane_index(i, 3u, 1u)], inverse_length);
    const mat3 rotation = rotation_of(q);
    const vec3 a0 = f_z.x * (view.row0.xyz - uv_j.x * view.row2.xyz);
    const vec3 a1 = f_z.y * (view.row1.xyz - uv_j.y * view.row2.xyz);
    const vec3 s = exp(scale_t.xyz);
    const vec3 r0 = (a0 * rotation) * s;
    const vec3 r1 = (a1 * rotation) * s;

    // dL/dV = -(2 / k^2) M^T H (M V), k = EXP2_FACTOR.
    const vec3 b0 = m.x * r0 + m.y * r1;
    const vec3 b1 = m.z * r0 + m.w * r1;
    const vec3 h0 = sum[0].x * b0 + sum[0].y * b1;
    const vec3 h1 = sum[0].y * b0 + sum[1].x * b1;
    const float scale = -2.0 / (EXP2_FACTOR * EXP2_FACTOR);
    const vec3 d_r0 = scale * (m.x * h0 + m.z * h1);
    const vec3 d_r1 = scale * (m.y * h0 + m.w * h1);
    const vec3 d_log_s = d_r0 * r0 + d_r1 * r1;
    const vec3 d_g0 = d_r0 * s;
    const vec3 d_g1 = d_r1 * s;
    const vec3 d_a0 = rotation * d_g0;
    const vec3 d_a1 = rotation * d_g1;
    const mat3 d_rotation = outerProduct(a0, d_g0) + outerProduct(a1, d_g1);
    const vec4 d_unit = d_unit_quaternion(q, d_rotation);
    const vec4 d_q = (d_unit - q * dot(q, d_unit)) * inverse_length;

    vec2 d_f_z = vec2(dot(d_a0, view.row0.xyz - uv_j.x * view.row2.xyz), dot(d_a1, view.row1.xyz - uv_j.y * view.row2.xyz));
    const vec2 inside = vec2(equal(uv, uv_j));
    // The displacement's flow is the difference of two projections; that of the later one is added to d_mean below.
    const vec3 p_later = to_next_camera(view, later);
    const bool displaced = unfolded(view.flow_model) == FLOW_DISPLACEMENT && p_later.z > view.near;
    const vec2 d_uv_later = displaced ? view.intrinsics.xy * sum[5] : vec2(0.0);
    const vec2 uv_later = p_later.xy / p_later.z;
    const vec3 d_p_later = displaced ? vec3(d_uv_later, -dot(d_uv_later, uv_later)) / p_later.z : vec3(0.0);
    vec2 d_uv = view.intrinsics.xy * d_xy - d_uv_later - inside * f_z * vec2(dot(d_a0, view.row2.xyz), dot(d_a1, view.row2.xyz));
#ifdef DYNAMIC
    const vec3 v_cam = rotate_to_camera(view, v.xyz);
    const vec2 g_flow = displaced ? vec2(0.0) : view.background.w * sum[5];
    d_f_z += g_flow * (v_cam.xy - uv * v_cam.z);
    d_uv -= g_flow * f_z * v_cam.z;
    const vec3 d_v_cam = vec3(g_flow * f_z, -dot(g_flow * f_z, uv));
#endif
    const vec3 d_p = vec3(d_uv / p.z, d_z - (dot(d_uv, uv) + dot(d_f_z, f_z)) / p.z);
    vec3 d_mean = view.row0.xyz * d_p.x + view.row1.xyz * d_p.y + view.row2.xyz * d_p.z;
    const vec3 from_camera = mean - vec3(view.row0.w, view.row1.w, view.row2.w);
    float inverse_distance;
    const vec3 dir = unit_direction(from_camera, inverse_distance);
    const vec3 d_dir = d_bands(i, dir, d_color);
    d_mean += (d_dir - dir * dot(dir, d_dir)) * inverse_distance;
    // What a shift of this camera does: the one a frame on stays.
    const vec3 d_shift = rotate_to_camera(view, d_mean);
    const vec3 d_later = view.next0.xyz * d_p_later.x + view.next1.xyz * d_p_later.y + view.next2.xyz * d_p_later.z;
    d_mean += d_later;

    vec4 d_mean_opacity = vec4(d_mean, d_opacity_t * weight * base * (1.0 - base));
    vec4 d_scale_t = vec4(d_log_s, 0.0);
    vec4 d_v = vec4(0.0);
#ifdef DYNAMIC
    // opacity(t') = base exp(-u^2), mu(t') = mu + v (t' - t_center).
    const float dt = view.time - v.w;
    const float rate = rate_of(scale_t.w);
    const float u = dt * rate;
    const float d_exponent = abs(u) < 16.0 ? d_opacity_t * base * weight : 0.0;
    const float d_time = dot(d_mean, v.xyz) - 2.0 * u * rate * d_exponent;
    const vec3 d_velocity =
        dt * d_mean + view.background.w * d_later + view.row0.xyz * d_v_cam.x + view.row1.xyz * d_v_cam.y + view.row2.xyz * d_v_cam.z;
    d_v = vec4(d_velocity, -d_time);
    d_scale_t.w = 2.0 * u * u * d_exponent;
#endif
    const bool good = finite4(d_mean_opacity) && finite4(d_q) && finite4(d_scale_t) && finite4(d_v) && finite3(d_color);
    if (!good) atomicAdd(n_bad[0], 1u);
    if (unfolded(pc.wants_camera) != 0u) {
        const vec3 d_row0 = f_z.x * d_a0;
        const vec3 d_row1 = f_z.y * d_a1;
        const vec3 d_row2 = -f_z.x * uv_j.x * d_a0 - f_z.y * uv_j.y * d_a1;
        vec3 d_turn = cross(p, d_p)
            + vec3(dot(d_row2, view.row1.xyz) - dot(d_row1, view.row2.xyz),
                dot(d_row0, view.row2.xyz) - dot(d_row2, view.row0.xyz),
                dot(d_row1, view.row0.xyz) - dot(d_row0, view.row1.xyz));
#ifdef DYNAMIC
        d_turn += cross(v_cam, d_v_cam);
#endif
        // Centre and camera enter by their difference alone, so a shift of the camera is one of all centres.
        vec3 d_shift_all = d_shift;
        if (unfolded(pc.wants_camera) == CAMERA_WITH_NEXT) {
            // A correction turns and shifts the camera one frame on too; in the frame of this one.
            const vec3 d_turn_later = cross(p_later, d_p_later);
            d_turn += rotate_to_camera(view,
                view.next0.xyz * d_turn_later.x + view.next1.xyz * d_turn_later.y + view.next2.xyz * d_turn_later.z);
            d_shift_all += rotate_to_camera(view, d_later);
        }
        d_camera[2u * at] = good ? vec4(d_turn, -d_v.w) : vec4(0.0);
        d_camera[2u * at + 1u] = good ? vec4(d_shift_all, 0.0) : vec4(0.0);
    }
    // In units of half a picture, as 3DGS's threshold for density control has it.
    const float pull = length(d_xy * 0.5 * vec2(float(view.width), float(view.height)));
    const bool counts = n_tiles > 0u && squared_reach(view, s1.z) >= 0.0;
#ifdef ADAM
    if (!good) return;
    vec4 own = state[i];
    float residual = own.z;
    const float pace = position_pace(adam, s);
    if (counts) own.xy += vec2(pull, 1.0);
#endif
    PUT_GEOMETRY(0u, good ? d_mean_opacity : vec4(0.0))
    PUT_GEOMETRY(1u, good ? d_q : vec4(0.0))
    PUT_GEOMETRY(2u, good ? d_scale_t : vec4(0.0))
    PUT_SH0(good ? vec4(SH_0 * d_color, 0.0) : vec4(0.0), good && counts ? pull : -1.0)
#ifdef DYNAMIC
    PUT_MOTION(good ? d_v : vec4(0.0))
#endif
    put_bands(i, dir, good ? d_color : vec3(0.0));
#ifdef ADAM
    own.zw = vec2(residual, adam.step);
    state[i] = own;
#endif
}
