// SPDX-License-Identifier: MIT OR Apache-2.0
// Purpose   derives from each Gaussian the numbers that culling reads: centre, reach, and time window.
// Equation  reach = exp(max s) sqrt(2 ln(sigmoid(o) / alpha_min)); window: |t - t_center| <= tau sqrt(ln(..)),
//           with the temporal cut in alpha_min's place where it is higher; all times if the cut is below 0.
//           Life of a block of 128 dynamic ones: from the first t_center - window to the last t_center + window.
// Grid      one thread per Gaussian of a group, 128 per workgroup; once per change of the parameters. Of dynamic ones, those of the
//           listed blocks or all.
// Writes    life: keys of -first and last, 0 where nobody lives.
// Numerics  a non-finite parameter gives reach -1, which culls, and is counted; so does an opacity below alpha_min,
//           uncounted. Reach and window carry a margin of 1e-5, lives one of 1e-6: whom culling keeps lives in its block's.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_KHR_shader_subgroup_ballot : require
#extension GL_KHR_shader_subgroup_arithmetic : require
#include "unfolded.glsl"
#include "grid.glsl"
#include "finite.glsl"
#include "temporal.glsl"
#ifdef DYNAMIC
#include "time_key.glsl"
#endif

layout(local_size_x = 128) in;

#ifdef DYNAMIC
const float ALWAYS = 1e30;
#endif

#ifdef DYNAMIC
layout(push_constant) uniform Push { uint n; float alpha_min; float temporal_cut; uint is_listed; } pc;
#else
layout(push_constant) uniform Push { uint n; float alpha_min; } pc;
#endif
layout(set = 0, binding = 0) restrict readonly buffer Geometry { vec4 geometry[]; };
layout(set = 0, binding = 1) restrict writeonly buffer Bound { vec4 bound[]; };
layout(set = 0, binding = 2) restrict buffer NBad { uint n_bad[]; };
#ifdef DYNAMIC
layout(set = 0, binding = 3) restrict readonly buffer Motion { vec4 motion[]; };
layout(set = 0, binding = 4) restrict writeonly buffer Window { float window[]; };
layout(set = 0, binding = 5) restrict writeonly buffer Life { uvec2 life[]; };
layout(set = 0, binding = 6) restrict readonly buffer Live { uint live[]; };
layout(set = 0, binding = 7) restrict readonly buffer LiveArgs { uint live_args[]; };
#include "live.glsl"

shared uint sh_life[2];
#endif

void main() {
#ifdef DYNAMIC
    const uint lane = gl_LocalInvocationIndex;
    const uint block = block_at(linear_group(), div_ceil(pc.n, 128u), pc.is_listed);
    const uint i = block == NO_BLOCK ? pc.n : block * 128u + lane;
#else
    const uint i = linear_thread(gl_WorkGroupSize.x);
#endif
    const bool exists = i < pc.n;
    const uint at = min(i, pc.n - 1u);
    const vec4 mean_opacity = geometry[plane_index(at, 3u, 0u)];
    const vec4 q = geometry[plane_index(at, 3u, 1u)];
    const vec4 scale_t = geometry[plane_index(at, 3u, 2u)];
    const float s = exp(max(max(scale_t.x, scale_t.y), scale_t.z));
    const float l = log(sigmoid(mean_opacity.w) / pc.alpha_min) * (1.0 + 1e-5) + 1e-5;
    float reach = s * sqrt(2.0 * max(l, 0.0)) * (1.0 + 1e-5);
    const vec4 q_abs = abs(q);
    const bool turns = max(max(q_abs.x, q_abs.y), max(q_abs.z, q_abs.w)) > 1e-37;
    bool good = finite4(mean_opacity) && finite4(q) && finite3(scale_t.xyz) && finite(reach) && turns;
#ifdef DYNAMIC
    // tau = infinity is a value, every other infinity is not.
    const vec4 v = motion[at];
    const float t_scale = scale_t.w;
    good = good && finite4(v) && (finite(t_scale) || t_scale > 0.0);
#endif
    if (exists && !good) atomicAdd(n_bad[0], 1u);
    if (!(good && l >= 0.0)) reach = -1.0;
    if (exists) bound[i] = vec4(mean_opacity.xyz, reach);
#ifdef DYNAMIC
    // A cut above alpha_min narrows the window, to nothing where the opacity does not reach it.
    const float l_time = log(sigmoid(mean_opacity.w) / max(pc.alpha_min, pc.temporal_cut)) * (1.0 + 1e-5) + 1e-5;
    const float own = l_time >= 0.0 ? exp(t_scale) * sqrt(l_time) * (1.0 + 1e-5) : -1.0;
    const float half_width = good ? (pc.temporal_cut < 0.0 ? ALWAYS : own) : -1.0;
    if (exists) window[i] = half_width;
    const float wider = half_width + 1e-6 * (abs(v.w) + half_width) + 1e-30;
    const bool ends = wider + abs(v.w) < ALWAYS;
    const uvec2 keys = ends ? uvec2(time_key(wider - v.w), time_key(wider + v.w)) : uvec2(FOREVER);
    const bool lives = exists && reach >= 0.0 && half_width >= 0.0;
    const uint before = subgroupMax(lives ? keys.x : 0u);
    const uint behind = subgroupMax(lives ? keys.y : 0u);
    if (lane < 2u) sh_life[lane] = 0u;
    barrier();
    if (gl_SubgroupInvocationID == 0u) {
        atomicMax(sh_life[0], before);
        atomicMax(sh_life[1], behind);
    }
    barrier();
    if (lane == 0u && block != NO_BLOCK) life[block] = uvec2(sh_life[0], sh_life[1]);
#endif
}
