// World to camera. `precise`, and from the camera's centre: the difference is exact where the two are close, and cull
// and projection must see the same depth.

vec3 to_camera(ViewParams view, vec3 mean_world) {
    precise vec3 d = mean_world - vec3(view.row0.w, view.row1.w, view.row2.w);
    precise float x = view.row0.x * d.x + view.row0.y * d.y + view.row0.z * d.z;
    precise float y = view.row1.x * d.x + view.row1.y * d.y + view.row1.z * d.z;
    precise float z = view.row2.x * d.x + view.row2.y * d.y + view.row2.z * d.z;
    return vec3(x, y, z);
}

// The same for the camera one frame on.
vec3 to_next_camera(ViewParams view, vec3 mean_world) {
    precise vec3 d = mean_world - vec3(view.next0.w, view.next1.w, view.next2.w);
    precise float x = view.next0.x * d.x + view.next0.y * d.y + view.next0.z * d.z;
    precise float y = view.next1.x * d.x + view.next1.y * d.y + view.next1.z * d.z;
    precise float z = view.next2.x * d.x + view.next2.y * d.y + view.next2.z * d.z;
    return vec3(x, y, z);
}

// A direction in camera axes.
vec3 rotate_to_camera(ViewParams view, vec3 v) {
    return vec3(dot(view.row0.xyz, v), dot(view.row1.xyz, v), dot(view.row2.xyz, v));
}

// The unit direction of `d` and the inverse of its length; scaled first, since squares past 1e19 are not representable.
vec3 unit_direction(vec3 d, out float inverse_length) {
    const float largest = max(max(abs(d.x), abs(d.y)), abs(d.z));
    const vec3 scaled = d / largest;
    const float inverse = inversesqrt(dot(scaled, scaled));
    inverse_length = inverse / largest;
    return scaled * inverse;
}
