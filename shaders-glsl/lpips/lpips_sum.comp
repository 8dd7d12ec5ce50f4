// SPDX-License-Identifier: MIT OR Apache-2.0
// Purpose   adds the workgroups' shares of LPIPS.
// Equation  none.
// Grid      one workgroup.
// Writes    value[0]: LPIPS, the sum over all taps.
// Numerics  64 interleaved partial sums, then one sum in order: the same bits in every run.
#version 460
#extension GL_GOOGLE_include_directive : require

layout(local_size_x = 64) in;

layout(push_constant) uniform Push { uint n; } pc;
layout(set = 0, binding = 0) restrict readonly buffer Sums { float sums[]; };
layout(set = 0, binding = 1) restrict writeonly buffer Value { float value[]; };

shared float sh_sums[64];

void main() {
    const uint lane = gl_LocalInvocationIndex;
    float own = 0.0;
    for (uint i = lane; i < pc.n; i += 64u) own += sums[i];
    sh_sums[lane] = own;
    barrier();
    if (lane == 0u) {
        float sum = 0.0;
        for (uint k = 0u; k < 64u; ++k) sum += sh_sums[k];
        value[0] = sum;
    }
}
