// Places of the indirect arguments, and the block sizes they are made for.

const uint ARGS_THREADS = 0u;      // 64 threads a workgroup
const uint ARGS_SCAN = 1u;         // SCAN_BLOCK items a workgroup, at least one
const uint ARGS_SORT = 2u;         // SORT_BLOCK keys a workgroup
const uint ARGS_FIRST_GROUP = 3u;  // one per group of Gaussians

const uint SCAN_BLOCK = 1024u;
const uint SORT_BLOCK = 2048u;
