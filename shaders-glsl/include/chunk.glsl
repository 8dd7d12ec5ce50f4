// Long lists on GPUs: cut into chunks, so that no subgroup walks a whole list while the others have ended.

const uint CHUNK = 1024u;   // entries of a chunk; a list that is longer has chunks, a workgroup each
const uint CHUNK_ROW = 64u;  // workgroups in a row of a grid of chunks, whose rows are an atomic maximum

// Places of the indirect arguments, of four words each; the last word is the number of items.
const uint CHUNK_ALL = 0u;    // chunks, and after them a workgroup for each tile
const uint CHUNK_ITEMS = 1u;  // chunks
const uint CHUNK_LONG = 2u;   // long lists, MERGE_GROUPS workgroups each

const uint MERGE_GROUPS = 4u;  // workgroups that merge a tile
