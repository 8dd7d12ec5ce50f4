//! The table of all settings of a run. A test holds it to the fields of [`super::Config`].

use super::setting::{Range, Setting, setting as s};
use super::terms;
use std::ops::Bound;

/// The largest number of a setting that is kept in 32 bits.
const MOST_U32: u64 = u32::MAX as u64;
/// The most Gaussians that a run is asked to begin with.
const MOST_POINTS: u64 = 50_000_000;
const NOT_NEGATIVE: Range = Range::NOT_NEGATIVE;
const POSITIVE: Range = Range::Number(Bound::Excluded(0.0), Bound::Unbounded);
const FRACTION: Range = Range::Number(Bound::Included(0.0), Bound::Included(1.0));
/// An opacity whose logit is finite.
const BETWEEN: Range = Range::Number(Bound::Excluded(0.0), Bound::Excluded(1.0));
const CUT: Range = Range::Number(Bound::Included(0.0), Bound::Excluded(0.5));

/// All settings of a run, in groups; those of the terms of the loss stand with the terms.
pub const SETTINGS: &[Setting] = &ALL;

const ALL: [Setting; FIRST.len() + terms::SETTINGS.len() + LAST.len()] = {
    let parts = [FIRST, &terms::SETTINGS, LAST];
    let mut all = [FIRST[0]; FIRST.len() + terms::SETTINGS.len() + LAST.len()];
    let (mut n, mut part) = (0, 0);
    while part < parts.len() {
        let mut at = 0;
        while at < parts[part].len() {
            all[n] = parts[part][at];
            (n, at) = (n + 1, at + 1);
        }
        part += 1;
    }
    all
};

/// Those before the terms of the loss.
const FIRST: &[Setting] = &[
    s("epochs", "passes", Range::Whole(0, MOST_U32), "Passes over all training images. Used unless steps is set."),
    s("steps", "steps", Range::Whole(0, u64::MAX), "Length of the run; 0 takes the length from epochs."),
    s("seed", "", Range::Whole(0, u64::MAX), "Seed of the image order, the random points and density control."),
    s(
        "sh_degree",
        "",
        Range::Whole(0, 3),
        "Highest degree of the spherical harmonics: how finely colours depend on the direction of view.",
    ),
    s("max_gaussians", "Gaussians", Range::Whole(1, MOST_U32), "The number of Gaussians never exceeds this."),
    s(
        "init",
        "",
        Range::Word(&["auto", "flow", "any_view", "concat", "points", "hull", "frustum", "random"]),
        "Where the first Gaussians come from.",
    ),
    s(
        "init_points",
        "Gaussians",
        Range::Whole(1, MOST_POINTS),
        "Most Gaussians from the surfaces that the images show; as many as the capture has points where those are more.",
    ),
    s("init_moving_points", "Gaussians", Range::Whole(1, MOST_POINTS), "Gaussians from the visual hull of one frame."),
    s("init_opacity", "", BETWEEN, "Opacity of Gaussians that begin on surfaces found in the images."),
    s("init_tau", "hull intervals", POSITIVE, "How long Gaussians from a hull are visible."),
    s("init_flow_threshold", "pixels per frame", NOT_NEGATIVE, "A point with more flow than this moves."),
    s("init_point_tau", "frames", POSITIVE, "How long Gaussians from the points of one frame are visible."),
    s(
        "init_static_tau",
        "clips",
        NOT_NEGATIVE,
        "How long points at rest are visible with init=flow; 0 makes them static for good.",
    ),
    s("background", "", Range::Colour, "Colour behind the scene."),
    s("offsets", "", Range::Switch, "Whether the time offsets of the cameras are learnt."),
    s("grids", "", Range::Switch, "Whether each camera has a bilateral grid that corrects its colours."),
    s(
        "adam",
        "",
        Range::Word(&["dense", "lazy", "sparse"]),
        "Which Gaussians take a step: all, those in view after catching up, or those in view alone.",
    ),
    s("moment_bits", "bits", Range::OneOf(&[16, 32]), "Size of each of Adam's moments in memory."),
    s(
        "accumulation",
        "",
        Range::Word(&["slots", "float_atomics", "fixed_point", "compare_exchange"]),
        "How gradients are added up. Slots and fixed_point give the same bits in every run.",
    ),
    s("loss.offset", "", NOT_NEGATIVE, "Weight of the squared time offsets."),
];

