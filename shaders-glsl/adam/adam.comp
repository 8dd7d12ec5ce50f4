// SPDX-License-Identifier: MIT OR Apache-2.0
// Purpose   one Adam step on a parameter group in blocks of planes.
// Equation  m <- b1 m + (1 - b1) g, v <- b2 v + (1 - b2) g^2, x <- x - (lr / c1) m / (sqrt(v / c2) + eps); the bias
//           corrections c1, c2 come from the host in f64 (pow is off by 1e-3 on some drivers).
// Grid      one thread per vec4.
// Numerics  a gradient that is not finite changes nothing and is counted. v = infinity (a gradient above 1e19) gives a
//           step of 0. A component whose rate is 0 keeps its bits. Nothing moves when the frame failed.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "types.glsl"
#include "grid.glsl"
#include "finite.glsl"

layout(local_size_x = 64) in;

// rates: lr / c1 of each plane's components. lowest: floor of the last component of the last plane (log tau).
layout(push_constant) uniform Push {
    vec4 rates[6];
    uint n;
    uint planes;
    float beta1;
    float beta2;
    float inverse_c2;
    float eps;
    float lowest;
} pc;
layout(set = 0, binding = 0) restrict readonly buffer FrameStatus { Status status; };
layout(set = 0, binding = 1) restrict readonly buffer Gradient { vec4 gradient[]; };
layout(set = 0, binding = 2) restrict buffer Parameter { vec4 parameter[]; };
layout(set = 0, binding = 3) restrict buffer Moment1 { vec4 moment1[]; };
layout(set = 0, binding = 4) restrict buffer Moment2 { vec4 moment2[]; };
layout(set = 0, binding = 5) restrict buffer NBad { uint n_bad[]; };

void main() {
    const uint i = linear_thread(gl_WorkGroupSize.x);
    if (i >= pc.n || status.failed != 0u) return;
    const vec4 g = gradient[i];
    if (!finite4(g)) {
        atomicAdd(n_bad[0], 1u);
        return;
    }
    const vec4 rate = pc.rates[(i >> 5u) % pc.planes];
    const vec4 m = pc.beta1 * moment1[i] + (1.0 - pc.beta1) * g;
    const vec4 v = pc.beta2 * moment2[i] + (1.0 - pc.beta2) * g * g;
    moment1[i] = m;
    moment2[i] = v;
    const vec4 x = parameter[i];
    vec4 moved = x - rate * m / (sqrt(v * pc.inverse_c2) + pc.eps);
    if ((i >> 5u) % pc.planes == pc.planes - 1u) moved.w = max(moved.w, pc.lowest);
    parameter[i] = mix(x, moved, notEqual(rate, vec4(0.0)));
}
