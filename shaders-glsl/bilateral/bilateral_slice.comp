// SPDX-License-Identifier: MIT OR Apache-2.0
// Purpose   maps each pixel's colour by the affine map that the camera's bilateral grid has at its place and luma; with
//           BACKWARD it carries the cotangents back to the colours, through the map and through the luma.
// Equation  y = A (c, 1), A trilinear in (x, y, 7 luma(c)); d_c = A^T d_y + 7 dluma/dc (d_y . dA/dz (c, 1)).
// Grid      a team of four lanes per part, see bilateral.glsl.
// Numerics  coordinate and index of the level are clamped, with zero derivative outside; a + t (b - a) along every axis, so
//           that the identity gives every finite colour its bits.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_KHR_shader_subgroup_ballot : require
#extension GL_KHR_shader_subgroup_basic : require
#extension GL_KHR_shader_subgroup_shuffle : require
#include "unfolded.glsl"
#include "grid.glsl"
#include "bilateral.glsl"

layout(local_size_x = 64) in;

// rows: of pixels in a part; parts: down a panel.
layout(push_constant) uniform Push { uint width; uint height; uint rows; uint parts; } pc;
layout(set = 0, binding = 0) restrict readonly buffer CameraGrid { vec4 camera_grid[]; };
layout(set = 0, binding = 1) restrict readonly buffer Image { vec4 image[]; };
#ifdef BACKWARD
layout(set = 0, binding = 2) restrict readonly buffer DGraded { vec4 d_graded[]; };
layout(set = 0, binding = 3) restrict writeonly buffer DImage { vec4 d_image[]; };
#else
layout(set = 0, binding = 2) restrict writeonly buffer Graded { vec4 graded[]; };
#endif

void main() {
    const uint lane = gl_SubgroupInvocationID & (TEAM - 1u);
    const uint base = gl_SubgroupInvocationID - lane;
    const uint index = (linear_group() * 64u + gl_SubgroupID * gl_SubgroupSize + base) / TEAM;
    if (index >= PANELS * PANELS * pc.parts) return;
    const uvec2 size = uvec2(pc.width, pc.height);
    const Part part = part_of(index, size, pc.rows, pc.parts);
    // This lane's levels, 2 lane and 2 lane + 1, left and right, three rows each; and how they change down the panel.
    vec4 upper[12];
    vec4 change[12];
    for (uint k = 0u; k < 4u; ++k) {
        const uint z = 2u * lane + k / 2u;
        const uvec2 column = part.panel + uvec2(k & 1u, 0u);
        const uint above = cell_row(column, z);
        const uint below = cell_row(column + uvec2(0u, 1u), z);
        for (uint c = 0u; c < 3u; ++c) {
            upper[3u * k + c] = camera_grid[above + c];
            change[3u * k + c] = camera_grid[below + c] - upper[3u * k + c];
        }
    }
    const uint steps = unfolded(div_ceil(div_ceil(pc.width, PANELS), TEAM));
    const uint rows = unfolded(pc.rows);
    uint row = 0u;
    do {
        const uint y = part.first.y + row;
        const float down = across(y, part.panel.y, pc.height);
        vec4 held[12];
        for (uint k = 0u; k < 12u; ++k) held[k] = upper[k] + down * change[k];
        uint step = 0u;
        do {
            const uint x = part.first.x + step * TEAM + lane;
            const bool valid = x < part.end.x && y < part.end.y;
            const uint pixel = valid ? y * pc.width + x : 0u;
            const vec4 seen = image[pixel];
            const vec3 color = seen.xyz;
            const float level = level_of(color);
            const uint z = min(uint(level), LEVELS - 2u);
            const float t = level - float(z);
            const bool is_even = (z & 1u) == 0u;
            // Of the two levels around, one is the even one of a lane and one the odd one of that lane or the one before.
            const uint even_lane = base + (z + 1u) / 2u;
            const uint odd_lane = base + z / 2u;
            const float to_odd = is_even ? t : 1.0 - t;
            const float right = across(x, part.panel.x, pc.width);
#ifdef BACKWARD
            const vec3 g = d_graded[pixel].xyz;
            vec3 d_color = vec3(0.0);
            float d_level = 0.0;
#else
            vec3 mapped = vec3(0.0);
#endif
            for (uint c = 0u; c < 3u; ++c) {
                const vec4 even_left = subgroupShuffle(held[c], even_lane);
                const vec4 even_right = subgroupShuffle(held[3u + c], even_lane);
                const vec4 odd_left = subgroupShuffle(held[6u + c], odd_lane);
                const vec4 odd_right = subgroupShuffle(held[9u + c], odd_lane);
                const vec4 even = even_left + right * (even_right - even_left);
                const vec4 change_to_odd = odd_left + right * (odd_right - odd_left) - even;
                const vec4 map_row = even + to_odd * change_to_odd;
#ifdef BACKWARD
                d_color += g[c] * map_row.xyz;
                d_level += g[c] * dot(change_to_odd, vec4(color, 1.0));
#else
                mapped[c] = dot(map_row, vec4(color, 1.0));
#endif
            }
#ifdef BACKWARD
            const float d_luma = (is_even ? d_level : -d_level) * float(LEVELS - 1u);
            if (valid) d_image[pixel] = vec4(d_color + (level_follows(color) ? d_luma : 0.0) * LUMA, 0.0);
#else
            if (valid) graded[pixel] = vec4(mapped, seen.w);
#endif
        } while (++step < steps);
    } while (++row < rows);
}
