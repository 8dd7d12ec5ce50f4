// SPDX-License-Identifier: MIT OR Apache-2.0
// Purpose   turns the number of intersections into grids, and reports an overflow.
// Equation  none.
// Grid      one thread.
// Numerics  integers only; on overflow every later grid is empty, so nothing is drawn from a truncated list.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "types.glsl"
#include "grid.glsl"
#include "args.glsl"

layout(local_size_x = 1) in;

layout(push_constant) uniform Push { uint capacity; } pc;
layout(set = 0, binding = 0) restrict buffer NIntersections { uint n_intersections[]; };
layout(set = 0, binding = 1) restrict buffer Args { uvec4 args[]; };
layout(set = 0, binding = 2) restrict writeonly buffer EmitArgs { uvec4 emit_args[]; };
layout(set = 0, binding = 3) restrict buffer FrameStatus { Status status; };

void main() {
    const uint n = n_intersections[0];
    const bool fits = n <= pc.capacity && status.failed == 0u;
    status.n_intersections = n;
    status.capacity_intersections = pc.capacity;
    if (n > pc.capacity) status.failed |= FAILED_INTERSECTIONS;
    const uint used = fits ? n : 0u;
    n_intersections[0] = used;
    emit_args[0] = fits ? args[ARGS_THREADS] : fold(0u);
    args[ARGS_THREADS] = fold(div_ceil(used, 64u));
    args[ARGS_SORT] = fold(div_ceil(used, SORT_BLOCK));
}
