// SPDX-License-Identifier: MIT OR Apache-2.0
// Purpose   blends each tile's Gaussians front to back into colour, alpha, depth, inverse depth and flow.
// Equation  SPEC 3: w = alpha T, T <- T (1 - alpha); stop before T falls below t_min, or when it is below t_cut.
// Grid      one subgroup per block of pixels, PIXELS per lane in a column; no barrier, no shared memory. CHUNKED: one
//           workgroup per chunk of a long list, then one per tile.
// Reads     splats through the tile's list, SEGMENT entries a round; later rounds continue from the images. CHUNKED: in one
//           round; a chunk starts from the light that those in front of it let through.
// Writes    image0: colour and alpha; image1: depth, inverse depth, flow (FULL only). Between rounds: sums and T, whose
//           sign says that the pixel is finished. TRAIN: also the final T and the number of the last entry added, from
//           which the backward pass starts. CHUNKED: a chunk leaves its sums, and T with that sign, in chunk0 and chunk1.
// Numerics  every lane loads one splat, the ballot drops those that miss the block, shuffles broadcast the rest. The
//           order of each pixel's sum is that of the list whatever the subgroup: the same bits at any width. CHUNKED: sums of
//           chunks, which differ from that in the last bits; of a list without chunks they do not.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_KHR_shader_subgroup_ballot : require
#extension GL_KHR_shader_subgroup_shuffle : require
#extension GL_KHR_shader_subgroup_vote : require
#include "types.glsl"
#include "unfolded.glsl"
#include "grid.glsl"
#include "splat.glsl"
#include "block.glsl"

layout(local_size_x = 64) in;

const float NEVER = 2.0;

#ifdef CHUNKED
layout(push_constant) uniform Push { uint n_tiles; } pc;
#else
layout(push_constant) uniform Push { uint n_blocks; uint stride; uint round; uint last_round; } pc;
#endif
layout(set = 0, binding = 0) uniform View { ViewParams view; };
layout(set = 0, binding = 1) restrict readonly buffer TileOrder { uint tile_order[]; };
layout(set = 0, binding = 2) restrict readonly buffer TileFirst { uint tile_first[]; };
layout(set = 0, binding = 3) restrict readonly buffer TileLast { uint tile_last[]; };
layout(set = 0, binding = 4) restrict readonly buffer SplatIds { uint splat_ids[]; };
layout(set = 0, binding = 5) restrict readonly buffer Splats { vec4 splats[]; };
layout(set = 0, binding = 6) restrict buffer Image0 { vec4 image0[]; };
// Bound to image0 where not FULL, and not touched.
layout(set = 0, binding = 7) restrict buffer Image1 { vec4 image1[]; };
#if defined(TRAIN) || defined(CHUNKED)
layout(set = 0, binding = 8) restrict buffer Tail { uvec2 tail[]; };
#endif
#ifdef CHUNKED
// Not TRAIN: tail and chunk_last are bound to others, and not touched; so is chunk1 where not FULL.
layout(set = 0, binding = 9) restrict readonly buffer ChunkArgs { uint chunk_args[]; };
layout(set = 0, binding = 10) restrict readonly buffer ChunkItems { uvec2 chunk_items[]; };
layout(set = 0, binding = 11) restrict readonly buffer ChunkLight { float chunk_light[]; };
layout(set = 0, binding = 12) restrict writeonly buffer Chunk0 { vec4 chunk0[]; };
layout(set = 0, binding = 13) restrict writeonly buffer Chunk1 { vec4 chunk1[]; };
layout(set = 0, binding = 14) restrict writeonly buffer ChunkLast { uint chunk_last[]; };
#endif

