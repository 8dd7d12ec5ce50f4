// SPDX-License-Identifier: MIT OR Apache-2.0
// Purpose   lists where each new Gaussian comes from: who is kept, the copy of a clone, the halves of a split.
// Equation  none (stream compaction with up to two entries each).
// Grid      one thread per flat index.
// Writes    source words and storage codes, in flat order; counters.
// Numerics  integers only.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_KHR_shader_subgroup_arithmetic : require
#include "grid.glsl"
#include "density.glsl"

layout(local_size_x = 128) in;

layout(push_constant) uniform Push { uint n; } pc;
layout(set = 0, binding = 0) restrict readonly buffer Flags { uint flags[]; };
layout(set = 0, binding = 1) restrict readonly buffer Offsets { uint offsets[]; };
layout(set = 0, binding = 2) restrict readonly buffer Codes { uint codes[]; };
layout(set = 0, binding = 3) restrict writeonly buffer Sources { uint sources[]; };
layout(set = 0, binding = 4) restrict writeonly buffer SourceCodes { uint source_codes[]; };
layout(set = 0, binding = 5) restrict buffer Counters { uint counters[]; };

void main() {
    const uint i = linear_thread(gl_WorkGroupSize.x);
    // Whole workgroups leave here: n is a multiple of 128.
    if (i >= pc.n) return;
    const uint flag = flags[i];
    const uint code = codes[i];
    const uint at = offsets[i];
    const bool kept = (flag & KEPT) != 0u;
    const bool grows = (flag & GROWS) != 0u;
    const bool splits = grows && (flag & LARGE) != 0u;
    if (kept) {
        sources[at] = source_word(i, splits ? HALF_A : AS_IT_WAS);
        source_codes[at] = code;
    }
    if (grows) {
        sources[at + 1u] = source_word(i, splits ? HALF_B : COPY);
        source_codes[at + 1u] = code;
    }
    if (kept) atomicAdd(counters[N_BUCKET + (code >> CODE_BUCKET)], 1u + uint(grows));
    const uint n_cloned = subgroupAdd(uint(grows && !splits));
    const uint n_split = subgroupAdd(uint(splits));
    if (gl_SubgroupInvocationID == 0u) {
        atomicAdd(counters[N_CLONED], n_cloned);
        atomicAdd(counters[N_SPLIT], n_split);
    }
}
