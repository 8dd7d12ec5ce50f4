// SPDX-License-Identifier: MIT OR Apache-2.0
// Purpose   projects the active Gaussians of a group, evaluates their colour and counts their tiles.
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
#include "unit.glsl"
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
layout(set = 0, binding = 7) restrict writeonly buffer TileCounts { uint tile_counts[]; };
layout(set = 0, binding = 8) restrict buffer FrameStatus { Status status; };
// One interface for all variants: what a variant does not need is bound to something else and not read.
layout(set = 0, binding = 9) restrict readonly buffer Motion { vec4 motion[]; };
layout(set = 0, binding = 10) restrict readonly buffer Sh1 { vec4 sh1[]; };
layout(set = 0, binding = 11) restrict readonly buffer Sh2 { vec4 sh2[]; };
layout(set = 0, binding = 12) restrict readonly buffer Sh3 { vec4 sh3[]; };

// A Gaussian at the view's time.
struct Gaussian {
    vec3 mean;
    vec3 velocity;
    float opacity;
    float cut;
    mat3 rotation;
    vec3 scale;
};

// A Gaussian on the picture, but for the colour.
struct Splat {
    vec2 xy;
    float z;
    vec2 flow;
    vec4 m;
    vec3 ellipse;  // slope, chord, reach_y
};

Gaussian gaussian_of(uint i) {
    const vec4 mean_opacity = geometry[plane_index(i, 3u, 0u)];
    const vec4 q_raw = geometry[plane_index(i, 3u, 1u)];
    const vec4 scale_t = geometry[plane_index(i, 3u, 2u)];
    Gaussian g;
    g.mean = mean_opacity.xyz;
    g.velocity = vec3(0.0);
    g.opacity = sigmoid(mean_opacity.w);
#ifdef DYNAMIC
    const vec4 v = motion[i];
    g.mean = mean_at(g.mean, v, view.time);
    g.velocity = v.xyz;
    g.opacity *= temporal_weight(v.w, scale_t.w, view.time);
#endif
    g.cut = squared_reach(view, g.opacity);
    float inverse_length;
    g.rotation = rotation_of(unit_quaternion(q_raw, inverse_length));
    g.scale = exp(scale_t.xyz);
    return g;
}

Splat splat_of(ViewParams view, Gaussian g) {
    Splat splat;
    splat.flow = vec2(0.0);
    vec3 later = g.mean;
    const vec3 p = to_camera(view, g.mean);
    const vec2 uv = p.xy / p.z;
    const vec2 uv_j = clamp(uv, view.clamp_uv.xz, view.clamp_uv.yw);
    const vec2 f_z = view.intrinsics.xy / p.z;
#ifdef DYNAMIC
    later = g.mean + view.background.w * g.velocity;
    const vec3 v_cam = rotate_to_camera(view, g.velocity);
    splat.flow = view.background.w * f_z * (v_cam.xy - uv * v_cam.z);
#endif
    const vec3 p_later = to_next_camera(view, later);
    if (unfolded(view.flow_model) == FLOW_DISPLACEMENT && p_later.z > view.near) {
        splat.flow = view.intrinsics.xy * (p_later.xy / p_later.z - uv);
    }
    const vec3 a0 = f_z.x * (view.row0.xyz - uv_j.x * view.row2.xyz);
    const vec3 a1 = f_z.y * (view.row1.xyz - uv_j.y * view.row2.xyz);
    const Conic conic = conic_of(a0 * g.rotation, a1 * g.rotation, g.scale, view.blur);
    const float root_cut = sqrt(g.cut >= 0.0 ? g.cut : FADED_REACH);
    splat.xy = view.intrinsics.xy * uv + view.intrinsics.zw;
    splat.z = p.z;
    splat.m = conic.m;
    splat.ellipse = vec3(conic.slope, root_cut * conic.chord, root_cut * conic.sd_y);
    return splat;
}

vec3 direction_from(ViewParams view, vec3 mean) {
    const vec3 from_camera = mean - vec3(view.row0.w, view.row1.w, view.row2.w);
    float inverse_distance;
    return unit_direction(from_camera, inverse_distance);
}

