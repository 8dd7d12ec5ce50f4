// SPDX-License-Identifier: MIT OR Apache-2.0
// Purpose   forms the gradient of the camera's grid: the parts' sums around each cell, and the total variation's share.
// Equation  TV = sum over the three axes of the mean squared difference of neighbours (Wang et al. 2024).
// Grid      one thread per row of a cell's map.
// Writes    d_grid; sums: TV per workgroup.
// Numerics  panel by panel and part by part in a fixed order: the same bits in every run.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_KHR_shader_subgroup_ballot : require
#include "unfolded.glsl"
#include "grid.glsl"
#include "bilateral.glsl"

layout(local_size_x = 64) in;

// parts: down a panel.
layout(push_constant) uniform Push { uint parts; float tv_weight; } pc;
layout(set = 0, binding = 0) restrict readonly buffer Partials { vec4 partials[]; };
layout(set = 0, binding = 1) restrict readonly buffer CameraGrid { vec4 camera_grid[]; };
layout(set = 0, binding = 2) restrict writeonly buffer DGrid { vec4 d_grid[]; };
layout(set = 0, binding = 3) restrict writeonly buffer Sums { vec4 sums[]; };

// Numbers that have a neighbour after them, along x and y, and along z.
const float PAIRS_XY = float(12u * LEVELS * CELLS * (CELLS - 1u));
const float PAIRS_Z = float(12u * (LEVELS - 1u) * CELLS * CELLS);

shared float sh_sums[64];

// Adds the derivative of the pairs along one axis: x is `at` of n, its neighbours `stride` away.
void add_axis(uint i, vec4 x, uint at, uint n, uint stride, float pairs, inout vec4 d_tv, inout float tv) {
    const vec4 before = at > 0u ? x - camera_grid[i - (at > 0u ? stride : 0u)] : vec4(0.0);
    const vec4 after = at + 1u < n ? x - camera_grid[i + (at + 1u < n ? stride : 0u)] : vec4(0.0);
    d_tv += 2.0 / pairs * (before + after);
    tv += dot(after, after) / pairs;
}

void main() {
    const uint index = linear_thread(gl_WorkGroupSize.x);
    const bool valid = index < GRID_ROWS;
    const uint i = valid ? index : 0u;
    const uint cell = i / 3u;
    const uvec2 xy = uvec2(cell % CELLS, cell / CELLS % CELLS);
    const uint z = cell / (CELLS * CELLS);
    const uint parts = unfolded(pc.parts);
    vec4 sum = vec4(0.0);
    for (uint corner = 0u; corner < 4u; ++corner) {
        // Wraps where there is no panel on that side.
        const uvec2 panel = xy - uvec2(corner & 1u, corner / 2u);
        if (panel.x < PANELS && panel.y < PANELS) {
            for (uint k = 0u; k < parts; ++k) {
                const uint part = (panel.y * parts + k) * PANELS + panel.x;
                sum += partials[PART_SUMS * part + 3u * (corner * LEVELS + z) + i % 3u];
            }
        }
    }
    const vec4 x = camera_grid[i];
    vec4 d_tv = vec4(0.0);
    float tv = 0.0;
    add_axis(i, x, xy.x, CELLS, 3u, PAIRS_XY, d_tv, tv);
    add_axis(i, x, xy.y, CELLS, 3u * CELLS, PAIRS_XY, d_tv, tv);
    add_axis(i, x, z, LEVELS, 3u * CELLS * CELLS, PAIRS_Z, d_tv, tv);
    if (valid) d_grid[i] = sum + pc.tv_weight * d_tv;
    sh_sums[gl_LocalInvocationIndex] = valid ? tv : 0.0;
    barrier();
    if (gl_LocalInvocationIndex == 0u && linear_group() < div_ceil(GRID_ROWS, 64u)) {
        float all = 0.0;
        for (uint k = 0u; k < 64u; ++k) all += sh_sums[k];
        sums[linear_group()] = vec4(all, 0.0, 0.0, 0.0);
    }
}
