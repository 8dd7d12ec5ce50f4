// SPDX-License-Identifier: MIT OR Apache-2.0
// Purpose   lists where each new Gaussian comes from when the dead are relocated: the living stay, the dead and the new
//           become copies.
// Equation  none.
// Grid      one thread per flat index, then one per new Gaussian.
// Writes    source words and storage codes, in flat order, the new ones last; the number of each bucket.
// Numerics  integers only. A living one that was copied is a copy itself: it shares its opacity and loses its moments.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "grid.glsl"
#include "density.glsl"

layout(local_size_x = 128) in;

// n_old: Gaussians, without the gaps.
layout(push_constant) uniform Push { uint n; uint n_new; uint n_old; } pc;
layout(set = 0, binding = 0) restrict readonly buffer Flags { uint flags[]; };
layout(set = 0, binding = 1) restrict readonly buffer Offsets { uint offsets[]; };
layout(set = 0, binding = 2) restrict readonly buffer Codes { uint codes[]; };
layout(set = 0, binding = 3) restrict readonly buffer Targets { uint targets[]; };
layout(set = 0, binding = 4) restrict readonly buffer Copies { uint copies[]; };
layout(set = 0, binding = 5) restrict writeonly buffer Sources { uint sources[]; };
layout(set = 0, binding = 6) restrict writeonly buffer SourceCodes { uint source_codes[]; };
layout(set = 0, binding = 7) restrict buffer Counters { uint counters[]; };

void main() {
    const uint i = linear_thread(gl_WorkGroupSize.x);
    const uint n_threads = pc.n + pc.n_new;
    if (i >= n_threads) return;
    const bool is_new = i >= pc.n;
    const uint old = min(i, pc.n - 1u);
    const bool listed = is_new || (i < pc.n && (flags[old] & EXISTS) != 0u);
    const uint origin = targets[i];
    const uint code = codes[origin];
    if (listed) {
        const uint at = is_new ? pc.n_old + (i - pc.n) : offsets[old];
        const bool untouched = origin == i && copies[origin] == 0u;
        sources[at] = source_word(origin, untouched ? AS_IT_WAS : COPY);
        source_codes[at] = code;
        atomicAdd(counters[N_BUCKET + (code >> CODE_BUCKET)], 1u);
    }
}
