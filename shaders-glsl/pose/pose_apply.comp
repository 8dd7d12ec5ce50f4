// SPDX-License-Identifier: MIT OR Apache-2.0
// Purpose   turns and shifts the view by what is learnt of its camera's pose, which only the device knows.
// Equation  x_camera = R exp([phi]x) (x - c - s): phi the turn and s the shift of the camera, both along the world's axes.
// Grid      one thread.
// Writes    view.row0 to row2, and next0 to next2 of a camera that moves: it has the same correction one frame on.
// Numerics  series of sine and cosine to phi^4, 5e-8 off at a turn of POSE_MOST_TURN. No turn and no shift change no bit.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "types.glsl"
#include "pose.glsl"

layout(local_size_x = 1) in;

layout(push_constant) uniform Push { uint camera; } pc;
layout(set = 0, binding = 0) restrict readonly buffer Poses { vec4 poses[]; };
layout(set = 0, binding = 1) restrict buffer View { ViewParams view; };

// A row of a rotation R as one of R exp([phi]x), and the centre behind it shifted.
vec4 corrected(vec4 row, vec3 phi, float shift) {
    const float square = dot(phi, phi);
    const float a = 1.0 - square * (1.0 / 6.0 - square * (1.0 / 120.0));
    const float b = 0.5 - square * (1.0 / 24.0 - square * (1.0 / 720.0));
    const vec3 turned = cross(phi, row.xyz);
    return vec4(row.xyz - a * turned + b * cross(phi, turned), row.w + shift);
}

void main() {
    if (gl_GlobalInvocationID.x > 0u) return;
    const vec3 phi = poses[POSE_ROWS * pc.camera].xyz;
    const vec3 shift = poses[POSE_ROWS * pc.camera + 1u].xyz;
    view.row0 = corrected(view.row0, phi, shift.x);
    view.row1 = corrected(view.row1, phi, shift.y);
    view.row2 = corrected(view.row2, phi, shift.z);
    view.next0 = corrected(view.next0, phi, shift.x);
    view.next1 = corrected(view.next1, phi, shift.y);
    view.next2 = corrected(view.next2, phi, shift.z);
}
