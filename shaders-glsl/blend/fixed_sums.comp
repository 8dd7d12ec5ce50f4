// SPDX-License-Identifier: MIT OR Apache-2.0
// Purpose   turns sums in fixed point into floats.
// Equation  x = word / scale.
// Grid      one thread per active Gaussian.
// Numerics  a Gaussian one of whose terms or sums was out of range gets NaN, which the projection's adjoint counts and leaves out.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "grid.glsl"
#include "finite.glsl"
#include "fixed.glsl"

layout(local_size_x = 64) in;

layout(push_constant) uniform Push { float inverse_scale; } pc;
layout(set = 0, binding = 0) restrict readonly buffer Count { uint count[]; };
layout(set = 0, binding = 1) restrict readonly buffer Words { uint words[]; };
layout(set = 0, binding = 2) restrict writeonly buffer DSlots { vec2 d_slots[]; };

float value(uint at, bool exceeds) {
    const float x = from_fixed(uvec2(words[at], words[at + 1u])) * pc.inverse_scale;
    return exceeds ? uintBitsToFloat(0x7fc00000u) : x;
}

void main() {
    const uint i = linear_thread(gl_WorkGroupSize.x);
    if (i >= count[0]) return;
    const uint first = FIXED_WORDS * i;
    const uint at = first + FIXED_WEIGHT;
    const bool exceeds = fixed_exceeds(uvec2(words[at], words[at + 1u]));
    for (uint c = 0u; c < 6u; ++c) {
        d_slots[6u * i + c] = vec2(value(first + 4u * c, exceeds), value(first + 4u * c + 2u, exceeds));
    }
}
