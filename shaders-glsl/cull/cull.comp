// SPDX-License-Identifier: MIT OR Apache-2.0
// Purpose   marks the Gaussians of a group that may touch the strip at the view's time.
// Equation  |C| <= |J|^2 |M|^2 + blur, so the alpha_min ellipse reaches at most sqrt(reach^2 |J|^2 + 2 ln(1/alpha_min) blur).
// Grid      one thread per Gaussian of a group, 128 per workgroup; of dynamic ones, those of the listed blocks.
// Writes    one bit per Gaussian (flat index), one count per block.
// Numerics  conservative: margins of 1e-2 px and 1e-5 of the position. The near test is the projection's own.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_KHR_shader_subgroup_ballot : require
#include "unfolded.glsl"
#include "types.glsl"
#include "grid.glsl"
#include "unit.glsl"
#include "camera.glsl"
#include "temporal.glsl"

layout(local_size_x = 128) in;

layout(push_constant) uniform Push { uint n; uint first; } pc;
layout(set = 0, binding = 0) uniform View { ViewParams view; };
layout(set = 0, binding = 1) restrict readonly buffer Bound { vec4 bound[]; };
layout(set = 0, binding = 2) restrict writeonly buffer Bits { uint bits[]; };
layout(set = 0, binding = 3) restrict writeonly buffer Counts { uint counts[]; };
#ifdef DYNAMIC
layout(set = 0, binding = 4) restrict readonly buffer Motion { vec4 motion[]; };
layout(set = 0, binding = 5) restrict readonly buffer Window { float window[]; };
layout(set = 0, binding = 6) restrict readonly buffer Live { uint live[]; };
layout(set = 0, binding = 7) restrict readonly buffer LiveArgs { uint live_args[]; };
#include "live.glsl"
#endif

shared uint sh_words[4];

bool may_touch(vec3 mean, float reach) {
    const vec3 p = to_camera(view, mean);
    if (!(p.z > view.near && reach >= 0.0)) return false;
    const vec2 uv = p.xy / p.z;
    const vec2 uv_j = clamp(uv, view.clamp_uv.xz, view.clamp_uv.yw);
    const vec2 f = view.intrinsics.xy;
    const vec2 gain = reach * (f / p.z) * sqrt(1.0 + uv_j * uv_j);
    const vec2 xy = f * uv + view.intrinsics.zw;
    const vec2 half_box = sqrt(gain * gain + vec2(2.0 * log(1.0 / view.alpha_min) * view.blur));
    const vec2 margin = 1e-2 + 1e-5 * (abs(xy) + half_box);
    const vec2 low = xy - half_box - margin;
    const vec2 high = xy + half_box + margin;
    const vec2 first = vec2(0.0, float(view.first_row));
    const vec2 last = vec2(float(view.width), float(view.first_row + view.n_rows));
    return !(low.x > last.x || low.y > last.y || high.x < first.x || high.y < first.y);
}

void main() {
    const uint n_blocks = div_ceil(pc.n, 128u);
#ifdef DYNAMIC
    const uint block = block_at(linear_group(), n_blocks, 1u);
#else
    const uint block = linear_group();
#endif
    const uint lane = gl_LocalInvocationIndex;
    const uint i = min(block, n_blocks) * 128u + lane;
    if (lane < 4u) sh_words[lane] = 0u;
    barrier();
    bool visible = false;
    if (i < pc.n) {
        const vec4 b = bound[i];
#ifdef DYNAMIC
        const vec4 v = motion[i];
        visible = abs(view.time - v.w) <= window[i] && may_touch(mean_at(b.xyz, v, view.time), b.w);
#else
        visible = may_touch(b.xyz, b.w);
#endif
    }
    const uvec4 ballot = subgroupBallot(visible);
    if (gl_SubgroupInvocationID == 0u) {
        const uint at = gl_SubgroupID * gl_SubgroupSize;
        atomicOr(sh_words[at >> 5u], ballot.x << (at & 31u));
        if (gl_SubgroupSize > 32u) atomicOr(sh_words[(at >> 5u) + 1u], ballot.y);
    }
    barrier();
    if (block < n_blocks) {
        if (lane < 4u) bits[(pc.first + block * 128u) / 32u + lane] = sh_words[lane];
        if (lane == 0u) {
            counts[pc.first / 128u + block] =
                bitCount(sh_words[0]) + bitCount(sh_words[1]) + bitCount(sh_words[2]) + bitCount(sh_words[3]);
        }
    }
}
