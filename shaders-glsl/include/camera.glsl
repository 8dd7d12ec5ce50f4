// World to camera. `precise`, and from the camera's centre: the difference is exact where the two are close, and cull
// and projection must see the same depth.

// Rows of a rotation; w: the camera's centre.
vec3 along_rows(vec4 row0, vec4 row1, vec4 row2, vec3 mean_world) {
    precise vec3 d = mean_world - vec3(row0.w, row1.w, row2.w);
    precise float x = row0.x * d.x + row0.y * d.y + row0.z * d.z;
    precise float y = row1.x * d.x + row1.y * d.y + row1.z * d.z;
    precise float z = row2.x * d.x + row2.y * d.y + row2.z * d.z;
    return vec3(x, y, z);
}

vec3 to_camera(ViewParams view, vec3 mean_world) { return along_rows(view.row0, view.row1, view.row2, mean_world); }

// The same for the camera one frame on.
vec3 to_next_camera(ViewParams view, vec3 mean_world) {
    return along_rows(view.next0, view.next1, view.next2, mean_world);
}

// A direction in camera axes.
vec3 rotate_to_camera(ViewParams view, vec3 v) {
    return vec3(dot(view.row0.xyz, v), dot(view.row1.xyz, v), dot(view.row2.xyz, v));
}

// The unit direction of `d` and the inverse of its length; scaled first, since squares past 1e19 are not representable.
vec3 unit_direction(vec3 d, out float inverse_length) {
    const float factor = unit_factor(max(max(abs(d.x), abs(d.y)), abs(d.z)));
    const vec3 scaled = d * factor;
    const float inverse = inversesqrt(dot(scaled, scaled));
    inverse_length = inverse * factor;
    return scaled * inverse;
}
