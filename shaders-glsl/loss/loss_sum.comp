// SPDX-License-Identifier: MIT OR Apache-2.0
// Purpose   adds the workgroups' sums of 1 - SSIM, absolute and squared error.
// Equation  none.
// Grid      one workgroup.
// Writes    loss[0]: sums over all pixels and channels, 1 - SSIM, absolute and squared error.
// Numerics  1,024 interleaved partial sums, added up in a fixed order: the same bits in every run.
#version 460
#extension GL_GOOGLE_include_directive : require

// Loads that a thread has under way at once: with one, a GPU would wait for memory at each.
const uint AT_ONCE = 8u;

// 128 threads are the most that every device has in a workgroup.
layout(local_size_x = 128) in;

layout(push_constant) uniform Push { uint n; } pc;
layout(set = 0, binding = 0) restrict readonly buffer Sums { vec4 sums[]; };
layout(set = 0, binding = 1) restrict writeonly buffer Loss { vec4 loss[]; };

shared vec4 sh_sums[128];

void main() {
    const uint lane = gl_LocalInvocationIndex;
    vec4 own[AT_ONCE];
    for (uint k = 0u; k < AT_ONCE; ++k) own[k] = vec4(0.0);
    for (uint i = lane; i < pc.n; i += 128u * AT_ONCE) {
        for (uint k = 0u; k < AT_ONCE; ++k) {
            const uint at = i + 128u * k;
            // Loaded in any case: a branch would make the loads wait for each other.
            const vec4 here = sums[min(at, pc.n - 1u)];
            own[k] += at < pc.n ? here : vec4(0.0);
        }
    }
    vec4 sum = vec4(0.0);
    for (uint k = 0u; k < AT_ONCE; ++k) sum += own[k];
    sh_sums[lane] = sum;
    barrier();
    for (uint n = 64u; n > 0u; n /= 2u) {
        if (lane < n) sh_sums[lane] += sh_sums[lane + n];
        barrier();
    }
    if (lane == 0u) loss[0] = sh_sums[0];
}
