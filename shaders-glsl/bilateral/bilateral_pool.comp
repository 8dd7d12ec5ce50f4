// SPDX-License-Identifier: MIT OR Apache-2.0
// Purpose   gives every cell of the camera's grid the gradient that one map for the whole image has.
// Equation  d_k <- sum_j d_j over all cells j: cells that begin alike and step alike stay one affine map.
// Grid      one workgroup per row of a map.
// Numerics  cells are summed in a fixed order: the same bits in every run. A sum that is not finite stays so, and Adam
//           takes no step along it.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "grid.glsl"
#include "bilateral.glsl"

layout(local_size_x = 128) in;

layout(set = 0, binding = 0) restrict buffer DGrid { vec4 d_grid[]; };

const uint N_CELLS = CELLS * CELLS * LEVELS;

shared vec4 sh_sums[128];

void main() {
    const uint row = linear_group();
    const uint lane = gl_LocalInvocationIndex;
    const bool valid = row < 3u;
    vec4 sum = vec4(0.0);
    for (uint cell = lane; cell < N_CELLS; cell += 128u) sum += valid ? d_grid[3u * cell + min(row, 2u)] : vec4(0.0);
    sh_sums[lane] = sum;
    barrier();
    for (uint half_way = 64u; half_way > 0u; half_way /= 2u) {
        if (lane < half_way) sh_sums[lane] += sh_sums[lane + half_way];
        barrier();
    }
    sum = sh_sums[0];
    for (uint cell = lane; cell < N_CELLS; cell += 128u) if (valid) d_grid[3u * cell + row] = sum;
}
