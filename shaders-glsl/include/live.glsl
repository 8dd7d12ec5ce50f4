// Blocks of 128 Gaussians of a group that a dispatch goes over, a workgroup each: all, or those that live_blocks.comp listed. To be
// included behind the buffers `live` and `live_args`, a group's own.

const uint NO_BLOCK = 0xffffffffu;

// The block that workgroup `place` takes of a group of `n`; NO_BLOCK for the padding of a folded grid.
uint block_at(uint place, uint n, uint is_listed) {
    uint count = n;
    uint block = place;
    if (unfolded(is_listed) != 0u) {
        count = live_args[3];
        block = live[min(place, n - 1u)];
    }
    return place < count ? block : NO_BLOCK;
}
