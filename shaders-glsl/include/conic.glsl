// The projected Gaussian in factored form (research: numerics_reliability.md, rows 1 and 2).
//
// With V = J R Rot(q) diag(s), a 2 x 3 matrix of rows r0 and r1, the covariance is [[a, b], [b, c]] + blur I and
//   det = |r0 x r1|^2 + blur (|r0|^2 + |r1|^2) + blur^2      (Cauchy-Binet)
// where every term is >= 0, so det cannot cancel. The cross product's components are s_j s_k times minors of G = J R
// Rot(q): products of scales are never subtracted. A square root M of the inverse covariance replaces the usual
// quadratic form: its exponent |M d|^2 is a sum of squares and never negative. Everything is divided by m = max |V|,
// so that log-scales up to 40 do not overflow; lengths are held below HUGE_PX, past which an image cannot tell.

const float HUGE_PX = 1e15;

// sqrt(log2(e) / 2): alpha = opacity * exp2(-|M d|^2) with M scaled by this.
const float EXP2_FACTOR = 0.8493218002880191;

struct Conic {
    vec4 m;       // M, row-major, scaled by EXP2_FACTOR
    float sd_y;   // sqrt(C_yy), pixels
    float slope;  // C_xy / C_yy
    float chord;  // sqrt(det / C_yy): half-width of the one-sigma ellipse along its middle row, pixels
};

Conic conic_of(vec3 g0_world, vec3 g1_world, vec3 s_world, float blur) {
    // Scales in pixels: far away G is as small as s is large, and products of either alone are not representable.
    const vec3 gain3 = max(abs(g0_world), abs(g1_world));
    const float gain = max(max(max(gain3.x, gain3.y), gain3.z), 1e-37);
    const vec3 g0 = g0_world / gain;
    const vec3 g1 = g1_world / gain;
    const vec3 s = s_world * gain;
    precise vec3 r0 = g0 * s;
    precise vec3 r1 = g1 * s;
    const vec3 largest = max(abs(r0), abs(r1));
    const float m = max(max(max(largest.x, largest.y), largest.z), 1e-18);
    precise vec3 e0 = r0 / m;
    precise vec3 e1 = r1 / m;
    precise float blur_m = blur / m / m;
    precise float a = e0.x * e0.x + e0.y * e0.y + e0.z * e0.z;
    precise float c = e1.x * e1.x + e1.y * e1.y + e1.z * e1.z;
    precise float b = e0.x * e1.x + e0.y * e1.y + e0.z * e1.z;
    // |r0 x r1| / m, component by component.
    const vec3 s_m = s / m;
    precise float cx = (s_m.y * s.z) * (g0.y * g1.z - g0.z * g1.y);
    precise float cy = (s_m.z * s.x) * (g0.z * g1.x - g0.x * g1.z);
    precise float cz = (s_m.x * s.y) * (g0.x * g1.y - g0.y * g1.x);
    const float cap = 1e14;
    const vec3 cross_m = min(abs(vec3(cx, cy, cz)), vec3(cap));
    // det / m^2, in square pixels.
    precise float det = (cross_m.x * cross_m.x + cross_m.y * cross_m.y + cross_m.z * cross_m.z) + blur * (a + c)
        + blur * blur_m;
    const float aa = max(a + blur_m, 1e-36);
    const float cc = max(c + blur_m, 1e-36);
    const float root_det = sqrt(det);
    const float root_a = sqrt(aa);
    const float root_c = sqrt(cc);
    Conic conic;
    if (aa >= cc) {
        const float minor = min(root_det / root_a, HUGE_PX);
        conic.m = EXP2_FACTOR * vec4(1.0 / min(m * root_a, HUGE_PX), 0.0, -(b / aa) / minor, 1.0 / minor);
    } else {
        const float minor = min(root_det / root_c, HUGE_PX);
        conic.m = EXP2_FACTOR * vec4(0.0, 1.0 / min(m * root_c, HUGE_PX), 1.0 / minor, -(b / cc) / minor);
    }
    conic.sd_y = min(m * root_c, HUGE_PX);
    conic.slope = b / cc;
    conic.chord = min(root_det / root_c, HUGE_PX);
    return conic;
}
