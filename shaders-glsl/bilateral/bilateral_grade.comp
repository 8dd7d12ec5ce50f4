// SPDX-License-Identifier: MIT OR Apache-2.0
// Purpose   does for GPUs what bilateral_slice does: maps each pixel's colour by the grid's affine map at its place and luma. With
//           BACKWARD it carries the cotangents back to the colours and sums those of a part's pixels, as bilateral_bwd does.
// Equation  y = A (c, 1), A trilinear in (x, y, 7 luma(c)); d_c = A^T d_y + 7 dluma/dc (d_y . dA/dz (c, 1));
//           d_A = sum over pixels of w d_y (c, 1)^T, w the trilinear weight of the cell.
// Grid      a workgroup per part, see bilateral.glsl; a thread a pixel. To sum, a thread has a level and a column of the map, and a
//           quarter of the pixels.
// Writes    partials: per part [corner: left and right above, left and right below][level][row of the map].
// Numerics  coordinate and index of the level are clamped, with zero derivative outside; a + t (b - a) along every axis, so
//           that the identity gives every finite colour its bits. Sums have a fixed order, the same at every width of subgroups. A
//           pixel whose colour or cotangent is not finite has no share in them.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "grid.glsl"
#include "finite.glsl"
#include "bilateral.glsl"

layout(local_size_x = 128) in;

// rows: of pixels in a part; parts: down a panel.
layout(push_constant) uniform Push { uint width; uint height; uint rows; uint parts; } pc;
layout(set = 0, binding = 0) restrict readonly buffer CameraGrid { vec4 camera_grid[]; };
layout(set = 0, binding = 1) restrict readonly buffer Image { vec4 image[]; };
#ifdef BACKWARD
layout(set = 0, binding = 2) restrict readonly buffer DGraded { vec4 d_graded[]; };
layout(set = 0, binding = 3) restrict writeonly buffer DImage { vec4 d_image[]; };
layout(set = 0, binding = 4) restrict writeonly buffer Partials { vec4 partials[]; };
#else
layout(set = 0, binding = 2) restrict writeonly buffer Graded { vec4 graded[]; };
#endif

// The maps around the part: four corners, LEVELS levels, three rows.
shared vec4 sh_maps[PART_SUMS];
const uint CORNER = 3u * LEVELS;

// A row of the map between the four corners of a level.
vec4 row_between(uint at, vec2 place) {
    const vec4 above = sh_maps[at] + place.x * (sh_maps[at + CORNER] - sh_maps[at]);
    const vec4 left = sh_maps[at + 2u * CORNER];
    const vec4 below = left + place.x * (sh_maps[at + 3u * CORNER] - left);
    return above + place.y * (below - above);
}

// Two levels of a row of the map: the lower one, and its difference to the upper one.
void around(uint at, vec2 place, out vec4 lower, out vec4 change) {
    lower = row_between(at, place);
    change = row_between(at + 3u, place) - lower;
}

#ifdef BACKWARD
const uint QUARTER = 32u;
const uint QUARTERS = 4u;
// Of each pixel: the factors of its map's columns; its cotangent and level; its weights at the corners. Then of each thread its sums,
// by row of the map.
shared vec4 sh_pixels[3u * QUARTER * QUARTERS];

// What the part's pixels of this quarter add to this thread's level and column, by row and corner.
void add_quarter(uint thread, inout vec4 sum[3]) {
    const float level = float(thread / 4u % LEVELS);
    for (uint k = 0u; k < QUARTER; ++k) {
        const uint from = 3u * (thread / QUARTER * QUARTER + k);
        const vec4 d = sh_pixels[from + 1u];
        const float share = max(1.0 - abs(d.w - level), 0.0) * sh_pixels[from][thread % 4u];
        const vec4 weight = share * sh_pixels[from + 2u];
        sum[0] += d.x * weight;
        sum[1] += d.y * weight;
        sum[2] += d.z * weight;
    }
}

