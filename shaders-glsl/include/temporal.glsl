// Motion and temporal opacity (SPEC 2).

float sigmoid(float x) { return 1.0 / (1.0 + exp(-x)); }

// mu(t') of a Gaussian with motion (velocity, t_center).
vec3 mean_at(vec3 mean, vec4 motion, float time) {
    precise vec3 moved = mean + motion.xyz * (time - motion.w);
    return moved;
}

// 1 / tau, held below infinity so that 0 / tau is 0 for the shortest tau too.
float rate_of(float t_scale) { return exp(min(-t_scale, 80.0)); }

// exp(-u^2); u is clamped where the result is zero anyway, so that u^2 cannot overflow.
float temporal_weight(float t_center, float t_scale, float time) {
    precise float u = min(abs(time - t_center) * rate_of(t_scale), 16.0);
    return exp(-u * u);
}
