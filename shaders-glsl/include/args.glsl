// Places of the indirect arguments, and the block sizes they are made for.

const uint ARGS_THREADS = 0u;      // 64 threads a workgroup
const uint ARGS_SCAN = 1u;         // SCAN_BLOCK items a workgroup
const uint ARGS_SORT = 2u;         // SORT_BLOCK keys a workgroup
const uint ARGS_SORT_SCAN = 3u;    // SCAN_BLOCK digit counts a workgroup
const uint ARGS_FIRST_GROUP = 4u;  // one per group of Gaussians

const uint SCAN_BLOCK = 1024u;
const uint SORT_BLOCK = 2048u;
