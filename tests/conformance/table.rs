//! The table.

use super::row::{Bench, Row, Tally};
use super::{
    chaos, clocks, counts, exposure, lists, losses, moments, optimiser, places, poison, shapes, sound, times, worlds,
};
use anyhow::Result;

/// All rows, in the study's order.
pub const ROWS: &[Row] = &[
    Row {
        name: "n01",
        what: "every number of a Gaussian and of a camera in turn: NaN, infinities, zeros, denormals, 1e38, half of the greatest",
        expected: "culled and counted, or drawn and finite; no other pixel changes",
        bound: "0 ULP on the others; 1e-4 of the range on its own pixels",
        cases: poison::numbers,
    },
    Row {
        name: "n02",
        what: "log-scales of -30 to 40, on one axis, two and three",
        expected: "stays visible, as in float64",
        bound: "1e-5 of the range of each output, below the study's 1/65536",
        cases: shapes::scales,
    },
    Row {
        name: "n03",
        what: "needles of 0.01 to 1e5 pixels",
        expected: "as in float64",
        bound: "1e-5 of the range; 5e-5 from 1000 px on, since a needle's line is as straight as f32 angles: 1e-7 of the distance",
        cases: shapes::needles,
    },
    Row {
        name: "n04",
        what: "quaternions of length 0 and 1e-30 to 3e38",
        expected: "length 0 is culled and counted; others turn alike, and their gradient lies across q",
        bound: "1e-5 of the range; 1e-5 of both lengths along q, and of length times gradient: the study's 1e-6 is what normalising in f32 rounds to",
        cases: shapes::quaternions,
    },
    Row {
        name: "n05",
        what: "depths from an ulp before the near plane to 1e6, and behind",
        expected: "the near plane culls exactly; the frame and every gradient as in float64",
        bound: "1e-5 of the range, 1e-5 of a gradient's length",
        cases: places::depths,
    },
    Row {
        name: "n06",
        what: "centres on corners of tiles and of the picture, an ulp and half a pixel beside, up to 1e6 px outside",
        expected: "no pixel is missing",
        bound: "1e-5 of the range; 2e-5 outside, where a position's last bit is 0.06 px",
        cases: places::centres,
    },
    Row {
        name: "n07",
        what: "logits of -90 to 90; alpha at 1/255 and 0.99, up to 1000 ulps of the logit beside",
        expected: "both passes take the same side; what is held at 0.99 has no gradient, what is below has the truth's",
        bound: "1e-5 of the range; at 1/255 either side, and nothing between; 1e-4 of a gradient's length",
        cases: exposure::opacities,
    },
    Row {
        name: "n08",
        what: "chains of 2 to 100,000 Gaussians, alpha 1/255 to 0.99",
        expected: "the transmittance falls as in float64, and the backward pass finds it again",
        bound: "1e-4",
        cases: lists::chains,
    },
    Row {
        name: "n09",
        what: "0 to 100,000 Gaussians in a tile, around 4, 8, 32, 64 and 256",
        expected: "all are blended; none gives the background exactly",
        bound: "1e-5 of the range",
        cases: lists::overlaps,
    },
    Row {
        name: "n10",
        what: "1000 Gaussians of one depth, and the order in which Gaussians are given",
        expected: "ties go by index; where depths differ the order given changes no bit",
        bound: "0 ULP; 1e-5 of the range against float64",
        cases: lists::ties,
    },
    Row {
        name: "n11",
        what: "times of 0 to 1e30 tau from a Gaussian's centre",
        expected: "exactly gone past the cut, with exactly no gradient",
        bound: "3e-5 of the range: exp of x is good to 3 + 2 abs(x) ULP, once of log tau and once of u^2; 1e-4 of a gradient's length",
        cases: times::distances,
    },
    Row {
        name: "n12",
        what: "log tau from -600 to infinity",
        expected: "infinite tau has the bits of a static Gaussian; the gradient of log tau stays below 0.736 of the opacity",
        bound: "0 ULP; 1e-5 of the range",
        cases: times::time_scales,
    },
    Row {
        name: "n13",
        what: "clips at time 0, 300, 18,000 and 1e5, and of 10 to 18,000 frames",
        expected: "the same bits of frame and gradient; 100 steps move t_center, and lead to the same picture",
        bound: "0 ULP; after the steps an RMS of 3e-5 (90 dB) in a clip in [0, 2], as the engine's time is; 3e-3 at 300, where t_center's ulp is 3e-5",
        cases: times::origins,
    },
    Row {
        name: "n14",
        what: "velocities of 0 to 1e30, and not finite ones",
        expected: "flow is exactly 0 without velocity; what is not finite is culled and counted",
        bound: "1e-5 of the range",
        cases: times::velocities,
    },
    Row {
        name: "n15",
        what: "worlds 0 to 5e5 units from the origin",
        expected: "as at the origin; recentring cannot be turned off, so there is no case without it",
        bound: "an RMS of 1e-4 (80 dB); 1e-5 of the range, 1e-4 at 60 units, the farthest that is not recentred",
        cases: worlds::offsets,
    },
    Row {
        name: "n16",
        what: "units of 1e-4 to 1e4, Gaussians at distances up to 1e30",
        expected: "the same picture; colours follow the direction at any distance",
        bound: "an RMS of 1e-4 (80 dB); 1e-5 of the range",
        cases: worlds::sizes,
    },
    Row {
        name: "n17",
        what: "fields of view of 1 to 179 degrees, fx other than fy, the principal point outside",
        expected: "as in float64",
        bound: "3e-5 of the range: at 179 degrees pixels are 0.2 focal lengths",
        cases: places::fields_of_view,
    },
    Row {
        name: "n18",
        what: "pictures of 1 x 1 to 65,536 x 1, of 16 and 23 megapixels, and of a row of tiles that no binding holds",
        expected: "as in float64, or an error with the need and the limit",
        bound: "2e-5 of the range; 5e-4 at 16 megapixels, where a position's last bit is 2.4e-4 px",
        cases: places::image_sizes,
    },
    Row {
        name: "n19",
        what: "colours of degree 0 to 3, coefficients to 1e30, below 0 and above 1",
        expected: "held at 0, with exactly no gradient there; nothing is held at 1",
        bound: "1e-5 of the range",
        cases: exposure::colors,
    },
    Row {
        name: "n20",
        what: "pictures equal to the truth: L1, SSIM, depth, end-point error, LPIPS, grids",
        expected: "loss 0 and exactly no cotangent",
        bound: "0; 2e-5 of SSIM, whose sums round",
        cases: losses::no_error,
    },
    Row {
        name: "n21",
        what: "SSIM of flat, chequered and bright pictures, up to 173 times white",
        expected: "between 0 and 1, as in float64",
        bound: "1e-5; 5e-3 at ten times white, where the moments' cancellation is 9 % of C2; 2e-2 where it is many times C2",
        cases: losses::similarity,
    },
    Row {
        name: "n22",
        what: "LPIPS of black pictures, of dead features and of faint ones",
        expected: "0 where nothing is alive, finite cotangents, as in float64 where a little is",
        bound: "0; of the value 6e-8 / light, the last bit of the picture over its light of 1e-7 to 1e-5",
        cases: losses::dead_features,
    },
    Row {
        name: "n23",
        what: "colours of -1, 0, 1, 2, 1e30 and not finite ones through a bilateral grid, at corners and in the middle",
        expected: "in the grid; no other pixel changes, and the grid's gradient stays finite",
        bound: "0 ULP on the others; 1e-6 of the colour, 1e-5 of its cotangent",
        cases: losses::colors_through_grids,
    },
    Row {
        name: "n24",
        what: "Adam: gradients of 0 to 1e30 and NaN, steps 1 to 30 epochs, rates of 0, tau below its floor",
        expected: "no gradient or no rate moves nothing; NaN moves nothing and is counted; the rest as in float64",
        bound: "1e-6 of the rate or of the step, past the parameter's last bit",
        cases: optimiser::gradients_of_any_size,
    },
    Row {
        name: "n25",
        what: "Adam's moments in 16 bits: 0 to the largest float, around 65504, infinite",
        expected: "saturate, keep 0; infinity stays so; the mean of a moment's roundings is the moment",
        bound: "its last bit, the mean of 300 0.14 of one",
        cases: moments::moments,
    },
    Row {
        name: "n26",
        what: "intersections around the capacity, and counts up to 2^32 - 1",
        expected: "a replay with the same bits; never a picture of a list cut short",
        bound: "0 ULP",
        cases: counts::counts,
    },
    Row {
        name: "n27",
        what: "time offsets all equal, one of 1e3, a drift of a million steps",
        expected: "the mean stays 0 and the bound holds",
        bound: "1e-6 frames",
        cases: clocks::offsets,
    },
    Row {
        name: "n28",
        what: "140 scenes with up to 5 % of their numbers poisoned: a frame and its gradient, or ten steps; poisoned cotangents",
        expected: "finite pixels, gradients, losses and Gaussians; what is not drawn has no gradient",
        bound: "exact",
        cases: chaos::poisoned_scenes,
    },
    Row {
        name: "n29",
        what: "sound: places that meet, bearings of 0 and 180 degrees, silence, a recording of a sample, NaN in one",
        expected: "finite; silence is silent; NaN is refused; no click",
        bound: "1e-6 rad, -60 dBFS at the edges of blocks",
        cases: sound::places_and_signals,
    },
    Row { name: "n30", what: "known faults put back", expected: "each turns its row red", bound: "", cases: mutations },
];

fn mutations(_: &Bench, tally: &mut Tally) -> Result<()> {
    tally.leave_out("it rebuilds the engine: run tools/mutants.sh");
    Ok(())
}
