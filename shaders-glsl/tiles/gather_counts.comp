// SPDX-License-Identifier: MIT OR Apache-2.0
// Purpose   reads the tile counts in depth order, for the scan that places the intersections.
// Equation  none.
// Grid      one thread per active Gaussian.
// Numerics  integers only.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "grid.glsl"

layout(local_size_x = 64) in;

layout(set = 0, binding = 0) restrict readonly buffer NActive { uint n_active[]; };
layout(set = 0, binding = 1) restrict readonly buffer Order { uint order[]; };
layout(set = 0, binding = 2) restrict readonly buffer TileCounts { uint tile_counts[]; };
layout(set = 0, binding = 3) restrict writeonly buffer Offsets { uint offsets[]; };

void main() {
    const uint i = linear_thread(gl_WorkGroupSize.x);
    if (i < n_active[0]) offsets[i] = tile_counts[order[i]];
}
