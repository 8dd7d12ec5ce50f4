// SPDX-License-Identifier: MIT OR Apache-2.0
// Purpose   cuts the crop out of picture and truth and scales both as LPIPS's trunk wants them.
// Equation  f = (gain x + offset - shift) / scale; LPIPS is made for 2 x - 1.
// Grid      one thread per pixel of the crop.
// Writes    features and truth_features: 3 channels and a 0 per pixel.
// Numerics  where the mask hides a pixel the picture takes the truth's colour, bit for bit.
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
    float gain;
    float offset;
} pc;
layout(set = 0, binding = 0) restrict readonly buffer Image { vec4 image[]; };
layout(set = 0, binding = 1) restrict readonly buffer Truth { uint truth[]; };
layout(set = 0, binding = 2) restrict writeonly buffer Features { vec4 features[]; };
layout(set = 0, binding = 3) restrict writeonly buffer TruthFeatures { vec4 truth_features[]; };

vec4 scaled(vec3 color) {
    precise vec3 f = (pc.gain * color + pc.offset - LPIPS_SHIFT) / LPIPS_SCALE;
    return vec4(f, 0.0);
}

void main() {
    const uint i = linear_thread(gl_WorkGroupSize.x);
    if (i >= pc.crop_width * pc.crop_height) return;
    const uint pixel = (pc.first_y + i / pc.crop_width) * pc.width + pc.first_x + i % pc.crop_width;
    const vec4 y = unpack_truth(truth[pixel]);
    features[i] = scaled(visible_color(image[pixel].xyz, y));
    truth_features[i] = scaled(y.xyz);
}
