// SPDX-License-Identifier: MIT OR Apache-2.0
// Purpose   merges the chunks of a long list into the picture.
// Equation  a pixel ends with the first chunk that finishes it: colours up to there add up, T is what that chunk leaves.
// Grid      one thread per pixel of a tile with a long list, MERGE_GROUPS workgroups a tile.
// Writes    as blend_fwd. TRAIN: also, in place of each chunk's colour, the sum over the chunks behind it, from which the
//           backward pass starts that chunk.
// Numerics  sums go from the back to the front, so that those behind a chunk cancel nothing.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "types.glsl"
#include "grid.glsl"
#include "chunk.glsl"

layout(local_size_x = 64) in;

layout(set = 0, binding = 0) uniform View { ViewParams view; };
layout(set = 0, binding = 1) restrict readonly buffer ChunkArgs { uint chunk_args[]; };
layout(set = 0, binding = 2) restrict readonly buffer LongLists { uvec2 long_lists[]; };
layout(set = 0, binding = 3) restrict readonly buffer TileFirst { uint tile_first[]; };
layout(set = 0, binding = 4) restrict readonly buffer TileLast { uint tile_last[]; };
layout(set = 0, binding = 5) restrict buffer Chunk0 { vec4 chunk0[]; };
// Not FULL: bound to chunk0, and not touched; image1 to image0. Not TRAIN: tail and chunk_last likewise.
layout(set = 0, binding = 6) restrict buffer Chunk1 { vec4 chunk1[]; };
layout(set = 0, binding = 7) restrict readonly buffer ChunkLast { uint chunk_last[]; };
layout(set = 0, binding = 8) restrict writeonly buffer Image0 { vec4 image0[]; };
layout(set = 0, binding = 9) restrict writeonly buffer Image1 { vec4 image1[]; };
layout(set = 0, binding = 10) restrict writeonly buffer Tail { uvec2 tail[]; };

void main() {
    const uint work = linear_group();
    const uint list = work / MERGE_GROUPS;
    if (list >= chunk_args[4u * CHUNK_LONG + 3u]) return;
    const uint tile = long_lists[list].x;
    const uint pixel = work % MERGE_GROUPS * gl_WorkGroupSize.x + gl_LocalInvocationIndex;
    const uint first = long_lists[list].y * TILE * TILE + pixel;
    const uint n = div_ceil(tile_last[tile] - tile_first[tile], CHUNK);
    const uint x = tile % view.tiles_x * TILE + pixel % TILE;
    const uint y = tile / view.tiles_x * TILE + pixel / TILE;
    if (!(x < view.width && y < view.n_rows)) return;

    uint taken = 0u;
    float T = 1.0;
    uint last = 0u;
    bool alive = true;
    while (alive) {
        const uint at = first + taken * TILE * TILE;
        const float left = chunk0[at].w;
        T = abs(left);
#ifdef TRAIN
        last = max(last, chunk_last[at]);
#endif
        ++taken;
        alive = taken < n && !(left < 0.0);
    }
    vec3 color = vec3(0.0);
    vec4 extra = vec4(0.0);
    for (uint k = taken; k > 0u; --k) {
        const uint at = first + (k - 1u) * TILE * TILE;
        const vec4 own = chunk0[at];
#ifdef TRAIN
        chunk0[at] = vec4(color, own.w);
#endif
        color += own.xyz;
#ifdef FULL
        const vec4 own_extra = chunk1[at];
#ifdef TRAIN
        chunk1[at] = extra;
#endif
        extra += own_extra;
#endif
    }
    const uint place = y * view.width + x;
    image0[place] = vec4(color + T * view.background.xyz, 1.0 - T);
#ifdef FULL
    image1[place] = extra;
#endif
#ifdef TRAIN
    tail[place] = uvec2(floatBitsToUint(T), last);
#endif
}
