//! Only what a scene requires (SPEC 12): reviews ask the training pictures which parts of which Gaussians pay.

mod decide;
mod evidence;
mod grids;
mod look;
mod merge;

pub use evidence::Evidence;
pub use grids::GridCheck;
pub use look::Seen;
pub use merge::merge_resting;

use crate::error::Result;
use crate::gpu::Gpu;
use crate::internals::train::density::recovered_from;
use crate::internals::train::{CameraState, Checkpoint, Config, Sight, Trainer};
use crate::recon::Progress;
use crate::scene::capture::Capture;
use crate::scene::{Motion, SH_C0, Splats};
use crate::settings::Constants;
use crate::stage::{GridState, Renderer};
use decide::{Fate, InTime, affordable};
use std::collections::BTreeSet;
use std::sync::Arc;

/// Purpose of the random numbers of a review; a step has 1 to 3, and 5.
const REVIEW: u64 = 4;
/// Training images of a review, at most: each takes as long as two steps.
pub(crate) const MOST_IMAGES: usize = 128;
/// The first review, of the run: by default density control adds its last Gaussians at half of it.
const FIRST: f64 = 0.6;
/// The last review, of the run: later steps mend some of what reviews took.
const LAST: f64 = 0.8;
/// Share of the Gaussians that may stay unjudged: the last ones would take many images each.
const UNSEEN: f64 = 0.02;
/// Price of a number in half logarithms of the number of observations: Schwarz's criterion.
const PRICE: f64 = 1.0;
/// PSNR that all reviews together may cost when they take place, dB.
const MARGIN: f64 = 0.05;
/// Largest velocity of a Gaussian that begins to move, scene units per clip; the cameras' extent is 3.
const FASTEST: f32 = 3.0;
/// Largest share of the Gaussians, as one in so many, that is not stored apart: a bucket costs twenty dispatches a step.
const FEW: usize = 32;

