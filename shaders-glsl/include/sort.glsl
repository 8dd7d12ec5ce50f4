// Radix sort: digits, and how the counts of blocks are added up.

const uint DIGITS = 256u;  // room for the values of a digit

// Blocks of a range, a power of two near the square root of all: the sum over all blocks before one is that over a few ranges
// and a few blocks.
uint range_blocks(uint n_blocks) {
    const uint width = n_blocks > 1u ? uint(findMSB(n_blocks - 1u)) + 1u : 0u;
    return 1u << ((width + 1u) / 2u);
}
