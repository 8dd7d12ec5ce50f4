//! Checks that the points of a model lie before the cameras that saw them, and finds how its poses are meant where they do not.

use std::collections::HashMap;

use crate::scene::Pose;
use crate::scene::undistort::{Distortion, Lens};
use glam::{DVec3, DVec4};

/// Observations that are judged, those of the first points.
const MAX_JUDGED: usize = 20_000;
const MIN_JUDGED: usize = 24;
/// The share of observations that a right model shows at least in or near its pictures.
const GOOD: f64 = 0.9;
/// By how much larger that share must be in another way: a wrong one shows half of them by chance.
const BETTER: f64 = 0.25;
/// Below this share a model is doubtful, whatever the other ways.
const DOUBTFUL: f64 = 0.5;
/// How far beyond the border of its picture an observation may be seen, in sides of it.
const MARGIN: f64 = 0.5;

/// A way in which a pose may be meant: what it is, and what its owner should write.
type Convention = (&'static str, &'static str);

const CONVENTIONS: [Convention; 6] = [
    ("as COLMAP has them", ""),
    ("with quaternions x y z w", "write quaternions as w x y z"),
    ("with centres of cameras in place of TX TY TZ", "write the translation -R C in place of the centre C"),
    ("from camera to world", "invert the poses: they must lead from the world to the camera"),
    (
        "with quaternions x y z w and centres in place of TX TY TZ",
        "write quaternions as w x y z, and the translation -R C in place of the centre C",
    ),
    (
        "from camera to world, with quaternions x y z w",
        "write quaternions as w x y z, and invert the poses: they must lead from the world to the camera",
    ),
];

#[derive(Default)]
pub(super) struct Facing {
    /// By image: its lens with its reach, and its pose in every way.
    cameras: HashMap<u32, (Lens, f64, [Pose; CONVENTIONS.len()])>,
    n_judged: usize,
    n_behind: usize,
    n_seen: [usize; CONVENTIONS.len()],
}

impl Facing {
    pub fn add_camera(&mut self, id: u32, lens: Lens, quaternion: [f64; 4], translation: [f64; 3]) {
        let [w, x, y, z] = quaternion;
        if !DVec4::from(quaternion).length().is_normal() {
            return;
        }
        let t = DVec3::from(translation);
        let plain = Pose::of_quaternion([w, x, y, z], t);
        // The fields hold x y z w, and were read as w x y z.
        let turned = Pose::of_quaternion([z, w, x, y], t);
        let centre = |pose: &Pose| Pose::at(t, pose.rotation);
        let inverse = |pose: &Pose| Pose::at(t, pose.rotation.transpose());
        let ways = [plain, turned, centre(&plain), inverse(&plain), centre(&turned), inverse(&turned)];
        self.cameras.insert(id, (lens, lens.reach(), ways));
    }

    pub fn add(&mut self, point: [f64; 3], seen_in: &[u32]) {
        for id in seen_in {
            let Some((lens, reach, ways)) = self.cameras.get(id).filter(|_| self.n_judged < MAX_JUDGED) else {
                continue;
            };
            self.n_judged += 1;
            for (way, (n, pose)) in self.n_seen.iter_mut().zip(ways).enumerate() {
                let local = pose.to_camera(DVec3::from(point));
                *n += usize::from(shows(lens, *reach, local));
                self.n_behind += usize::from(way == 0 && local.z <= 0.0);
            }
        }
    }

    /// The fault where most points do not lie before the cameras that saw them, and its remedy where another convention fits.
    pub fn verdict(&self) -> Option<(String, Option<&'static str>)> {
        let n = self.n_judged;
        let share = |way: usize| self.n_seen[way] as f64 / n as f64;
        let best = (1..CONVENTIONS.len()).max_by_key(|way| (self.n_seen[*way], std::cmp::Reverse(*way)))?;
        let is_other = share(best) >= GOOD && share(best) - share(0) >= BETTER;
        if n < MIN_JUDGED || share(0) >= DOUBTFUL && !is_other {
            return None;
        }
        let behind = self.n_behind;
        let outside = n - self.n_seen[0] - behind;
        let wrong = format!(
            "of {n} observations of points, {behind} are behind the camera and {outside} far outside its picture"
        );
        if !is_other {
            return Some((format!("{wrong}: poses or points may be wrong"), None));
        }
        let (what, remedy) = CONVENTIONS[best];
        Some((format!("{wrong}; the poses fit {what} ({:.0} % are in the picture)", 100.0 * share(best)), Some(remedy)))
    }
}

fn shows(lens: &Lens, reach: f64, local: DVec3) -> bool {
    if local.z.is_nan() || local.z <= 0.0 {
        return false;
    }
    let size = lens.intrinsics.size();
    let at = [local.x / local.z, local.y / local.z];
    // Beyond the lens's reach a pinhole decides.
    let pinhole = Lens { distortion: Distortion::None, ..*lens };
    let pixel = lens.pixel(at, reach).or_else(|| pinhole.pixel(at, reach));
    let near = |v: f64, side: f64| (-MARGIN * side..=(1.0 + MARGIN) * side).contains(&v);
    pixel.is_some_and(|[x, y]| near(x, size.x) && near(y, size.y))
}
