// The power of two that brings numbers, the largest of size `largest`, to about 1, held in the range of floats. No division: past
// 2^126 a device may take the inverse for 0.
float unit_factor(float largest) {
    const uint exponent = floatBitsToUint(largest) & 0x7f800000u;
    return uintBitsToFloat(0x7f000000u - min(exponent, 0x7e800000u));
}
