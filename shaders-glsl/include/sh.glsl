// Real spherical harmonics in 3DGS's order and signs; `SH_DEGREE` is a define. Source: Kerbl et al. 2023 and
// Ramamoorthi and Hanrahan 2001. Factors are sqrt((2l+1)/(4 pi)) times those of the associated Legendre functions.

const float SH_0 = 0.28209479177387814;
const float SH_1 = 0.4886025119029199;

#if SH_DEGREE >= 1
vec3 sh_band1(vec4 c0, vec4 c1, vec4 c2, vec3 d) {
    return SH_1 * (-d.y * c0.xyz + d.z * vec3(c0.w, c1.xy) - d.x * vec3(c1.zw, c2.x));
}
#endif

#if SH_DEGREE >= 2
vec3 sh_band2(vec4 c0, vec4 c1, vec4 c2, vec4 c3, vec3 d) {
    const float xx = d.x * d.x, yy = d.y * d.y, zz = d.z * d.z;
    return 1.0925484305920792 * d.x * d.y * c0.xyz
        - 1.0925484305920792 * d.y * d.z * vec3(c0.w, c1.xy)
        + 0.31539156525252005 * (2.0 * zz - xx - yy) * vec3(c1.zw, c2.x)
        - 1.0925484305920792 * d.x * d.z * c2.yzw
        + 0.5462742152960396 * (xx - yy) * c3.xyz;
}
#endif

#if SH_DEGREE >= 3
vec3 sh_band3(vec4 c0, vec4 c1, vec4 c2, vec4 c3, vec4 c4, vec4 c5, vec3 d) {
    const float xx = d.x * d.x, yy = d.y * d.y, zz = d.z * d.z;
    return -0.5900435899266435 * d.y * (3.0 * xx - yy) * c0.xyz
        + 2.890611442640554 * d.x * d.y * d.z * vec3(c0.w, c1.xy)
        - 0.4570457994644658 * d.y * (4.0 * zz - xx - yy) * vec3(c1.zw, c2.x)
        + 0.3731763325901154 * d.z * (2.0 * zz - 3.0 * xx - 3.0 * yy) * c2.yzw
        - 0.4570457994644658 * d.x * (4.0 * zz - xx - yy) * c3.xyz
        + 1.445305721320277 * d.z * (xx - yy) * vec3(c3.w, c4.xy)
        - 0.5900435899266435 * d.x * (xx - 3.0 * yy) * vec3(c4.zw, c5.x);
}
#endif
