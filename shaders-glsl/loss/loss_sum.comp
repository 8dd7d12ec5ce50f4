// SPDX-License-Identifier: MIT OR Apache-2.0
// Purpose   adds the workgroups' sums of 1 - SSIM, absolute and squared error.
// Equation  none.
// Grid      one workgroup.
// Writes    loss[0]: sums over all pixels and channels, 1 - SSIM, absolute and squared error.
// Numerics  64 interleaved partial sums, then one sum in order: the same bits in every run.
#version 460
#extension GL_GOOGLE_include_directive : require

layout(local_size_x = 64) in;

layout(push_constant) uniform Push { uint n; } pc;
layout(set = 0, binding = 0) restrict readonly buffer Sums { vec4 sums[]; };
layout(set = 0, binding = 1) restrict writeonly buffer Loss { vec4 loss[]; };

shared vec4 sh_sums[64];

void main() {
    const uint lane = gl_LocalInvocationIndex;
    vec4 own = vec4(0.0);
    for (uint i = lane; i < pc.n; i += 64u) own += sums[i];
    sh_sums[lane] = own;
    barrier();
    if (lane == 0u) {
        vec4 sum = vec4(0.0);
        for (uint k = 0u; k < 64u; ++k) sum += sh_sums[k];
        loss[0] = sum;
    }
}
