// SPDX-License-Identifier: MIT OR Apache-2.0
// Purpose   adds up what a picture says of each Gaussian: how much would change without one of its parts, or with a new one.
// Equation  s = g . delta, g the gradient for the cotangents at hand and delta the step to the part's absence (or a unit of
//           what a static Gaussian lacks). With cotangents of random signs E[s s] = delta^T J^T J delta (Hutchinson 1989):
//           the Fisher information along delta. With the pictures' errors the sum of s is the loss's slope along it.
// Grid      one thread per Gaussian of the group.
// Writes    3 vec4 per Gaussian, added to: (motion, bands 1 to 3), (all of it, constant band per unit of colour, swell,
//           pictures that see it), (velocity, ramp).
// Numerics  the picture is affine in an opacity and in colours, so these steps are exact; that of the motion is of first
//           order. A fading Gaussian's opacity is divided out of its gradient: its weight is at least alpha_min where it is active.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "grid.glsl"
#include "temporal.glsl"

layout(local_size_x = 64) in;

layout(push_constant) uniform Push {
    uint n;
    float time;      // of the view, normalised
    float middle;    // of the clip
    float squares;   // 1: adds s s; 0: s
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

const float SH_0 = 0.28209479177387814;

vec4 term(vec4 s) { return s * mix(vec4(1.0), s, pc.squares); }

void main() {
    const uint i = linear_thread(gl_WorkGroupSize.x);
    if (i >= pc.n) return;
    const uint at = plane_index(i, 3u, 0u);
    const vec3 d_mean = d_geometry[at].xyz;
    // o dL/do of the opacity that the picture saw: the logit's gradient is that times 1 - sigmoid.
    const float d_own = d_geometry[at].w / max(1.0 - sigmoid(geometry[at].w), 1e-6);
    const vec3 d_color = d_sh0[i].xyz / SH_0;

    vec4 part = vec4(0.0);
    vec4 lack = vec4(0.0);
    float swell = 0.0;
#ifdef DYNAMIC
    // At rest where it is at the clip's middle, as opaque as it is then.
    const vec4 v = motion[i];
    const float t_scale = geometry[at + 64u].w;
    const float weight = max(temporal_weight(v.w, t_scale, pc.time), 1e-6);
    const float at_rest = temporal_weight(v.w, t_scale, pc.middle);
    part.x = dot(d_mean, v.xyz) * (pc.middle - pc.time) + (at_rest / weight - 1.0) * d_own;
#else
    const float x = pc.time - pc.middle;
    lack = vec4(x * d_mean, x * d_own);
    swell = (x * x - 1.0 / 12.0) * d_own;
#endif
#if SH_DEGREE >= 1
    for (uint p = 0u; p < 3u; ++p) part.y -= dot(sh1[plane_index(i, 3u, p)], d_sh1[plane_index(i, 3u, p)]);
#endif
#if SH_DEGREE >= 2
    for (uint p = 0u; p < 4u; ++p) part.z -= dot(sh2[plane_index(i, 4u, p)], d_sh2[plane_index(i, 4u, p)]);
#endif
#if SH_DEGREE >= 3
    for (uint p = 0u; p < 6u; ++p) part.w -= dot(sh3[plane_index(i, 6u, p)], d_sh3[plane_index(i, 6u, p)]);
#endif
    const vec4 d_color4 = vec4(d_color, 0.0);
    const vec4 colors = term(d_color4);
    const vec4 whole = term(vec4(-d_own, 0.0, swell, 0.0));
    const float seen = any(notEqual(d_color4, vec4(0.0))) ? 1.0 : 0.0;
    sums[at] += term(part);
    sums[at + 32u] += vec4(whole.x, colors.x + colors.y + colors.z, whole.z, seen);
    sums[at + 64u] += term(lack);
}
