// GLSL: projection of a Gaussian (as the engine's SPEC 3 has it), the blending of its quad, and the last pass to the screen.

/** Texels of a row of the texture that holds the order of drawing. */
export const ORDER_WIDTH = 2048;

/**
 * Four vertices are one Gaussian, in the order of drawing. Instances would be fewer words, but devices are slow at small ones.
 * @param {number} shDegree @param {number} lookTexels
 */
export const splatVertexSource = (shDegree, lookTexels) => `#version 300 es
precision highp float;
precision highp int;
precision highp sampler2D;
precision highp usampler2D;
#define SH_DEGREE ${shDegree}
#define LOOK_TEXELS ${lookTexels}
uniform usampler2D order;
uniform sampler2D geometry;
uniform usampler2D look;
uniform int row_slots;
uniform mat3 rotation;      // world to camera
uniform vec3 center;        // of the camera, world
uniform vec4 intrinsics;    // fx, fy, cx, cy
uniform vec4 clamp_uv;      // least x, y, largest x, y of the Jacobian's x/z and y/z
uniform vec4 constants;     // blur, alpha_min, near, time
uniform vec2 size;          // of the picture, pixels
out vec2 w;                 // place within the Gaussian, standard deviations
flat out vec4 color;        // rgb, opacity

// Coefficient k of the SH bytes, which begin at byte 8: -4 + byte * 8 / 255.
vec3 coefficient(uint words[4 * LOOK_TEXELS], const int k) {
  vec3 c;
  for (int channel = 0; channel < 3; ++channel) {
    int at = 8 + 3 * k + channel;
    c[channel] = float((words[at >> 2] >> uint(8 * (at & 3))) & 255u);
  }
  return c * (8.0 / 255.0) - 4.0;
}

vec3 color_of(ivec2 texel, vec3 d) {
  uint words[4 * LOOK_TEXELS];
  for (int i = 0; i < LOOK_TEXELS; ++i) {
    uvec4 w = texelFetch(look, texel + ivec2(i, 0), 0);
    for (int k = 0; k < 4; ++k) words[4 * i + k] = w[k];
  }
  vec3 c = vec3(unpackUnorm2x16(words[0]), unpackUnorm2x16(words[1]).x);
#if SH_DEGREE >= 1
  c += 0.4886025119029199 * (-d.y * coefficient(words, 0) + d.z * coefficient(words, 1) - d.x * coefficient(words, 2));
#endif
#if SH_DEGREE >= 2
  float xx = d.x * d.x, yy = d.y * d.y, zz = d.z * d.z;
  c += 1.0925484305920792 * (d.x * d.y * coefficient(words, 3) - d.y * d.z * coefficient(words, 4) - d.x * d.z * coefficient(words, 6))
    + 0.31539156525252005 * (2.0 * zz - xx - yy) * coefficient(words, 5) + 0.5462742152960396 * (xx - yy) * coefficient(words, 7);
#endif
#if SH_DEGREE >= 3
  c += -0.5900435899266435 * (d.y * (3.0 * xx - yy) * coefficient(words, 8) + d.x * (xx - 3.0 * yy) * coefficient(words, 14))
    + 2.890611442640554 * d.x * d.y * d.z * coefficient(words, 9)
    - 0.4570457994644658 * (4.0 * zz - xx - yy) * (d.y * coefficient(words, 10) + d.x * coefficient(words, 12))
    + 0.3731763325901154 * d.z * (2.0 * zz - 3.0 * xx - 3.0 * yy) * coefficient(words, 11)
    + 1.445305721320277 * d.z * (xx - yy) * coefficient(words, 13);
#endif
  return max(c, 0.0);
}

mat3 rotation_of(vec4 q) {
  vec3 q2 = q.xyz + q.xyz;
  float xx = q.x * q2.x, xy = q.x * q2.y, xz = q.x * q2.z, yy = q.y * q2.y, yz = q.y * q2.z, zz = q.z * q2.z;
  vec3 w = q.w * q2;
  return mat3(1.0 - yy - zz, xy + w.z, xz - w.y, xy - w.z, 1.0 - xx - zz, yz + w.x, xz + w.y, yz - w.x, 1.0 - xx - yy);
}

void main() {
  int place_in_order = gl_VertexID >> 2;
  int id = int(texelFetch(order, ivec2(place_in_order % ${ORDER_WIDTH}, place_in_order / ${ORDER_WIDTH}), 0).r);
  ivec2 at = ivec2(id % row_slots, id / row_slots);
  ivec2 texel = ivec2(4 * at.x, at.y);
  vec4 place = texelFetch(geometry, texel, 0);
  vec4 motion = texelFetch(geometry, texel + ivec2(1, 0), 0);
  vec4 shape = texelFetch(geometry, texel + ivec2(2, 0), 0);
  float dt = constants.w - motion.w;
  float age = dt * shape.w;
  float opacity = place.w * exp(-age * age);
  vec3 world = place.xyz + dt * motion.xyz - center;
  vec3 p = rotation * world;
  w = vec2(0.0);
  color = vec4(0.0);
  gl_Position = vec4(2.0, 2.0, 2.0, 1.0);
  if (!(opacity >= constants.y) || !(p.z > constants.z)) return;

  vec2 uv = p.xy / p.z;
  vec2 f_z = intrinsics.xy / p.z;
  vec2 j = clamp(uv, clamp_uv.xy, clamp_uv.zw);
  mat3 m = rotation * rotation_of(texelFetch(geometry, texel + ivec2(3, 0), 0));
  vec3 row2 = vec3(m[0].z, m[1].z, m[2].z);
  vec3 r0 = f_z.x * (vec3(m[0].x, m[1].x, m[2].x) - j.x * row2) * shape.xyz;
  vec3 r1 = f_z.y * (vec3(m[0].y, m[1].y, m[2].y) - j.y * row2) * shape.xyz;
  // The determinant by Cauchy-Binet is a sum of squares: it does not cancel where a Gaussian is thin.
  float blur = constants.x;
  float a = dot(r0, r0), c = dot(r1, r1);
  vec3 area = cross(r0, r1);
  float det = dot(area, area) + blur * (a + c) + blur * blur;
  float sd_x = sqrt(a + blur);
  // d = L w with C = L L^T; the quad covers |w| <= reach, where alpha falls to alpha_min.
  float reach = sqrt(max(0.0, 2.0 * log(opacity / constants.y)));
  vec4 axes = reach * vec4(sd_x, dot(r0, r1) / sd_x, 0.0, sqrt(det) / sd_x);
  vec2 xy = intrinsics.xy * uv + intrinsics.zw;
  if (!(dot(abs(axes), vec4(1.0)) + abs(xy.x) + abs(xy.y) < 1e9)) return;
  vec2 corner = vec2(gl_VertexID & 1, (gl_VertexID >> 1) & 1) * 2.0 - 1.0;
  xy += corner.x * axes.xy + corner.y * axes.zw;
  w = corner * reach;
  color = vec4(color_of(ivec2(LOOK_TEXELS * at.x, at.y), normalize(world)), opacity);
  gl_Position = vec4(2.0 * xy.x / size.x - 1.0, 1.0 - 2.0 * xy.y / size.y, 0.0, 1.0);
}`;

export const splatFragmentSource = `#version 300 es
precision highp float;
in vec2 w;
flat in vec4 color;
uniform vec2 alpha_range;
out vec4 result;
void main() {
  float alpha = color.a * exp(-0.5 * dot(w, w));
  if (alpha < alpha_range.x) discard;
  alpha = min(alpha, alpha_range.y);
  result = vec4(color.rgb * alpha, alpha);
}`;

export const screenVertexSource = `#version 300 es
void main() {
  gl_Position = vec4(gl_VertexID == 1 ? 3.0 : -1.0, gl_VertexID == 2 ? 3.0 : -1.0, 0.0, 1.0);
}`;

export const screenFragmentSource = `#version 300 es
precision highp float;
precision highp sampler2D;
uniform sampler2D picture;
uniform ivec2 origin;
uniform vec3 background;
out vec4 result;
void main() {
  vec4 c = texelFetch(picture, ivec2(gl_FragCoord.xy) - origin, 0);
  result = vec4(c.rgb + (1.0 - c.a) * background, 1.0);
}`;
