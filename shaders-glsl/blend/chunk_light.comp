// SPDX-License-Identifier: MIT OR Apache-2.0
// Purpose   says how much light each chunk of a long list lets through, so that all chunks can be blended at once.
// Equation  the product of 1 - alpha over the chunk's entries.
// Grid      one workgroup per chunk, one subgroup per block of pixels.
// Writes    a factor per chunk and pixel of its tile. The last chunk of a list has nothing behind it and writes none.
// Numerics  entries are those of blend_fwd: alpha >= alpha_min, cut off at alpha_max. Below t_min or t_cut all that lies behind
//           is dark, whatever is in front of the chunk, so the walk ends.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_KHR_shader_subgroup_ballot : require
#extension GL_KHR_shader_subgroup_shuffle : require
#extension GL_KHR_shader_subgroup_vote : require
#define PIXELS 4
#include "types.glsl"
#include "unfolded.glsl"
#include "grid.glsl"
#include "splat.glsl"
#include "block.glsl"

layout(local_size_x = 64) in;

layout(set = 0, binding = 0) uniform View { ViewParams view; };
layout(set = 0, binding = 1) restrict readonly buffer ChunkArgs { uint chunk_args[]; };
layout(set = 0, binding = 2) restrict readonly buffer ChunkItems { uvec2 chunk_items[]; };
layout(set = 0, binding = 3) restrict readonly buffer TileFirst { uint tile_first[]; };
layout(set = 0, binding = 4) restrict readonly buffer TileLast { uint tile_last[]; };
layout(set = 0, binding = 5) restrict readonly buffer SplatIds { uint splat_ids[]; };
layout(set = 0, binding = 6) restrict readonly buffer Splats { vec4 splats[]; };
layout(set = 0, binding = 7) restrict writeonly buffer ChunkLight { float chunk_light[]; };

void main() {
    const uint work = linear_group();
    if (work >= chunk_args[4u * CHUNK_ITEMS + 3u]) return;
    const uvec2 item = chunk_items[work];
    uint e = tile_first[item.x] + item.y * CHUNK;
    const uint end = e + CHUNK;
    if (end >= tile_last[item.x]) return;
    const uint lane = gl_SubgroupInvocationID;
    const uint n_lanes = gl_SubgroupSize;
    const BlockShape shape = block_shape();
    const uvec2 first = block_first(view, shape, item.x, gl_SubgroupID);
    const uint x = first.x + lane % shape.columns;
    const uint y = first.y + lane / shape.columns;
    const vec2 corner = vec2(float(first.x), float(view.first_row + first.y)) + 0.5;
    const float center_x = float(x) + 0.5;
    const float center_y = float(view.first_row + y) + 0.5;
    const float alpha_min = view.alpha_min;
    const float alpha_max = view.alpha_max;
    const float dark = max(view.t_min, view.t_cut);

    float T[PIXELS];
    for (uint k = 0u; k < PIXELS; ++k) T[k] = 1.0;
    bool alive = true;
    while (alive) {
        const bool valid = e + lane < end;
        const uint id = valid ? splat_ids[e + lane] : 0u;
        const vec4 s0 = splats[SPLAT_PLANES * id];
        const vec4 s1 = splats[SPLAT_PLANES * id + 1u];
        const vec4 s3 = splats[SPLAT_PLANES * id + 3u];
        const bool hit = valid && touches_block(view, s0.xy, s3.yzw, corner, shape);
        const uvec4 hits = subgroupBallot(hit);
        for (uint half_mask = 0u; half_mask < 2u; ++half_mask) {
            uint word = half_mask == 0u ? hits.x : hits.y;
            if (word != 0u) do {
                const uint i = 32u * half_mask + uint(findLSB(word));
                word &= word - 1u;
                const vec2 xy = vec2(subgroupShuffle(s0.x, i), subgroupShuffle(s0.y, i));
                const vec4 m = vec4(subgroupShuffle(s0.z, i), subgroupShuffle(s0.w, i), subgroupShuffle(s1.x, i),
                    subgroupShuffle(s1.y, i));
                const float opacity = subgroupShuffle(s1.z, i);
                const float dx = center_x - xy.x;
                for (uint k = 0u; k < PIXELS; ++k) {
                    const float dy = center_y + float(k * shape.lane_rows) - xy.y;
                    const float raw = splat_alpha(m, opacity, vec2(dx, dy));
                    T[k] *= raw >= alpha_min ? 1.0 - min(raw, alpha_max) : 1.0;
                }
            } while (word != 0u);
        }
        bool any_alive = false;
        for (uint k = 0u; k < PIXELS; ++k) any_alive = any_alive || T[k] >= dark;
        e += n_lanes;
        alive = e < end && subgroupAny(any_alive);
    }
    for (uint k = 0u; k < PIXELS; ++k) chunk_light[work * TILE * TILE + pixel_of_tile(shape, lane, k)] = T[k];
}
