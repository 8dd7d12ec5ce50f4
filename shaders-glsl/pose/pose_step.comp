// SPDX-License-Identifier: MIT OR Apache-2.0
// Purpose   moves the pose of the image's camera: Adam, bound, gauge.
// Equation  with x_camera = R exp([phi]x) (x - c - s): dL/dphi = R'^T dL/dturn, dL/ds = -R'^T dL/dshift, R' the view's rotation;
//           turn and shift of the picture's gradient are along the camera's axes. Then the gauge, seven numbers for the similarity of
//           cameras and scene that no image sees: the mean turn is taken off, the mean shift, and the growth of the arrangement,
//           sum b s / sum b^2, where b is where a camera is from the mean of all.
// Grid      one workgroup.
// Reads     total: the camera's gradient, (turn, time), (shift, 0). arrangement, per camera: b and 1 where its pose is learnt.
//           view: as pose_apply left it.
// Writes    poses, POSE_ROWS vec4 per camera and as many for all.
// Numerics  all cameras share one second moment of the turns and one of the shifts. With a moment of its own, a camera that is right
//           would step as far as one that is wrong, and the gauge would set them against each other. What the gauge takes off is
//           orthogonal to what stays; afterwards a pose may pass its bound by that step's mean. Sums in a fixed order. A gradient
//           that is not finite, or a frame that failed, moves nothing.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "types.glsl"
#include "finite.glsl"
#include "pose.glsl"

layout(local_size_x = 64) in;

// inverse_spread: 1 / sum b^2, or 0. Rates in radians and scene units.
layout(push_constant) uniform Push {
    uint camera; uint n_cameras; float inverse_n; float inverse_spread; float turn_rate; float shift_rate; float most_shift;
} pc;
layout(set = 0, binding = 0) restrict readonly buffer Total { vec4 total[]; };
layout(set = 0, binding = 1) restrict readonly buffer Arrangement { vec4 arrangement[]; };
layout(set = 0, binding = 2) restrict readonly buffer FrameStatus { Status status; };
layout(set = 0, binding = 3) restrict readonly buffer View { ViewParams view; };
layout(set = 0, binding = 4) restrict buffer Poses { vec4 poses[]; };

const float BETA_1 = 0.9;
const float BETA_2 = 0.999;
const float EPS = 1e-15;

shared vec4 sh_turns[64];
shared vec4 sh_shifts[64];

vec3 to_world(vec3 v) {
    return view.row0.xyz * v.x + view.row1.xyz * v.y + view.row2.xyz * v.z;
}

// Moves the vector at `at` and holds it to a length of `most`. `c1`: 1 - beta_1^step; `second`: the second moment without its bias.
void move(uint at, vec3 gradient, float c1, float second, float rate, float most) {
    const vec3 first = BETA_1 * poses[at + 2u].xyz + (1.0 - BETA_1) * gradient;
    const vec3 moved = poses[at].xyz - rate / (c1 * (sqrt(second) + EPS)) * first;
    poses[at] = vec4(moved * min(1.0, most / max(length(moved), EPS)), c1);
    poses[at + 2u] = vec4(first, 0.0);
}

// Second moments of turn and shift of all cameras, without their bias, in the step at hand.
vec2 second_moments(vec3 turn, vec3 shift) {
    const uint at = POSE_ROWS * pc.n_cameras;
    const vec2 squares = vec2(dot(turn, turn), dot(shift, shift)) / 3.0;
    const vec2 second = BETA_2 * poses[at].xy + (1.0 - BETA_2) * squares;
    const float c2 = BETA_2 * poses[at].z + (1.0 - BETA_2);
    poses[at] = vec4(second, c2, 0.0);
    return second / c2;
}

void main() {
    const uint lane = gl_LocalInvocationIndex;
    const vec3 turn = to_world(total[0].xyz);
    const vec3 shift = -to_world(total[1].xyz);
    const bool moves = status.failed == 0u && finite3(turn) && finite3(shift) && arrangement[pc.camera].w > 0.0;
    vec3 turns = vec3(0.0);
    vec4 shifts = vec4(0.0);
    for (uint k = lane; k < pc.n_cameras; k += 64u) {
        const vec4 b = arrangement[k];
        if (moves && b.w > 0.0) {
            const uint at = POSE_ROWS * k;
            if (k == pc.camera) {
                const float c1 = BETA_1 * poses[at].w + (1.0 - BETA_1);
                const vec2 second = second_moments(turn, shift);
                move(at, turn, c1, second.x, pc.turn_rate, POSE_MOST_TURN);
                move(at + 1u, shift, c1, second.y, pc.shift_rate, pc.most_shift);
            }
            const vec3 s = poses[at + 1u].xyz;
            turns += poses[at].xyz;
            shifts += vec4(s, dot(b.xyz, s));
        }
    }
    sh_turns[lane] = vec4(turns, 0.0);
    sh_shifts[lane] = shifts;
    barrier();
    turns = vec3(0.0);
    shifts = vec4(0.0);
    for (uint k = 0u; k < 64u; ++k) {
        turns += sh_turns[k].xyz;
        shifts += sh_shifts[k];
    }
    const vec3 mean_turn = turns * pc.inverse_n;
    const vec3 mean_shift = shifts.xyz * pc.inverse_n;
    const float growth = shifts.w * pc.inverse_spread;
    for (uint k = lane; k < pc.n_cameras; k += 64u) {
        const vec4 b = arrangement[k];
        if (moves && b.w > 0.0) {
            poses[POSE_ROWS * k].xyz -= mean_turn;
            poses[POSE_ROWS * k + 1u].xyz -= mean_shift + growth * b.xyz;
        }
    }
}
