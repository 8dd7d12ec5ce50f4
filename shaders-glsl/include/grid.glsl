// One-dimensional grids, folded into two dimensions past the device's limit on workgroups. The last row of a folded
// grid holds padding groups: every kernel compares its index with its count before it touches memory.

const uint MAX_GROUPS = 65535u;

uint linear_group() { return gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x; }

// `size` is gl_WorkGroupSize.x: an include comes before the layout that sets it, and would see 1.
uint linear_thread(uint size) { return linear_group() * size + gl_LocalInvocationIndex; }

uint div_ceil(uint n, uint d) { return n / d + uint(n % d != 0u); }

// Indirect arguments for `n` workgroups.
uvec4 fold(uint n) { return uvec4(min(n, MAX_GROUPS), div_ceil(n, MAX_GROUPS), 1u, n); }

// Blocks of 32 items, `planes` vec4 each: coalesced for neighbours, one cache line apart for the planes of one item.
const uint PLANE_BLOCK = 32u;  // items in one block of planes
uint plane_index(uint i, uint planes, uint p) { return ((i >> 5u) * planes + p) * PLANE_BLOCK + (i & (PLANE_BLOCK - 1u)); }
