// SPDX-License-Identifier: MIT OR Apache-2.0
// Purpose   rounds a band of spherical harmonics to halves, for projection to read.
// Equation  none.
// Grid      one thread per vec4.
// Numerics  numbers beyond a half's range become its largest, 65,504, zero stays zero with its sign, and what is not finite
//           stays so, so that its Gaussian is not drawn. The parameters themselves keep their bits.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "grid.glsl"
#include "finite.glsl"

layout(local_size_x = 64) in;

const float LARGEST = 65504.0;

layout(push_constant) uniform Push { uint n; } pc;
layout(set = 0, binding = 0) restrict readonly buffer Band { vec4 band[]; };
layout(set = 0, binding = 1) restrict writeonly buffer Halves { uvec2 halves[]; };

uint half_pair(vec2 x) {
    // Infinity in all its bits: what packHalf2x16 makes of what is not finite is the driver's choice.
    const uvec2 words = uvec2(packHalf2x16(vec2(clamp(x.x, -LARGEST, LARGEST), 0.0)),
        packHalf2x16(vec2(clamp(x.y, -LARGEST, LARGEST), 0.0)));
    return (finite(x.x) ? words.x : 0x7c00u) | (finite(x.y) ? words.y : 0x7c00u) << 16u;
}

void main() {
    const uint i = linear_thread(gl_WorkGroupSize.x);
    if (i >= pc.n) return;
    const vec4 x = band[i];
    halves[i] = uvec2(half_pair(x.xy), half_pair(x.zw));
}
