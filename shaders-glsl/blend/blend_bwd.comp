// SPDX-License-Identifier: MIT OR Apache-2.0
// Purpose   carries the cotangents of a picture back to the splats, in one of three modes of accumulation.
// Equation  with q = g . c over all channels: dL/dalpha = T q - (S + g_T T_N) / (1 - alpha), S <- S + w q, back to front.
// Grid      slots (no ACCUMULATE): one subgroup per tile, for one of the tile's blocks; the blocks come one dispatch after
//           another, so that each slot has one writer at a time: plain sums in a fixed order, the same bits in every run.
//           CHUNKED: one workgroup per chunk of a long list, then one per tile; of its subgroups that of the block.
//           Otherwise one subgroup per block of a tile, or of a chunk, all at once: 1 fixed point in 64 bits of two words (the
//           same bits in any order), 2 fixed point in one word of 64 bits (the same bits as 1).
// Reads     the forward pass's lists, final T and last entry; cotangents: d_image0 (colour, alpha), d_image1 (depth,
//           inverse depth, flow; FULL only). WALKED entries a round, the last entries first; T and S stay in `carry`.
//           CHUNKED: a chunk starts from the T that it left, and from S by the colours behind it, as blend_merge has them.
// Writes    slots, 6 vec2 each, added to what earlier blocks left:
//           (h u u, h u w) (h w w, h u) (h w, opacity) (r, g) (b, z) (flow), h = dL/dpower, (u, w) = M d;
//           with ACCUMULATE the same twelve per active Gaussian (fixed point: FIXED_WORDS, see fixed.glsl).
// Numerics  one scalar S instead of a colour per pixel. 1 / (1 - alpha) <= 100 for alpha_max = 0.99. Moments in whitened
//           coordinates stay accurate for needles. A clamped alpha has no derivative.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_KHR_shader_subgroup_arithmetic : require
#extension GL_KHR_shader_subgroup_ballot : require
#extension GL_KHR_shader_subgroup_shuffle : require
#include "types.glsl"
#include "unfolded.glsl"
#include "grid.glsl"
#include "splat.glsl"
#include "block.glsl"
#if ACCUMULATE > 0
#include "finite.glsl"
#include "fixed.glsl"
#endif
#if ACCUMULATE == 2
#extension GL_EXT_shader_explicit_arithmetic_types_int64 : require
#extension GL_EXT_shader_atomic_int64 : require
#endif

layout(local_size_x = 64) in;

// Of sums that are no slots each number of a lane is an iteration. Of 4 lanes that makes 6 for an entry; drivers on a CPU allow
// 65,535.
const uint SUM_SEGMENT = 8192u;
#if ACCUMULATE > 0
#define WALKED SUM_SEGMENT
#else
#define WALKED SEGMENT
#endif
const float LN_2 = 0.6931471805599453;

#ifdef CHUNKED
// block: that of the slots' dispatch. scale: of the fixed point. large: from here on its terms are, see fixed.glsl.
layout(push_constant) uniform Push { uint n_tiles; uint block; float scale; float large; } pc;
#else
// n_work: tiles, or blocks of all tiles with ACCUMULATE. scale: of the fixed point. large: from here on its terms are.
layout(push_constant) uniform Push {
    uint n_work; uint stride; uint block; uint segment; uint first_round; float scale; float large;
} pc;
#endif
layout(set = 0, binding = 0) uniform View { ViewParams view; };
layout(set = 0, binding = 1) restrict readonly buffer TileOrder { uint tile_order[]; };
layout(set = 0, binding = 2) restrict readonly buffer TileFirst { uint tile_first[]; };
layout(set = 0, binding = 3) restrict readonly buffer SplatIds { uint splat_ids[]; };
layout(set = 0, binding = 4) restrict readonly buffer Slots { uint slots[]; };
layout(set = 0, binding = 5) restrict readonly buffer Splats { vec4 splats[]; };
layout(set = 0, binding = 6) restrict readonly buffer Tail { uvec2 tail[]; };
layout(set = 0, binding = 7) restrict readonly buffer DImage0 { vec4 d_image0[]; };
#ifdef CHUNKED
layout(set = 0, binding = 8) restrict readonly buffer TileLast { uint tile_last[]; };
#else
layout(set = 0, binding = 8) restrict buffer Carry { vec2 carry[]; };
#endif
#if ACCUMULATE == 2
layout(set = 0, binding = 9) restrict buffer DSlots { uint64_t d_slots[]; };
#elif ACCUMULATE == 1
layout(set = 0, binding = 9) restrict buffer DSlots { uint d_slots[]; };
#else
layout(set = 0, binding = 9) restrict buffer DSlots { vec2 d_slots[]; };
#endif
// Bound to d_image0 where not FULL, and not read.
layout(set = 0, binding = 10) restrict readonly buffer DImage1 { vec4 d_image1[]; };
#ifdef CHUNKED
layout(set = 0, binding = 11) restrict readonly buffer ChunkArgs { uint chunk_args[]; };
layout(set = 0, binding = 12) restrict readonly buffer ChunkItems { uvec2 chunk_items[]; };
layout(set = 0, binding = 13) restrict readonly buffer Chunk0 { vec4 chunk0[]; };
// Bound to chunk0 where not FULL, and not read.
layout(set = 0, binding = 14) restrict readonly buffer Chunk1 { vec4 chunk1[]; };
#endif

