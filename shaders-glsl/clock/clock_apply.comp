// SPDX-License-Identifier: MIT OR Apache-2.0
// Purpose   adds the camera's time offset, which only the device knows, to the view's time.
// Equation  SPEC 2: t' = t + dgamma_k dt.
// Grid      one thread.
// Writes    view.time, which holds t before.
// Numerics  one product and one sum in f32: 1e-7 of the clip.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "types.glsl"

layout(local_size_x = 1) in;

layout(push_constant) uniform Push { uint camera; } pc;
layout(set = 0, binding = 0) restrict readonly buffer Clocks { vec4 clocks[]; };
layout(set = 0, binding = 1) restrict buffer View { ViewParams view; };

void main() {
    if (gl_GlobalInvocationID.x > 0u) return;
    view.time += clocks[pc.camera].x * view.background.w;
}
