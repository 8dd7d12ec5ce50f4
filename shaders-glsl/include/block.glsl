// Blocks of pixels that a subgroup blends: as wide as the subgroup up to a tile, PIXELS rows of lanes high.

// GPUs blend four pixels a lane and walk long lists in chunks, CPU drivers eight and in rounds.
#if PIXELS == 4
#define CHUNKED
#include "chunk.glsl"
#endif

// Entries of a list that a round walks: lavapipe ends an invocation's loops after 65,535 iterations in all, without a word.
const uint SEGMENT = 32768u;

struct BlockShape {
    uint columns;    // pixels across
    uint lane_rows;  // rows that the lanes cover at once; a lane's pixels lie this far apart
    uint rows;       // pixels down
    uint per_tile;   // blocks of a tile
};

BlockShape block_shape() {
    const uint columns = min(gl_SubgroupSize, TILE);
    const uint lane_rows = gl_SubgroupSize / columns;
    const uint rows = lane_rows * PIXELS;
    return BlockShape(columns, lane_rows, rows, TILE / columns * (TILE / rows));
}

// The block's first pixel, column and row of the strip.
uvec2 block_first(ViewParams view, BlockShape shape, uint tile, uint block) {
    const uint across = TILE / shape.columns;
    return uvec2(tile % view.tiles_x, tile / view.tiles_x) * TILE
        + uvec2(block % across * shape.columns, block / across * shape.rows);
}

#ifdef CHUNKED
// Of a lane's k-th pixel, the place in the tile, of which a workgroup's subgroups are the blocks.
uint pixel_of_tile(BlockShape shape, uint lane, uint k) {
    const uint across = TILE / shape.columns;
    const uint row = gl_SubgroupID / across * shape.rows + lane / shape.columns + k * shape.lane_rows;
    return row * TILE + gl_SubgroupID % across * shape.columns + lane % shape.columns;
}
#endif

// Whether an ellipse (slope, chord, reach_y) may touch the block whose first pixel centre is `corner`, or nobody asks.
bool touches_block(ViewParams view, vec2 xy, vec3 ellipse, vec2 corner, BlockShape shape) {
    const vec2 last = corner + vec2(float(shape.columns - 1u), float(shape.rows - 1u));
    const vec2 extent = band_extent(xy, ellipse.x, ellipse.y, ellipse.z, corner.y, last.y);
    const bool meets = extent.x <= extent.y && extent.y >= corner.x && extent.x <= last.x;
    const bool unasked = (unfolded(view.bounds) & EVERY_BLOCK) != 0u;
    return meets || unasked;
}
