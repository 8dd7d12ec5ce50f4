// SPDX-License-Identifier: MIT OR Apache-2.0
// Purpose   adds the workgroups' gradients of camera and background.
// Equation  none.
// Grid      one workgroup; three threads work.
// Numerics  one sum in order: the same bits in every run.
#version 460
#extension GL_GOOGLE_include_directive : require

layout(local_size_x = 64) in;

layout(set = 0, binding = 0) restrict readonly buffer Partials { vec4 partials[]; };
layout(set = 0, binding = 1) restrict writeonly buffer Total { vec4 total[]; };

void main() {
    const uint plane = gl_LocalInvocationIndex;
    if (plane >= 3u) return;
    vec4 sum = vec4(0.0);
    for (uint k = 0u; k < 64u; ++k) sum += partials[3u * k + plane];
    total[plane] = sum;
}
