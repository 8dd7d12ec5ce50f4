// SPDX-License-Identifier: MIT OR Apache-2.0
// Purpose   projects the active Gaussians of a group, evaluates their colour and counts the tiles they touch.
// Equation  SPEC 3: x_c = R mu(t') + t, C = (J R M)(J R M)^T + blur I, alpha = opacity(t') exp(-d^T C^-1 d / 2).
//           Flow: dt J0 R v, or pi'(mu(t' + dt)) - pi(mu(t')) where that lies before the camera one frame on.
// Grid      one thread per active Gaussian of the group.
// Reads     the parameters of the active Gaussians, by group-local index.
// Writes    splats (four vec4 each), depth key, identity, tile count, by active index.
// Numerics  factored form of include/conic.glsl; a record with anything non-finite touches no tile and is counted.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_KHR_shader_subgroup_ballot : require
#include "types.glsl"
#include "unfolded.glsl"
#include "grid.glsl"
#include "finite.glsl"
#include "camera.glsl"
#include "temporal.glsl"
#include "sh.glsl"
#include "rotation.glsl"
#include "conic.glsl"
#include "splat.glsl"

layout(local_size_x = 64) in;

layout(push_constant) uniform Push { uint group; uint first; } pc;
layout(set = 0, binding = 0) uniform View { ViewParams view; };
layout(set = 0, binding = 1) restrict readonly buffer Ranges { uvec2 ranges[]; };
layout(set = 0, binding = 2) restrict readonly buffer ActiveId { uint active_id[]; };
layout(set = 0, binding = 3) restrict readonly buffer Geometry { vec4 geometry[]; };
layout(set = 0, binding = 4) restrict readonly buffer Sh0 { vec4 sh0[]; };
layout(set = 0, binding = 5) restrict writeonly buffer Splats { vec4 splats[]; };
layout(set = 0, binding = 6) restrict writeonly buffer DepthKeys { uint depth_keys[]; };
layout(set = 0, binding = 7) restrict writeonly buffer Identity { uint identity[]; };
layout(set = 0, binding = 8) restrict writeonly buffer TileCounts { uint tile_counts[]; };
layout(set = 0, binding = 9) restrict buffer FrameStatus { Status status; };
// One interface for all variants: what a variant does not need is bound to something else and not read.
layout(set = 0, binding = 10) restrict readonly buffer Motion { vec4 motion[]; };
#ifdef SH_HALF
// Bands as halves, from sh_half.comp; places as those of the vec4.
layout(set = 0, binding = 11) restrict readonly buffer Sh1 { uvec2 sh1[]; };
layout(set = 0, binding = 12) restrict readonly buffer Sh2 { uvec2 sh2[]; };
layout(set = 0, binding = 13) restrict readonly buffer Sh3 { uvec2 sh3[]; };
vec4 band(uvec2 words) { return vec4(unpackHalf2x16(words.x), unpackHalf2x16(words.y)); }
#else
layout(set = 0, binding = 11) restrict readonly buffer Sh1 { vec4 sh1[]; };
layout(set = 0, binding = 12) restrict readonly buffer Sh2 { vec4 sh2[]; };
layout(set = 0, binding = 13) restrict readonly buffer Sh3 { vec4 sh3[]; };
vec4 band(vec4 values) { return values; }
#endif

// Before the clamp to >= 0, which would hide a NaN.
vec3 color_of(uint i, vec3 dir) {
    vec3 c = SH_0 * sh0[i].xyz;
#if SH_DEGREE >= 1
    const uint b1 = plane_index(i, 3u, 0u);
    c += sh_band1(band(sh1[b1]), band(sh1[b1 + 32u]), band(sh1[b1 + 64u]), dir);
#endif
#if SH_DEGREE >= 2
    const uint b2 = plane_index(i, 4u, 0u);
    c += sh_band2(band(sh2[b2]), band(sh2[b2 + 32u]), band(sh2[b2 + 64u]), band(sh2[b2 + 96u]), dir);
#endif
#if SH_DEGREE >= 3
    const uint b3 = plane_index(i, 6u, 0u);
    c += sh_band3(band(sh3[b3]), band(sh3[b3 + 32u]), band(sh3[b3 + 64u]), band(sh3[b3 + 96u]), band(sh3[b3 + 128u]),
        band(sh3[b3 + 160u]), dir);
#endif
    return c + 0.5;
}

// Positive floats order as their bits do. A short key counts from the near plane on and is full 2^16 times as far: what lies
// farther, and before the near plane, where nothing is drawn, shares the last one.
uint depth_key(ViewParams view, float z) {
    const uint bits = floatBitsToUint(z);
    const uint shift = unfolded(view.depth_shift);
    const uint steps = (bits - floatBitsToUint(view.near)) >> shift;
    return shift == 0u ? bits : min(steps, (1u << (27u - shift)) - 1u);
}