// Adds x to sum c of active Gaussian `id`.
#if ACCUMULATE == 1
// The carries of the low word add up to the same number in any order.
void add_word(uint at, uvec2 word) {
    const uint old = atomicAdd(d_slots[at], word.x);
    atomicAdd(d_slots[at + 1u], word.y + uint(old + word.x < old));
}
void accumulate(uint id, uint c, float x) {
    float term = x * pc.scale;
    const uint first = FIXED_WORDS * id;
    if (fixed_is_large(term, pc.large)) {
        add_word(first + FIXED_WEIGHT, uvec2(fixed_weight(term), 0u));
        term = fixed_fits(term) ? term : 0.0;
    }
    add_word(first + 2u * c, fixed_word(term));
}
#elif ACCUMULATE == 2
void accumulate(uint id, uint c, float x) {
    float term = x * pc.scale;
    const uint first = FIXED_WORDS / 2u * id;
    if (fixed_is_large(term, pc.large)) {
        atomicAdd(d_slots[first + FIXED_WEIGHT / 2u], packUint2x32(uvec2(fixed_weight(term), 0u)));
        term = fixed_fits(term) ? term : 0.0;
    }
    atomicAdd(d_slots[first + c], packUint2x32(fixed_word(term)));
}
#endif

// One step of the transposing reduction: halves the values of each lane, doubles the lanes that each is summed over.
#define HALVE(n, m)                                                        \
    for (uint c = 0u; c < n; ++c) {                                        \
        const bool upper = (lane & m) != 0u;                               \
        const float keep = upper ? v[c + n] : v[c];                        \
        const float send = upper ? v[c] : v[c + n];                        \
        v[c] = keep + subgroupShuffleXor(send, m);                         \
    }

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
    const uint begin = tile_first[tile] + item.y * CHUNK;
#if ACCUMULATE > 0
    const bool is_other = false;
#else
    const bool is_other = gl_SubgroupID != pc.block;
#endif
    // Work beyond the last tile, or a tile that has chunks, or another dispatch's block.
    if (is_other || (!is_chunk && (work - n_chunks > place || begin + CHUNK < tile_last[tile]))) return;
    const uvec2 first = block_first(view, shape, tile, gl_SubgroupID);
#else
    const uint slot = linear_group() * (64u / n_lanes) + gl_SubgroupID;
    if (slot >= pc.n_work) return;
    const uint dealt = (slot * pc.stride) % pc.n_work;
#if ACCUMULATE > 0
    const uint tile = tile_order[dealt / shape.per_tile];
    const uvec2 first = block_first(view, shape, tile, dealt % shape.per_tile);
#else
    const uint tile = tile_order[dealt];
    const uvec2 first = block_first(view, shape, tile, pc.block);
#endif
#endif
    const uint x = first.x + lane % shape.columns;
    const uint y = first.y + lane / shape.columns;
    const vec2 corner = vec2(float(first.x), float(view.first_row + first.y)) + 0.5;
    const float center_x = float(x) + 0.5;
    const float center_y = float(view.first_row + y) + 0.5;

#ifndef CHUNKED
    const uint segment = unfolded(pc.segment);
    const bool is_first_round = unfolded(pc.first_round) != 0u;
#endif
    // Of each pixel: transmittance behind the entry at hand, sum over later entries, entries added, cotangents.
    float T[PIXELS];
    float S[PIXELS];
    float behind[PIXELS];
    uint n_last[PIXELS];
    vec3 g[PIXELS];
#ifdef FULL
    vec4 g_extra[PIXELS];
#endif
    uint last = 0u;
    for (uint k = 0u; k < PIXELS; ++k) {
        const uint row = y + k * shape.lane_rows;
        const bool inside = x < view.width && row < view.n_rows;
        const uint pixel = inside ? row * view.width + x : 0u;
        const uvec2 t = tail[pixel];
        const vec4 d0 = d_image0[pixel];
        const float T_N = uintBitsToFloat(t.x);
        n_last[k] = inside ? t.y : 0u;
        g[k] = d0.xyz;
        behind[k] = (dot(d0.xyz, view.background.xyz) - d0.w) * T_N;
        T[k] = T_N;
        S[k] = 0.0;
#ifdef FULL
        g_extra[k] = d_image1[pixel];
#endif
#ifdef CHUNKED
        if (is_chunk) {
            const uint at = work * TILE * TILE + pixel_of_tile(shape, lane, k);
            const vec4 saved = chunk0[at];
            T[k] = abs(saved.w);
            S[k] = dot(g[k], saved.xyz);
#ifdef FULL
            const vec4 other = chunk1[at];
            S[k] += dot(g_extra[k], vec4(view.depth_to_alpha * other.xy, other.zw));
#endif
        }
#else
        if (!is_first_round) {
            const vec2 saved = carry[pixel];
            T[k] = saved.x;
            S[k] = saved.y;
        }
#endif
        last = max(last, n_last[k]);
    }
