// SPDX-License-Identifier: MIT OR Apache-2.0
// Purpose   filters the moments along the columns, forms SSIM and its derivatives, and sums 1 - SSIM and the absolute error.
// Equation  S = (2 mx my + C1)(2 sxy + C2) / ((mx^2 + my^2 + C1)(sxx + syy + C2)); L1 = |x - y|.
// Grid      one thread per RUN places of a column, 64 neighbouring columns per workgroup. A place stands for STRIDE x STRIDE
//           pixels, at the first of which SSIM is taken.
// Writes    partials: dS/dE[x], dS/dE[xx], dS/dE[xy] per channel, 3 vec4 per place; sums: (1 - S, L1, squared error) per
//           workgroup, summed over places, pixels and channels in a fixed order.
// Numerics  sxx + syy = E[xx + yy] - (mx^2 + my^2) is clamped at 0, with zero derivative there.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "grid.glsl"
#include "ssim.glsl"

layout(local_size_x = 64) in;

layout(push_constant) uniform Push { uint width; uint height; } pc;
layout(set = 0, binding = 0) restrict readonly buffer Moments { vec4 moments[]; };
layout(set = 0, binding = 1) restrict readonly buffer Image { vec4 image[]; };
layout(set = 0, binding = 2) restrict readonly buffer Truth { uint truth[]; };
layout(set = 0, binding = 3) restrict writeonly buffer Partials { vec4 partials[]; };
layout(set = 0, binding = 4) restrict writeonly buffer Sums { vec4 sums[]; };

shared vec4 sh_sums[64];

void main() {
    const uint columns = div_ceil(pc.width, STRIDE);
    const uint rows = div_ceil(pc.height, STRIDE);
    const uint runs = div_ceil(rows, RUN);
    const uint i = linear_thread(gl_WorkGroupSize.x);
    const bool valid = i < runs * columns;
    const uint column = valid ? i % columns : 0u;
    const uint first = valid ? (i / columns) * RUN : 0u;
    vec4 m0[RUN];
    vec4 m1[RUN];
    vec4 m2[RUN];
    for (uint k = 0u; k < RUN; ++k) {
        m0[k] = m1[k] = m2[k] = vec4(0.0);
    }
    for (uint t = 0u; t < RUN_LOADS; ++t) {
        const int row = int(STRIDE * first + t) - int(SSIM_RADIUS);
        const bool inside = row >= 0 && row < int(pc.height);
        const uint at = 3u * (uint(clamp(row, 0, int(pc.height) - 1)) * columns + column);
        const vec4 a0 = moments[at];
        const vec4 a1 = moments[at + 1u];
        const vec4 a2 = moments[at + 2u];
        for (uint k = 0u; k < RUN; ++k) {
            if (t >= STRIDE * k && t - STRIDE * k <= 2u * SSIM_RADIUS) {
                const float w = inside ? SSIM_WINDOW[t - STRIDE * k] : 0.0;
                m0[k] += w * a0;
                m1[k] += w * a1;
                m2[k] += w * a2;
            }
        }
    }
    vec4 own = vec4(0.0);
    for (uint k = 0u; k < RUN; ++k) {
        if (valid && first + k < rows) {
            const uint place = (first + k) * columns + column;
            const vec3 mx = m0[k].xyz;
            const vec3 my = vec3(m0[k].w, m1[k].xy);
            precise vec3 means = mx * mx + my * my;
            precise vec3 variances = vec3(m1[k].zw, m2[k].x) - means;
            // Where the variances are rounding, so is the covariance.
            const vec3 varies = vec3(greaterThan(variances, vec3(0.0)));
            precise vec3 sxy = varies * (m2[k].yzw - mx * my);
            precise vec3 c = means + SSIM_C1;
            precise vec3 d = max(variances, vec3(0.0)) + SSIM_C2;
            precise vec3 p = (2.0 * mx * my + SSIM_C1) / c;
            precise vec3 q = (2.0 * sxy + SSIM_C2) / d;
            precise vec3 s = p * q;
            // With d and sxy held, then through d = E[xx + yy] - mx^2 - my^2 + C2 and sxy = E[xy] - mx my. Bracketed so that
            // everything cancels to 0, bit for bit, where picture and truth are equal.
            precise vec3 d_exx = -(s / d) * varies;
            precise vec3 d_exy = varies * (2.0 * (p / d));
            precise vec3 d_mx = 2.0 * (my * q - mx * s) / c - (2.0 * mx * d_exx + my * d_exy);
            partials[3u * place] = vec4(d_mx, d_exx.x);
            partials[3u * place + 1u] = vec4(d_exx.yz, d_exy.xy);
            partials[3u * place + 2u] = vec4(d_exy.z, 0.0, 0.0, 0.0);
            own.x += (1.0 - s.x) + (1.0 - s.y) + (1.0 - s.z);
            for (uint q = 0u; q < STRIDE * STRIDE; ++q) {
                const uvec2 at = uvec2(STRIDE * column + q % STRIDE, STRIDE * (first + k) + q / STRIDE);
                if (at.x < pc.width && at.y < pc.height) {
                    const uint pixel = at.y * pc.width + at.x;
                    const vec4 y = unpack_truth(truth[pixel]);
                    const vec3 error = abs(visible_color(image[pixel].xyz, y) - y.xyz);
                    own.yz += vec2(error.x + error.y + error.z, dot(error, error));
                }
            }
        }
    }
    sh_sums[gl_LocalInvocationIndex] = own;
    barrier();
    if (gl_LocalInvocationIndex == 0u && linear_group() < div_ceil(runs * columns, 64u)) {
        vec4 sum = vec4(0.0);
        for (uint k = 0u; k < 64u; ++k) sum += sh_sums[k];
        sums[linear_group()] = sum;
    }
}
