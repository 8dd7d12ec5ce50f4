// SPDX-License-Identifier: MIT OR Apache-2.0
// Purpose   adds the gradients of an image to those of the images before it.
// Equation  sum += round(2^50 g), in 64 bits; of the constant band's fourth number see batch.glsl.
// Grid      one thread per active Gaussian of the group. A buffer that the group lacks is bound to another, and not touched.
// Reads     gradients as project_bwd writes them, finite.
// Writes    sums, and a bit for each Gaussian that has been active.
// Numerics  saturates at +-16, and keeps 2^-50 of a gradient. Nothing is added when a frame failed.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_KHR_shader_subgroup_ballot : require
#include "types.glsl"
#include "unfolded.glsl"
#include "grid.glsl"
#include "finite.glsl"
#include "fixed.glsl"
#include "batch.glsl"

layout(local_size_x = 64) in;

// first: flat index of the group's first Gaussian; is_dynamic: 1 where it has motion, else 0.
layout(push_constant) uniform Push { uint group; uint first; uint is_dynamic; uint degree; } pc;
layout(set = 0, binding = 0) restrict readonly buffer FrameStatus { Status status; };
layout(set = 0, binding = 1) restrict readonly buffer Ranges { uvec2 ranges[]; };
layout(set = 0, binding = 2) restrict readonly buffer ActiveId { uint active_id[]; };
layout(set = 0, binding = 3) restrict readonly buffer DGeometry { vec4 d_geometry[]; };
layout(set = 0, binding = 4) restrict readonly buffer DSh0 { vec4 d_sh0[]; };
layout(set = 0, binding = 5) restrict readonly buffer DMotion { vec4 d_motion[]; };
layout(set = 0, binding = 6) restrict readonly buffer DSh1 { vec4 d_sh1[]; };
layout(set = 0, binding = 7) restrict readonly buffer DSh2 { vec4 d_sh2[]; };
layout(set = 0, binding = 8) restrict readonly buffer DSh3 { vec4 d_sh3[]; };
layout(set = 0, binding = 9) restrict buffer SumsGeometry { uvec4 sums_geometry[]; };
layout(set = 0, binding = 10) restrict buffer SumsSh0 { uvec4 sums_sh0[]; };
layout(set = 0, binding = 11) restrict buffer SumsMotion { uvec4 sums_motion[]; };
layout(set = 0, binding = 12) restrict buffer SumsSh1 { uvec4 sums_sh1[]; };
layout(set = 0, binding = 13) restrict buffer SumsSh2 { uvec4 sums_sh2[]; };
layout(set = 0, binding = 14) restrict buffer SumsSh3 { uvec4 sums_sh3[]; };
layout(set = 0, binding = 15) restrict buffer Touched { uint touched[]; };

// Planes of a buffer, none where the group lacks it. The loop is one that lavapipe skips; an `if` is not.
#define ADD(gradients, sums, planes)                                                \
    for (uint p = 0u; p < (planes); ++p) {                                          \
        const vec4 g = gradients[plane_index(i, planes, p)];                        \
        const uint place = plane_index(i, 2u * (planes), 2u * p);                   \
        uvec4 low = sums[place], high = sums[place + 32u];                          \
        for (uint c = 0u; c < 4u; ++c) {                                            \
            const uvec2 sum = sum_of(uvec2(low[c], high[c]), batch_word(g[c]));     \
            low[c] = sum.x;                                                         \
            high[c] = sum.y;                                                        \
        }                                                                           \
        sums[place] = low;                                                          \
        sums[place + 32u] = high;                                                   \
    }

void main() {
    const uvec2 range = ranges[pc.group];
    const uint at = range.x + linear_thread(gl_WorkGroupSize.x);
    if (at >= range.y || status.failed != 0u) return;
    const uint i = active_id[at] - pc.first;
    const uint is_dynamic = unfolded(pc.is_dynamic);
    const uint degree = unfolded(pc.degree);
    ADD(d_geometry, sums_geometry, 3u)
    const vec4 g0 = d_sh0[i];
    const uint place0 = plane_index(i, 2u, 0u);
    uvec4 low0 = sums_sh0[place0], high0 = sums_sh0[place0 + 32u];
    for (uint c = 0u; c < 4u; ++c) {
        const uvec2 sum = sum_of(uvec2(low0[c], high0[c]), c < 3u ? batch_word(g0[c]) : pull_word(g0.w));
        low0[c] = sum.x;
        high0[c] = sum.y;
    }
    sums_sh0[place0] = low0;
    sums_sh0[place0 + 32u] = high0;
    ADD(d_motion, sums_motion, is_dynamic)
    ADD(d_sh1, sums_sh1, degree > 0u ? 3u : 0u)
    ADD(d_sh2, sums_sh2, degree > 1u ? 4u : 0u)
    ADD(d_sh3, sums_sh3, degree > 2u ? 6u : 0u)
    atomicOr(touched[i >> 5], 1u << (i & 31u));
}
