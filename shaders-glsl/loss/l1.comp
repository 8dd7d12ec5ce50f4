// SPDX-License-Identifier: MIT OR Apache-2.0
// Purpose   the absolute error alone, in the steps without SSIM: its cotangent and sums.
// Equation  L = (1 - lambda) mean|x - y|, as ssim_bwd.comp has it.
// Grid      one thread per pixel.
// Writes    d_image: the colour's cotangent, and 0 for alpha; sums: (0, L1, squared error, 0) per workgroup.
// Numerics  as ssim_bwd.comp; the sums have a fixed order.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "grid.glsl"
#include "ssim.glsl"

layout(local_size_x = 64) in;

layout(push_constant) uniform Push { uint n; float l1_weight; } pc;
layout(set = 0, binding = 0) restrict readonly buffer Image { vec4 image[]; };
layout(set = 0, binding = 1) restrict readonly buffer Truth { uint truth[]; };
layout(set = 0, binding = 2) restrict writeonly buffer DImage { vec4 d_image[]; };
layout(set = 0, binding = 3) restrict writeonly buffer Sums { vec4 sums[]; };

shared vec2 sh_sums[64];

void main() {
    const uint i = linear_thread(gl_WorkGroupSize.x);
    const bool valid = i < pc.n;
    const uint pixel = valid ? i : 0u;
    const vec4 y = unpack_truth(truth[pixel]);
    const vec3 x = visible_color(image[pixel].xyz, y);
    const vec3 error = abs(x - y.xyz);
    if (valid) d_image[pixel] = vec4(y.w * (pc.l1_weight * sign(x - y.xyz)), 0.0);
    sh_sums[gl_LocalInvocationIndex] = valid ? vec2(error.x + error.y + error.z, dot(error, error)) : vec2(0.0);
    barrier();
    if (gl_LocalInvocationIndex == 0u && linear_group() < div_ceil(pc.n, 64u)) {
        vec2 sum = vec2(0.0);
        for (uint k = 0u; k < 64u; ++k) sum += sh_sums[k];
        sums[linear_group()] = vec4(0.0, sum, 0.0);
    }
}
