// SPDX-License-Identifier: MIT OR Apache-2.0
// Purpose   takes the mean deviation from the identity over the cameras that film off every camera's grid.
// Equation  A_k <- A_k - mean_j (A_j - I), j over the first n_filming, k over all: a tint of all that film is one of the scene (SPEC 7),
//           one of photographs is that of another day.
// Grid      one thread per row of a cell's map.
// Numerics  deviations are summed in the cameras' order. Nothing changes when the frame failed.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_KHR_shader_subgroup_ballot : require
#include "types.glsl"
#include "unfolded.glsl"
#include "grid.glsl"
#include "bilateral.glsl"

layout(local_size_x = 64) in;

layout(push_constant) uniform Push { uint n_cameras; uint n_filming; } pc;
layout(set = 0, binding = 0) restrict readonly buffer FrameStatus { Status status; };
layout(set = 0, binding = 1) restrict buffer Grids { vec4 grids[]; };

void main() {
    const uint i = linear_thread(gl_WorkGroupSize.x);
    if (i >= GRID_ROWS || status.failed != 0u) return;
    const vec4 identity = vec4(equal(uvec4(i % 3u), uvec4(0u, 1u, 2u, 3u)));
    const uint n_cameras = unfolded(pc.n_cameras);
    const uint n_filming = unfolded(pc.n_filming);
    vec4 sum = vec4(0.0);
    for (uint k = 0u; k < n_filming; ++k) sum += grids[k * GRID_ROWS + i] - identity;
    const vec4 mean = sum / float(n_filming);
    for (uint k = 0u; k < n_cameras; ++k) grids[k * GRID_ROWS + i] -= mean;
}
