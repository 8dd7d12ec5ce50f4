// Adam on the planes of a parameter buffer.

#include "moments.glsl"

// Buffers of a group.
const uint GEOMETRY = 0u;
const uint SH_0_BUFFER = 1u;
const uint MOTION = 2u;
const uint SH_1_BUFFER = 3u;  // bands 2 and 3 follow

// Plane `p` of buffer `kind` among all that a Gaussian has: none has more than six.
uint plane_number(uint kind, uint p) { return 6u * kind + p; }

// By how much the position of a Gaussian with these standard deviations moves faster than one of pace 1: in proportion to the longest.
float position_pace(AdamParams a, vec3 s) {
    return a.inverse_size > 0.0 ? clamp(max(s.x, max(s.y, s.z)) * a.inverse_size, 0.25, 16.0) : 1.0;
}

// The numbers of plane `p` of buffer `kind` among those of all parameters, in the order that AdamParams names; those of position
// times `pace`.
vec4 plane_rates(vec4 r0, vec4 r1, vec4 r2, uint kind, uint p, float pace) {
    if (kind == GEOMETRY) {
        if (p == 0u) return vec4(vec3(r0.x * pace), r0.y);
        return p == 1u ? r0.zzzz : vec4(r0.www, r1.x);
    }
    if (kind == SH_0_BUFFER) return vec4(r1.www, 0.0);
    if (kind == MOTION) return vec4(r1.yyy, r1.z);
    return vec4(r2[kind - SH_1_BUFFER]);
}

// The gradient of the regularisers at plane `p` of buffer `kind`, whose values are x.
vec4 regulariser(AdamParams a, uint kind, uint p, vec4 x) {
    const float base = 1.0 / (1.0 + exp(-x.w));
    const vec4 d_opacity = vec4(0.0, 0.0, 0.0, a.opacity_reg * base * (1.0 - base));
    const vec4 d_scale = vec4(a.scale_reg * exp(min(x.xyz, 60.0)), 0.0);
    return kind != GEOMETRY || p == 1u ? vec4(0.0) : p == 0u ? d_opacity : d_scale;
}

// The change of parameters with gradient g; moves the moments. 0 where the rate is 0.
vec4 adam_change(AdamParams a, vec4 rate, vec4 g, inout vec4 m, inout vec4 v) {
    m = a.beta1 * m + (1.0 - a.beta1) * g;
    v = a.beta2 * v + (1.0 - a.beta2) * g * g;
    return mix(vec4(0.0), -rate * m / (sqrt(v * a.inverse_c2) + a.eps), notEqual(rate, vec4(0.0)));
}

// x + change, with the part that rounding lost kept in `residual` (Kahan 1965): t_center moves by less than its last bit.
float compensated(float x, float change, inout float residual) {
    precise float y = change - residual;
    precise float sum = x + y;
    precise float lost = (sum - x) - y;
    residual = lost;
    return sum;
}

// The values of plane `p` after `change`; `residual` is t_center's.
vec4 moved(AdamParams a, uint kind, uint p, vec4 x, vec4 change, inout float residual) {
    vec4 y = mix(x + change, x, equal(change, vec4(0.0)));
    if (kind == GEOMETRY && p == 2u && change.w != 0.0) y.w = max(y.w, a.lowest_t_scale);
    if (kind == MOTION) y.w = compensated(x.w, change.w, residual);
    return y;
}
