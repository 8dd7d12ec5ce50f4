//! Gaussians at points: of a reconstruction, at random, or found by the other modules here.

use super::chosen::{picked, views};
use super::hull;
use crate::random::Keyed;
use crate::report::statistics::mean;
use crate::scene::capture::{Camera, Capture, Point};
use crate::scene::{Motion, SH_C0, Splats};
use glam::{DVec3, Vec3};
use std::collections::HashMap;

pub(super) const OPACITY: f64 = 0.1;

/// Largest standard deviation of a Gaussian from a point, in units of the scale of the scene there.
const WIDEST: f64 = 0.1;
/// Lenses that a point's distance is measured to, evenly chosen.
const MOST_LENSES: usize = 512;

#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Found {
    /// World.
    pub position: [f64; 3],
    /// In [0, 1].
    pub color: [f32; 3],
}

impl Found {
    pub fn at(&self) -> Vec3 {
        DVec3::from(self.position).as_vec3()
    }
}

impl From<&Point> for Found {
    fn from(point: &Point) -> Self {
        Found { position: point.position, color: point.color.map(|c| f32::from(c) / 255.0) }
    }
}

/// One isotropic Gaussian per point, of opacity 0.1. In a clip of several frames all are dynamic, at rest, and visible
/// throughout.
pub(crate) fn from_points(points: &[Point], capture: &Capture, sh_degree: u32) -> Splats {
    let found: Vec<Found> = points.iter().map(Found::from).collect();
    let sizes = spacings(&found, &Reach::new(capture));
    let mut splats = Splats::new(sh_degree);
    append(&mut splats, &found, &sizes, OPACITY, throughout(capture));
    splats
}

/// `n` grey points, uniform in the space that most cameras look at, else in the ball around the cameras.
pub(crate) fn random_points(capture: &Capture, n: usize, seed: u64) -> Vec<Point> {
    let key = [seed, 0x0070_6f69_6e74];
    let shared = hull::shared_space(&views(capture), n, &key);
    if !shared.is_empty() {
        return shared.into_iter().map(|at| Point { position: at.as_dvec3().to_array(), color: [128; 3] }).collect();
    }
    let extent = capture.extent();
    let random = Keyed::new(&key);
    let point = |i: u64| {
        let direction = DVec3::from_array(std::array::from_fn(|k| random.normal(4 * i + k as u64)));
        let r = extent.radius * random.uniform(8 * i + 6).cbrt() / direction.length().max(1e-9);
        let position = (DVec3::from(extent.center) + r * direction).to_array();
        Point { position, color: [128; 3] }
    };
    (0..n as u64).map(point).collect()
}

/// At rest and visible throughout; `None` in a clip of one frame, whose Gaussians are static.
pub(super) fn throughout(capture: &Capture) -> Option<Motion> {
    (capture.n_frames > 1).then_some(Motion { velocity: [0.0; 3], t_center: 0.5, t_scale: 0.0 })
}

/// Appends an isotropic Gaussian for each of `found`, of a standard deviation from `sizes`. Those without `motion` are
/// static; all of them come before the first that moves.
pub(super) fn append(splats: &mut Splats, found: &[Found], sizes: &[f64], opacity: f64, motion: Option<Motion>) {
    found.iter().zip(sizes).for_each(|(found, size)| push(splats, found, *size, opacity, motion));
}

pub(super) fn push(splats: &mut Splats, found: &Found, size: f64, opacity: f64, motion: Option<Motion>) {
    splats.source_row.push(splats.len() as u32);
    splats.position.push(found.position.map(|x| x as f32));
    splats.rotation.push([1.0, 0.0, 0.0, 0.0]);
    splats.scale.push([size.ln() as f32; 3]);
    splats.opacity.push((opacity / (1.0 - opacity)).ln() as f32);
    splats.sh.push(found.color.map(|c| ((f64::from(c) - 0.5) / SH_C0) as f32));
    splats.sh.resize(splats.len() * splats.n_coefficients(), [0.0; 3]);
    splats.motion.extend(motion);
    splats.n_static += usize::from(motion.is_none());
}

