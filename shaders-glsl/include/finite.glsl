// Finiteness by the exponent's bits: comparisons with infinity may be folded away by a compiler.

bool finite(float x) { return (floatBitsToUint(x) & 0x7f800000u) != 0x7f800000u; }

bool finite2(vec2 v) { return finite(v.x) && finite(v.y); }

bool finite3(vec3 v) { return finite(v.x) && finite(v.y) && finite(v.z); }

bool finite4(vec4 v) { return finite3(v.xyz) && finite(v.w); }
