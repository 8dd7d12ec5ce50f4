// SPDX-License-Identifier: MIT OR Apache-2.0
// Purpose   one step of Adam on one camera's grid, along its gradient and that of the total variation.
// Equation  TV = sum over the three axes of the mean squared difference of neighbours (Wang et al. 2024); Adam as in adam.glsl.
// Grid      one thread per row of a cell's map.
// Writes    stepped: the grid after the step; it is copied to its place afterwards, since neighbours read it here.
//           sums: TV before the step, per workgroup.
// Numerics  a component whose gradient is not finite keeps its bits and its moments'. Nothing changes when the frame failed.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "types.glsl"
#include "grid.glsl"
#include "finite.glsl"
#include "adam.glsl"
#include "bilateral.glsl"

layout(local_size_x = 64) in;

// rate: divided by the first moment's correction.
layout(push_constant) uniform Push {
    float rate;
    float beta1;
    float beta2;
    float inverse_c2;
    float eps;
    float tv_weight;
} pc;
layout(set = 0, binding = 0) restrict readonly buffer FrameStatus { Status status; };
layout(set = 0, binding = 1) restrict readonly buffer CameraGrid { vec4 camera_grid[]; };
layout(set = 0, binding = 2) restrict readonly buffer DGrid { vec4 d_grid[]; };
layout(set = 0, binding = 3) restrict buffer First { vec4 first[]; };
layout(set = 0, binding = 4) restrict buffer Second { vec4 second[]; };
layout(set = 0, binding = 5) restrict writeonly buffer Stepped { vec4 stepped[]; };
layout(set = 0, binding = 6) restrict writeonly buffer Sums { vec4 sums[]; };

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
    const uint i = linear_thread(gl_WorkGroupSize.x);
    const bool valid = i < GRID_ROWS;
    const uint cell = (valid ? i : 0u) / 3u;
    const vec4 x = camera_grid[valid ? i : 0u];
    vec4 d_tv = vec4(0.0);
    float tv = 0.0;
    if (valid) {
        add_axis(i, x, cell % CELLS, CELLS, 3u, PAIRS_XY, d_tv, tv);
        add_axis(i, x, cell / CELLS % CELLS, CELLS, 3u * CELLS, PAIRS_XY, d_tv, tv);
        add_axis(i, x, cell / (CELLS * CELLS), LEVELS, 3u * CELLS * CELLS, PAIRS_Z, d_tv, tv);
        const vec4 g = d_grid[i] + pc.tv_weight * d_tv;
        AdamParams adam;
        adam.beta1 = pc.beta1;
        adam.beta2 = pc.beta2;
        adam.inverse_c2 = pc.inverse_c2;
        adam.eps = pc.eps;
        const vec4 m_old = first[i];
        const vec4 v_old = second[i];
        vec4 m = m_old;
        vec4 v = v_old;
        const vec4 change = adam_change(adam, vec4(pc.rate), g, m, v);
        const bvec4 usable = bvec4(finite(g.x), finite(g.y), finite(g.z), finite(g.w));
        const bvec4 moves = bvec4(uvec4(usable) * uint(status.failed == 0u));
        first[i] = mix(m_old, m, moves);
        second[i] = mix(v_old, v, moves);
        stepped[i] = mix(x, x + change, moves);
    }
    sh_sums[gl_LocalInvocationIndex] = tv;
    barrier();
    if (gl_LocalInvocationIndex == 0u && linear_group() < div_ceil(GRID_ROWS, 64u)) {
        float sum = 0.0;
        for (uint k = 0u; k < 64u; ++k) sum += sh_sums[k];
        sums[linear_group()] = vec4(sum, 0.0, 0.0, 0.0);
    }
}
