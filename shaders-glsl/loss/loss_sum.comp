// SPDX-License-Identifier: MIT OR Apache-2.0
// Purpose   adds what up to four terms of the loss left by workgroup. REPORT: to where the host reads it, with the frame's status and
//           the bad gradients.
// Equation  none.
// Grid      one workgroup per term; REPORT: at least one.
// Writes    loss: the sums of each term.
// Numerics  1,024 interleaved partial sums, added up in a fixed order: the same bits in every run.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "grid.glsl"
#ifdef REPORT
#include "types.glsl"
#endif

// Loads that a thread has under way at once: with one, a GPU would wait for memory at each.
const uint AT_ONCE = 8u;

// 128 threads are the most that every device has in a workgroup.
layout(local_size_x = 128) in;

layout(push_constant) uniform Push { uint n0; uint n1; uint n2; uint n3; } pc;
layout(set = 0, binding = 0) restrict readonly buffer Sums0 { vec4 sums0[]; };
layout(set = 0, binding = 1) restrict readonly buffer Sums1 { vec4 sums1[]; };
layout(set = 0, binding = 2) restrict readonly buffer Sums2 { vec4 sums2[]; };
layout(set = 0, binding = 3) restrict readonly buffer Sums3 { vec4 sums3[]; };
layout(set = 0, binding = 4) restrict writeonly buffer Loss { vec4 loss[]; };
#ifdef REPORT
layout(set = 0, binding = 5) restrict readonly buffer FrameStatus { Status status; };
layout(set = 0, binding = 6) restrict readonly buffer NBad { uint n_bad[]; };
layout(set = 0, binding = 7) restrict writeonly buffer LeftStatus { Status left_status; };
layout(set = 0, binding = 8) restrict writeonly buffer LeftBad { uint left_bad[]; };
#endif

shared vec4 sh_sums[128];

// Loaded past the end, too: a branch would make the loads wait for each other.
#define ADD_UP(SUMS, N) for (uint i = lane; i < N; i += 128u * AT_ONCE) { \
    for (uint k = 0u; k < AT_ONCE; ++k) { \
        const uint at = i + 128u * k; \
        const vec4 here = SUMS[min(at, N - 1u)]; \
        own[k] += at < N ? here : vec4(0.0); \
    } \
}

void main() {
    const uint lane = gl_LocalInvocationIndex;
    const uint term = linear_group();
    vec4 own[AT_ONCE];
    for (uint k = 0u; k < AT_ONCE; ++k) own[k] = vec4(0.0);
    if (term == 0u) {
        ADD_UP(sums0, pc.n0)
    } else if (term == 1u) {
        ADD_UP(sums1, pc.n1)
    } else if (term == 2u) {
        ADD_UP(sums2, pc.n2)
    } else {
        ADD_UP(sums3, pc.n3)
    }
    vec4 sum = vec4(0.0);
    for (uint k = 0u; k < AT_ONCE; ++k) sum += own[k];
    sh_sums[lane] = sum;
    barrier();
    for (uint n = 64u; n > 0u; n /= 2u) {
        if (lane < n) sh_sums[lane] += sh_sums[lane + n];
        barrier();
    }
    if (lane == 0u && term < 4u) loss[term] = sh_sums[0];
#ifdef REPORT
    if (lane == 0u && term == 0u) {
        left_status = status;
        left_bad[0] = n_bad[0];
    }
#endif
}
