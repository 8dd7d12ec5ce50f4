// SPDX-License-Identifier: MIT OR Apache-2.0
// Purpose   compares the features of picture and truth at one depth of LPIPS's trunk, and forms the cotangent.
// Equation  n(f) = f / sqrt(sum f^2 + eps); d = mean over pixels of sum over channels of w (n(x) - n(y))^2;
//           dd/dx = (h - n(x) (h . n(x))) / sqrt(sum x^2 + eps) with h = 2 w (n(x) - n(y)) / pixels.
// Grid      four threads per pixel, which share its channels.
// Writes    sums: one per workgroup, in the first number, from `first_sum` on; d_features: 0 where x is not above 0 (ReLU).
// Numerics  eps is inside the root, so where all features are dead value and cotangent are 0. `precise`: equal features
//           give exactly 0.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_KHR_shader_subgroup_basic : require
#extension GL_KHR_shader_subgroup_shuffle : require
#include "grid.glsl"

layout(local_size_x = 64) in;

layout(push_constant) uniform Push {
    uint pixels;     // that are compared: a part of the maps,
    uint columns;    // so many of each row,
    uint first;      // from this one on
    uint width;      // of the maps
    uint planes;
    uint first_sum;
    float per_pixel;
} pc;
layout(set = 0, binding = 0) restrict readonly buffer Features { vec4 features[]; };
layout(set = 0, binding = 1) restrict readonly buffer TruthFeatures { vec4 truth_features[]; };
layout(set = 0, binding = 2) restrict readonly buffer Linear { vec4 linear[]; };
layout(set = 0, binding = 3) restrict writeonly buffer Sums { vec4 sums[]; };
#ifdef BACKWARD
layout(set = 0, binding = 4) restrict writeonly buffer DFeatures { vec4 d_features[]; };
#endif

const float EPS = 1e-10;
const uint TEAM = 4u;

shared float sh_sums[64u / TEAM];

float team_sum(float x) {
    precise float pair = x + subgroupShuffleXor(x, 1u);
    precise float all = pair + subgroupShuffleXor(pair, 2u);
    return all;
}

void main() {
    const uint thread = gl_SubgroupID * gl_SubgroupSize + gl_SubgroupInvocationID;
    const uint pixel = linear_group() * (64u / TEAM) + thread / TEAM;
    const bool valid = pixel < pc.pixels;
    const uint at = valid ? pixel : 0u;
    const uint first = (pc.first + at / pc.columns * pc.width + at % pc.columns) * pc.planes;
    precise float x_square = 0.0;
    precise float y_square = 0.0;
    for (uint p = thread % TEAM; p < pc.planes; p += TEAM) {
        const vec4 x = features[first + p];
        const vec4 y = truth_features[first + p];
        x_square += x.x * x.x + x.y * x.y + x.z * x.z + x.w * x.w;
        y_square += y.x * y.x + y.y * y.y + y.z * y.z + y.w * y.w;
    }
    precise float x_scale = 1.0 / sqrt(team_sum(x_square) + EPS);
    precise float y_scale = 1.0 / sqrt(team_sum(y_square) + EPS);
    float value = 0.0;
    float along = 0.0;
    for (uint p = thread % TEAM; p < pc.planes; p += TEAM) {
        precise vec4 x = x_scale * features[first + p];
        precise vec4 y = y_scale * truth_features[first + p];
        precise vec4 difference = x - y;
        const vec4 h = linear[p] * difference;
        value += dot(h, difference);
        along += dot(h, x);
    }
    value = team_sum(value);
#ifdef BACKWARD
    along = team_sum(along);
    if (valid) {
        for (uint p = thread % TEAM; p < pc.planes; p += TEAM) {
            precise vec4 x = x_scale * features[first + p];
            precise vec4 y = y_scale * truth_features[first + p];
            precise vec4 difference = x - y;
            const vec4 d = 2.0 * pc.per_pixel * x_scale * (linear[p] * difference - along * x);
            d_features[first + p] = mix(vec4(0.0), d, greaterThan(x, vec4(0.0)));
        }
    }
#endif
    if (thread % TEAM == 0u) sh_sums[thread / TEAM] = valid ? value : 0.0;
    barrier();
    if (thread == 0u && linear_group() < div_ceil(pc.pixels, 64u / TEAM)) {
        float sum = 0.0;
        for (uint k = 0u; k < 64u / TEAM; ++k) sum += sh_sums[k];
        sums[pc.first_sum + linear_group()] = vec4(pc.per_pixel * sum, 0.0, 0.0, 0.0);
    }
}
