// Quaternions (w, x, y, z) and their matrices.

// A quaternion of any length as a unit one and the inverse of its length; scaled first, since squares of 1e-30 or 1e20 are not
// representable.
vec4 unit_quaternion(vec4 q, out float inverse_length) {
    const vec4 size = abs(q);
    const float factor = unit_factor(max(max(size.x, size.y), max(size.z, size.w)));
    const vec4 scaled = q * factor;
    const float inverse = inversesqrt(dot(scaled, scaled));
    inverse_length = inverse * factor;
    return scaled * inverse;
}

// Columns of the rotation of a unit quaternion.
mat3 rotation_of(vec4 q) {
    const float w = q.x, x = q.y, y = q.z, z = q.w;
    return mat3(
        1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + w * z), 2.0 * (x * z - w * y),
        2.0 * (x * y - w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z + w * x),
        2.0 * (x * z + w * y), 2.0 * (y * z - w * x), 1.0 - 2.0 * (x * x + y * y));
}

// Gradient of the unit quaternion from that of its matrix, d_r[column][row].
vec4 d_unit_quaternion(vec4 q, mat3 d_r) {
    const float w = q.x, x = q.y, y = q.z, z = q.w;
    return 2.0 * vec4(
        x * (d_r[1][2] - d_r[2][1]) + y * (d_r[2][0] - d_r[0][2]) + z * (d_r[0][1] - d_r[1][0]),
        -2.0 * x * (d_r[1][1] + d_r[2][2]) + y * (d_r[1][0] + d_r[0][1]) + z * (d_r[2][0] + d_r[0][2])
            + w * (d_r[1][2] - d_r[2][1]),
        x * (d_r[1][0] + d_r[0][1]) - 2.0 * y * (d_r[0][0] + d_r[2][2]) + z * (d_r[2][1] + d_r[1][2])
            + w * (d_r[2][0] - d_r[0][2]),
        x * (d_r[2][0] + d_r[0][2]) + y * (d_r[2][1] + d_r[1][2]) - 2.0 * z * (d_r[0][0] + d_r[1][1])
            + w * (d_r[0][1] - d_r[1][0]));
}
