// SPDX-License-Identifier: MIT OR Apache-2.0
// Purpose   decides for each Gaussian of a group whether it is kept, how hard it is pulled and where it is stored.
// Equation  pull = sum of gradient norms / frames seen. Opacity: the largest over the training times f / F, at the one
//           nearest to t_center. Slot of time: of those that are 1 / 2^k of a clip, k <= levels, the shortest that 4 tau fits into.
//           Code: Morton's, of 0.5 + 0.5 x / (1 + |x|) with x = (p - centre) / extent.
// Grid      one thread per flat index of the group, its gap included.
// Writes    flags; score: the pull as a key that sorts the hardest first, all ones for who cannot grow; or, where
//           `weight` is not 0, a number proportional to the opacity, 0 for the dead. Everything by flat index.
// Numerics  what is not finite or cannot turn is not kept, nor what a rule of pruning marks. Comparisons are the f32 reference's own.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_KHR_shader_subgroup_ballot : require
#extension GL_KHR_shader_subgroup_arithmetic : require
#include "unfolded.glsl"
#include "grid.glsl"
#include "finite.glsl"
#include "unit.glsl"
#include "rotation.glsl"
#include "temporal.glsl"
#include "density.glsl"

layout(local_size_x = 128) in;

// The limits of the rules of pruning, which are functions below.
struct PruneLimits {
    float opacity;        // the largest over the training times, below which a Gaussian goes
    float log_scale;      // log of the largest standard deviation, above which it goes
    float veil;           // standard deviation towards a lens, in units of its depth before it, above which it goes
};

layout(push_constant) uniform Push {
    vec4 center;          // w: 1 / extent
    uint n;
    uint first;
    uint n_frames;
    uint weight;          // of opacity 1; 0 asks for pulls
    float split_above;    // log of the standard deviation above which a Gaussian splits
    float gradient;
    uint bucket;
    uint n_lenses;
    uint levels;
    uint is_held;         // 1: no rule prunes
    PruneLimits limits;
} pc;
layout(set = 0, binding = 0) restrict readonly buffer Geometry { vec4 geometry[]; };
layout(set = 0, binding = 1) restrict readonly buffer State { vec4 state[]; };
layout(set = 0, binding = 2) restrict writeonly buffer Flags { uint flags[]; };
layout(set = 0, binding = 3) restrict writeonly buffer Scores { uint scores[]; };
layout(set = 0, binding = 4) restrict writeonly buffer Identity { uint identity[]; };
layout(set = 0, binding = 5) restrict writeonly buffer Entries { uint entries[]; };
layout(set = 0, binding = 6) restrict writeonly buffer Codes { uint codes[]; };
layout(set = 0, binding = 7) restrict buffer Counters { uint counters[]; };
layout(set = 0, binding = 8) restrict readonly buffer Lenses { vec4 lenses[]; };  // two each: place and reach, axis
// One interface for all variants.
layout(set = 0, binding = 9) restrict readonly buffer Motion { vec4 motion[]; };

// What rules of pruning judge.
struct Gaussian {
    vec3 mean;
    vec3 log_scale;
    mat3 turn;
    float opacity;  // the largest over the training times
};

bool is_faint(Gaussian g) { return !(g.opacity >= pc.limits.opacity); }

bool is_large(Gaussian g) { return !(max(max(g.log_scale.x, g.log_scale.y), g.log_scale.z) <= pc.limits.log_scale); }

// Whether it is a floater before a camera: it reaches too far towards a lens, along the line there. A wall that is seen face on is
// wide and hides nothing.
bool is_veil(Gaussian g) {
    // Rows of diag(s) R^T: times a direction, the standard deviations along it.
    const vec3 sizes = exp(min(g.log_scale, vec3(80.0)));
    bool veils = false;
    for (uint k = 0u; k < unfolded(pc.n_lenses); ++k) {
        precise vec3 offset = g.mean - lenses[2u * k].xyz;
        precise float depth = dot(offset, lenses[2u * k + 1u].xyz);
        precise float aside = length(offset - depth * lenses[2u * k + 1u].xyz) - depth * lenses[2u * k].w;
        precise float towards = length(sizes * (normalize(offset) * g.turn));
        // Who is beside what the lens sees must be wider to reach into it.
        veils = veils || (depth > 0.0 && towards > pc.limits.veil * (depth + 2.0 * max(aside, 0.0)));
    }
    return veils;
}

