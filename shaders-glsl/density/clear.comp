// SPDX-License-Identifier: MIT OR Apache-2.0
// Purpose   moves Gaussians out of the space just before lenses, to where the lenses do not see them.
// Equation  With o = p - lens, z = axis . o and s = |o|^2 - z^2, the height of p over the surface that the lens and its
//           neighbours stand on is h = z - slope . o - curvature s / 2. Where -margin < h < depth and s < radius^2:
//           p -= (h + margin + a little) axis. Lens after lens.
// Grid      one thread per Gaussian of a group.
// Numerics  a little exceeds the rounding of h, so a Gaussian that was moved is not moved again. None moves if the step failed.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_KHR_shader_subgroup_ballot : require
#include "unfolded.glsl"
#include "types.glsl"
#include "grid.glsl"

layout(local_size_x = 64) in;

layout(push_constant) uniform Push { uint n; uint n_clearings; float margin; float little; } pc;
layout(set = 0, binding = 0) restrict readonly buffer FrameStatus { Status status; };
layout(set = 0, binding = 1) restrict readonly buffer Clearings { vec4 clearings[]; };  // three each: place and radius, axis and curvature, slope and depth
layout(set = 0, binding = 2) restrict buffer Geometry { vec4 geometry[]; };

void main() {
    const uint i = linear_thread(gl_WorkGroupSize.x);
    if (i >= pc.n || status.failed != 0u) return;
    const uint at = plane_index(i, 3u, 0u);
    const vec4 mean_opacity = geometry[at];
    vec3 p = mean_opacity.xyz;
    bool moved = false;
    for (uint k = 0u; k < unfolded(pc.n_clearings); ++k) {
        const vec4 place = clearings[3u * k];
        const vec4 axis = clearings[3u * k + 1u];
        const vec4 slope = clearings[3u * k + 2u];
        const vec3 offset = p - place.xyz;
        const float z = dot(offset, axis.xyz);
        const vec3 aside = offset - z * axis.xyz;
        const float square = dot(aside, aside);
        const float height = z - dot(offset, slope.xyz) - 0.5 * axis.w * square;
        const bool within = height > -pc.margin && height < slope.w && square < place.w * place.w;
        p -= within ? (height + pc.margin + pc.little) * axis.xyz : vec3(0.0);
        moved = moved || within;
    }
    if (moved) geometry[at] = vec4(p, mean_opacity.w);
}
