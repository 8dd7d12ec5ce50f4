// Structs that the host shares; the Rust side is generated from these.

// One view, or one horizontal strip of it. Lengths in scene units, image quantities in pixels.
struct ViewParams {
    vec4 row0;        // rows of the world-to-camera rotation; w: the camera's centre, world, x
    vec4 row1;        // y
    vec4 row2;        // z
    vec4 intrinsics;  // fx, fy, cx, cy
    vec4 clamp_uv;    // range of x/z and y/z inside which the Jacobian follows the centre: u low, u high, v low, v high
    vec4 background;  // rgb; w: flow_dt
    vec4 next0;       // as row0 to row2, of the camera one frame on
    vec4 next1;
    vec4 next2;
    float time;       // t' of SPEC 2, the camera's offset included
    float near;
    float blur;
    float alpha_min;
    float alpha_max;
    float t_min;
    uint width;
    uint height;
    uint first_row;   // pixel row at which the strip begins, a multiple of TILE
    uint n_rows;      // pixel rows in the strip
    uint tiles_x;
    uint tiles_y;     // tile rows in the strip
    uint flow_model;  // FLOW_*
    float depth_to_alpha;  // 1, or 0 where the cotangents of the depths must not reach the opacities
    uint bounds;      // TILES_*, and EVERY_BLOCK or not
    uint depth_shift; // low bits that a depth key lacks: DEPTH_SHIFT_*, or 0 for all bits of the depth
    float t_cut;      // a pixel whose transmittance has fallen below this is finished; 0 leaves it to t_min
    float unused0;    // to whole vec4
    float unused1;
    float unused2;
};

// The report of a frame. `failed` holds FAILED_* bits; the numbers are the need, even if it did not fit.
struct Status {
    uint failed;
    uint n_active;
    uint n_visible;
    uint n_intersections;
    uint max_tile_list;
    uint n_bad;
    uint capacity_active;
    uint capacity_intersections;
};

// One step of Adam: what the host computes in double precision.
struct AdamParams {
    vec4 position_opacity_rotation_scale;  // lr / c1; that of position at a pace of 1
    vec4 t_scale_velocity_t_center_sh0;
    vec4 sh1_sh2_sh3;      // 0 for a band that is not active yet
    float beta1;
    float beta2;
    float inverse_c2;
    float eps;
    float lowest_t_scale;  // floor of log tau
    float opacity_reg;     // weight of the sum of the opacities in the loss
    float scale_reg;       // weight of the sum of the standard deviations, per scene unit
    float step;            // number of the step, from 1
    float inverse_size;    // 1 / the longest standard deviation whose pace is 1; 0: every pace is
};

const uint DEPTH_SHIFT_24 = 4u;   // of keys of 24 bits
const uint DEPTH_SHIFT_16 = 11u;  // of keys of 16 bits

// Gradients of this camera with the one a frame on where it is, or as a correction of the pose moves both.
const uint CAMERA_ALONE = 1u;
const uint CAMERA_WITH_NEXT = 2u;

const uint FLOW_VELOCITY = 0u;
const uint FLOW_DISPLACEMENT = 1u;

// The tiles that a Gaussian is listed for, include/splat.glsl.
const uint TILES_ELLIPSE = 0u;
const uint TILES_RECTANGLE = 1u;
const uint TILES_SQUARE = 2u;
const uint TILES_MASK = 3u;
// The blend asks no block of pixels whether the ellipse reaches it.
const uint EVERY_BLOCK = 4u;

const uint FAILED_ACTIVE = 1u;
const uint FAILED_INTERSECTIONS = 2u;
const uint FAILED_LIST = 4u;

const uint TILE = 16u;