/// What a review found and did.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(default)]
pub struct Review {
    /// Step after which it was.
    pub step: u64,
    /// Standard deviation of the errors of the colours, in [0, 1].
    pub noise: f64,
    /// Price of a number, in half logarithms of the number of observations; less than 1 if the pictures would lose too much.
    pub price: f64,
    /// Training pictures that it looked at.
    pub pictures: usize,
    /// Pictures that it might look at.
    pub budget: usize,
    /// Gaussians in none of these pictures.
    pub unseen: usize,
    /// Gaussians that were not judged, since they are in too few of these pictures.
    pub left: usize,
    /// Gaussians before it.
    pub before: usize,
    /// Gaussians after it.
    pub after: usize,
    /// Gaussians that were not worth their numbers.
    pub removed: usize,
    /// Gaussians that became part of another.
    pub merged: usize,
    /// Dynamic Gaussians that became static.
    pub came_to_rest: usize,
    /// Static Gaussians that became dynamic.
    pub began_to_move: usize,
    /// Gaussians that lost band 1, 2, 3.
    pub lost_bands: [usize; 3],
    /// Checks of training cameras that had no grid.
    pub grids: Vec<GridCheck>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Due {
    Grids,
    Gaussians,
}

/// The review after step `step` of `total`. That of the grids is a step later where both coincide, and none falls into the
/// dip after a reset of the opacities.
pub fn review_due(config: &Config, step: u64, total: u64) -> Option<Due> {
    let grids_at = config.required.grids_at;
    let at = |fraction: f64| recovered_from(config, (fraction * total as f64).round() as u64, total);
    let reviews = reviews_at(config, total);
    let is_of_gaussians = |step: u64| reviews.contains(&step);
    if step == 0 || step >= total {
        None
    } else if is_of_gaussians(step) {
        Some(Due::Gaussians)
    } else {
        let grids = (at(grids_at).max(1)..total).find(|step| !is_of_gaussians(*step));
        (config.grids.is_some() && grids_at > 0.0 && grids == Some(step)).then_some(Due::Grids)
    }
}

/// Steps with a review of the Gaussians; fewer than were asked for where several fall on one.
fn reviews_at(config: &Config, total: u64) -> BTreeSet<u64> {
    // More would fall on the same steps.
    let reviews = u64::from(config.required.reviews).min(total + 1);
    let at = |k: u64| FIRST + (LAST - FIRST) * k as f64 / reviews.saturating_sub(1).max(1) as f64;
    let steps = (0..reviews).map(|k| recovered_from(config, (at(k) * total as f64).round() as u64, total));
    steps.filter(|step| (1..total).contains(step)).collect()
}

/// Reviews the cameras or the Gaussians of `trainer`, by `most_images` images of `capture` at most.
#[tracing::instrument(level = "info", name = "review", skip_all)]
pub fn review(
    trainer: &mut Trainer,
    gpu: &Arc<Gpu>,
    capture: &Capture,
    constants: Constants,
    due: Due,
    most_images: usize,
    progress: &mut Progress,
) -> Result<Review> {
    let mut checkpoint = trainer.checkpoint()?;
    let (offsets, _) = trainer.offsets()?;
    let Config { background, seed, grids, .. } = checkpoint.config;
    let splats = trainer.splats()?;
    let mut renderer = Renderer::new(gpu.clone(), &splats, constants)?;
    let sight = Sight {
        offsets: offsets.into_iter().enumerate().collect(),
        poses: trainer.poses()?,
        ..Sight::new(capture, background)
    };
    if due == Due::Grids {
        let n = checkpoint.params.len();
        let mut report = Review { step: checkpoint.step, before: n, after: n, ..Review::default() };
        // What a run that was lengthened has learnt stays.
        if grids.is_some() && capture.is_rig_clip() && checkpoint.cameras.has_grid.is_empty() {
            report.grids = give_grids(&mut renderer, &sight, &mut checkpoint.cameras)?;
            trainer.replace(&checkpoint)?;
        }
        return Ok(report);
    }
    let key = [seed, checkpoint.step, REVIEW];
    let has_grid = &checkpoint.cameras.has_grid;
    let budget = (most_images, UNSEEN);
    let mut evidence = Evidence::gather(&mut renderer, &splats, &sight, has_grid, budget, &key, progress)?;
    drop(renderer);
    let n_frames = capture.n_frames.max(1);
    let times: Vec<f64> = (0..n_frames).map(|f| f64::from(f) / f64::from(n_frames)).collect();
    // The margin is for the run.
    let margin = MARGIN / reviews_at(&checkpoint.config, checkpoint.total).len().max(1) as f64;
    let (mut fates, price) = affordable(&checkpoint.params, &evidence, &times, PRICE, margin, &key);
    // One that goes anyway takes none with it.
    let mut gone: Vec<bool> = fates.iter().map(|fate| !fate.stays).collect();
    let n_merged = merge_resting(&mut checkpoint.params, &mut evidence, price, &mut gone);
    let merged: Vec<bool> = fates.iter().zip(&gone).map(|(fate, gone)| fate.stays && *gone).collect();
    fates.iter_mut().zip(&gone).for_each(|(fate, gone)| fate.stays = !gone);
    let noise = evidence.variance.sqrt();
    let unseen = evidence.seen.iter().filter(|seen| seen.pictures == 0 && !seen.is_hidden).count();
    let left = evidence.seen.iter().filter(|seen| !seen.tells_all()).count();
    let (pictures, budget) = (evidence.pictures, most_images);
    let found = tally(&checkpoint, &fates, &merged);
    let report = Review { merged: n_merged, noise, price, pictures, budget, unseen, left, ..found };
    carry_out(&mut checkpoint, &fates);
    trainer.replace(&checkpoint)?;
    Ok(report)
}

/// Gives a grid, the identity as yet, to each training camera that needs one, and to no other.
fn give_grids(renderer: &mut Renderer, sight: &Sight, state: &mut CameraState) -> Result<Vec<GridCheck>> {
    let cameras = &sight.capture.cameras;
    let mut checks = Vec::new();
    state.has_grid = vec![false; cameras.len()];
    for camera in (0..cameras.len()).filter(|camera| !cameras[*camera].is_test) {
        let check = grids::check(renderer, sight, camera)?;
        state.has_grid[camera] = check.is_needed;
        checks.push(check);
    }
    let n = state.has_grid.iter().filter(|has| **has).count();
    (state.grids, state.grid_steps) = (vec![GridState::identity(); n], vec![0; n]);
    if n == 0 {
        state.has_grid.clear();
    }
    Ok(checks)
}

fn tally(checkpoint: &Checkpoint, fates: &[Fate], merged: &[bool]) -> Review {
    let staying = || fates.iter().enumerate().filter(|(_, fate)| fate.stays);
    let params = &checkpoint.params;
    let lost = |band: usize| {
        staying().filter(|(i, fate)| params.degree_of(*i) >= band && usize::from(fate.degree) < band).count()
    };
    Review {
        step: checkpoint.step,
        before: fates.len(),
        after: staying().count(),
        removed: fates.iter().zip(merged).filter(|(fate, merged)| !fate.stays && !**merged).count(),
        came_to_rest: staying().filter(|(_, fate)| fate.time == InTime::ComesToRest).count(),
        began_to_move: staying().filter(|(_, fate)| matches!(fate.time, InTime::BeginsToMove(_))).count(),
        lost_bands: [lost(1), lost(2), lost(3)],
        ..Review::default()
    }
}

/// Carries out `fates` on the Gaussians of `checkpoint`, with their moments and state, in the order of their buckets.
fn carry_out(checkpoint: &mut Checkpoint, fates: &[Fate]) {
    let params = &checkpoint.params;
    let is_dynamic = |i: usize| match fates[i].time {
        InTime::AsBefore => i >= params.n_static,
        InTime::ComesToRest => false,
        InTime::BeginsToMove(_) => true,
    };
    let mut order: Vec<usize> = (0..fates.len()).filter(|&i| fates[i].stays).collect();
    let stored = stored_degrees(order.iter().map(|&i| (is_dynamic(i), usize::from(fates[i].degree))));
    let degree_of = |i: usize| stored[usize::from(is_dynamic(i))][usize::from(fates[i].degree)];
    order.sort_by_key(|&i| (is_dynamic(i), std::cmp::Reverse(degree_of(i))));
    let none = Motion { velocity: [0.0; 3], t_center: 0.0, t_scale: 0.0 };
    let carry = |from: &Splats, motion: &dyn Fn(usize) -> Motion| -> Splats {
        let k = from.n_coefficients();
        let sh = order.iter().flat_map(|&i| {
            let kept = (usize::from(fates[i].degree) + 1).pow(2);
            (0..k).map(move |c| if c < kept { from.sh[i * k + c] } else { [0.0; 3] })
        });
        Splats {
            n_static: order.iter().filter(|&&i| !is_dynamic(i)).count(),
            degree: order.iter().map(|&i| degree_of(i)).collect(),
            sh: sh.collect(),
            motion: order.iter().filter(|&&i| is_dynamic(i)).map(|&i| motion(i)).collect(),
            source_row: (0..order.len() as u32).collect(),
            ..from.in_order(&order)
        }
    };
    let motion_of = |from: &Splats, i: usize| i.checked_sub(from.n_static).and_then(|at| from.motion.get(at)).copied();
    let mut now = carry(params, &|i| match fates[i].time {
        InTime::BeginsToMove(velocity) => Motion {
            velocity: velocity.map(|v| if v.is_finite() { v.clamp(-FASTEST, FASTEST) } else { 0.0 }),
            t_center: 0.5,
            t_scale: decide::NEW_TAU.ln(),
        },
        InTime::AsBefore | InTime::ComesToRest => motion_of(params, i).unwrap_or(none),
    });
    for (at, &i) in order.iter().enumerate().filter(|(_, i)| fates[**i].time == InTime::ComesToRest) {
        let Some(motion) = motion_of(params, i) else { continue };
        let ahead = 0.5 - motion.t_center;
        now.position[at] = std::array::from_fn(|c| params.position[i][c] + motion.velocity[c] * ahead);
        let opacity = params.mean_weight(i) / (1.0 + (-f64::from(params.opacity[i])).exp());
        now.opacity[at] = (opacity / (1.0 - opacity).max(1e-9)).ln() as f32;
    }
    let k = params.n_coefficients();
    for (at, &i) in order.iter().enumerate() {
        now.sh[at * k].iter_mut().zip(fates[i].color).for_each(|(x, color)| *x += (color / SH_C0) as f32);
    }
    let moments = |of: &Splats| {
        carry(of, &|i| match fates[i].time {
            InTime::AsBefore => motion_of(of, i).unwrap_or(none),
            InTime::ComesToRest | InTime::BeginsToMove(_) => none,
        })
    };
    (checkpoint.first, checkpoint.second) = (moments(&checkpoint.first), moments(&checkpoint.second));
    checkpoint.state = order.iter().map(|&i| checkpoint.state[i]).collect();
    checkpoint.params = now;
}

/// By population and degree, the degree that its Gaussians are stored with: few join the next higher degree.
fn stored_degrees(all: impl Iterator<Item = (bool, usize)>) -> [[u8; 4]; 2] {
    let mut counts = [[0usize; 4]; 2];
    all.for_each(|(is_dynamic, degree)| counts[usize::from(is_dynamic)][degree] += 1);
    let few = counts.as_flattened().iter().sum::<usize>() / FEW;
    counts.map(|mut counts| {
        let mut stored = [0, 1, 2, 3];
        for degree in 0..3 {
            let higher = (degree + 1..4).find(|higher| counts[*higher] > 0);
            if let (1.., Some(higher)) = (counts[degree], higher.filter(|_| counts[degree] < few)) {
                counts[higher] += std::mem::take(&mut counts[degree]);
                // Those that joined it before go with it.
                stored.iter_mut().filter(|to| usize::from(**to) == degree).for_each(|to| *to = higher as u8);
            }
        }
        stored
    })
}
