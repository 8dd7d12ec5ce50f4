// SSIM's window over a tile by a workgroup of 128: first down, a thread a column and channel, then across, a thread a run of a row
// and channel. Shared memory carries the numbers in between.
//
// Needs NUMBERS, a vector of what is filtered; APART, inputs from one output to the next along an axis; EVERY, of which inputs one is
// there; PLACE(CHANNEL, COLUMN), the thread of a column and channel.

const uint TILE_COLUMNS = 32u;  // pixels across a tile
const uint RUN = 8u;            // outputs of a thread, which share their inputs; as many rows has a tile of outputs
const uint ACROSS = TILE_COLUMNS / APART;                              // outputs across a tile
const uint RUNS = ACROSS / RUN;                                        // across a tile
const uint INPUTS = APART * (RUN - 1u) + 2u * SSIM_RADIUS + 1u;        // that a run sees
const uint FIRST = SSIM_RADIUS % EVERY;                                // the first of them that is there
const uint COLUMNS = (APART * (ACROSS - 1u) + 2u * SSIM_RADIUS + EVERY - FIRST) / EVERY;  // of inputs that a tile sees
// Odd, so that the rows of a column lie in different banks.
const uint PITCH = 3u * COLUMNS | 1u;
const uint OUT_PITCH = ACROSS + 1u;
const uint OUT_PLANE = RUN * OUT_PITCH;

// Adds `value`, input T of a run, to what output K sums. The window's later half has a sum of its own: half the rounding error, which
// the variances of flat pictures are made of. Written out, as a compiler that leaves a loop over T rolled reads the window from memory.
#define ADD(SUM, T, K) SUM[K] = fma(NUMBERS(SSIM_WINDOW[(T - APART * K) % 11u]), value, SUM[K]);
#define TAP(T, K) if (T >= APART * K && T <= APART * K + 2u * SSIM_RADIUS) { \
    if (T <= APART * K + SSIM_RADIUS) { ADD(sum, T, K) } else { ADD(late, T, K) } \
}
#define TAPS(T) TAP(T, 0u) TAP(T, 1u) TAP(T, 2u) TAP(T, 3u) TAP(T, 4u) TAP(T, 5u) TAP(T, 6u) TAP(T, 7u)
// An input: `value` becomes LOAD(T), T counting those that are there.
#define INPUT(T, LOAD) if (T < INPUTS && T % EVERY == FIRST) { const NUMBERS value = LOAD(T / EVERY); TAPS(T) }
// A run: `sum` becomes its outputs.
#define FILTER(LOAD) { \
    NUMBERS late[RUN]; \
    for (uint k = 0u; k < RUN; ++k) sum[k] = late[k] = NUMBERS(0.0); \
    INPUT(0u, LOAD) INPUT(1u, LOAD) INPUT(2u, LOAD) INPUT(3u, LOAD) INPUT(4u, LOAD) INPUT(5u, LOAD) INPUT(6u, LOAD) \
    INPUT(7u, LOAD) INPUT(8u, LOAD) INPUT(9u, LOAD) INPUT(10u, LOAD) INPUT(11u, LOAD) INPUT(12u, LOAD) INPUT(13u, LOAD) \
    INPUT(14u, LOAD) INPUT(15u, LOAD) INPUT(16u, LOAD) INPUT(17u, LOAD) INPUT(18u, LOAD) INPUT(19u, LOAD) INPUT(20u, LOAD) \
    INPUT(21u, LOAD) INPUT(22u, LOAD) INPUT(23u, LOAD) INPUT(24u, LOAD) \
    for (uint k = 0u; k < RUN; ++k) sum[k] += late[k]; \
}

// Filtered down, by row and thread; then along both axes, by channel, row and column.
shared NUMBERS sh[max(RUN * PITCH, 3u * OUT_PLANE)];

// Goes across what each thread has filtered down its column.
void filter_across(uint thread, NUMBERS down[RUN]) {
    if (thread < 3u * COLUMNS) {
        for (uint k = 0u; k < RUN; ++k) sh[k * PITCH + thread] = down[k];
    }
    barrier();
    const uint row = thread % RUN;
    const uint run = thread / RUN % RUNS;
    const uint channel = min(thread / (RUN * RUNS), 2u);
    const uint first = row * PITCH;
    const uint column = APART * RUN * run / EVERY;
    NUMBERS sum[RUN];
#define DOWN(T) sh[first + PLACE(channel, column + T)]
    FILTER(DOWN)
    barrier();
    if (thread < 3u * RUN * RUNS) {
        const uint at = channel * OUT_PLANE + row * OUT_PITCH + run * RUN;
        for (uint k = 0u; k < RUN; ++k) sh[at + k] = sum[k];
    }
    barrier();
}

// What became of output `i` of the tile in a channel.
NUMBERS filtered(uint channel, uint i) { return sh[channel * OUT_PLANE + i / ACROSS * OUT_PITCH + i % ACROSS]; }