/// Those that follow the terms of the loss.
const LAST: &[Setting] = &[
    s(
        "lr.pace.steps",
        "steps",
        Range::Whole(0, u64::MAX),
        "Length of the run that the learning rates are given for; 0 uses the same rates in every run.",
    ),
    s("lr.pace.start", "", FRACTION, "A run of n steps begins with (lr.pace.steps / n)^start times the rates."),
    s(
        "lr.pace.settled",
        "steps",
        Range::Whole(0, u64::MAX),
        "Steps from which on a run ends with the rates as they are.",
    ),
    s("lr.pace.end", "", FRACTION, "A shorter run ends with (lr.pace.settled / n)^end times the rates."),
    s(
        "lr.pace.most",
        "",
        Range::Number(Bound::Included(1.0), Bound::Included(100.0)),
        "The rates are raised at most by this factor.",
    ),
    s("lr.position", "scene extents", Range::Rate, "Learning rate of positions."),
    s("lr.sh0", "", Range::Rate, "Learning rate of the constant colour."),
    s("lr.sh_rest", "", Range::Rate, "Learning rate of the higher spherical harmonics."),
    s("lr.opacity", "", Range::Rate, "Learning rate of opacities, as logits."),
    s("lr.scale", "", Range::Rate, "Learning rate of scales, as logarithms."),
    s("lr.rotation", "", Range::Rate, "Learning rate of rotations, as quaternions."),
    s("lr.velocity", "scene units per clip", Range::Rate, "Learning rate of velocities."),
    s("lr.t_center", "clips", Range::Rate, "Learning rate of the times of peak visibility."),
    s("lr.t_scale", "", Range::Rate, "Learning rate of how long Gaussians are visible, as logarithms."),
    s("lr.offset", "frames", Range::Rate, "Learning rate of the cameras' time offsets."),
    s("lr.grid", "", Range::Rate, "Learning rate of the bilateral grids."),
    s(
        "density.strategy",
        "",
        Range::Word(&["adc", "mcmc"]),
        "How Gaussians are added and removed: as in 3DGS, or as in 3DGS-MCMC.",
    ),
    s("density.start", "of the run", FRACTION, "When density control begins, unless density.first_step comes first."),
    s("density.first_step", "steps", Range::Whole(0, u64::MAX), "Density control begins at this step at the latest."),
    s("density.stop", "of the run", FRACTION, "When the last Gaussians are added; 0 turns density control off."),
    s(
        "density.every",
        "steps",
        Range::Whole(1, u64::MAX),
        "Steps between two rounds, at most. Short runs have ten rounds that add, but at least eight steps apart.",
    ),
    s(
        "density.gradient",
        "half images",
        NOT_NEGATIVE,
        "adc: mean gradient of a projected centre above which a Gaussian is cloned or split.",
    ),
    s("density.growth", "of the Gaussians", FRACTION, "adc: share of the Gaussians that one round may add."),
    s(
        "density.growth_least",
        "Gaussians",
        Range::Whole(0, u64::MAX),
        "adc: Gaussians that one round may add, however few there are.",
    ),
    s(
        "density.split_above",
        "scene extents",
        POSITIVE,
        "adc: a growing Gaussian larger than this is split, a smaller one is cloned.",
    ),
    s(
        "density.prune_opacity",
        "",
        Range::Number(Bound::Included(0.0), Bound::Excluded(1.0)),
        "Gaussians that are never more opaque than this are removed (adc) or moved elsewhere (mcmc).",
    ),
    s(
        "density.prune_scale",
        "scene extents",
        POSITIVE,
        "adc: Gaussians larger than this are removed while others are added.",
    ),
    s(
        "density.prune_veil",
        "depths",
        POSITIVE,
        "Gaussians larger than this share of their distance to a lens are removed (adc) or moved elsewhere (mcmc).",
    ),
    s(
        "density.reset_every",
        "steps",
        Range::Whole(0, u64::MAX),
        "adc: steps between two resets of the opacities; 0 never resets.",
    ),
    s("density.reset_to", "", BETWEEN, "adc: a reset lowers opacities to this."),
    s(
        "density.mcmc_growth",
        "of the Gaussians",
        FRACTION,
        "mcmc: share of the Gaussians that one round adds, up to max_gaussians.",
    ),
    s("density.mcmc_noise", "position rates", NOT_NEGATIVE, "mcmc: size of the random movement of faint Gaussians."),
    s("density.opacity_reg", "", NOT_NEGATIVE, "mcmc: weight of the mean opacity in the loss."),
    s("density.scale_reg", "per scene unit", NOT_NEGATIVE, "mcmc: weight of the mean size in the loss."),
    s(
        "resolution.reduction",
        "pixels",
        Range::Whole(1, 8),
        "The run begins on images reduced by this factor; 1 leaves them whole.",
    ),
    s("resolution.until", "of the run", FRACTION, "How long the run sees reduced images."),
    s(
        "frame.tile_bound",
        "",
        Range::Word(&["ellipse", "rectangle", "square"]),
        "The tiles that a Gaussian is listed for. All give the same picture; ellipse is the fastest.",
    ),
    s(
        "frame.block_cull",
        "",
        Range::Switch,
        "Whether blocks of pixels skip the Gaussians that miss them. The picture is the same.",
    ),
    s(
        "frame.time_cull",
        "",
        Range::Switch,
        "Whether Gaussians that are invisible at a frame's time are left out early. The picture is the same.",
    ),
    s("frame.depth_bits", "bits", Range::OneOf(&[16, 24, 32]), "Precision of the depth by which Gaussians are sorted."),
    s(
        "frame.sh_bits",
        "bits",
        Range::OneOf(&[16, 32]),
        "Precision of the higher spherical harmonics that a frame reads.",
    ),
    s("frame.alpha_cut", "", CUT, "Contributions to a pixel below this are left out."),
    s("frame.t_cut", "", CUT, "A pixel that lets less light through than this is finished."),
    s("frame.temporal_cut", "", CUT, "Gaussians fainter than this at a frame's time are left out."),
    s(
        "required.reviews",
        "reviews",
        Range::Whole(0, MOST_U32),
        "How often Gaussians are reduced to what the images need; 0 never reduces them.",
    ),
    s("required.first", "of the run", FRACTION, "When the first review takes place."),
    s(
        "required.last",
        "of the run",
        Range::Number(Bound::Included(0.0), Bound::Excluded(1.0)),
        "When the last review takes place.",
    ),
    s("required.images", "images", Range::Whole(1, MOST_U32), "Training images that a review looks at, at most."),
    s(
        "required.unseen",
        "of the Gaussians",
        FRACTION,
        "Share of the Gaussians that a review may leave unjudged because too few images show them.",
    ),
    s(
        "required.price",
        "",
        POSITIVE,
        "What a number must be worth to stay, in half logarithms of the number of observations.",
    ),
    s("required.margin", "dB", POSITIVE, "PSNR that all reviews together may cost when they take place."),
    s(
        "required.grids_at",
        "of the run",
        Range::Number(Bound::Included(0.0), Bound::Excluded(1.0)),
        "When it is decided which cameras need a bilateral grid.",
    ),
];
