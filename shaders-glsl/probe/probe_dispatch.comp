// SPDX-License-Identifier: MIT OR Apache-2.0
// Purpose   measures what a dispatch costs that does next to nothing and waits for the one before.
// Equation  count <- count + step.
// Grid      one workgroup.
// Numerics  exact.
#version 460
#extension GL_GOOGLE_include_directive : require

layout(local_size_x = 64) in;

layout(set = 0, binding = 0) restrict readonly buffer Steps { uint steps[]; };
layout(set = 0, binding = 1) restrict buffer Count { uint count[]; };

void main() {
    if (gl_LocalInvocationIndex == 0u) count[0] += steps[0];
}
