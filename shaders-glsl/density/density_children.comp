// SPDX-License-Identifier: MIT OR Apache-2.0
// Purpose   writes the geometry of a new group of Gaussians: those that stay, clones, halves of splits, and copies that
//           share the opacity of the one they were drawn from.
// Equation  half: p + R diag(e^s) N(0, 1), s - ln 1.6 (3DGS). One of N copies: 1 - (1 - o')^N = o, and the standard
//           deviations times o / D, D = sum_i sum_k C(i-1, k) (-1)^k o'^(k+1) / sqrt(k+1) for i = 1 .. N, k < i
//           (3DGS-MCMC). With 1 / sqrt(k+1) as the integral of e^(-(k+1) x^2) over sqrt(pi), both sums close:
//           D = 1 / sqrt(pi) times the integral of 1 - (1 - o' e^(-x^2))^N.
// Grid      one thread per new Gaussian; one dispatch per pair of groups, each serving its own sources.
// Numerics  all terms of D are positive and the integrand is entire, so 18 points of the trapezoidal rule give it to
//           1e-8 for any N and o below 1 - 1e-7; the double sum cancels in f32. Opacities are carried as -ln(1 - o).
#version 460
#extension GL_GOOGLE_include_directive : require
#include "grid.glsl"
#include "unit.glsl"
#include "rotation.glsl"
#include "random.glsl"
#include "density.glsl"

layout(local_size_x = 64) in;

// ceiling: opacity logit that none exceeds.
layout(push_constant) uniform Push { uint n; uint start; uint old_first; uint old_n; uint key; float ceiling; } pc;
layout(set = 0, binding = 0) restrict readonly buffer Sources { uint sources[]; };
layout(set = 0, binding = 1) restrict readonly buffer Copies { uint copies[]; };
layout(set = 0, binding = 2) restrict readonly buffer Old { vec4 old[]; };
layout(set = 0, binding = 3) restrict writeonly buffer Geometry { vec4 geometry[]; };

const uint POINTS = 18u;
const float STEP = 0.25;
const float LOG_SHRINK = 0.47000363;  // ln 1.6

// ln(1 + x) for x in 0 .. 1, also where 1 + x rounds to 1: 2 artanh(x / (2 + x)).
float log_1p(float x) {
    const float z = x / (2.0 + x);
    const float y = z * z;
    return 2.0 * z * (1.0 + y * (1.0 / 3.0 + y * (1.0 / 5.0 + y * (1.0 / 7.0 + y * (1.0 / 9.0
        + y * (1.0 / 11.0 + y * (1.0 / 13.0)))))));
}

// 1 - e^-x for x >= 0, also where e^-x rounds to 1.
float one_minus_exp(float x) {
    const float series = x * (1.0 - x / 2.0 * (1.0 - x / 3.0 * (1.0 - x / 4.0 * (1.0 - x / 5.0 * (1.0 - x / 6.0)))));
    return x < 0.25 ? series : 1.0 - exp(-x);
}

// 1 - (1 - a)^n in sums of positive terms, n >= 1.
float union_of(float a, uint n) {
    float u = 0.0;
    for (int bit = findMSB(n); bit >= 0; --bit) {
        u = u * (2.0 - u);
        if (((n >> uint(bit)) & 1u) != 0u) u += a * (1.0 - u);
    }
    return u;
}

// Logit of the opacity of one of `n` copies, and the logarithm of the factor of its standard deviations.
vec2 shared_opacity(float logit, uint n) {
    // -ln(1 - o) = ln(1 + e^logit), and that of a copy.
    const float all = max(logit, 0.0) + log_1p(exp(-abs(logit)));
    const float own = all / float(n);
    const float opacity = one_minus_exp(own);
    float sum = 0.5 * union_of(opacity, n);
    for (uint k = 1u; k < POINTS; ++k) {
        const float x = STEP * float(k);
        sum += union_of(opacity * exp(-x * x), n);
    }
    const float integral = 2.0 * STEP * 0.5641896 * sum;
    return vec2(log(opacity) + own, log(one_minus_exp(all) / integral));
}

void main() {
    const uint i = linear_thread(gl_WorkGroupSize.x);
    if (i >= div_ceil(pc.n, 32u) * 32u) return;
    if (i >= pc.n) {
        for (uint p = 0u; p < 3u; ++p) geometry[plane_index(i, 3u, p)] = vec4(0.0);
        return;
    }
    const uint word = sources[pc.start + i];
    const uint parent = source_of(word);
    const uint kind = kind_of(word);
    const uint from = parent - pc.old_first;
    if (from >= pc.old_n) return;
    vec4 mean_opacity = old[plane_index(from, 3u, 0u)];
    const vec4 q = old[plane_index(from, 3u, 1u)];
    vec4 scale_t = old[plane_index(from, 3u, 2u)];
    if (kind >= HALF_A) {
        float inverse_length;
        const mat3 turn = rotation_of(unit_quaternion(q, inverse_length));
        const vec3 normals = random_normals3(pc.key, parent, 4u * (kind - HALF_A));
        mean_opacity.xyz += turn * (exp(scale_t.xyz) * normals);
        scale_t.xyz -= LOG_SHRINK;
    }
    const uint n_copies = copies[parent];
    if (n_copies > 0u) {
        const vec2 share = shared_opacity(mean_opacity.w, n_copies + 1u);
        mean_opacity.w = share.x;
        scale_t.xyz += share.y;
    }
    mean_opacity.w = min(mean_opacity.w, pc.ceiling);
    geometry[plane_index(i, 3u, 0u)] = mean_opacity;
    geometry[plane_index(i, 3u, 1u)] = q;
    geometry[plane_index(i, 3u, 2u)] = scale_t;
}