// Adds up the quarters and writes the part's sums.
void write_sums(uint thread, uint index, vec4 sum[3]) {
    for (uint c = 0u; c < 3u; ++c) sh_pixels[3u * thread + c] = sum[c];
    barrier();
    if (thread < PART_SUMS) {
        const uint corner = thread / CORNER;
        const uint from = 12u * (thread / 3u % LEVELS) + thread % 3u;
        vec4 all = vec4(0.0);
        for (uint k = 0u; k < QUARTERS; ++k) {
            const uint at = from + 3u * QUARTER * k;
            all += vec4(sh_pixels[at][corner], sh_pixels[at + 3u][corner], sh_pixels[at + 6u][corner], sh_pixels[at + 9u][corner]);
        }
        partials[PART_SUMS * index + thread] = all;
    }
}
#endif

void main() {
    const uint thread = gl_LocalInvocationIndex;
    const uint index = min(linear_group(), PANELS * PANELS * pc.parts - 1u);
    const Part part = part_of(index, uvec2(pc.width, pc.height), pc.rows, pc.parts);
    if (thread < PART_SUMS) {
        const uint corner = thread / CORNER;
        const uint cell = cell_row(part.panel + uvec2(corner & 1u, corner / 2u), thread / 3u % LEVELS);
        sh_maps[thread] = camera_grid[cell + thread % 3u];
    }
    barrier();
    // The last part of a panel may have no rows, and panels of small pictures no columns.
    const uint columns = part.end.x - part.first.x;
    const uint n = part.end.y > part.first.y ? columns * (part.end.y - part.first.y) : 0u;
#ifdef BACKWARD
    vec4 sum[3] = vec4[3](vec4(0.0), vec4(0.0), vec4(0.0));
#endif
    for (uint begin = 0u; begin < n; begin += 128u) {
        const bool valid = begin + thread < n;
        const uint i = valid ? begin + thread : 0u;
        const uvec2 at = part.first + uvec2(i % columns, i / columns);
        const uint pixel = at.y * pc.width + at.x;
        const vec2 place = vec2(across(at.x, part.panel.x, pc.width), across(at.y, part.panel.y, pc.height));
        const vec4 seen = image[pixel];
        const vec4 color = vec4(seen.xyz, 1.0);
        const float level = level_of(color.xyz);
        const uint z = min(uint(level), LEVELS - 2u);
        const float t = level - float(z);
        vec4 lower;
        vec4 change;
#ifdef BACKWARD
        const vec3 g = d_graded[pixel].xyz;
        vec3 d_color = vec3(0.0);
        float d_level = 0.0;
        for (uint c = 0u; c < 3u; ++c) {
            around(3u * z + c, place, lower, change);
            d_color += g[c] * (lower + t * change).xyz;
            d_level += g[c] * dot(change, color);
        }
        const float d_luma = level_follows(color.xyz) ? d_level * float(LEVELS - 1u) : 0.0;
        if (valid) d_image[pixel] = vec4(d_color + d_luma * LUMA, 0.0);
        const bool counts = valid && finite3(color.xyz) && finite3(g);
        sh_pixels[3u * thread] = counts ? color : vec4(0.0);
        sh_pixels[3u * thread + 1u] = counts ? vec4(g, level) : vec4(0.0);
        const vec2 left = vec2(1.0 - place.x, place.x);
        sh_pixels[3u * thread + 2u] = vec4((1.0 - place.y) * left, place.y * left);
        barrier();
        add_quarter(thread, sum);
        barrier();
#else
        vec3 mapped;
        for (uint c = 0u; c < 3u; ++c) {
            around(3u * z + c, place, lower, change);
            mapped[c] = dot(lower + t * change, color);
        }
        if (valid) graded[pixel] = vec4(mapped, seen.w);
#endif
    }
#ifdef BACKWARD
    write_sums(thread, index, sum);
#endif
}
