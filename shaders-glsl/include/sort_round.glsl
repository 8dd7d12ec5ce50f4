// What a round of the radix sort reads and writes.
// INDEXED: a key's value is its place; else it is read.

layout(push_constant) uniform Push { uint shift; uint mask; } pc;
layout(set = 0, binding = 0) restrict readonly buffer Count { uint count[]; };
layout(set = 0, binding = 1) restrict readonly buffer BlockCounts { uint block_counts[]; };
layout(set = 0, binding = 2) restrict readonly buffer RangeCounts { uint range_counts[]; };
layout(set = 0, binding = 3) restrict readonly buffer KeysIn { uint keys_in[]; };
layout(set = 0, binding = 4) restrict writeonly buffer KeysOut { uint keys_out[]; };
layout(set = 0, binding = 5) restrict writeonly buffer ValuesOut { uint values_out[]; };
#ifndef INDEXED
layout(set = 0, binding = 6) restrict readonly buffer ValuesIn { uint values_in[]; };
#endif

uint digit_of(uint key) { return (key >> pc.shift) & pc.mask; }

uint value_of(uint i) {
#ifdef INDEXED
    return i;
#else
    return values_in[i];
#endif
}

// Keys with a digit: all, and those of the blocks before one.
uvec2 counts_of(uint digit, uint block, uint n_blocks) {
    const uint length = range_blocks(n_blocks);
    const uint n_ranges = div_ceil(n_blocks, length);
    const uint range = block / length;
    uvec2 sums = uvec2(0u);
    // Four loads at a time, which wait for memory together; what lies past the end is read and not added.
    for (uint r = 0u; r < n_ranges; r += 4u) {
        uint n[4];
        for (uint k = 0u; k < 4u; ++k) n[k] = range_counts[min(r + k, n_ranges - 1u) * DIGITS + digit];
        for (uint k = 0u; k < 4u; ++k) sums += uvec2(r + k < n_ranges ? n[k] : 0u, r + k < range ? n[k] : 0u);
    }
    const uint end = min(block, n_blocks);
    for (uint b = range * length; b < end; b += 4u) {
        uint n[4];
        for (uint k = 0u; k < 4u; ++k) n[k] = block_counts[min(b + k, end - 1u) * DIGITS + digit];
        for (uint k = 0u; k < 4u; ++k) sums.y += b + k < end ? n[k] : 0u;
    }
    return sums;
}

// Orders the shared memory of a subgroup alone: subgroupBarrier() orders buffers too, for which NVK empties a cache twice a lap.
void subgroup_shared_barrier() {
    controlBarrier(gl_ScopeSubgroup, gl_ScopeSubgroup, gl_StorageSemanticsShared, gl_SemanticsAcquireRelease);
}
