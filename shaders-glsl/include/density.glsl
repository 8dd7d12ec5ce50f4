// What the kernels of density control share.

// Bits of `flags`.
const uint EXISTS = 1u;   // 0 in the gaps between groups
const uint KEPT = 2u;     // neither pruned nor dead
const uint LARGE = 4u;    // splits when it grows
const uint GROWS = 8u;

// Where a new Gaussian comes from: the flat index of the old one, and what becomes of it.
const uint SOURCE_BITS = 30u;
const uint AS_IT_WAS = 0u;  // keeps its moments; all others begin with none
const uint COPY = 1u;
const uint HALF_A = 2u;
const uint HALF_B = 3u;

uint source_word(uint flat_index, uint kind) { return flat_index | (kind << SOURCE_BITS); }
uint source_of(uint word) { return word & ((1u << SOURCE_BITS) - 1u); }
uint kind_of(uint word) { return word >> SOURCE_BITS; }

// Places in `counters`.
const uint N_LISTED = 0u;
const uint N_KEPT = 1u;
const uint N_CLONED = 2u;
const uint N_SPLIT = 3u;
const uint N_BUCKET = 4u;  // eight: Gaussians of each bucket, 4 * is dynamic + 3 - SH degree

// Bucket, slot of time and place of a Gaussian, most significant first. The bucket has 3 bits, the slot one more than there are
// levels, the place 24, of which the lowest make way for more than so many levels.
const uint CODE_BUCKET = 29u;
const uint LEVELS_BESIDE_PLACE = 4u;
