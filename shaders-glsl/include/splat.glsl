// One projected Gaussian as four vec4, and the two predicates that every kernel shares.
//
//   0: x, y, M00, M01      1: M10, M11, opacity, z      2: r, g, b, flow_x      3: flow_y, slope, chord, reach_y
//
// The region where alpha >= alpha_min is an ellipse about (x, y): |M d|^2 <= log2(opacity / alpha_min). `reach_y` is
// its half-height, `chord` its half-width along its middle row, and in a row dy from the middle it spans
//   slope dy -+ chord sqrt(1 - (dy / reach_y)^2).
// `chord` and `reach_y` carry a margin of 5e-6, far above rounding, so that no pixel is lost.

const uint SPLAT_PLANES = 4u;

// One kernel counts a Gaussian's tiles and another writes them. Sums and products below are `precise`, so both have the same; but
// Vulkan lets each have its own quotients, roots and logarithms. So the one that writes takes half of the margin: what it lists
// was counted, and none of its own tiles comes too late for a slot. Of chord, root of 1 - f^2 where f is a quotient, both kernels
// together err by 1.6e-6, in units of that root; of log(opacity / alpha_min) by 3.5e-6.
vec3 inner_ellipse(vec3 ellipse) { return vec3(ellipse.x, ellipse.yz * (1.0 - 2.5e-6)); }
float inner_opacity(float opacity) { return opacity * (1.0 + 4e-6); }

// Alpha before the clamp, at pixel centre minus projected centre. The one definition of what a pixel sees.
float splat_alpha(vec4 m, float opacity, vec2 d) {
    precise float u = m.x * d.x + m.y * d.y;
    precise float w = m.z * d.x + m.w * d.y;
    precise float power = u * u + w * w;
    precise float alpha = opacity * exp2(-power);
    return alpha;
}

// Where alpha reaches alpha_min: the square of the distance from the centre, in standard deviations, with a margin. Below 0 it
// does so nowhere.
float squared_reach(ViewParams view, float opacity) {
    precise float reach = 2.0 * log(opacity / view.alpha_min) * (1.0 + 1e-5) + 1e-5;
    return reach;
}

// That of a Gaussian which is listed though it does not show: box_reach tells the square's size from it.
const float FADED_REACH = 2e-5;

// The x-range, pixels, of the ellipse's part between rows y_low and y_high (pixel centres). Empty when x > y.
vec2 band_extent(vec2 xy, float slope, float chord, float reach_y, float y_low, float y_high) {
    precise float margin_y = 1e-3 + 1e-6 * abs(xy.y);
    precise float d_low = max(y_low - xy.y - margin_y, -reach_y);
    precise float d_high = min(y_high - xy.y + margin_y, reach_y);
    precise float tilt = slope * reach_y;
    precise float reach_x = sqrt(tilt * tilt + chord * chord);
    // The row of the rightmost point; the leftmost lies opposite.
    precise float d_tip = reach_y * (tilt / reach_x);
    precise float d_right = clamp(d_tip, d_low, d_high);
    precise float d_left = clamp(-d_tip, d_low, d_high);
    precise float f_right = d_right / reach_y;
    precise float f_left = d_left / reach_y;
    precise float right = slope * d_right + chord * sqrt(max(1.0 - f_right * f_right, 0.0));
    precise float left = slope * d_left - chord * sqrt(max(1.0 - f_left * f_left, 0.0));
    precise float margin_x = 1e-3 + 1e-6 * (abs(xy.x) + reach_x);
    return d_low <= d_high ? vec2(xy.x + left - margin_x, xy.x + right + margin_x) : vec2(1.0, 0.0);
}

bool squared(ViewParams view) { return (unfolded(view.bounds) & TILES_MASK) == TILES_SQUARE; }

// A coarser bound than the ellipse: half the sides, pixels, of a box about (x, y) that holds it. That of the ellipse
// itself, or 3DGS's square about the widest axis for an opacity of 1, whatever the Gaussian's is. Neither changes a picture:
// both list pairs for nothing.
vec2 box_reach(ViewParams view, float opacity, vec3 ellipse) {
    precise float tilt = ellipse.x * ellipse.z;
    precise float xx = tilt * tilt + ellipse.y * ellipse.y;
    precise float yy = ellipse.z * ellipse.z;
    precise float half_difference = 0.5 * (xx - yy);
    precise float xy = tilt * ellipse.z;
    precise float widest = sqrt(0.5 * (xx + yy) + sqrt(half_difference * half_difference + xy * xy));
    precise float own = sqrt(max(log(opacity / view.alpha_min), 0.5 * FADED_REACH));
    precise float side = widest * max(sqrt(-log(view.alpha_min)) / own, 1.0) * (1.0 + 1e-5);
    return squared(view) ? vec2(side) : vec2(sqrt(xx), ellipse.z);
}

bool boxed(ViewParams view) { return (unfolded(view.bounds) & TILES_MASK) != TILES_ELLIPSE; }

// Of `n` tiles in a row those, [x, y), with a pixel centre from `low` to `high`.
uvec2 tiles_between(float low, float high, float n) {
    precise float first = (low - 15.5) * 0.0625;
    precise float last = (high - 0.5) * 0.0625;
    return uvec2(uint(clamp(ceil(first), 0.0, n)), uint(clamp(floor(last) + 1.0, 0.0, n)));
}

// Tile rows [x, y) of the strip that the ellipse may touch.
uvec2 tile_rows(ViewParams view, float y, float reach_y) {
    precise float margin = 1e-3 + 1e-6 * abs(y);
    precise float top = y - float(view.first_row) - reach_y - margin;
    precise float bottom = y - float(view.first_row) + reach_y + margin;
    return tiles_between(top, bottom, float(view.tiles_y));
}

// Tile columns [x, y) that the ellipse touches in tile row `row` of the strip; x >= y means none.
uvec2 tile_columns(ViewParams view, vec2 xy, float slope, float chord, float reach_y, uint row) {
    const float y0 = float(view.first_row + TILE * row);
    const vec2 extent = band_extent(xy, slope, chord, reach_y, y0 + 0.5, y0 + 15.5);
    const uvec2 columns = tiles_between(extent.x, extent.y, float(view.tiles_x));
    return extent.x <= extent.y ? columns : uvec2(0u);
}

// Tile columns [x, y) that a box about `x` of half-width `reach_x` touches.
uvec2 box_columns(ViewParams view, float x, float reach_x) {
    precise float margin = 1e-3 + 1e-6 * (abs(x) + reach_x);
    precise float left = x - reach_x - margin;
    precise float right = x + reach_x + margin;
    const uvec2 columns = tiles_between(left, right, float(view.tiles_x));
    return uvec2(columns.x, max(columns.y, columns.x));
}

// The rows and columns that a Gaussian is listed for, by the view's bound.
uvec2 listed_rows(ViewParams view, vec2 xy, float opacity, vec3 ellipse) {
    return tile_rows(view, xy.y, boxed(view) ? box_reach(view, opacity, ellipse).y : ellipse.z);
}

uvec2 listed_columns(ViewParams view, vec2 xy, float opacity, vec3 ellipse, uint row) {
    if (boxed(view)) return box_columns(view, xy.x, box_reach(view, opacity, ellipse).x);
    return tile_columns(view, xy, ellipse.x, ellipse.y, ellipse.z, row);
}
