// SPDX-License-Identifier: MIT OR Apache-2.0
// Purpose   finds where each tile's list begins and ends among the sorted intersections.
// Equation  none.
// Grid      one thread per intersection.
// Writes    first and last + 1 per tile; tiles without any keep the zeros they were cleared to.
// Numerics  integers only.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "grid.glsl"

layout(local_size_x = 64) in;

layout(push_constant) uniform Push { uint n_tiles; } pc;
layout(set = 0, binding = 0) restrict readonly buffer NIntersections { uint n_intersections[]; };
layout(set = 0, binding = 1) restrict readonly buffer TileKeys { uint tile_keys[]; };
layout(set = 0, binding = 2) restrict writeonly buffer TileFirst { uint tile_first[]; };
layout(set = 0, binding = 3) restrict writeonly buffer TileLast { uint tile_last[]; };

void main() {
    const uint i = linear_thread(gl_WorkGroupSize.x);
    const uint n = n_intersections[0];
    if (i >= n) return;
    const uint tile = tile_keys[i];
    const uint before = i > 0u ? tile_keys[i - 1u] : 0xffffffffu;
    const uint after = i + 1u < n ? tile_keys[i + 1u] : 0xffffffffu;
    if (tile < pc.n_tiles && tile != before) tile_first[tile] = i;
    if (tile < pc.n_tiles && tile != after) tile_last[tile] = i + 1u;
}
