// SPDX-License-Identifier: MIT OR Apache-2.0
// Purpose   convolves feature maps: forward with bias and ReLU, or a cotangent back to the maps it came from.
// Equation  y[p, o] = sum over taps t and channels c of w[t, c, o] x[stride p + t - pad, c]; zeros outside. Going back, w
//           holds the flipped kernel, and `stride` is 1: the host turns a stride into that many channels a side.
// Grid      one subgroup per PIXELS pixels and BLOCKS channels per lane: lanes are output channels, and load the input
//           together, four lanes to a pixel.
// Reads     features: pixels of `in_planes` vec4; weights: per tap and 16 channels of it, four vec4 of each output.
// Writes    maps: `out_channels` from `out_first` on, of pixels of `out_stride` floats. Going back they are 0 where the
//           maps that went forward are not above 0, and added to what is there where `add` says so.
// Numerics  one sum a lane, in the order of the weights: the same bits in every run. ReLU lets NaN through.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_KHR_shader_subgroup_ballot : require
#extension GL_KHR_shader_subgroup_basic : require
#extension GL_KHR_shader_subgroup_shuffle : require
#include "unfolded.glsl"
#include "grid.glsl"

layout(local_size_x = 64) in;

layout(push_constant) uniform Push {
    uint in_width;
    uint in_height;
    uint in_planes;
    uint in_first;  // the first vec4 that is read
    uint out_width;
    uint out_height;
    uint out_channels;
    uint out_stride;
    uint out_first;
    uint columns;   // taps across; a run may hold several
    uint run;       // vec4 of a tap, a multiple of 4; the weights of what a pixel does not have are 0
    uint steps;     // of 4 vec4, in all taps
    uint stride;
    uint pad;
    uint add;
    uint mask;
} pc;
layout(set = 0, binding = 0) restrict readonly buffer Features { vec4 features[]; };
layout(set = 0, binding = 1) restrict readonly buffer Weights { vec4 weights[]; };
#ifdef BACKWARD
layout(set = 0, binding = 2) restrict readonly buffer Forward { float forward[]; };
layout(set = 0, binding = 3) restrict buffer Maps { float maps[]; };
#else
layout(set = 0, binding = 2) restrict readonly buffer Bias { float bias[]; };
layout(set = 0, binding = 3) restrict writeonly buffer Maps { float maps[]; };
#endif

const uint PIXELS = 16u;
const uint BLOCKS = 2u;
// Lanes of a subgroup, and pixels of one load, four lanes each. GPUs have their own kernels: where the width is not known, the lane
// and the load that a pixel is in are not either, and a compiler keeps all loads in memory.
#ifdef LANES
const uint WIDTH = LANES;
const uint PER_LOAD = min(LANES / 4u, PIXELS);
#else
#define WIDTH gl_SubgroupSize
#define PER_LOAD min(gl_SubgroupSize / 4u, PIXELS)
#endif

void main() {
    const uint lane = gl_SubgroupInvocationID;
    const uint n_pixels = pc.out_width * pc.out_height;
    const uint across = div_ceil(n_pixels, PIXELS);
    const uint unit = linear_group() * gl_NumSubgroups + gl_SubgroupID;
    if (unit >= across * div_ceil(pc.out_channels, BLOCKS * WIDTH)) return;
    // Neighbouring units share weights, which are the larger part of what is read.
    const uint first = unit % across * PIXELS;
    uint channel[BLOCKS];
    uint column_of[BLOCKS];
    for (uint b = 0u; b < BLOCKS; ++b) {
        channel[b] = (unit / across * BLOCKS + b) * WIDTH + lane;
        column_of[b] = min(channel[b], pc.out_channels - 1u);
    }

    // Where this lane loads; subgroups of more than four lanes a pixel would load some twice.
    const uint per_load = PER_LOAD;
    const uint n_loads = PIXELS / per_load;
    const int row_planes = int(pc.in_width * pc.in_planes);
    int row[PIXELS];
    int plane[PIXELS];
    for (uint l = 0u; l < n_loads; ++l) {
        const uint pixel = min(first + l * per_load + lane / 4u % per_load, n_pixels - 1u);
        row[l] = int(pixel / pc.out_width * pc.stride) - int(pc.pad);
        const int column = int(pixel % pc.out_width * pc.stride) - int(pc.pad);
        plane[l] = column * int(pc.in_planes) + int(pc.in_first + lane % 4u);
    }

    float sum[BLOCKS][PIXELS];
    for (uint b = 0u; b < BLOCKS; ++b) {
#ifdef BACKWARD
        const float start = 0.0;
#else
        const float start = bias[column_of[b]];
#endif
        for (uint q = 0u; q < PIXELS; ++q) sum[b][q] = start;
    }
    const uint steps = unfolded(pc.steps);
    uint step = 0u;
    uint tap_column = 0u;
    int tap_row = 0;
    uint along = 0u;
    // One loop, and of this form: lavapipe runs the body of any other once more than its count.
    do {
        const int offset = int(tap_column * pc.in_planes + along);
        vec4 loaded[PIXELS];
        for (uint l = 0u; l < n_loads; ++l) {
            const int y = row[l] + tap_row;
            const int x = plane[l] + offset;
            const bool inside = y >= 0 && y < int(pc.in_height) && x >= 0 && x < row_planes;
            const vec4 value = features[inside ? y * row_planes + x : 0];
            loaded[l] = inside ? value : vec4(0.0);
        }
        for (uint c = 0u; c < 4u; ++c) {
            vec4 w[BLOCKS];
            for (uint b = 0u; b < BLOCKS; ++b) w[b] = weights[(step * 4u + c) * pc.out_channels + column_of[b]];
            for (uint q = 0u; q < PIXELS; ++q) {
                const vec4 value = subgroupShuffle(loaded[q / per_load], q % per_load * 4u + c);
                for (uint b = 0u; b < BLOCKS; ++b) {
                    float s = sum[b][q];
                    s = fma(w[b].x, value.x, s);
                    s = fma(w[b].y, value.y, s);
                    s = fma(w[b].z, value.z, s);
                    s = fma(w[b].w, value.w, s);
                    sum[b][q] = s;
                }
            }
        }
        along += 4u;
        const bool tap_ends = along == pc.run;
        along = tap_ends ? 0u : along;
        tap_column += tap_ends ? 1u : 0u;
        const bool row_ends = tap_column == pc.columns;
        tap_column = row_ends ? 0u : tap_column;
        tap_row += row_ends ? 1 : 0;
    } while (++step < steps);

    for (uint b = 0u; b < BLOCKS; ++b) {
        for (uint q = 0u; q < PIXELS; ++q) {
            if (channel[b] < pc.out_channels && first + q < n_pixels) {
                const uint at = (first + q) * pc.out_stride + pc.out_first + channel[b];
                float s = sum[b][q];
#ifdef BACKWARD
                if (unfolded(pc.add) != 0u) s += maps[at];
                if (unfolded(pc.mask) != 0u) s = forward[at] > 0.0 ? s : 0.0;
                maps[at] = s;
#else
                maps[at] = s < 0.0 ? 0.0 : s;
#endif
            }
        }
    }
}
