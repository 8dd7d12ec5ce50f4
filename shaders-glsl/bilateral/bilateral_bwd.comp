// SPDX-License-Identifier: MIT OR Apache-2.0
// Purpose   sums the cotangents of a part's pixels into the four columns of cells at its corners.
// Equation  d_A = sum over pixels of w d_y (c, 1)^T, w the trilinear weight of the cell.
// Grid      a team of four lanes per part, see bilateral.glsl; each lane sums two levels.
// Writes    partials: per part [corner: left and right above, left and right below][level][row of the map].
// Numerics  sums along rows, then down, in an order that does not depend on the subgroup's size. A pixel whose colour or
//           cotangent is not finite has no share.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_KHR_shader_subgroup_ballot : require
#extension GL_KHR_shader_subgroup_basic : require
#extension GL_KHR_shader_subgroup_shuffle : require
#include "unfolded.glsl"
#include "grid.glsl"
#include "finite.glsl"
#include "bilateral.glsl"

layout(local_size_x = 64) in;

// rows: of pixels in a part; parts: down a panel.
layout(push_constant) uniform Push { uint width; uint height; uint rows; uint parts; } pc;
layout(set = 0, binding = 0) restrict readonly buffer Image { vec4 image[]; };
layout(set = 0, binding = 1) restrict readonly buffer DGraded { vec4 d_graded[]; };
layout(set = 0, binding = 2) restrict writeonly buffer Partials { vec4 partials[]; };

void main() {
    const uint lane = gl_SubgroupInvocationID & (TEAM - 1u);
    const uint base = gl_SubgroupInvocationID - lane;
    const uint index = (linear_group() * 64u + gl_SubgroupID * gl_SubgroupSize + base) / TEAM;
    if (index >= PANELS * PANELS * pc.parts) return;
    const uvec2 size = uvec2(pc.width, pc.height);
    const Part part = part_of(index, size, pc.rows, pc.parts);
    const vec2 levels = vec2(float(2u * lane), float(2u * lane + 1u));
    // Two levels, left and right, three rows each.
    vec4 above[12];
    vec4 below[12];
    for (uint k = 0u; k < 12u; ++k) above[k] = below[k] = vec4(0.0);
    const uint steps = unfolded(div_ceil(div_ceil(pc.width, PANELS), TEAM));
    const uint rows = unfolded(pc.rows);
    uint row = 0u;
    do {
        const uint y = part.first.y + row;
        vec4 sum[12];
        for (uint k = 0u; k < 12u; ++k) sum[k] = vec4(0.0);
        uint step = 0u;
        do {
            const uint x = part.first.x + step * TEAM + lane;
            const bool valid = x < part.end.x && y < part.end.y;
            const uint pixel = valid ? y * pc.width + x : 0u;
            const vec3 color = image[pixel].xyz;
            const vec3 g = d_graded[pixel].xyz;
            const bool counts = valid && finite3(color) && finite3(g);
            const vec3 own_color = counts ? color : vec3(0.0);
            const vec3 own_g = counts ? g : vec3(0.0);
            const float own_level = level_of(own_color);
            const float own_right = across(x, part.panel.x, pc.width);
            for (uint k = 0u; k < TEAM; ++k) {
                const vec4 factor = vec4(subgroupShuffle(own_color, base + k), 1.0);
                const vec3 d = subgroupShuffle(own_g, base + k);
                const float right = subgroupShuffle(own_right, base + k);
                const vec2 weight = max(1.0 - abs(subgroupShuffle(own_level, base + k) - levels), vec2(0.0));
                for (uint s = 0u; s < 2u; ++s) {
                    const vec3 to_right = weight[s] * right * d;
                    const vec3 to_left = weight[s] * (1.0 - right) * d;
                    for (uint c = 0u; c < 3u; ++c) {
                        sum[6u * s + c] += to_left[c] * factor;
                        sum[6u * s + 3u + c] += to_right[c] * factor;
                    }
                }
            }
        } while (++step < steps);
        const float down = across(y, part.panel.y, pc.height);
        for (uint k = 0u; k < 12u; ++k) {
            above[k] += (1.0 - down) * sum[k];
            below[k] += down * sum[k];
        }
    } while (++row < rows);
    for (uint k = 0u; k < 12u; ++k) {
        const uint z = 2u * lane + k / 6u;
        const uint at = PART_SUMS * index + 3u * (k / 3u % 2u * LEVELS + z) + k % 3u;
        partials[at] = above[k];
        partials[at + 2u * LEVELS * 3u] = below[k];
    }
}
