// SPDX-License-Identifier: MIT OR Apache-2.0
// Purpose   adds up what a picture says of each Gaussian: how much would change without one of its parts, or with a new one.
// Equation  s = g . delta, g the gradient for the cotangents at hand and delta the step to the part's absence (or a unit of
//           what a static Gaussian lacks). With cotangents of random signs E[s s] = delta^T J^T J delta (Hutchinson 1989):
//           the Fisher information along delta. With the pictures' errors the sum of s is the loss's slope along it.
// Grid      one thread per Gaussian of the group.
// Writes    6 vec4 per Gaussian, the first three added to: (motion, bands 1 to 3), (all of it, constant band per unit of
//           colour, swell, pictures that see it), (velocity, ramp), colours of bands 1 to 3 in the mean over the cameras.
// Numerics  the picture is affine in an opacity and in colours, so these steps are exact; that of the motion is of first
//           order. A fading Gaussian's opacity is divided out of its gradient: its weight is at least alpha_min where it is active.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_KHR_shader_subgroup_ballot : require
#include "grid.glsl"
#include "temporal.glsl"
#include "sh.glsl"
#include "unfolded.glsl"

layout(local_size_x = 64) in;

layout(push_constant) uniform Push {
    uint n;
    float time;      // of the view, normalised
    float middle;    // of the clip
    float squares;   // 1: adds s s; 0: s
    uint n_cameras;
    float is_of_clip; // 1; 0 for a photograph, which has no time and says nothing of motion
} pc;
layout(set = 0, binding = 0) restrict readonly buffer Geometry { vec4 geometry[]; };
layout(set = 0, binding = 1) restrict readonly buffer DGeometry { vec4 d_geometry[]; };
layout(set = 0, binding = 2) restrict readonly buffer DSh0 { vec4 d_sh0[]; };
layout(set = 0, binding = 3) restrict buffer Sums { vec4 sums[]; };
// One interface for all variants.
layout(set = 0, binding = 4) restrict readonly buffer Motion { vec4 motion[]; };
layout(set = 0, binding = 5) restrict readonly buffer Sh1 { vec4 sh1[]; };
layout(set = 0, binding = 6) restrict readonly buffer Sh2 { vec4 sh2[]; };
layout(set = 0, binding = 7) restrict readonly buffer Sh3 { vec4 sh3[]; };
layout(set = 0, binding = 8) restrict readonly buffer DSh1 { vec4 d_sh1[]; };
layout(set = 0, binding = 9) restrict readonly buffer DSh2 { vec4 d_sh2[]; };
layout(set = 0, binding = 10) restrict readonly buffer DSh3 { vec4 d_sh3[]; };
layout(set = 0, binding = 11) restrict readonly buffer Cameras { vec4 cameras[]; };  // centre, weight; weights add up to 1

vec4 term(vec4 s) { return s * mix(vec4(1.0), s, pc.squares); }

void main() {
    const uint i = linear_thread(gl_WorkGroupSize.x);
    if (i >= pc.n) return;
    const uint at = plane_index(i, 3u, 0u);
    const uint to = plane_index(i, 6u, 0u);
    const vec3 d_mean = d_geometry[at].xyz;
    // o dL/do of the opacity that the picture saw: the logit's gradient is that times 1 - sigmoid.
    const float d_own = d_geometry[at].w / max(1.0 - sigmoid(geometry[at].w), 1e-6);
    const vec3 d_color = d_sh0[i].xyz / SH_0;

    const uint n_cameras = unfolded(pc.n_cameras);
    vec4 part = vec4(0.0);
    vec4 lack = vec4(0.0);
    float swell = 0.0;
#ifdef DYNAMIC
    // At rest where it is at the clip's middle, as opaque as in the mean over the clip.
    const vec4 v = motion[i];
    const float t_scale = geometry[at + 64u].w;
    const float weight = max(temporal_weight(v.w, t_scale, pc.time), 1e-6);
    float at_rest = 0.0;
    for (uint k = 0u; k < 8u; ++k) at_rest += 0.125 * temporal_weight(v.w, t_scale, 2.0 * pc.middle * (float(k) + 0.5) / 8.0);
    part.x = dot(d_mean, v.xyz) * (pc.middle - pc.time) + (at_rest / weight - 1.0) * d_own;
#else
    const float x = pc.time - pc.middle;
    lack = pc.is_of_clip * vec4(x * d_mean, x * d_own);
    swell = pc.is_of_clip * (x * x - 1.0 / 12.0) * d_own;
#endif
    // What a band is in the mean over the cameras goes into the constant band when it is dropped.
    vec3 mean1 = vec3(0.0), mean2 = vec3(0.0), mean3 = vec3(0.0);
#if SH_DEGREE >= 1
    for (uint k = 0u; k < n_cameras; ++k) {
        const vec3 d = normalize(geometry[at].xyz - cameras[k].xyz);
        const uint b1 = plane_index(i, 3u, 0u);
        mean1 += cameras[k].w * sh_band1(sh1[b1], sh1[b1 + 32u], sh1[b1 + 64u], d);
#if SH_DEGREE >= 2
        const uint b2 = plane_index(i, 4u, 0u);
        mean2 += cameras[k].w * sh_band2(sh2[b2], sh2[b2 + 32u], sh2[b2 + 64u], sh2[b2 + 96u], d);
#endif
#if SH_DEGREE >= 3
        const uint b3 = plane_index(i, 6u, 0u);
        mean3 += cameras[k].w * sh_band3(
            sh3[b3], sh3[b3 + 32u], sh3[b3 + 64u], sh3[b3 + 96u], sh3[b3 + 128u], sh3[b3 + 160u], d);
#endif
    }
    for (uint p = 0u; p < 3u; ++p) part.y -= dot(sh1[plane_index(i, 3u, p)], d_sh1[plane_index(i, 3u, p)]);
#endif
#if SH_DEGREE >= 2
    for (uint p = 0u; p < 4u; ++p) part.z -= dot(sh2[plane_index(i, 4u, p)], d_sh2[plane_index(i, 4u, p)]);
#endif
#if SH_DEGREE >= 3
    for (uint p = 0u; p < 6u; ++p) part.w -= dot(sh3[plane_index(i, 6u, p)], d_sh3[plane_index(i, 6u, p)]);
#endif
    part.yzw += vec3(dot(mean1, d_color), dot(mean2, d_color), dot(mean3, d_color));
    const vec4 d_color4 = vec4(d_color, 0.0);
    const vec4 colors = term(d_color4);
    const vec4 whole = term(vec4(-d_own, 0.0, swell, 0.0));
    const float seen = any(notEqual(d_color4, vec4(0.0))) ? 1.0 : 0.0;
    sums[to] += term(part);
    sums[to + 32u] += vec4(whole.x, colors.x + colors.y + colors.z, whole.z, seen);
    sums[to + 64u] += term(lack);
    sums[to + 96u] = vec4(mean1, 0.0);
    sums[to + 128u] = vec4(mean2, 0.0);
    sums[to + 160u] = vec4(mean3, 0.0);
}
