// Derivatives of include/sh.glsl: of the coefficients, and of the direction. `g` is the colour's gradient.

#if SH_DEGREE >= 1
vec3 sh_band1_d_dir(vec4 c0, vec4 c1, vec4 c2, vec3 g) {
    return SH_1 * vec3(-dot(vec3(c1.zw, c2.x), g), -dot(c0.xyz, g), dot(vec3(c0.w, c1.xy), g));
}
#endif

#if SH_DEGREE >= 2
const float SH_2A = 1.0925484305920792;
const float SH_2B = 0.31539156525252005;
const float SH_2C = 0.5462742152960396;

// The five functions of band 2.
float[5] sh_basis2(vec3 d) {
    const float xx = d.x * d.x, yy = d.y * d.y, zz = d.z * d.z;
    return float[5](SH_2A * d.x * d.y, -SH_2A * d.y * d.z, SH_2B * (2.0 * zz - xx - yy), -SH_2A * d.x * d.z,
        SH_2C * (xx - yy));
}

vec3 sh_band2_d_dir(vec4 c0, vec4 c1, vec4 c2, vec4 c3, vec3 d, vec3 g) {
    const float p0 = dot(c0.xyz, g), p1 = dot(vec3(c0.w, c1.xy), g), p2 = dot(vec3(c1.zw, c2.x), g);
    const float p3 = dot(c2.yzw, g), p4 = dot(c3.xyz, g);
    return SH_2A * (p0 * vec3(d.y, d.x, 0.0) - p1 * vec3(0.0, d.z, d.y) - p3 * vec3(d.z, 0.0, d.x))
        + SH_2B * p2 * vec3(-2.0 * d.x, -2.0 * d.y, 4.0 * d.z) + SH_2C * p4 * vec3(2.0 * d.x, -2.0 * d.y, 0.0);
}
#endif

#if SH_DEGREE >= 3
const float SH_3A = 0.5900435899266435;
const float SH_3B = 2.890611442640554;
const float SH_3C = 0.4570457994644658;
const float SH_3D = 0.3731763325901154;
const float SH_3E = 1.445305721320277;

// The seven functions of band 3.
float[7] sh_basis3(vec3 d) {
    const float xx = d.x * d.x, yy = d.y * d.y, zz = d.z * d.z;
    return float[7](-SH_3A * d.y * (3.0 * xx - yy), SH_3B * d.x * d.y * d.z, -SH_3C * d.y * (4.0 * zz - xx - yy),
        SH_3D * d.z * (2.0 * zz - 3.0 * xx - 3.0 * yy), -SH_3C * d.x * (4.0 * zz - xx - yy), SH_3E * d.z * (xx - yy),
        -SH_3A * d.x * (xx - 3.0 * yy));
}

vec3 sh_band3_d_dir(vec4 c0, vec4 c1, vec4 c2, vec4 c3, vec4 c4, vec4 c5, vec3 d, vec3 g) {
    const float x = d.x, y = d.y, z = d.z, xx = x * x, yy = y * y, zz = z * z;
    return -SH_3A * dot(c0.xyz, g) * vec3(6.0 * x * y, 3.0 * xx - 3.0 * yy, 0.0)
        + SH_3B * dot(vec3(c0.w, c1.xy), g) * vec3(y * z, x * z, x * y)
        - SH_3C * dot(vec3(c1.zw, c2.x), g) * vec3(-2.0 * x * y, 4.0 * zz - xx - 3.0 * yy, 8.0 * y * z)
        + SH_3D * dot(c2.yzw, g) * vec3(-6.0 * x * z, -6.0 * y * z, 6.0 * zz - 3.0 * xx - 3.0 * yy)
        - SH_3C * dot(c3.xyz, g) * vec3(4.0 * zz - 3.0 * xx - yy, -2.0 * x * y, 8.0 * x * z)
        + SH_3E * dot(vec3(c3.w, c4.xy), g) * vec3(2.0 * x * z, -2.0 * y * z, xx - yy)
        - SH_3A * dot(vec3(c4.zw, c5.x), g) * vec3(3.0 * xx - 3.0 * yy, -6.0 * x * y, 0.0);
}
#endif
