// SPDX-License-Identifier: MIT OR Apache-2.0
// Purpose   one step of Adam on one camera's grid, along its gradient.
// Equation  as adam.glsl.
// Grid      one thread per row of a cell's map.
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
layout(push_constant) uniform Push { float rate; float beta1; float beta2; float inverse_c2; float eps; } pc;
layout(set = 0, binding = 0) restrict readonly buffer FrameStatus { Status status; };
layout(set = 0, binding = 1) restrict buffer CameraGrid { vec4 camera_grid[]; };
layout(set = 0, binding = 2) restrict readonly buffer DGrid { vec4 d_grid[]; };
layout(set = 0, binding = 3) restrict buffer First { vec4 first[]; };
layout(set = 0, binding = 4) restrict buffer Second { vec4 second[]; };

void main() {
    const uint i = linear_thread(gl_WorkGroupSize.x);
    if (i >= GRID_ROWS) return;
    const vec4 g = d_grid[i];
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
