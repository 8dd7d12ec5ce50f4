// SPDX-License-Identifier: MIT OR Apache-2.0
// Purpose   one step of Adam on one camera's grid, along its gradient. POOLED: along the gradient that one map for the whole image has.
// Equation  as adam.glsl. POOLED: d_k <- sum_j d_j over all cells j: cells that begin alike and step alike stay one affine map.
// Grid      one thread per row of a cell's map; POOLED: one workgroup per row of a map.
// Numerics  a component whose gradient is not finite keeps its bits and its moments'. Nothing changes when the frame failed.
//           POOLED: cells are summed in a fixed order, so every run has the same bits.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "types.glsl"
#include "grid.glsl"
#include "finite.glsl"
#include "adam.glsl"
#include "bilateral.glsl"

#ifdef POOLED
layout(local_size_x = 128) in;
#else
layout(local_size_x = 64) in;
#endif

// rate: divided by the first moment's correction.
layout(push_constant) uniform Push { float rate; float beta1; float beta2; float inverse_c2; float eps; } pc;
layout(set = 0, binding = 0) restrict readonly buffer FrameStatus { Status status; };
layout(set = 0, binding = 1) restrict buffer CameraGrid { vec4 camera_grid[]; };
layout(set = 0, binding = 2) restrict readonly buffer DGrid { vec4 d_grid[]; };
layout(set = 0, binding = 3) restrict buffer First { vec4 first[]; };
layout(set = 0, binding = 4) restrict buffer Second { vec4 second[]; };

// A step of row `i` along `g`.
void step_along(vec4 g, uint i) {
    AdamParams adam;
    adam.beta1 = pc.beta1;
    adam.beta2 = pc.beta2;
    adam.inverse_c2 = pc.inverse_c2;
    adam.eps = pc.eps;
    const vec4 x = camera_grid[i];
    const vec4 m_old = first[i];
    const vec4 v_old = second[i];
    vec4 m = m_old;
    vec4 v = v_old;
    const vec4 change = adam_change(adam, vec4(pc.rate), g, m, v);
    const bvec4 usable = bvec4(finite(g.x), finite(g.y), finite(g.z), finite(g.w));
    const bvec4 moves = bvec4(uvec4(usable) * uint(status.failed == 0u));
    first[i] = mix(m_old, m, moves);
    second[i] = mix(v_old, v, moves);
    camera_grid[i] = mix(x, x + change, moves);
}

#ifdef POOLED

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
    for (uint cell = lane; cell < N_CELLS; cell += 128u) if (valid) step_along(sum, 3u * cell + row);
}

#else

void main() {
    const uint i = linear_thread(gl_WorkGroupSize.x);
    if (i < GRID_ROWS) step_along(d_grid[i], i);
}

#endif
