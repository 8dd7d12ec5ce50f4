// SPDX-License-Identifier: MIT OR Apache-2.0
// Purpose   adds the active Gaussians' gradients of the camera.
// Equation  none.
// Grid      64 workgroups; a thread adds those of a word of 32 Gaussians, and goes on to the word 4,096 further.
// Writes    partials, three vec4 per workgroup: rotation and time, translation; the third is left alone.
// Numerics  partial sums whose order is that of the flat index: the same bits in every run, whatever else is active with
//           gradients of 0.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "grid.glsl"

layout(local_size_x = 64) in;

// n: words of Bits.
layout(push_constant) uniform Push { uint n; } pc;
layout(set = 0, binding = 0) restrict readonly buffer Count { uint count[]; };
layout(set = 0, binding = 1) restrict readonly buffer Bits { uint bits[]; };
layout(set = 0, binding = 2) restrict readonly buffer Offsets { uint offsets[]; };
layout(set = 0, binding = 3) restrict readonly buffer DCamera { vec4 d_camera[]; };
layout(set = 0, binding = 4) restrict writeonly buffer Partials { vec4 partials[]; };

shared vec4 sh_turn[64];
shared vec4 sh_shift[64];

void main() {
    const uint lane = gl_LocalInvocationIndex;
    const uint group = linear_group();
    vec4 turn = vec4(0.0);
    vec4 shift = vec4(0.0);
    for (uint word = group * 64u + lane; word < pc.n; word += 4096u) {
        // The rank of the word's first, as compact.comp has it.
        uint i = offsets[word >> 2u];
        for (uint w = word & ~3u; w < word; ++w) i += bitCount(bits[w]);
        const uint end = min(i + bitCount(bits[word]), count[0]);
        for (; i < end; ++i) {
            turn += d_camera[2u * i];
            shift += d_camera[2u * i + 1u];
        }
    }
    sh_turn[lane] = turn;
    sh_shift[lane] = shift;
    barrier();
    if (lane == 0u && group < 64u) {
        turn = vec4(0.0);
        shift = vec4(0.0);
        for (uint k = 0u; k < 64u; ++k) {
            turn += sh_turn[k];
            shift += sh_shift[k];
        }
        partials[3u * group] = turn;
        partials[3u * group + 1u] = shift;
    }
}
