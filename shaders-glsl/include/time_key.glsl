// Times as integers, for the ends of lives.

// A number that orders as x does: 0 before all times, FOREVER behind them.
const uint FOREVER = 0xffffffffu;
uint time_key(float x) {
    const uint bits = floatBitsToUint(x);
    return (bits & 0x80000000u) != 0u ? ~bits : bits | 0x80000000u;
}
