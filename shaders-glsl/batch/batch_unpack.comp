// SPDX-License-Identifier: MIT OR Apache-2.0
// Purpose   puts rows that machines have exchanged back into the sums of a group.
// Equation  as in batch_pack.comp, the other way.
// Grid      one thread per row. A buffer that the group lacks is bound to another, and not touched.
// Reads     rows; ids, group-local and ascending.
// Writes    sums of those Gaussians.
// Numerics  exact.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_KHR_shader_subgroup_ballot : require
#include "unfolded.glsl"
#include "grid.glsl"

layout(local_size_x = 64) in;

// n: rows; is_dynamic: 1 where the group has motion, else 0.
layout(push_constant) uniform Push { uint n; uint is_dynamic; uint degree; } pc;
layout(set = 0, binding = 0) restrict readonly buffer Ids { uint ids[]; };
layout(set = 0, binding = 1) restrict readonly buffer Rows { uvec2 rows[]; };
layout(set = 0, binding = 2) restrict writeonly buffer SumsGeometry { uvec4 sums_geometry[]; };
layout(set = 0, binding = 3) restrict writeonly buffer SumsSh0 { uvec4 sums_sh0[]; };
layout(set = 0, binding = 4) restrict writeonly buffer SumsMotion { uvec4 sums_motion[]; };
layout(set = 0, binding = 5) restrict writeonly buffer SumsSh1 { uvec4 sums_sh1[]; };
layout(set = 0, binding = 6) restrict writeonly buffer SumsSh2 { uvec4 sums_sh2[]; };
layout(set = 0, binding = 7) restrict writeonly buffer SumsSh3 { uvec4 sums_sh3[]; };

// Planes of a buffer, none where the group lacks it. The loop is one that lavapipe skips; an `if` is not.
#define COPY(sums, planes)                                                      \
    for (uint p = 0u; p < (planes); ++p) {                                      \
        const uint place = plane_index(i, 2u * (planes), 2u * p);               \
        uvec4 low, high;                                                        \
        for (uint c = 0u; c < 4u; ++c) {                                        \
            const uvec2 word = rows[(e + c) * n + r];                           \
            low[c] = word.x;                                                    \
            high[c] = word.y;                                                   \
        }                                                                       \
        sums[place] = low;                                                      \
        sums[place + 32u] = high;                                               \
        e += 4u;                                                                \
    }

void main() {
    const uint r = linear_thread(gl_WorkGroupSize.x);
    if (r >= pc.n) return;
    const uint n = pc.n;
    const uint i = ids[r];
    const uint is_dynamic = unfolded(pc.is_dynamic);
    const uint degree = unfolded(pc.degree);
    uint e = 0u;
    COPY(sums_geometry, 3u)
    COPY(sums_sh0, 1u)
    COPY(sums_motion, is_dynamic)
    COPY(sums_sh1, degree > 0u ? 3u : 0u)
    COPY(sums_sh2, degree > 1u ? 4u : 0u)
    COPY(sums_sh3, degree > 2u ? 6u : 0u)
}