void main() {
    const uint lane = gl_SubgroupInvocationID;
    const uint n_lanes = gl_SubgroupSize;
    const BlockShape shape = block_shape();
#ifdef CHUNKED
    const uint n_chunks = chunk_args[4u * CHUNK_ITEMS + 3u];
    const uint work = linear_group();
    const bool is_chunk = work < n_chunks;
    const uint place = min(is_chunk ? 0u : work - n_chunks, pc.n_tiles - 1u);
    const uvec2 item = is_chunk ? chunk_items[work] : uvec2(tile_order[place], 0u);
    const uint tile = item.x;
    const uint last = tile_last[tile];
    uint e = tile_first[tile] + item.y * CHUNK;
    const uint end = min(e + CHUNK, last);
    // Work beyond the last tile, or a tile that has chunks.
    if (!is_chunk && (work - n_chunks > place || end < last)) return;
    const uvec2 first = block_first(view, shape, tile, gl_SubgroupID);
#else
    const uint slot = linear_group() * (64u / n_lanes) + gl_SubgroupID;
    if (slot >= pc.n_blocks) return;
    // CPU drivers give each thread one contiguous run of groups: the stride deals the heavy tiles out.
    const uint place = (slot * pc.stride) % pc.n_blocks;
    const uint tile = tile_order[place / shape.per_tile];
    const uvec2 first = block_first(view, shape, tile, place % shape.per_tile);
#endif
    const uint x = first.x + lane % shape.columns;
    const uint y = first.y + lane / shape.columns;
    const vec2 corner = vec2(float(first.x), float(view.first_row + first.y)) + 0.5;
    const float center_x = float(x) + 0.5;
    const float center_y = float(view.first_row + y) + 0.5;

    // Read once: the compiler may not keep a uniform over a store, nor know that the images do not overlap it.
    const float alpha_max = view.alpha_max;
    const float t_min = view.t_min;
    const float t_cut = view.t_cut;

#ifndef CHUNKED
    const uint round = unfolded(pc.round);
    const bool is_last_round = unfolded(pc.last_round) != 0u;
#endif
    // A pixel's threshold is alpha_min while it is alive and out of reach once it is finished.
    float threshold[PIXELS];
    float T[PIXELS];
    vec3 color[PIXELS];
#ifdef FULL
    vec4 extra[PIXELS];
#endif
#ifdef TRAIN
    uint n_last[PIXELS];
#endif
    for (uint k = 0u; k < PIXELS; ++k) {
        const uint row = y + k * shape.lane_rows;
        const bool inside = x < view.width && row < view.n_rows;
        const uint pixel = row * view.width + x;
        threshold[k] = inside ? view.alpha_min : NEVER;
        T[k] = 1.0;
        color[k] = vec3(0.0);
#ifdef FULL
        extra[k] = vec4(0.0);
#endif
#ifdef TRAIN
        n_last[k] = 0u;
#endif
#ifndef CHUNKED
        if (inside && round > 0u) {
            const vec4 saved = image0[pixel];
            color[k] = saved.xyz;
            T[k] = abs(saved.w);
            if (saved.w < 0.0) threshold[k] = NEVER;
#ifdef FULL
            extra[k] = image1[pixel];
#endif
#ifdef TRAIN
            n_last[k] = tail[pixel].y;
#endif
        }
#endif
    }

#ifdef CHUNKED
    for (uint j = work - item.y; j < work; ++j) {
        for (uint k = 0u; k < PIXELS; ++k) T[k] *= chunk_light[j * TILE * TILE + pixel_of_tile(shape, lane, k)];
    }
    bool any_alive = false;
    for (uint k = 0u; k < PIXELS; ++k) {
        if (T[k] < t_min || T[k] < t_cut) threshold[k] = NEVER;
        any_alive = any_alive || threshold[k] < NEVER;
    }
    bool alive = e < end && subgroupAny(any_alive);
#else
    const uint last = tile_last[tile];
    uint e = min(tile_first[tile] + round * SEGMENT, last);
    const uint end = min(e + SEGMENT, last);
    bool alive = e < end;
    bool any_alive;
#endif
    while (alive) {
        const bool valid = e + lane < end;
        const uint id = valid ? splat_ids[e + lane] : 0u;
        const vec4 s0 = splats[SPLAT_PLANES * id];
        const vec4 s1 = splats[SPLAT_PLANES * id + 1u];
        const vec4 s2 = splats[SPLAT_PLANES * id + 2u];
        const vec4 s3 = splats[SPLAT_PLANES * id + 3u];
        const bool hit = valid && touches_block(view, s0.xy, s3.yzw, corner, shape);
        const float inverse_z = 1.0 / s1.w;
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
                const vec3 rgb = vec3(subgroupShuffle(s2.x, i), subgroupShuffle(s2.y, i), subgroupShuffle(s2.z, i));
#ifdef FULL
                const vec4 other = vec4(subgroupShuffle(s1.w, i), subgroupShuffle(inverse_z, i),
                    subgroupShuffle(s2.w, i), subgroupShuffle(s3.x, i));
#endif
                const float dx = center_x - xy.x;
                for (uint k = 0u; k < PIXELS; ++k) {
                    const float dy = center_y + float(k * shape.lane_rows) - xy.y;
                    const float raw = splat_alpha(m, opacity, vec2(dx, dy));
                    const float alpha = min(raw, alpha_max);
                    precise float T_next = T[k] * (1.0 - alpha);
                    const bool contributes = raw >= threshold[k];
                    const bool added = contributes && T_next >= t_min;
                    const float w = added ? alpha * T[k] : 0.0;
                    color[k] += w * rgb;
#ifdef FULL
                    extra[k] += w * other;
#endif
#ifdef TRAIN
                    n_last[k] = added ? e + i + 1u : n_last[k];
#endif
                    T[k] = added ? T_next : T[k];
                    threshold[k] = (contributes && !added) || T[k] < t_cut ? NEVER : threshold[k];
                }
            } while (word != 0u);
        }
        any_alive = false;
        for (uint k = 0u; k < PIXELS; ++k) any_alive = any_alive || threshold[k] < NEVER;
        e += n_lanes;
        alive = e < end && subgroupAny(any_alive);
    }

    for (uint k = 0u; k < PIXELS; ++k) {
        const uint row = y + k * shape.lane_rows;
        if (x < view.width && row < view.n_rows) {
            const uint pixel = row * view.width + x;
#ifdef CHUNKED
            if (is_chunk) {
                const uint at = work * TILE * TILE + pixel_of_tile(shape, lane, k);
                chunk0[at] = vec4(color[k], threshold[k] < NEVER ? T[k] : -T[k]);
#ifdef FULL
                chunk1[at] = extra[k];
#endif
#ifdef TRAIN
                chunk_last[at] = n_last[k];
#endif
                continue;
            }
            image0[pixel] = vec4(color[k] + T[k] * view.background.xyz, 1.0 - T[k]);
#else
            image0[pixel] = is_last_round
                ? vec4(color[k] + T[k] * view.background.xyz, 1.0 - T[k])
                : vec4(color[k], threshold[k] < NEVER ? T[k] : -T[k]);
#endif
#ifdef FULL
            image1[pixel] = extra[k];
#endif
#ifdef TRAIN
            tail[pixel] = uvec2(floatBitsToUint(T[k]), n_last[k]);
#endif
        }
    }
}
