// SPDX-License-Identifier: MIT OR Apache-2.0
// Purpose   turns the number of active Gaussians into grids, and finds each group's range in the active list.
// Equation  none.
// Grid      one workgroup; one thread per group.
// Writes    args: ARGS_* below, then one per group for its active Gaussians and one per group for the others; ranges:
//           [first, last) per group.
// Numerics  integers only; when the active list overflows, no grid has work to do and `failed` says so.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "types.glsl"
#include "grid.glsl"
#include "args.glsl"

layout(local_size_x = 64) in;

layout(push_constant) uniform Push { uint n_groups; uint capacity; uint n_blocks; } pc;
layout(set = 0, binding = 0) restrict buffer NActive { uint n_active[]; };
layout(set = 0, binding = 1) restrict readonly buffer Offsets { uint offsets[]; };
layout(set = 0, binding = 2) restrict readonly buffer GroupFirst { uint group_first[]; };
layout(set = 0, binding = 3) restrict writeonly buffer Ranges { uvec2 ranges[]; };
layout(set = 0, binding = 4) restrict writeonly buffer Args { uvec4 args[]; };
layout(set = 0, binding = 5) restrict buffer FrameStatus { Status status; };

void main() {
    const uint n = n_active[0];
    const bool fits = n <= pc.capacity;
    barrier();
    const uint used = fits ? n : 0u;
    for (uint g = gl_LocalInvocationIndex; g < pc.n_groups; g += 64u) {
        const uint first = offsets[group_first[g]];
        const uint last = g + 1u < pc.n_groups ? offsets[group_first[g + 1u]] : n;
        ranges[g] = fits ? uvec2(first, last) : uvec2(0u);
        args[ARGS_FIRST_GROUP + g] = fold(fits ? div_ceil(last - first, 64u) : 0u);
        const uint blocks = (g + 1u < pc.n_groups ? group_first[g + 1u] : pc.n_blocks) - group_first[g];
        args[ARGS_FIRST_GROUP + pc.n_groups + g] = fold(fits ? div_ceil(blocks * 128u - (last - first), 64u) : 0u);
    }
    if (gl_LocalInvocationIndex == 0u) {
        status.n_active = n;
        status.capacity_active = pc.capacity;
        if (!fits) status.failed |= FAILED_ACTIVE;
        n_active[0] = used;
        args[ARGS_THREADS] = fold(div_ceil(used, 64u));
        args[ARGS_SCAN] = fold(max(div_ceil(used, SCAN_BLOCK), 1u));
        args[ARGS_SORT] = fold(div_ceil(used, SORT_BLOCK));
    }
}
