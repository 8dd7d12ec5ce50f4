// SPDX-License-Identifier: MIT OR Apache-2.0
// Purpose   lists the tiles, heavy ones first, so that no device ends on its longest list.
// Equation  counting sort by bucket; the order inside a bucket is free, and no picture depends on it.
// Grid      one thread per tile.
// Numerics  integers only. `cursors` is zero at the start.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "grid.glsl"

layout(local_size_x = 64) in;

layout(push_constant) uniform Push { uint n_tiles; } pc;
layout(set = 0, binding = 0) restrict readonly buffer TileFirst { uint tile_first[]; };
layout(set = 0, binding = 1) restrict readonly buffer TileLast { uint tile_last[]; };
layout(set = 0, binding = 2) restrict readonly buffer Buckets { uint buckets[]; };
layout(set = 0, binding = 3) restrict buffer Cursors { uint cursors[]; };
layout(set = 0, binding = 4) restrict writeonly buffer TileOrder { uint tile_order[]; };

void main() {
    const uint tile = linear_thread(gl_WorkGroupSize.x);
    if (tile >= pc.n_tiles) return;
    const uint bucket = 31u - uint(findMSB((tile_last[tile] - tile_first[tile]) | 1u));
    uint at = atomicAdd(cursors[bucket], 1u);
    for (uint b = 0u; b < bucket; ++b) at += buckets[b];
    tile_order[at] = tile;
}
