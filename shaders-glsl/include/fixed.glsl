// Sums in fixed point: 64 bits, which add up to the same bits in any order, in two words or one.

// Words per active Gaussian: twelve sums, low word first, and behind them the weight of their large terms, likewise.
const uint FIXED_WORDS = 26u;
const uint FIXED_WEIGHT = 24u;

// A sum that leaves its 64 bits wraps, and nothing shows that afterwards. So the sizes of large terms are added up as well, whatever
// their signs and for the twelve sums of a Gaussian together. Of n terms of a sum those of at least FIXED_SMALL / n are large; an
// ordinary picture has none, and pays nothing. The small ones come to FIXED_SMALL at most, half of what FIXED_MOST leaves below 2^63:
// where the weight is below FIXED_MOST, no sum has wrapped.
const float FIXED_SMALL = 1152921504606846976.0;  // 2^60
// In units of 2^32: 3/4 of 2^63.
const uint FIXED_MOST = 0x60000000u;
// From here on a term is out of range by itself.
const float FIXED_RANGE = 4611686018427387904.0;  // 2^62

bool fixed_fits(float x) { return finite(x) && abs(x) < FIXED_RANGE; }

// `x`, which fits, rounded to an integer in two's complement, low word first.
uvec2 fixed_word(float x) {
    const float size = abs(x);
    // Exact: half is added to no size, since a sum would round, and a float's 24 bits never straddle the split in a way that does.
    const float below = floor(size);
    const float whole = below + (size - below < 0.5 ? 0.0 : 1.0);
    const uint high = uint(whole * (1.0 / 4294967296.0));
    const uint low = uint(whole - float(high) * 4294967296.0);
    return x < 0.0 ? uvec2(~low + 1u, ~high + uint(low == 0u)) : uvec2(low, high);
}

// The same of any `x`: 0 where it does not fit.
uvec2 to_fixed(float x) { return fixed_fits(x) ? fixed_word(x) : uvec2(0u); }

// Whether a term is large, by its bits, whose order has all that is not finite behind the numbers.
bool fixed_is_large(float x, float large) { return (floatBitsToUint(x) & 0x7fffffffu) >= floatBitsToUint(large); }

// The weight of a large term: its size in units of 2^32, rounded up; of one out of range, more than there may be.
uint fixed_weight(float x) { return fixed_fits(x) ? uint(abs(x) * (1.0 / 4294967296.0)) + 1u : FIXED_MOST; }

// Whether a term or a sum of a Gaussian was out of range, by its weight.
bool fixed_exceeds(uvec2 weight) { return weight.y != 0u || weight.x >= FIXED_MOST; }

// The number that `word` stands for, to the precision of a float.
float from_fixed(uvec2 word) {
    const bool negative = (word.y & 0x80000000u) != 0u;
    const uvec2 size = negative ? uvec2(~word.x + 1u, ~word.y + uint(word.x == 0u)) : word;
    const float x = float(size.y) * 4294967296.0 + float(size.x);
    return negative ? -x : x;
}