// Seen along a direction, before the clamp to >= 0, which would hide a NaN.
vec3 color_of(uint i, vec3 dir) {
    vec3 color = SH_0 * sh0[i].xyz;
#if SH_DEGREE >= 1
    const uint b1 = plane_index(i, 3u, 0u);
    const vec4 c1[3] = vec4[](sh1[b1], sh1[b1 + 32u], sh1[b1 + 64u]);
    color += sh_band1(c1[0], c1[1], c1[2], dir);
#endif
#if SH_DEGREE >= 2
    const uint b2 = plane_index(i, 4u, 0u);
    const vec4 c2[4] = vec4[](sh2[b2], sh2[b2 + 32u], sh2[b2 + 64u], sh2[b2 + 96u]);
    color += sh_band2(c2[0], c2[1], c2[2], c2[3], dir);
#endif
#if SH_DEGREE >= 3
    const uint b3 = plane_index(i, 6u, 0u);
    const vec4 c3[6] = vec4[](sh3[b3], sh3[b3 + 32u], sh3[b3 + 64u], sh3[b3 + 96u], sh3[b3 + 128u], sh3[b3 + 160u]);
    color += sh_band3(c3[0], c3[1], c3[2], c3[3], c3[4], c3[5], dir);
#endif
    return color + 0.5;
}

// Positive floats order as their bits do. A short key counts from the near plane on. It is full 2^32 times as far if it has 24
// bits, 2^16 times if it has 16: what lies farther, and before the near plane, where nothing is drawn, shares the last one.
uint depth_key(ViewParams view, float z) {
    const uint bits = floatBitsToUint(z);
    const uint shift = unfolded(view.depth_shift);
    const uint steps = (bits - floatBitsToUint(view.near)) >> shift;
    return shift == 0u ? bits : min(steps, shift == DEPTH_SHIFT_24 ? 0xffffffu : 0xffffu);
}

// Tiles that the splat is listed for; whether it shows in one, and whether anything of it is not finite.
uint tiles_of(ViewParams view, Splat splat, Gaussian g, vec3 color, out bool seen, out bool bad) {
    uint n_tiles = 0u;
    seen = false;
    bad = !(finite2(splat.xy) && finite4(splat.m) && finite(g.opacity) && finite(splat.z) && finite3(color)
        && finite2(splat.flow) && finite3(splat.ellipse));
    const bool shows = g.cut >= 0.0;
    if (!bad && splat.z > view.near && (shows || squared(view))) {
        const uvec2 rows = tile_rows(view, splat.xy.y, splat.ellipse.z);
        for (uint row = rows.x; row < rows.y; ++row) {
            const uvec2 columns =
                tile_columns(view, splat.xy, splat.ellipse.x, splat.ellipse.y, splat.ellipse.z, row);
            n_tiles += columns.y - min(columns.x, columns.y);
        }
        seen = shows && n_tiles > 0u;
        // Who is seen does not depend on the bound.
        if (boxed(view) && (seen || !shows)) {
            const uvec2 box_rows = listed_rows(view, splat.xy, g.opacity, splat.ellipse);
            const uvec2 columns = listed_columns(view, splat.xy, g.opacity, splat.ellipse, 0u);
            n_tiles = (box_rows.y - box_rows.x) * (columns.y - columns.x);
        }
    }
    return n_tiles;
}

void main() {
    const uvec2 range = ranges[pc.group];
    const uint at = range.x + linear_thread(gl_WorkGroupSize.x);
    bool seen = false;
    bool bad = false;
    if (at < range.y) {
        const uint i = active_id[at] - pc.first;
        const Gaussian g = gaussian_of(i);
        const Splat splat = splat_of(view, g);
        const vec3 color = color_of(i, direction_from(view, g.mean));
        depth_keys[at] = depth_key(view, splat.z);
        splats[SPLAT_PLANES * at] = vec4(splat.xy, splat.m.xy);
        splats[SPLAT_PLANES * at + 1u] = vec4(splat.m.zw, g.opacity, splat.z);
        splats[SPLAT_PLANES * at + 2u] = vec4(max(color, vec3(0.0)), splat.flow.x);
        splats[SPLAT_PLANES * at + 3u] = vec4(splat.flow.y, splat.ellipse);
        tile_counts[at] = tiles_of(view, splat, g, color, seen, bad);
    }
    const uvec4 visible = subgroupBallot(seen);
    const uvec4 faulty = subgroupBallot(bad);
    if (gl_SubgroupInvocationID == 0u) {
        if ((visible.x | visible.y) != 0u) atomicAdd(status.n_visible, bitCount(visible.x) + bitCount(visible.y));
        if ((faulty.x | faulty.y) != 0u) atomicAdd(status.n_bad, bitCount(faulty.x) + bitCount(faulty.y));
    }
}
