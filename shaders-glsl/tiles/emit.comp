// SPDX-License-Identifier: MIT OR Apache-2.0
// Purpose   writes one (tile, Gaussian) pair per tile that a Gaussian touches, in depth order.
// Equation  the count's own predicate on an ellipse with half of its margin, include/splat.glsl.
// Grid      one thread per active Gaussian. A subgroup hands its Gaussians' rows of tiles around, a row to a lane, and then the
//           pairs of these rows, a pair to a lane: so no lane waits for one with more, and neighbours are stored by neighbours.
//           SLOTS: also tells where each Gaussian's pairs begin, for the backward pass.
// Numerics  no more pairs than were counted, whatever either kernel's roundings; a slot that the count foresaw and the rows did
//           not fill gets the tile past the last, which nothing reads.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_KHR_shader_subgroup_ballot : require
#extension GL_KHR_shader_subgroup_arithmetic : require
#extension GL_KHR_shader_subgroup_shuffle : require
#include "types.glsl"
#include "unfolded.glsl"
#include "grid.glsl"
#include "splat.glsl"

layout(local_size_x = 64) in;

layout(set = 0, binding = 0) uniform View { ViewParams view; };
layout(set = 0, binding = 1) restrict readonly buffer NActive { uint n_active[]; };
layout(set = 0, binding = 2) restrict readonly buffer Order { uint order[]; };
layout(set = 0, binding = 3) restrict readonly buffer TileCounts { uint tile_counts[]; };
layout(set = 0, binding = 4) restrict readonly buffer Offsets { uint offsets[]; };
layout(set = 0, binding = 5) restrict readonly buffer Splats { vec4 splats[]; };
layout(set = 0, binding = 6) restrict writeonly buffer TileKeys { uint tile_keys[]; };
layout(set = 0, binding = 7) restrict writeonly buffer SplatIds { uint splat_ids[]; };
#ifdef SLOTS
layout(set = 0, binding = 8) restrict writeonly buffer SlotFirst { uint slot_first[]; };
#endif

void write_pair(uint at, uint tile, uint id) {
    tile_keys[at] = tile;
    splat_ids[at] = id;
}

// The lane `step` further on where that has at most `item` earlier items, else `lane`.
uint halved(uint earlier, uint item, uint lane, uint step) {
    return lane + (subgroupShuffle(earlier, lane + step) <= item ? step : 0u);
}

// The last lane whose number of earlier items is at most `item`: it has that item. The first lane has none before it. No loop: the pairs
// of Gaussians that fill a picture of 4K take half of the turns that lavapipe grants, and each would take those of a loop here too.
uint holder(uint earlier, uint item) {
    uint lane = halved(earlier, item, 0u, gl_SubgroupSize >> 1u);
    lane = halved(earlier, item, lane, gl_SubgroupSize >> 2u);
    lane = halved(earlier, item, lane, gl_SubgroupSize >> 3u);
    lane = halved(earlier, item, lane, gl_SubgroupSize >> 4u);
    lane = halved(earlier, item, lane, gl_SubgroupSize >> 5u);
    return halved(earlier, item, lane, gl_SubgroupSize >> 6u);
}

void main() {
    const uint i = linear_thread(gl_WorkGroupSize.x);
    const bool valid = i < n_active[0];
    const uint id = valid ? order[i] : 0u;
    const uint n = valid ? tile_counts[id] : 0u;
    const uint first = valid ? offsets[i] : 0u;
    const vec2 xy = splats[SPLAT_PLANES * id].xy;
    const float opacity = inner_opacity(splats[SPLAT_PLANES * id + 1u].z);
    const vec3 ellipse = inner_ellipse(splats[SPLAT_PLANES * id + 3u].yzw);
    const uint none = view.tiles_x * view.tiles_y;
    const uint lane = gl_SubgroupInvocationID;
#ifdef SLOTS
    if (valid) slot_first[id] = first;
#endif

    const uvec2 rows = n > 0u ? listed_rows(view, xy, opacity, ellipse) : uvec2(0u);
    const uint n_rows = rows.y - min(rows.x, rows.y);
    const uint rows_before = subgroupExclusiveAdd(n_rows);
    const uint all_rows = subgroupAdd(n_rows);
    if (n_rows == 0u) {
        for (uint k = 0u; k < n; ++k) write_pair(first + k, none, id);
    }
    // Pairs of the Gaussian whose rows the last lap may have left half done.
    uint begun = 0u;
    uint begun_by = gl_SubgroupSize;
    for (uint row0 = 0u; row0 < all_rows; row0 += gl_SubgroupSize) {
        const uint item = row0 + lane;
        const uint owner = holder(rows_before, item);
        const vec2 xy_o = vec2(subgroupShuffle(xy.x, owner), subgroupShuffle(xy.y, owner));
        const float opacity_o = subgroupShuffle(opacity, owner);
        const vec3 ellipse_o = vec3(
            subgroupShuffle(ellipse.x, owner), subgroupShuffle(ellipse.y, owner), subgroupShuffle(ellipse.z, owner));
        const uint id_o = subgroupShuffle(id, owner);
        const uint first_o = subgroupShuffle(first, owner);
        const uint n_o = subgroupShuffle(n, owner);
        const uint rows_before_o = subgroupShuffle(rows_before, owner);
        const uint n_rows_o = subgroupShuffle(n_rows, owner);
        const uint row = subgroupShuffle(rows.x, owner) + item - rows_before_o;
        uvec2 columns = uvec2(0u);
        if (item < all_rows) columns = listed_columns(view, xy_o, opacity_o, ellipse_o, row);
        const uint width = columns.y - min(columns.x, columns.y);
        const uint before = subgroupExclusiveAdd(width);
        const uint n_pairs = subgroupAdd(width);
        // Of its Gaussian's pairs, those in earlier rows of this lap, and of laps before.
        const uint head = max(rows_before_o, row0) - row0;
        const uint done = before - subgroupShuffle(before, head) + (owner == begun_by ? begun : 0u);
        begun = subgroupShuffle(done + width, gl_SubgroupSize - 1u);
        begun_by = subgroupShuffle(owner, gl_SubgroupSize - 1u);
        // By the number of a pair in this lap: its place, its tile, and the end of its Gaussian's.
        const uint place = first_o + done - before;
        const uint tile = row * view.tiles_x + columns.x - before;
        const uint end = first_o + n_o;
        for (uint pair0 = 0u; pair0 < n_pairs; pair0 += gl_SubgroupSize) {
            const uint pair = pair0 + lane;
            const uint from = holder(before, pair);
            const uint at = subgroupShuffle(place, from) + pair;
            const uint tile_of = subgroupShuffle(tile, from) + pair;
            const uint id_of = subgroupShuffle(id_o, from);
            const uint end_of = subgroupShuffle(end, from);
            if (pair < n_pairs && at < end_of) write_pair(at, tile_of, id_of);
        }
        // Behind the last row of a Gaussian.
        if (item < all_rows && item + 1u == rows_before_o + n_rows_o) {
            for (uint k = done + width; k < n_o; ++k) write_pair(first_o + k, none, id_o);
        }
    }
}
