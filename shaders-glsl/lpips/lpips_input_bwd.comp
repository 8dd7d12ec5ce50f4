// SPDX-License-Identifier: MIT OR Apache-2.0
// Purpose   adds the cotangent of LPIPS's input to that of the picture.
// Equation  dL/dx += weight mask 2 / scale dL/df.
// Grid      one thread per pixel of the crop.
// Reads     d_blocks: what the first layer's strides cover, `stride` pixels a side and 3 channels each, beginning `pad`
//           pixels before the crop.
// Writes    d_image: the colour's cotangent, added to what is there; alpha is left alone.
// Numerics  where the mask hides a pixel nothing is added.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "grid.glsl"
#include "ssim.glsl"
#include "lpips.glsl"

layout(local_size_x = 64) in;

layout(push_constant) uniform Push {
    uint width;
    uint first_x;
    uint first_y;
    uint crop_width;
    uint crop_height;
    uint blocks_x;
    uint stride;
    uint pad;
    float weight;
} pc;
layout(set = 0, binding = 0) restrict readonly buffer DBlocks { float d_blocks[]; };
layout(set = 0, binding = 1) restrict readonly buffer Truth { uint truth[]; };
layout(set = 0, binding = 2) restrict buffer DImage { vec4 d_image[]; };

void main() {
    const uint i = linear_thread(gl_WorkGroupSize.x);
    if (i >= pc.crop_width * pc.crop_height) return;
    const uvec2 crop = uvec2(i % pc.crop_width, i / pc.crop_width);
    const uint pixel = (pc.first_y + crop.y) * pc.width + pc.first_x + crop.x;
    const uvec2 block = (crop + pc.pad) / pc.stride;
    const uvec2 within = (crop + pc.pad) % pc.stride;
    const uint at = 3u * (((block.y * pc.blocks_x + block.x) * pc.stride + within.y) * pc.stride + within.x);
    const vec3 d = vec3(d_blocks[at], d_blocks[at + 1u], d_blocks[at + 2u]);
    const float visible = unpack_truth(truth[pixel]).w;
    d_image[pixel] += vec4(pc.weight * visible * 2.0 / LPIPS_SCALE * d, 0.0);
}
