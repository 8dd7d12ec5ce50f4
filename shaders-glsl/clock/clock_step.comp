// SPDX-License-Identifier: MIT OR Apache-2.0
// Purpose   moves the cameras' time offsets: Adam on the image's gradient and the L2 term, bound, gauge.
// Equation  SPEC 4, 6: dL/ddgamma_k = dt dL/dt' + 2 lambda dgamma_k; then |dgamma_k| <= bound and the mean of the offsets that
//           are learnt is taken off: a shift common to all is one of every Gaussian's time.
// Grid      one workgroup.
// Reads     total: the camera's gradient, that by t' in total[0].w. free: 1 where the offset is learnt.
// Writes    clocks, per camera: offset, frames; first and second moment; what rounding has lost of the offset.
// Numerics  the mean is summed in a fixed order; after the gauge an offset may pass the bound by the mean of that step. Offsets are
//           compensated (Kahan). A gradient that is not finite, or a frame that failed, moves nothing.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "types.glsl"
#include "finite.glsl"

layout(local_size_x = 64) in;

// rate: learning rate / c1. regulariser: 2 lambda.
layout(push_constant) uniform Push {
    uint camera; uint n_cameras; float dt; float rate; float inverse_c2; float regulariser; float bound;
} pc;
layout(set = 0, binding = 0) restrict readonly buffer Total { vec4 total[]; };
layout(set = 0, binding = 1) restrict readonly buffer Free { uint free_offsets[]; };
layout(set = 0, binding = 2) restrict readonly buffer FrameStatus { Status status; };
layout(set = 0, binding = 3) restrict buffer Clocks { vec4 clocks[]; };

const float BETA_1 = 0.9;
const float BETA_2 = 0.999;
const float EPS = 1e-15;

shared vec2 sh_sums[64];

void main() {
    const uint lane = gl_LocalInvocationIndex;
    const float of_image = pc.dt * total[0].w;
    const bool moves = status.failed == 0u && finite(of_image);
    vec2 own = vec2(0.0);
    for (uint k = lane; k < pc.n_cameras; k += 64u) {
        vec4 clock = clocks[k];
        if (moves && free_offsets[k] != 0u) {
            const float g = (k == pc.camera ? of_image : 0.0) + pc.regulariser * clock.x;
            clock.y = BETA_1 * clock.y + (1.0 - BETA_1) * g;
            clock.z = BETA_2 * clock.z + (1.0 - BETA_2) * g * g;
            const float change = -pc.rate * clock.y / (sqrt(clock.z * pc.inverse_c2) + EPS);
            precise float y = change - clock.w;
            precise float sum = clock.x + y;
            precise float lost = (sum - clock.x) - y;
            clock.w = lost;
            clock.x = clamp(sum, -pc.bound, pc.bound);
            own += vec2(clock.x, 1.0);
            clocks[k] = clock;
        }
    }
    sh_sums[lane] = own;
    barrier();
    vec2 sum = vec2(0.0);
    for (uint k = 0u; k < 64u; ++k) sum += sh_sums[k];
    const float mean = sum.x / max(sum.y, 1.0);
    for (uint k = lane; k < pc.n_cameras; k += 64u) {
        if (moves && free_offsets[k] != 0u) clocks[k].x -= mean;
    }
}
