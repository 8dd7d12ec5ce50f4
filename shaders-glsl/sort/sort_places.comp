// SPDX-License-Identifier: MIT OR Apache-2.0
// Purpose   replaces each block's count of a digit by the place that the first of these keys is sorted to.
// Equation  keys with a smaller digit + keys with this digit in earlier blocks.
// Grid      one subgroup per digit, whose counts it walks over, a few consecutive ones per lane.
// Numerics  integers only.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_KHR_shader_subgroup_arithmetic : require
#include "grid.glsl"
#include "args.glsl"

layout(local_size_x = 64) in;

layout(set = 0, binding = 0) restrict readonly buffer Count { uint count[]; };
layout(set = 0, binding = 1) restrict readonly buffer Histogram { uint histogram[]; };
layout(set = 0, binding = 2) restrict buffer Digits { uint digits[]; };

void main() {
    const uint n_blocks = div_ceil(count[0], SORT_BLOCK);
    const uint lane = gl_SubgroupInvocationID;
    const uint digit = linear_group() * (64u / gl_SubgroupSize) + gl_SubgroupID;
    uint smaller = 0u;
    for (uint d = 0u; d < 256u; d += gl_SubgroupSize) smaller += d + lane < digit ? histogram[d + lane] : 0u;
    uint running = subgroupAdd(smaller);
    for (uint first = 0u; first < n_blocks; first += 4u * gl_SubgroupSize) {
        const uint block = first + 4u * lane;
        uint own[4];
        uint sum = 0u;
        for (uint k = 0u; k < 4u; ++k) {
            own[k] = block + k < n_blocks ? digits[digit * n_blocks + block + k] : 0u;
            sum += own[k];
        }
        uint place = running + subgroupExclusiveAdd(sum);
        for (uint k = 0u; k < 4u; ++k) {
            if (block + k < n_blocks) digits[digit * n_blocks + block + k] = place;
            place += own[k];
        }
        running += subgroupAdd(sum);
    }
}