pub(super) fn median_color(mut colors: Vec<[f32; 3]>) -> Option<[f32; 3]> {
    let middle = colors.len() / 2;
    if colors.is_empty() {
        return None;
    }
    Some([0, 1, 2].map(|channel| {
        colors.sort_unstable_by(|a, b| a[channel].total_cmp(&b[channel]));
        colors[middle][channel]
    }))
}

pub(super) struct Reach {
    pub radius: f64,
    lenses: Vec<DVec3>,
}

impl Reach {
    pub fn new(capture: &Capture) -> Self {
        let training = capture.cameras.iter().filter(|camera| !camera.is_test);
        let centers = |camera: &Camera| -> Vec<DVec3> {
            let shots = camera.shots.iter().take(if camera.moves() { usize::MAX } else { 1 });
            shots.map(|shot| camera.pose(shot.frame).center()).collect()
        };
        let all: Vec<DVec3> = training.flat_map(centers).collect();
        Reach { radius: capture.extent().radius, lenses: picked(&all, MOST_LENSES) }
    }

    /// The largest standard deviation at a point: a tenth of the extent, or of its distance to the nearest lens beyond
    /// two extents, where it looks no larger.
    fn widest(&self, at: DVec3) -> f64 {
        let squares = self.lenses.iter().map(|lens| lens.distance_squared(at));
        let nearest = squares.fold(f64::INFINITY, f64::min).sqrt();
        WIDEST * if nearest.is_finite() { self.radius.max(nearest - 2.0 * self.radius) } else { self.radius }
    }
}

/// For each point the mean distance to its 3 nearest neighbours, at most the widest that `reach` allows.
pub(super) fn spacings(found: &[Found], reach: &Reach) -> Vec<f64> {
    let radius = reach.radius;
    let points: Vec<DVec3> = found.iter().map(|found| found.position.into()).collect();
    // Cells that would hold about two points each if the points filled the ball evenly.
    let cell = (radius / (points.len() as f64 / 2.0).cbrt()).max(1e-9 * radius.max(1e-9));
    let key = |p: &DVec3| (p / cell).floor().to_array().map(|x| x as i64);
    let mut grid: HashMap<[i64; 3], Vec<usize>> = HashMap::new();
    for (i, p) in points.iter().enumerate() {
        grid.entry(key(p)).or_default().push(i);
    }
    let spacing = |(i, p): (usize, &DVec3)| {
        let center = key(p);
        let mut nearest = [f64::INFINITY; 3];
        // A neighbour within cells * cell lies within `cells` cells: stop when the third is that near.
        for cells in 1..=8i64 {
            nearest = [f64::INFINITY; 3];
            for offset in cube(cells) {
                let at: [i64; 3] = std::array::from_fn(|k| center[k] + offset[k]);
                for &j in grid.get(&at).into_iter().flatten().filter(|j| **j != i) {
                    let d = points[j].distance_squared(*p);
                    if d < nearest[2] {
                        nearest[2] = d;
                        nearest.sort_by(f64::total_cmp);
                    }
                }
            }
            if nearest[2].sqrt() <= cells as f64 * cell {
                break;
            }
        }
        let widest = reach.widest(*p);
        let found = mean(nearest.iter().filter(|d| d.is_finite()).map(|d| d.sqrt()));
        found.map_or(widest, |mean| mean.clamp(1e-7 * radius, widest))
    };
    points.iter().enumerate().map(spacing).collect()
}

/// All offsets of at most `reach` along each axis.
pub(super) fn cube(reach: i64) -> impl Iterator<Item = [i64; 3]> {
    let side = move || -reach..=reach;
    side().flat_map(move |x| side().flat_map(move |y| side().map(move |z| [x, y, z])))
}
