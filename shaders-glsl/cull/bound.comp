// SPDX-License-Identifier: MIT OR Apache-2.0
// Purpose   derives from each Gaussian the numbers that culling reads: centre, reach, and time window.
// Equation  reach = exp(max s) sqrt(2 ln(sigmoid(o) / alpha_min)); window: |t - t_center| <= tau sqrt(ln(..)),
//           with the temporal cut in alpha_min's place where it is higher; all times if the cut is below 0.
// Grid      one thread per Gaussian of a group; once per change of the parameters.
// Numerics  a non-finite parameter gives reach -1, which culls, and is counted; so does an opacity below alpha_min,
//           uncounted. Reach and window carry a margin of 1e-5.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "grid.glsl"
#include "finite.glsl"
#include "temporal.glsl"

layout(local_size_x = 128) in;

#ifdef DYNAMIC
const float ALWAYS = 1e30;
#endif

layout(push_constant) uniform Push { uint n; float alpha_min; float temporal_cut; } pc;
layout(set = 0, binding = 0) restrict readonly buffer Geometry { vec4 geometry[]; };
layout(set = 0, binding = 1) restrict writeonly buffer Bound { vec4 bound[]; };
layout(set = 0, binding = 2) restrict buffer NBad { uint n_bad[]; };
#ifdef DYNAMIC
layout(set = 0, binding = 3) restrict readonly buffer Motion { vec4 motion[]; };
layout(set = 0, binding = 4) restrict writeonly buffer Window { float window[]; };
#endif

void main() {
    const uint i = linear_thread(gl_WorkGroupSize.x);
    if (i >= pc.n) return;
    const vec4 mean_opacity = geometry[plane_index(i, 3u, 0u)];
    const vec4 q = geometry[plane_index(i, 3u, 1u)];
    const vec4 scale_t = geometry[plane_index(i, 3u, 2u)];
    const float s = exp(max(max(scale_t.x, scale_t.y), scale_t.z));
    const float l = log(sigmoid(mean_opacity.w) / pc.alpha_min) * (1.0 + 1e-5) + 1e-5;
    float reach = s * sqrt(2.0 * max(l, 0.0)) * (1.0 + 1e-5);
    const vec4 q_abs = abs(q);
    const bool turns = max(max(q_abs.x, q_abs.y), max(q_abs.z, q_abs.w)) > 1e-37;
    bool good = finite4(mean_opacity) && finite4(q) && finite3(scale_t.xyz) && finite(reach) && turns;
#ifdef DYNAMIC
    // tau = infinity is a value, every other infinity is not.
    const vec4 v = motion[i];
    const float t_scale = scale_t.w;
    good = good && finite4(v) && (finite(t_scale) || t_scale > 0.0);
    // A cut above alpha_min narrows the window, to nothing where the opacity does not reach it.
    const float l_time = log(sigmoid(mean_opacity.w) / max(pc.alpha_min, pc.temporal_cut)) * (1.0 + 1e-5) + 1e-5;
    const float own = l_time >= 0.0 ? exp(t_scale) * sqrt(l_time) * (1.0 + 1e-5) : -1.0;
    window[i] = good ? (pc.temporal_cut < 0.0 ? ALWAYS : own) : -1.0;
#endif
    if (!good) atomicAdd(n_bad[0], 1u);
    if (!(good && l >= 0.0)) reach = -1.0;
    bound[i] = vec4(mean_opacity.xyz, reach);
}
