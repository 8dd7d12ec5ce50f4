// SPDX-License-Identifier: MIT OR Apache-2.0
// Purpose   lists the chunks of the lists that are longer than one, and makes grids over them.
// Equation  a list of n entries has ceil(n / CHUNK) chunks, which are neighbours.
// Grid      one thread per tile.
// Writes    of each chunk, tile and number; of each long list, tile and first chunk; indirect arguments.
// Numerics  integers only. `chunk_args` is zero at the start. Where a list's chunks stand is free, and no picture depends on it.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "grid.glsl"
#include "chunk.glsl"

layout(local_size_x = 64) in;

layout(push_constant) uniform Push { uint n_tiles; } pc;
layout(set = 0, binding = 0) restrict readonly buffer TileFirst { uint tile_first[]; };
layout(set = 0, binding = 1) restrict readonly buffer TileLast { uint tile_last[]; };
layout(set = 0, binding = 2) restrict buffer ChunkArgs { uint chunk_args[]; };
layout(set = 0, binding = 3) restrict writeonly buffer ChunkItems { uvec2 chunk_items[]; };
layout(set = 0, binding = 4) restrict writeonly buffer LongLists { uvec2 long_lists[]; };

// Makes grid `at` at least `n` workgroups large.
void grow(uint at, uint n) { atomicMax(chunk_args[4u * at + 1u], div_ceil(n, CHUNK_ROW)); }

void main() {
    const uint tile = linear_thread(gl_WorkGroupSize.x);
    if (tile >= pc.n_tiles) return;
    if (tile == 0u) {
        for (uint at = 0u; at < 3u; ++at) {
            chunk_args[4u * at] = CHUNK_ROW;
            chunk_args[4u * at + 2u] = 1u;
        }
        grow(CHUNK_ALL, pc.n_tiles);
    }
    const uint length = tile_last[tile] - tile_first[tile];
    if (length <= CHUNK) return;
    const uint n = div_ceil(length, CHUNK);
    const uint item = atomicAdd(chunk_args[4u * CHUNK_ITEMS + 3u], n);
    const uint at = atomicAdd(chunk_args[4u * CHUNK_LONG + 3u], 1u);
    grow(CHUNK_ALL, pc.n_tiles + item + n);
    grow(CHUNK_ITEMS, item + n);
    grow(CHUNK_LONG, MERGE_GROUPS * (at + 1u));
    long_lists[at] = uvec2(tile, item);
    for (uint k = 0u; k < n; ++k) chunk_items[item + k] = uvec2(tile, k);
}
