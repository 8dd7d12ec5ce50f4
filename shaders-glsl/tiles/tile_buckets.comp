// SPDX-License-Identifier: MIT OR Apache-2.0
// Purpose   counts the tiles by the logarithm of their list's length, and finds the longest list.
// Equation  bucket = 32 - bit width: heavy tiles first.
// Grid      one thread per tile.
// Numerics  integers only.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "types.glsl"
#include "grid.glsl"

layout(local_size_x = 64) in;

layout(push_constant) uniform Push { uint n_tiles; uint longest; } pc;
layout(set = 0, binding = 0) restrict readonly buffer TileFirst { uint tile_first[]; };
layout(set = 0, binding = 1) restrict readonly buffer TileLast { uint tile_last[]; };
layout(set = 0, binding = 2) restrict buffer Buckets { uint buckets[]; };
layout(set = 0, binding = 3) restrict buffer FrameStatus { Status status; };

void main() {
    const uint tile = linear_thread(gl_WorkGroupSize.x);
    if (tile >= pc.n_tiles) return;
    const uint n = tile_last[tile] - tile_first[tile];
    atomicAdd(buckets[31u - uint(findMSB(n | 1u))], 1u);
    if (n > 0u) atomicMax(status.max_tile_list, n);
    // The recorded rounds of the blend would not reach this list's end.
    if (n > pc.longest) atomicOr(status.failed, FAILED_LIST);
}