void main() {
    const uvec2 range = ranges[pc.group];
    const uint at = range.x + linear_thread(gl_WorkGroupSize.x);
    uint n_tiles = 0u;
    bool seen = false;
    bool bad = false;
    if (at < range.y) {
        const uint i = active_id[at] - pc.first;
        const vec4 mean_opacity = geometry[plane_index(i, 3u, 0u)];
        const vec4 q_raw = geometry[plane_index(i, 3u, 1u)];
        const vec4 scale_t = geometry[plane_index(i, 3u, 2u)];
        vec3 mean = mean_opacity.xyz;
        float opacity = sigmoid(mean_opacity.w);
        vec2 flow = vec2(0.0);
        vec3 later = mean;
#ifdef DYNAMIC
        const vec4 v = motion[i];
        mean = mean_at(mean, v, view.time);
        opacity *= temporal_weight(v.w, scale_t.w, view.time);
        later = mean + view.background.w * v.xyz;
#endif
        const vec3 p = to_camera(view, mean);
        const vec2 uv = p.xy / p.z;
        const vec2 uv_j = clamp(uv, view.clamp_uv.xz, view.clamp_uv.yw);
        const vec2 f_z = view.intrinsics.xy / p.z;
#ifdef DYNAMIC
        const vec3 v_cam = rotate_to_camera(view, v.xyz);
        flow = view.background.w * f_z * (v_cam.xy - uv * v_cam.z);
#endif
        const vec3 p_later = to_next_camera(view, later);
        if (unfolded(view.flow_model) == FLOW_DISPLACEMENT && p_later.z > view.near) {
            flow = view.intrinsics.xy * (p_later.xy / p_later.z - uv);
        }
        float q_norm;
        const mat3 rotation = rotation_of(unit_quaternion(q_raw, q_norm));
        const vec3 a0 = f_z.x * (view.row0.xyz - uv_j.x * view.row2.xyz);
        const vec3 a1 = f_z.y * (view.row1.xyz - uv_j.y * view.row2.xyz);
        const Conic conic = conic_of(a0 * rotation, a1 * rotation, exp(scale_t.xyz), view.blur);
        const vec2 xy = view.intrinsics.xy * uv + view.intrinsics.zw;
        const float cut = squared_reach(view, opacity);
        const float root_cut = sqrt(cut >= 0.0 ? cut : FADED_REACH);
        const vec3 from_camera = mean - vec3(view.row0.w, view.row1.w, view.row2.w);
        float inverse_distance;
        const vec3 color = color_of(i, unit_direction(from_camera, inverse_distance));
        const float reach_y = root_cut * conic.sd_y;
        const float chord = root_cut * conic.chord;
        splats[SPLAT_PLANES * at] = vec4(xy, conic.m.xy);
        splats[SPLAT_PLANES * at + 1u] = vec4(conic.m.zw, opacity, p.z);
        splats[SPLAT_PLANES * at + 2u] = vec4(max(color, vec3(0.0)), flow.x);
        splats[SPLAT_PLANES * at + 3u] = vec4(flow.y, conic.slope, chord, reach_y);
        depth_keys[at] = depth_key(view, p.z);
        identity[at] = at;
        bad = !(finite2(xy) && finite4(conic.m) && finite(opacity) && finite(p.z) && finite3(color) && finite2(flow)
            && finite3(vec3(conic.slope, chord, reach_y)));
        const bool shows = cut >= 0.0;
        if (!bad && p.z > view.near && (shows || squared(view))) {
            const uvec2 rows = tile_rows(view, xy.y, reach_y);
            for (uint row = rows.x; row < rows.y; ++row) {
                const uvec2 columns = tile_columns(view, xy, conic.slope, chord, reach_y, row);
                n_tiles += columns.y - min(columns.x, columns.y);
            }
            seen = shows && n_tiles > 0u;
            // Who is seen does not depend on the bound.
            if (boxed(view) && (seen || !shows)) {
                const vec3 ellipse = vec3(conic.slope, chord, reach_y);
                const uvec2 box_rows = listed_rows(view, xy, opacity, ellipse);
                const uvec2 columns = listed_columns(view, xy, opacity, ellipse, 0u);
                n_tiles = (box_rows.y - box_rows.x) * (columns.y - columns.x);
            }
        }
        tile_counts[at] = n_tiles;
    }
    const uvec4 visible = subgroupBallot(seen);
    const uvec4 faulty = subgroupBallot(bad);
    if (gl_SubgroupInvocationID == 0u) {
        if ((visible.x | visible.y) != 0u) atomicAdd(status.n_visible, bitCount(visible.x) + bitCount(visible.y));
        if ((faulty.x | faulty.y) != 0u) atomicAdd(status.n_bad, bitCount(faulty.x) + bitCount(faulty.y));
    }
}
