// SPDX-License-Identifier: MIT OR Apache-2.0
// Purpose   filters the moments of picture and truth along the rows.
// Equation  E[x], E[y], E[x x + y y], E[x y] per channel under SSIM's window (SPEC 4).
// Grid      one thread per RUN places of a row: all pixels, or every STRIDE-th.
// Writes    moments, by place: the four of the three channels in 3 vec4; rows are all there.
// Numerics  colours lie in [0, 1] or near it; the variances' cancellation is met by the columns' clamp. SSIM asks for the
//           sum of the variances alone. Where x = y that of the squares is twice the product's, bit for bit.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "grid.glsl"
#include "ssim.glsl"

layout(local_size_x = 64) in;

layout(push_constant) uniform Push { uint width; uint height; } pc;
layout(set = 0, binding = 0) restrict readonly buffer Image { vec4 image[]; };
layout(set = 0, binding = 1) restrict readonly buffer Truth { uint truth[]; };
layout(set = 0, binding = 2) restrict writeonly buffer Moments { vec4 moments[]; };

void main() {
    const uint places = div_ceil(pc.width, STRIDE);
    const uint runs = div_ceil(places, RUN);
    const uint i = linear_thread(gl_WorkGroupSize.x);
    if (i >= runs * pc.height) return;
    const uint row = i / runs;
    const uint first = (i % runs) * RUN;
    vec3 x[RUN];
    vec3 y[RUN];
    precise vec3 squares[RUN];
    precise vec3 products[RUN];
    for (uint k = 0u; k < RUN; ++k) {
        x[k] = y[k] = squares[k] = products[k] = vec3(0.0);
    }
    for (uint t = 0u; t < RUN_LOADS; ++t) {
        const int column = int(STRIDE * first + t) - int(SSIM_RADIUS);
        const bool inside = column >= 0 && column < int(pc.width);
        const uint pixel = row * pc.width + uint(clamp(column, 0, int(pc.width) - 1));
        const vec4 b = unpack_truth(truth[pixel]);
        const vec3 a = visible_color(image[pixel].xyz, b);
        for (uint k = 0u; k < RUN; ++k) {
            if (t >= STRIDE * k && t - STRIDE * k <= 2u * SSIM_RADIUS) {
                const float w = inside ? SSIM_WINDOW[t - STRIDE * k] : 0.0;
                precise vec3 wa = w * a;
                precise vec3 wb = w * b.xyz;
                x[k] += wa;
                y[k] += wb;
                squares[k] += wa * a + wb * b.xyz;
                products[k] += wa * b.xyz;
            }
        }
    }
    for (uint k = 0u; k < RUN; ++k) {
        if (first + k < places) {
            const uint at = 3u * (row * places + first + k);
            moments[at] = vec4(x[k], y[k].x);
            moments[at + 1u] = vec4(y[k].yz, squares[k].xy);
            moments[at + 2u] = vec4(squares[k].z, products[k]);
        }
    }
}
