// SPDX-License-Identifier: MIT OR Apache-2.0
// Purpose   turns an output of the blend into pixels of 8 bits a channel for a window, and lays rows of an overlay over them.
// Equation  colour and alpha: 255 clamp(x); inverse depth: five colours along x / high; flow: its angle as hue,
//           |f| / high as saturation; each to the nearest level. Overlay of alpha a: (a o + (255 - a) p) / 255.
// Grid      one thread per pixel of the strip.
// Reads     image0, image1: of the strip; overlay: whole rows of the window from row `top` on, bytes R, G, B, alpha.
// Writes    pixels: of the window; bytes R, G, B, 255, or with is_bgra B, G, R, 255.
// Numerics  levels of colour and alpha are those of the PNG; NaN is 0, and a flow that is not finite is black.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_KHR_shader_subgroup_ballot : require
#include "unfolded.glsl"
#include "finite.glsl"
#include "grid.glsl"

layout(local_size_x = 64) in;

// first: the strip's first pixel; n: pixels of the strip; top: the overlay's first pixel.
layout(push_constant) uniform Push {
    uint first; uint n; uint top; uint layer; uint is_bgra; float high;
} pc;
layout(set = 0, binding = 0) restrict readonly buffer Image0 { vec4 image0[]; };
layout(set = 0, binding = 1) restrict readonly buffer Image1 { vec4 image1[]; };
layout(set = 0, binding = 2) restrict readonly buffer Overlay { uint overlay[]; };
layout(set = 0, binding = 3) restrict writeonly buffer Pixels { uint pixels[]; };

const vec3 RAMP[5] =
    vec3[](vec3(0.02, 0.02, 0.10), vec3(0.30, 0.08, 0.50), vec3(0.80, 0.20, 0.35), vec3(0.98, 0.60, 0.15), vec3(1.0, 1.0, 0.75));

// To 0 to 1; NaN to 0.
float part(float x) { return x > 0.0 ? min(x, 1.0) : 0.0; }

vec3 ramp(float x) {
    const float at = 4.0 * part(x);
    const uint k = min(uint(at), 3u);
    return mix(RAMP[k], RAMP[k + 1u], at - float(k));
}

vec3 wheel(vec2 flow, float high) {
    if (!finite2(flow)) return vec3(0.0);
    const float most = max(abs(flow.x), abs(flow.y));
    if (!(most > 0.0)) return vec3(1.0);
    const vec2 way = flow / most;
    // Of the size of y: SwiftShader takes the angle of y = -0 and x < 0 for 0.
    const float angle = atan(abs(way.y), way.x);
    const float hue = (way.y < 0.0 ? -angle : angle) * 0.9549296585513721 + 6.0;
    const vec3 full = clamp(abs(mod(hue + vec3(0.0, 4.0, 2.0), 6.0) - 3.0) - 1.0, 0.0, 1.0);
    return mix(vec3(1.0), full, part(most / high * length(way)));
}

// Half away from zero, as on the host.
uint level(float x) {
    precise const float scaled = part(x) * 255.0;
    const float below = floor(scaled);
    return uint(below) + uint(scaled - below >= 0.5);
}

void main() {
    const uint i = linear_thread(gl_WorkGroupSize.x);
    if (i >= pc.n) return;
    const uint layer = unfolded(pc.layer);
    const vec4 seen = image0[i];
    vec3 color = seen.xyz;
    if (layer == 1u) color = vec3(seen.w);
    if (layer == 2u) color = ramp(image1[i].y / pc.high);
    if (layer == 3u) color = wheel(image1[i].zw, pc.high);
    uvec3 levels = uvec3(level(color.x), level(color.y), level(color.z));
    const uint pixel = pc.first + i;
    if (pixel >= unfolded(pc.top)) {
        const uint over = overlay[pixel - pc.top];
        const uint a = over >> 24u;
        const uvec3 o = uvec3(over, over >> 8u, over >> 16u) & 255u;
        levels = (a * o + (255u - a) * levels + 127u) / 255u;
    }
    if (unfolded(pc.is_bgra) != 0u) levels = levels.zyx;
    pixels[pixel] = levels.x | levels.y << 8u | levels.z << 16u | 0xff000000u;
}