// A Gaussian goes by any rule.
bool is_pruned(Gaussian g) {
    bool goes = is_faint(g);
    goes = is_large(g) || goes;
    goes = is_veil(g) || goes;
    return goes;
}

// The low 8 bits, two apart.
uint spread(uint x) {
    x = (x | (x << 8u)) & 0x0000f00fu;
    x = (x | (x << 4u)) & 0x000c30c3u;
    return (x | (x << 2u)) & 0x00249249u;
}

uint morton(vec3 p) {
    precise vec3 x = (p - pc.center.xyz) * pc.center.w;
    precise vec3 contracted = 0.5 + 0.5 * (x / (1.0 + abs(x)));
    const uvec3 cell = uvec3(clamp(contracted * 256.0, 0.0, 255.0));
    return spread(cell.x) | (spread(cell.y) << 1u) | (spread(cell.z) << 2u);
}

void main() {
    const uint i = linear_thread(gl_WorkGroupSize.x);
    if (i >= div_ceil(pc.n, 128u) * 128u) return;
    const bool exists = i < pc.n;
    // A gap stands for the group's last Gaussian, so that all lanes load.
    const uint at = min(i, pc.n - 1u);
    const vec4 mean_opacity = geometry[plane_index(at, 3u, 0u)];
    const vec4 q = geometry[plane_index(at, 3u, 1u)];
    const vec4 scale_t = geometry[plane_index(at, 3u, 2u)];
    const vec2 stat = state[at].xy;
    const vec4 q_abs = abs(q);
    const float scale = max(max(scale_t.x, scale_t.y), scale_t.z);
    float opacity = sigmoid(mean_opacity.w);
    bool good = finite4(mean_opacity) && finite4(q) && finite3(scale_t.xyz);
    good = good && max(max(q_abs.x, q_abs.y), max(q_abs.z, q_abs.w)) > 1e-37;
    uint code = pc.bucket << CODE_BUCKET;
#ifdef DYNAMIC
    const vec4 v = motion[at];
    const float t_scale = scale_t.w;
    good = good && finite4(v) && (finite(t_scale) || t_scale > 0.0);
    const float n_frames = float(pc.n_frames);
    const float frame = clamp(floor(v.w * n_frames + 0.5), 0.0, n_frames - 1.0);
    opacity *= temporal_weight(v.w, t_scale, frame / n_frames);
    precise float level = floor(-1.442695 * t_scale - 2.0);
    const uint n_slots = 1u << uint(clamp(level, 0.0, float(pc.levels)));
    const uint slot = min(uint(clamp(v.w, 0.0, 1.0) * float(n_slots)), n_slots - 1u);
    code |= (n_slots - 1u + slot) << (CODE_BUCKET - 1u - pc.levels);
    code |= morton(mean_opacity.xyz) >> (max(pc.levels, LEVELS_BESIDE_PLACE) - LEVELS_BESIDE_PLACE);
#else
    code |= morton(mean_opacity.xyz);
#endif
    float inverse_length;
    const mat3 turn = rotation_of(unit_quaternion(q, inverse_length));
    const bool pruned = is_pruned(Gaussian(mean_opacity.xyz, scale_t.xyz, turn, opacity)) && unfolded(pc.is_held) == 0u;
    const bool kept = exists && good && !pruned;
    const float pull = stat.y > 0.0 ? stat.x / stat.y : 0.0;
    uint score = kept && pull > pc.gradient ? ~floatBitsToUint(pull) : 0xffffffffu;
    if (unfolded(pc.weight) != 0u) score = kept ? 1u + uint(float(pc.weight) * opacity) : 0u;

    const uint place = pc.first + i;
    flags[place] = (exists ? EXISTS : 0u) | (kept ? KEPT : 0u) | (scale > pc.split_above ? LARGE : 0u);
    scores[place] = score;
    identity[place] = place;
    entries[place] = (pc.weight != 0u ? exists : kept) ? 1u : 0u;
    codes[place] = code;
    const uint n_kept = subgroupAdd(kept ? 1u : 0u);
    if (gl_SubgroupInvocationID == 0u) atomicAdd(counters[N_KEPT], n_kept);
}
