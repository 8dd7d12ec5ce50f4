// SPDX-License-Identifier: MIT OR Apache-2.0
// Purpose   copies the sums of chosen Gaussians of a group to rows, which machines exchange.
// Equation  element e of row r at e * n + r: those of a plane one after the other, geometry, constant band, motion, bands 1 to 3.
// Grid      one thread per row. A buffer that the group lacks is bound to another, and not touched.
// Reads     sums of batch_add; ids, group-local and ascending.
// Writes    rows, as 64-bit integers with the low word first.
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
layout(set = 0, binding = 1) restrict writeonly buffer Rows { uvec2 rows[]; };
layout(set = 0, binding = 2) restrict readonly buffer SumsGeometry { uvec4 sums_geometry[]; };
layout(set = 0, binding = 3) restrict readonly buffer SumsSh0 { uvec4 sums_sh0[]; };
layout(set = 0, binding = 4) restrict readonly buffer SumsMotion { uvec4 sums_motion[]; };
layout(set = 0, binding = 5) restrict readonly buffer SumsSh1 { uvec4 sums_sh1[]; };
layout(set = 0, binding = 6) restrict readonly buffer SumsSh2 { uvec4 sums_sh2[]; };
layout(set = 0, binding = 7) restrict readonly buffer SumsSh3 { uvec4 sums_sh3[]; };

// Planes of a buffer, none where the group lacks it. The loop is one that lavapipe skips; an `if` is not.
#define COPY(sums, planes)                                                      \
    for (uint p = 0u; p < (planes); ++p) {                                      \
        const uint place = plane_index(i, 2u * (planes), 2u * p);               \
        const uvec4 low = sums[place], high = sums[place + 32u];                \
        for (uint c = 0u; c < 4u; ++c) rows[(e + c) * n + r] = uvec2(low[c], high[c]); \
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
