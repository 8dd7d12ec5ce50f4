// What LPIPS v0.1 does to a picture of [0, 1] before the trunk: 2 x - 1, less the shift, over the scale. Many leave the first out.

const vec3 LPIPS_SHIFT = vec3(-0.030, -0.088, -0.188);
const vec3 LPIPS_SCALE = vec3(0.458, 0.448, 0.450);
