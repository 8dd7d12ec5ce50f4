// Counter-based random numbers: a function of their key alone, in integers, so that every device draws the same.

// One linear congruential step and PCG's output permutation (O'Neill 2014; Jarzynski and Olano 2020).
uint permute(uint x) {
    const uint s = x * 747796405u + 2891336453u;
    const uint w = ((s >> ((s >> 28u) + 4u)) ^ s) * 277803737u;
    return (w >> 22u) ^ w;
}

// What the numbers of item `index` under `key` are drawn from.
uint random_key(uint key, uint index) { return permute(index + permute(key)); }

// Number `draw` of that item: 32 bits.
uint random_bits(uint key, uint index, uint draw) { return permute(draw + random_key(key, index)); }

// The high word of a * b: scales 32 random bits to 0 .. b - 1.
uint multiply_high(uint a, uint b) {
    const uint al = a & 0xffffu, ah = a >> 16u, bl = b & 0xffffu, bh = b >> 16u;
    const uint middle = ah * bl + ((al * bl) >> 16u);
    return ah * bh + (middle >> 16u) + ((al * bh + (middle & 0xffffu)) >> 16u);
}

// sin(pi/2 x) for x in 0 .. 1, to 1e-7: the built-in sine promises 2^-11.
float quarter_sine(float x) {
    const float y = x * x;
    return x * (1.5707963 + y * (-0.6459641 + y * (0.079692626 + y * (-0.0046817541
        + y * (1.6044118e-4 - y * 3.5988432e-6)))));
}

// Two standard normal numbers from the draws `draw` and `draw + 1` (Box and Muller).
vec2 random_normals(uint key, uint index, uint draw) {
    const float u = (float(random_bits(key, index, draw) >> 8u) + 1.0) / 16777216.0;
    const float radius = sqrt(max(-2.0 * log(u), 0.0));
    // The angle: two bits of quarter turns, 24 of a fraction of one.
    const uint bits = random_bits(key, index, draw + 1u);
    const float x = float((bits >> 6u) & 0xffffffu) / 16777216.0;
    const vec2 in_quarter = vec2(quarter_sine(1.0 - x), quarter_sine(x));
    const vec2 turned = (bits & 0x40000000u) != 0u ? vec2(-in_quarter.y, in_quarter.x) : in_quarter;
    return (bits & 0x80000000u) != 0u ? -radius * turned : radius * turned;
}

// Three standard normal numbers from four draws.
vec3 random_normals3(uint key, uint index, uint draw) {
    return vec3(random_normals(key, index, draw), random_normals(key, index, draw + 2u).x);
}
