// Bilateral grids (Wang et al. 2024): 16 x 16 x 8 cells of affine maps of colours, over the picture and the luma. A cell is
// three vec4, the rows of its map, the constant last; x runs fastest, then y, then z, then the camera.
//
// The cells' columns stand at the corners of 15 x 15 panels; the pixels of a panel lie between the same four. A part is a
// few pixel rows of a panel and belongs to a team of four neighbouring lanes, each with two of the eight levels in its
// registers: the slices at any luma are a shuffle away, and no two teams add to the same sum.

const uint CELLS = 16u;   // across and down
const uint LEVELS = 8u;   // of luma
const uint PANELS = CELLS - 1u;
const uint GRID_ROWS = CELLS * CELLS * LEVELS * 3u;  // vec4 of a camera
const uint TEAM = 4u;
const uint PART_SUMS = 4u * LEVELS * 3u;  // vec4 that a part sums: the four columns at its corners

// Luma of Rec. 601, as the reference has it.
const vec3 LUMA = vec3(0.299, 0.587, 0.114);

// Pixels of a team: from `first` up to and without `end`.
struct Part {
    uvec2 panel;
    uvec2 first;
    uvec2 end;
};

// The first of n pixels along an axis whose centre is not before column `panel` of cells.
uint first_pixel(uint panel, uint n) { return (2u * panel * n + PANELS - 1u) / (2u * PANELS); }

// How far the centre of `pixel` is on its way across the panel, in [0, 1). From integers: one rounding at any size.
float across(uint pixel, uint panel, uint n) {
    return float(int((2u * pixel + 1u) * PANELS) - int(2u * panel * n)) / float(2u * n);
}

// Part `index` of those that have `rows` pixel rows, `parts` of them down a panel.
Part part_of(uint index, uvec2 size, uint rows, uint parts) {
    Part part;
    part.panel = uvec2(index % PANELS, index / PANELS / parts);
    part.first = uvec2(first_pixel(part.panel.x, size.x), first_pixel(part.panel.y, size.y));
    part.end = uvec2(first_pixel(part.panel.x + 1u, size.x), first_pixel(part.panel.y + 1u, size.y));
    part.first.y += index / PANELS % parts * rows;
    part.end.y = min(part.end.y, part.first.y + rows);
    return part;
}

// Place of the first row of the map of a cell.
uint cell_row(uvec2 xy, uint z) { return 3u * ((z * CELLS + xy.y) * CELLS + xy.x); }

// Whether the luma of a colour is where the level follows it.
bool level_follows(vec3 color) {
    const float luma = dot(color, LUMA);
    return luma > 0.0 && luma < 1.0;
}

// The level of a colour, 0 to LEVELS - 1; what is not a number has 0.
float level_of(vec3 color) {
    const float luma = dot(color, LUMA);
    return luma > 0.0 ? min(luma, 1.0) * float(LEVELS - 1u) : 0.0;
}