#ifdef CHUNKED
    uint end = min(subgroupMax(last), begin + CHUNK);
#else
    const uint begin = tile_first[tile] + segment * WALKED;
    uint end = min(subgroupMax(last), begin + WALKED);
#endif
    bool more = begin < end;
    while (more) {
        // Lane i looks at the i-th entry from the end.
        const bool valid = begin + lane < end;
        const uint e = end - 1u - (valid ? lane : 0u);
        const uint id = splat_ids[e];
#if ACCUMULATE > 0
        const uint slot_e = id;
#else
        const uint slot_e = slots[e];
#endif
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
                const float inv = subgroupShuffle(inverse_z, i);
                const vec4 other = vec4(view.depth_to_alpha * vec2(subgroupShuffle(s1.w, i), inv),
                    subgroupShuffle(s2.w, i), subgroupShuffle(s3.x, i));
#endif
                const uint out_slot = subgroupShuffle(slot_e, i);
                const uint number = end - i;
                const float dx = center_x - xy.x;
                float v[16];
                for (uint c = 0u; c < 16u; ++c) v[c] = 0.0;
                for (uint k = 0u; k < PIXELS; ++k) {
                    const vec2 d = vec2(dx, center_y + float(k * shape.lane_rows) - xy.y);
                    const float raw = splat_alpha(m, opacity, d);
                    const bool added = raw >= view.alpha_min && number <= n_last[k];
                    const float alpha = min(raw, view.alpha_max);
                    const float ra = 1.0 / (1.0 - alpha);
                    const float T_i = T[k] * ra;
                    float q = dot(g[k], rgb);
#ifdef FULL
                    q += dot(g_extra[k], other);
#endif
                    const float w = added ? alpha * T_i : 0.0;
                    const float d_alpha = added && raw < view.alpha_max ? T_i * q - ra * (S[k] + behind[k]) : 0.0;
                    S[k] += w * q;
                    T[k] = added ? T_i : T[k];
                    const float u = m.x * d.x + m.y * d.y;
                    const float t = m.z * d.x + m.w * d.y;
                    const float d_log = d_alpha * raw;
                    const float h = -LN_2 * d_log;
                    v[0] += h * u * u;
                    v[1] += h * u * t;
                    v[2] += h * t * t;
                    v[3] += h * u;
                    v[4] += h * t;
                    v[5] += d_log;
                    v[6] += w * g[k].x;
                    v[7] += w * g[k].y;
                    v[8] += w * g[k].z;
#ifdef FULL
                    v[9] += w * (g_extra[k].x - g_extra[k].y * inv * inv);
                    v[10] += w * g_extra[k].z;
                    v[11] += w * g_extra[k].w;
#endif
                }
                // The opacity's gradient is d_alpha exp2(-power), summed as d_alpha alpha. A square may list an opacity of 0.
                v[5] /= max(opacity, 1e-37);
                HALVE(8u, 1u)
                HALVE(4u, 2u)
                // Bit 0 of the lane chose the upper eight values, bit 1 the upper four of those, and so on.
                uint c = (lane & 1u) * 8u + (lane >> 1u & 1u) * 4u;
                if (n_lanes >= 8u) {
                    HALVE(2u, 4u)
                    c += (lane >> 2u & 1u) * 2u;
                }
                if (n_lanes >= 16u) {
                    HALVE(1u, 8u)
                    c += lane >> 3u & 1u;
                }
                if (n_lanes >= 32u) v[0] += subgroupShuffleXor(v[0], 16u);
                if (n_lanes >= 64u) v[0] += subgroupShuffleXor(v[0], 32u);
#if ACCUMULATE > 0
                if (lane < 16u) {
                    for (uint k = 0u; k < max(16u / n_lanes, 1u); ++k) {
                        // Chosen and not indexed: lavapipe does not unroll this, and keeps what is indexed in memory.
                        const float sum = k == 0u ? v[0] : k == 1u ? v[1] : k == 2u ? v[2] : v[3];
                        if (c + k < 12u && sum != 0.0) accumulate(out_slot, c + k, sum);
                    }
                }
#else
                if (c < 12u && lane < 16u) {
                    const uint at = 6u * out_slot + c / 2u;
                    if (n_lanes >= 16u) {
                        d_slots[at][c & 1u] += v[0];
                    } else {
                        d_slots[at] += vec2(v[0], v[1]);
                        if (n_lanes == 4u) d_slots[at + 1u] += vec2(v[2], v[3]);
                    }
                }
#endif
            } while (word != 0u);
        }
        end -= min(n_lanes, end - begin);
        more = begin < end;
    }
#ifndef CHUNKED
    for (uint k = 0u; k < PIXELS; ++k) {
        const uint row = y + k * shape.lane_rows;
        if (segment > 0u && x < view.width && row < view.n_rows) carry[row * view.width + x] = vec2(T[k], S[k]);
    }
#endif
}
