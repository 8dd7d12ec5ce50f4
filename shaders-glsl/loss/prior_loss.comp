// SPDX-License-Identifier: MIT OR Apache-2.0
// Purpose   compares depth and flow with their priors: cotangents and sums.
// Equation  SPEC 4: mean |D - D^| over the pixels with a prior, mean |F - F^| (end-point error) over those with one.
// Grid      one thread per pixel.
// Reads     priors, halves: of the depths, two pixels a word, and of the flows, a pixel a word. A picture without depths, or
//           without flows, has one word for all, of no prior: what is not finite is none. The mask of the truth.
// Writes    d_image1: the cotangents of depth, inverse depth and flow. sums: (depth error, end-point error, 0, 0) by workgroup.
// Numerics  no error has no derivative. The sums have a fixed order: the same bits in every run.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "grid.glsl"

layout(local_size_x = 64) in;

// The weights hold the numbers of pixels that the means are over.
layout(push_constant) uniform Push {
    uint n;
    uint is_metric;
    float depth_weight;
    float flow_weight;
    uint last_depth;
    uint last_flow;
} pc;
layout(set = 0, binding = 0) restrict readonly buffer Image1 { vec4 image1[]; };
layout(set = 0, binding = 1) restrict readonly buffer Truth { uint truth[]; };
layout(set = 0, binding = 2) restrict readonly buffer Depths { uint depths[]; };
layout(set = 0, binding = 3) restrict readonly buffer Flows { uint flows[]; };
layout(set = 0, binding = 4) restrict writeonly buffer DImage1 { vec4 d_image1[]; };
layout(set = 0, binding = 5) restrict writeonly buffer Sums { vec4 sums[]; };

shared vec2 sh_sums[64];

// By the exponent's bits.
bool finite_half(uint half_bits) { return (half_bits & 0x7c00u) != 0x7c00u; }

void main() {
    const uint i = linear_thread(gl_WorkGroupSize.x);
    const bool valid = i < pc.n;
    const uint pixel = valid ? i : 0u;
    const vec4 found = image1[pixel];
    const bool counts = valid && truth[pixel] >> 24u != 0u;
    const uint depth = (depths[min(pixel >> 1u, pc.last_depth)] >> (16u * (pixel & 1u))) & 0xffffu;
    const uint flow = flows[min(pixel, pc.last_flow)];
    const bool has_depth = counts && finite_half(depth);
    const bool has_flow = counts && finite_half(flow) && finite_half(flow >> 16u);
    const float depth_error = has_depth ? (pc.is_metric != 0u ? found.x : found.y) - unpackHalf2x16(depth).x : 0.0;
    const vec2 flow_error = has_flow ? found.zw - unpackHalf2x16(flow) : vec2(0.0);
    const float distance = length(flow_error);
    if (valid) {
        const float d_depth = pc.depth_weight * sign(depth_error);
        const vec2 d_flow = distance > 0.0 ? pc.flow_weight * (flow_error / distance) : vec2(0.0);
        d_image1[pixel] = vec4(pc.is_metric != 0u ? vec2(d_depth, 0.0) : vec2(0.0, d_depth), d_flow);
    }
    sh_sums[gl_LocalInvocationIndex] = vec2(abs(depth_error), distance);
    barrier();
    if (gl_LocalInvocationIndex == 0u && linear_group() < div_ceil(pc.n, 64u)) {
        vec2 sum = vec2(0.0);
        for (uint k = 0u; k < 64u; ++k) sum += sh_sums[k];
        sums[linear_group()] = vec4(sum, 0.0, 0.0);
    }
}
