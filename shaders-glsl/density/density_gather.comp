// SPDX-License-Identifier: MIT OR Apache-2.0
// Purpose   carries numbers of an old group of Gaussians to a new one, in the order of the list of sources.
// Equation  out[i] = in[source of i] where the mask of its kind is set, else 0.
// Grid      one thread per vec4 of the new buffer; one dispatch per pair of groups, each serving its own sources.
// Numerics  moves bits, which need not be those of floats; the padding of the last block becomes 0.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "grid.glsl"
#include "density.glsl"

layout(local_size_x = 64) in;

layout(push_constant) uniform Push {
    vec4 as_it_was;   // masks: which components a Gaussian keeps that stays as it was,
    vec4 child;       // and any other
    uint size;        // of the new buffer
    uint planes;
    uint n;           // Gaussians of the new group
    uint start;       // its first in the list of sources
    uint old_first;   // flat index of the old group's first
    uint old_n;
    uint faded;       // the first planes, whose last component none keeps
} pc;
layout(set = 0, binding = 0) restrict readonly buffer Sources { uint sources[]; };
layout(set = 0, binding = 1) restrict readonly buffer Old { uvec4 old[]; };
layout(set = 0, binding = 2) restrict writeonly buffer Gathered { uvec4 gathered[]; };

void main() {
    const uint at = linear_thread(gl_WorkGroupSize.x);
    if (at >= pc.size) return;
    const uint plane = (at >> 5u) % pc.planes;
    const uint i = (at >> 5u) / pc.planes * 32u + (at & 31u);
    if (i >= pc.n) {
        gathered[at] = uvec4(0u);
        return;
    }
    const uint word = sources[pc.start + i];
    const uint from = source_of(word) - pc.old_first;
    if (from >= pc.old_n) return;
    vec4 mask = kind_of(word) == AS_IT_WAS ? pc.as_it_was : pc.child;
    if (plane < pc.faded) mask.w = 0.0;
    gathered[at] = mix(uvec4(0u), old[plane_index(from, pc.planes, plane)], notEqual(mask, vec4(0.0)));
}
