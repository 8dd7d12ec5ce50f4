//! Where the mouth of a person is in a picture, from the points that a detector found.

use glam::DVec2;

/// Points below this score are not there.
const MIN_SCORE: f64 = 0.3;
/// With fewer points of the mouth its middle is not known.
const MIN_POINTS: usize = 6;
/// Standard deviation of a mouth's middle relative to its width, and the least, pixels.
const RELATIVE_SIGMA: f64 = 0.02;
const MIN_SIGMA: f64 = 1.0;
/// From nose to mouth, relative to the largest distance between nose, eyes and ears.
const NOSE_TO_MOUTH: f64 = 0.6;

/// The mouth of a person in a picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mouth {
    /// Its middle, pixels of the picture that the detector saw.
    pub at: DVec2,
    /// Standard deviation in x and in y, pixels.
    pub sigma: f64,
    /// Mean score of its points, 0 to 1.
    pub weight: f64,
    /// From corner to corner, pixels; 0 where a corner is not seen.
    pub width: f64,
    /// Distance of the lips relative to the width; none where they are not seen.
    pub opening: Option<f64>,
    /// Only the nose is seen; `at` is where it is.
    pub approx: bool,
}

/// Where a list of points has what is of use.
struct Layout {
    /// First point of the outer lip; the twelve of it are followed by the eight of the inner lip. Both begin at the
    /// speaker's right corner and go over the upper lip.
    lips: Option<usize>,
    /// Nose, and what else of the head gives its size.
    head: &'static [usize],
}

const COCO_HEAD: &[usize] = &[0, 1, 2, 3, 4];
const BODY_25_HEAD: &[usize] = &[0, 15, 16, 17, 18];

/// By the number of points: COCO's 17, Halpe's 26 and OpenPose's 25 of the body; the face's 68 or 70; COCO-WholeBody's 133,
/// the same with a neck in between, and Halpe's 136.
fn layout(n_points: usize) -> Option<Layout> {
    let (lips, head) = match n_points {
        17 | 26 => (None, COCO_HEAD),
        25 => (None, BODY_25_HEAD),
        68 | 70 => (Some(48), &[][..]),
        133 => (Some(71), COCO_HEAD),
        134 => (Some(72), COCO_HEAD),
        136 => (Some(74), COCO_HEAD),
        _ => return None,
    };
    Some(Layout { lips, head })
}

/// A point with its score. Scores of SimCC heads are no probabilities and exceed 1.
pub(super) type Keypoint = (DVec2, f64);

/// The mouth among the points of a person; `None` when too little of it and of the head is seen, `Err` with the reason when
/// the number of points is of no known layout.
pub(super) fn mouth(points: &[Keypoint]) -> Result<Option<Mouth>, String> {
    if points.is_empty() {
        return Ok(None);
    }
    let layout = layout(points.len()).ok_or_else(|| {
        format!("has a person of {} points; 17, 25, 26, 68, 70, 133, 134 and 136 are known", points.len())
    })?;
    let seen = |index: usize| {
        let (at, score) = points[index];
        (score >= MIN_SCORE && at.is_finite()).then_some((at, score.min(1.0)))
    };
    let by_lips = layout.lips.and_then(|first| by_lips(first, &seen));
    Ok(by_lips.or_else(|| by_nose(layout.head, &seen)))
}

fn by_lips(first: usize, seen: &dyn Fn(usize) -> Option<Keypoint>) -> Option<Mouth> {
    let found: Vec<Keypoint> = (first..first + 20).filter_map(seen).collect();
    if found.len() < MIN_POINTS {
        return None;
    }
    let total: f64 = found.iter().map(|(_, score)| score).sum();
    let at = found.iter().map(|(at, score)| *at * *score).sum::<DVec2>() / total;
    let between = |a: usize, b: usize| Some((seen(first + a)?.0 - seen(first + b)?.0).length());
    let width = between(0, 6).unwrap_or(0.0);
    let opening = between(14, 18).filter(|_| width > 0.0).map(|lips| lips / width);
    let sigma = MIN_SIGMA.max(RELATIVE_SIGMA * width);
    Some(Mouth { at, sigma, weight: total / found.len() as f64, width, opening, approx: false })
}

fn by_nose(head: &[usize], seen: &dyn Fn(usize) -> Option<Keypoint>) -> Option<Mouth> {
    let (nose, weight) = seen(*head.first()?)?;
    let others: Vec<DVec2> = head.iter().filter_map(|index| Some(seen(*index)?.0)).collect();
    let pairs = others.iter().flat_map(|a| others.iter().map(|b| (*a - *b).length()));
    let size = pairs.fold(0.0, f64::max);
    let sigma = NOSE_TO_MOUTH * size;
    (size > 0.0).then(|| Mouth {
        at: nose,
        sigma: sigma.max(MIN_SIGMA),
        weight,
        width: 0.0,
        opening: None,
        approx: true,
    })
}
