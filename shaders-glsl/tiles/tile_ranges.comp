// SPDX-License-Identifier: MIT OR Apache-2.0
// Purpose   finds where each tile's list begins and ends among the sorted intersections, counts the tiles by the logarithm of
//           their list's length, and finds the longest list.
// Equation  bucket = 32 - bit width: heavy tiles first.
// Grid      one thread per tile, which searches the sorted tiles by halves.
// Writes    first and last + 1 per tile, both 0 for a tile without any.
// Numerics  integers only. `buckets` is zero at the start.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "types.glsl"
#include "grid.glsl"

layout(local_size_x = 64) in;

layout(push_constant) uniform Push { uint n_tiles; uint longest; } pc;
layout(set = 0, binding = 0) restrict readonly buffer NIntersections { uint n_intersections[]; };
layout(set = 0, binding = 1) restrict readonly buffer TileKeys { uint tile_keys[]; };
layout(set = 0, binding = 2) restrict writeonly buffer TileFirst { uint tile_first[]; };
layout(set = 0, binding = 3) restrict writeonly buffer TileLast { uint tile_last[]; };
layout(set = 0, binding = 4) restrict buffer Buckets { uint buckets[]; };
layout(set = 0, binding = 5) restrict buffer FrameStatus { Status status; };

void main() {
    const uint tile = linear_thread(gl_WorkGroupSize.x);
    if (tile >= pc.n_tiles) return;
    const uint n = n_intersections[0];
    // Entries of earlier tiles, and of these and this one: two searches in step.
    uvec2 at = uvec2(0u);
    for (uint step = n > 0u ? 1u << findMSB(n) : 0u; step > 0u; step >>= 1u) {
        const uvec2 next = at + step;
        const uvec2 key = uvec2(tile_keys[min(next.x, n) - 1u], tile_keys[min(next.y, n) - 1u]);
        if (next.x <= n && key.x < tile) at.x = next.x;
        if (next.y <= n && key.y <= tile) at.y = next.y;
    }
    const uint length = at.y - at.x;
    tile_first[tile] = length > 0u ? at.x : 0u;
    tile_last[tile] = length > 0u ? at.y : 0u;
    atomicAdd(buckets[31u - uint(findMSB(length | 1u))], 1u);
    if (length > 0u) atomicMax(status.max_tile_list, length);
    // The recorded rounds of the blend would not reach this list's end.
    if (length > pc.longest) atomicOr(status.failed, FAILED_LIST);
}
