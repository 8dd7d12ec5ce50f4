//! Which parts of which Gaussians pay (SPEC 12): a part stays when the pictures need it more than its numbers cost.

use crate::internals::train::require::evidence::Evidence;
use crate::internals::train::require::look::Seen;
use crate::random::Keyed;
use crate::report::statistics::median_high;
use crate::scene::Splats;
use crate::stage::Response;

/// Position, rotation without the length, scale, opacity, colour of degree 0.
const GEOMETRY_NUMBERS: f64 = 13.0;
/// Velocity, time of peak visibility, tau.
const MOTION_NUMBERS: f64 = 5.0;
/// Least temporal weight over the clip of a Gaussian that may come to rest: pictures that do not show it say nothing.
const LEAST_WEIGHT: f64 = 0.25;
/// Median of chi squared with five degrees of freedom.
const MEDIAN_OF_5: f64 = 4.351_46;
const HALVINGS: u32 = 16;
/// Tau of a Gaussian that begins to move, clips.
pub(super) const NEW_TAU: f32 = 2.0;

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fate {
    pub stays: bool,
    pub degree: u8,
    /// Added to its colour: the mean over the cameras of the bands that go.
    pub color: [f64; 3],
    pub time: InTime,
    /// Log-likelihood that the pictures lose.
    pub loss: f64,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub enum InTime {
    AsBefore,
    /// Where it is in the middle of the clip, and as opaque as in the mean.
    ComesToRest,
    /// Scene units per clip.
    BeginsToMove([f32; 3]),
}

/// Half a logarithm of the number of observations for each number (Schwarz 1978).
fn cost(numbers: f64, evidence: &Evidence, price: f64) -> f64 {
    0.5 * price * numbers * evidence.n_values.max(2.0).ln()
}

/// The log-likelihood that the pictures lose by a step along which their information and slope are given.
fn loss(information: f64, slope: f64, seen: &Seen, evidence: &Evidence) -> f64 {
    seen.scale * (slope + 0.5 * information) / evidence.variance.max(f64::MIN_POSITIVE)
}

/// Fates of all Gaussians at the highest price of a number, at most `price`, at which the pictures lose no more than
/// `margin` dB of PSNR by what is removed; with that price.
pub fn affordable(
    splats: &Splats,
    evidence: &Evidence,
    frame_times: &[f64],
    price: f64,
    margin: f64,
    key: &[u64],
) -> (Vec<Fate>, f64) {
    // Errors of the variance found have a log-likelihood of half their number.
    let budget = 0.5 * evidence.n_values * (10f64.powf(margin / 10.0) - 1.0);
    let at = |price: f64| {
        let fates = fates(splats, evidence, frame_times, price, key);
        let loss = fates.iter().map(|fate| fate.loss).sum::<f64>();
        (fates, loss)
    };
    let (mut best, loss) = at(price);
    if loss <= budget {
        return (best, price);
    }
    let (mut low, mut high) = (0.0, price);
    best = at(low).0;
    for _ in 0..HALVINGS {
        let middle = 0.5 * (low + high);
        let (fates, loss) = at(middle);
        if loss <= budget {
            (low, best) = (middle, fates);
        } else {
            high = middle;
        }
    }
    (best, low)
}

/// Fates of all Gaussians at normalised `frame_times`. `price` multiplies the cost of a number that may go; one that
/// comes pays in full. `key` chooses which of those that are not worth their numbers go now.
fn fates(splats: &Splats, evidence: &Evidence, frame_times: &[f64], price: f64, key: &[u64]) -> Vec<Fate> {
    let random = Keyed::new(key);
    let overdispersion = overdispersion(splats, evidence);
    let of = |i: usize| {
        let (information, slope, seen) = (&evidence.information[i], &evidence.slope[i], &evidence.seen[i]);
        let is_dynamic = i >= splats.n_static;
        let caution = seen.caution();
        let part = |of: fn(&Response) -> f64| loss(caution * of(information), of(slope), seen, evidence);
        // What is not a number stays.
        let pays = |loss: f64, numbers: f64| loss.is_nan() || loss >= cost(numbers, evidence, price);
        let (mut degree, mut color, mut lost) = (splats.degree_of(i), [0.0; 3], 0.0);
        while degree > 0 {
            let numbers = (3 * (2 * degree + 1)) as f64;
            let band = loss(caution * information.bands[degree - 1], slope.bands[degree - 1], seen, evidence);
            if !seen.tells_band(degree) || pays(band, numbers) {
                break;
            }
            lost += band.max(0.0);
            degree -= 1;
            color.iter_mut().zip(information.band_means[degree]).for_each(|(sum, mean)| *sum += mean);
        }
        let numbers = GEOMETRY_NUMBERS
            + if is_dynamic { MOTION_NUMBERS } else { 0.0 }
            + (3 * ((degree + 1) * (degree + 1) - 1)) as f64;
        // Two that hide each other must not go together.
        let stays = !seen.tells_all() || pays(part(|r| r.whole), numbers) || random.bits(i as u64) & 1 == 0;
        let tells_motion = seen.tells_motion(frame_times.len());
        let time = if is_dynamic {
            let always = frame_times.iter().all(|time| splats.weight_at(i, *time) >= LEAST_WEIGHT);
            // Without caution: what comes to rest wrongly begins to move again at the next review.
            let rest = loss(information.rest, slope.rest, seen, evidence);
            if tells_motion && always && !pays(rest, MOTION_NUMBERS) {
                lost += rest.max(0.0);
                InTime::ComesToRest
            } else {
                InTime::AsBefore
            }
        } else if tells_motion && 0.5 * score(i, evidence) / overdispersion > cost(MOTION_NUMBERS, evidence, 1.0) {
            let newton = |k: usize| -(slope.lacks[k] / information.lacks[k].max(f64::MIN_POSITIVE)) as f32;
            InTime::BeginsToMove(std::array::from_fn(newton))
        } else {
            InTime::AsBefore
        };
        let loss = if stays { lost } else { part(|r| r.whole).max(0.0) };
        Fate { stays, degree: degree as u8, color, time, loss }
    };
    (0..splats.len()).map(of).collect()
}

/// The score statistic of what a static Gaussian lacks (Rao 1948): chi squared with five degrees of freedom if it lacks
/// nothing and errors are independent.
fn score(i: usize, evidence: &Evidence) -> f64 {
    let (information, slope) = (&evidence.information[i], &evidence.slope[i]);
    let terms = slope.lacks.iter().zip(&information.lacks).filter(|(_, h)| **h > 0.0).map(|(g, h)| g * g / h);
    evidence.seen[i].scale * terms.sum::<f64>() / evidence.variance.max(f64::MIN_POSITIVE)
}

/// By how much scores are larger than independent errors would make them, at least 1. The median shows it, as most of
/// what stands still does so rightly (genomic control, Devlin and Roeder 1999).
fn overdispersion(splats: &Splats, evidence: &Evidence) -> f64 {
    let seen = (0..splats.n_static).filter(|&i| evidence.seen[i].tells_something());
    let scores = seen.map(|i| score(i, evidence)).filter(|score| score.is_finite());
    median_high(scores).map_or(1.0, |median| (median / MEDIAN_OF_5).max(1.0))
}
