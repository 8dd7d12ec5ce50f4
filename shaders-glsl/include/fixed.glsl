// Sums in fixed point: 64 bits, which add up to the same bits in any order, in two words or one.

// Words per active Gaussian: twelve sums, low word first, then one that is not 0 when a term was out of range, and an idle one.
const uint FIXED_WORDS = 26u;
const uint FIXED_POISON = 24u;

// `x` rounded to an integer in two's complement, low word first; false when it is not finite or at least 2^54, which leaves
// room for 512 such terms.
bool to_fixed(float x, out uvec2 word) {
    const float size = abs(x);
    word = uvec2(0u);
    if (!(finite(x) && size < 18014398509481984.0)) return false;
    // Exact: half is added to no size, since a sum would round, and a float's 24 bits never straddle the split in a way that does.
    const float below = floor(size);
    const float whole = below + (size - below < 0.5 ? 0.0 : 1.0);
    const uint high = uint(whole * (1.0 / 4294967296.0));
    const uint low = uint(whole - float(high) * 4294967296.0);
    word = x < 0.0 ? uvec2(~low + 1u, ~high + uint(low == 0u)) : uvec2(low, high);
    return true;
}

// The number that `word` stands for, to the precision of a float.
float from_fixed(uvec2 word) {
    const bool negative = (word.y & 0x80000000u) != 0u;
    const uvec2 size = negative ? uvec2(~word.x + 1u, ~word.y + uint(word.x == 0u)) : word;
    const float x = float(size.y) * 4294967296.0 + float(size.x);
    return negative ? -x : x;
}
