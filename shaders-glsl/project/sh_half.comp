// SPDX-License-Identifier: MIT OR Apache-2.0
// Purpose   rounds a band of spherical harmonics to halves, for projection to read.
// Equation  none.
// Grid      one workgroup per block of 128 Gaussians of a group: the listed ones, or all.
// Numerics  numbers beyond a half's range become its largest, 65,504, zero stays zero with its sign, and what is not finite
//           stays so, so that its Gaussian is not drawn. The parameters themselves keep their bits.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_KHR_shader_subgroup_ballot : require
#include "unfolded.glsl"
#include "grid.glsl"
#include "finite.glsl"

layout(local_size_x = 128) in;

const float LARGEST = 65504.0;

// n: blocks. size: vec4s of the band, `planes` per Gaussian.
layout(push_constant) uniform Push { uint n; uint size; uint planes; uint is_listed; } pc;
layout(set = 0, binding = 0) restrict readonly buffer Band { vec4 band[]; };
layout(set = 0, binding = 1) restrict writeonly buffer Halves { uvec2 halves[]; };
layout(set = 0, binding = 2) restrict readonly buffer Live { uint live[]; };
layout(set = 0, binding = 3) restrict readonly buffer LiveArgs { uint live_args[]; };
#include "live.glsl"

uint half_pair(vec2 x) {
    // Infinity in all its bits: what packHalf2x16 makes of what is not finite is the driver's choice.
    const uvec2 words = uvec2(packHalf2x16(vec2(clamp(x.x, -LARGEST, LARGEST), 0.0)),
        packHalf2x16(vec2(clamp(x.y, -LARGEST, LARGEST), 0.0)));
    return (finite(x.x) ? words.x : 0x7c00u) | (finite(x.y) ? words.y : 0x7c00u) << 16u;
}

void main() {
    const uint block = block_at(linear_group(), pc.n, pc.is_listed);
    if (block == NO_BLOCK) return;
    // 128 Gaussians have their planes in one piece.
    for (uint plane = 0u; plane < unfolded(pc.planes); ++plane) {
        const uint i = (block * pc.planes + plane) * 128u + gl_LocalInvocationIndex;
        if (i < pc.size) {
            const vec4 x = band[i];
            halves[i] = uvec2(half_pair(x.xy), half_pair(x.zw));
        }
    }
}
