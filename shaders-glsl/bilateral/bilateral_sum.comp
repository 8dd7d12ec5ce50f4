// SPDX-License-Identifier: MIT OR Apache-2.0
// Purpose   adds the parts' sums around each cell: the gradient of the camera's grid.
// Equation  none.
// Grid      one thread per row of a cell's map.
// Numerics  panel by panel and part by part in a fixed order: the same bits in every run.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_KHR_shader_subgroup_ballot : require
#include "unfolded.glsl"
#include "grid.glsl"
#include "bilateral.glsl"

layout(local_size_x = 64) in;

// parts: down a panel.
layout(push_constant) uniform Push { uint parts; } pc;
layout(set = 0, binding = 0) restrict readonly buffer Partials { vec4 partials[]; };
layout(set = 0, binding = 1) restrict writeonly buffer DGrid { vec4 d_grid[]; };

void main() {
    const uint i = linear_thread(gl_WorkGroupSize.x);
    if (i >= GRID_ROWS) return;
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
                const uint index = (panel.y * parts + k) * PANELS + panel.x;
                sum += partials[PART_SUMS * index + 3u * (corner * LEVELS + z) + i % 3u];
            }
        }
    }
    d_grid[i] = sum;
}
