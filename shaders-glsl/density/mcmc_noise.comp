// SPDX-License-Identifier: MIT OR Apache-2.0
// Purpose   lets faint Gaussians wander: adds noise of their own shape to their positions after each step.
// Equation  p += rate / (1 + exp(-100 ((1 - o) - 0.995))) Sigma N(0, 1), Sigma = R diag(e^2s) R^T (3DGS-MCMC, Kheradmand
//           et al. 2024).
// Grid      one thread per Gaussian of a group.
// Numerics  a move that is not finite is left out, and so are all when the step failed.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "types.glsl"
#include "grid.glsl"
#include "finite.glsl"
#include "temporal.glsl"
#include "unit.glsl"
#include "rotation.glsl"
#include "random.glsl"

layout(local_size_x = 64) in;

layout(push_constant) uniform Push { uint n; uint first; uint key; float rate; } pc;
layout(set = 0, binding = 0) restrict readonly buffer FrameStatus { Status status; };
layout(set = 0, binding = 1) restrict buffer Geometry { vec4 geometry[]; };

void main() {
    const uint i = linear_thread(gl_WorkGroupSize.x);
    if (i >= pc.n || status.failed != 0u) return;
    const vec4 mean_opacity = geometry[plane_index(i, 3u, 0u)];
    const vec4 q = geometry[plane_index(i, 3u, 1u)];
    const vec3 scale = exp(geometry[plane_index(i, 3u, 2u)].xyz);
    const float gate = sigmoid(100.0 * (0.005 - sigmoid(mean_opacity.w)));
    float inverse_length;
    const mat3 turn = rotation_of(unit_quaternion(q, inverse_length));
    const vec3 normals = random_normals3(pc.key, pc.first + i, 0u);
    const vec3 moved = mean_opacity.xyz + pc.rate * gate * (turn * (scale * scale * (normals * turn)));
    if (finite3(moved)) geometry[plane_index(i, 3u, 0u)] = vec4(moved, mean_opacity.w);
}
