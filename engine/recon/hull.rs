//! The visual hull: the space that every camera sees as foreground, which moves or was cut out.

use super::eye::{Axis, Ground, ViewBuffers};
use super::points::{Found, median_color};
use crate::random::{Keyed, permutation};
use crate::report::statistics::median_high;
use crate::scene::View;
use glam::{IVec3, Mat3, Vec2, Vec3};
use std::collections::HashSet;

/// Halvings of the cube: leaves are 1/256 of its side.
const LEVELS: u32 = 8;
/// Halvings that find the part of the cube that is needed; if that is smaller than `SMALL`, it alone is carved.
const COARSE_LEVELS: u32 = 6;
const SMALL: f32 = 0.25;
const MOST_ZOOMS: usize = 4;
const BLANK_SIDE: usize = 64;
/// Cells at which halving ends early: masks that are all foreground would fill the cube.
const MOST_CELLS: usize = 200_000;
/// Cameras that must see a cell, as a fraction of all and at least 3: fewer leave long phantoms.
const LEAST_SEEN: f32 = 1.0 / 3.0;
const LEAST_CAMERAS: f32 = 3.0;
/// A camera looks at what is at least so far before it, as a fraction of the distance and in training units.
const LEAST_BEFORE: f32 = 0.01;
const NOWHERE: f32 = 1e-4;
/// Half of the cube's side, in distances of the cameras from the point between them.
const INWARD_REACH: f32 = 1.5;
const OUTWARD_REACH: f32 = 10.0;
/// Cameras, as a fraction of those that see a cell, that may see no foreground where there is some: masks have holes.
const MOST_MISSES: f32 = 0.1;

pub(super) struct Cube {
    center: Vec3,
    half: f32,
    least_seen: f32,
    pub is_inward: bool,
}

impl Cube {
    /// Around the point nearest to all optical axes.
    pub fn around(axes: &[Axis]) -> Self {
        // Where the axes are parallel, a weak pull to the middle of the cameras decides.
        let n = axes.len() as f32;
        let middle = axes.iter().map(|axis| axis.center).sum::<Vec3>() / n;
        let (mut across, mut sum) = (Mat3::IDENTITY * 1e-3 * n, middle * 1e-3 * n);
        for Axis { center, along } in axes {
            let flat = Mat3::IDENTITY - Mat3::from_cols(along * along.x, along * along.y, along * along.z);
            across += flat;
            sum += flat * *center;
        }
        let center = across.inverse() * sum;
        let distances = axes.iter().map(|axis| f64::from(axis.center.distance(center)));
        let distance = median_high(distances).unwrap_or(0.0) as f32;
        // Where axes are parallel, or there is one alone, what is nearest to them lies where the cameras are.
        let looks_at = |axis: &&Axis| axis.depth(center) > (LEAST_BEFORE * axis.center.distance(center)).max(NOWHERE);
        let n_inward = axes.iter().filter(looks_at).count();
        let is_inward = 2 * n_inward > axes.len();
        let (reach, least_seen) =
            if is_inward { (INWARD_REACH, LEAST_CAMERAS.max(LEAST_SEEN * n)) } else { (OUTWARD_REACH, LEAST_CAMERAS) };
        Cube { center, half: reach * distance, least_seen, is_inward }
    }
}

/// A camera's foreground, summed from the first pixel on.
struct Silhouette<'a> {
    eye: &'a ViewBuffers,
    /// Counts of moving or unknown pixels in the rows above and the columns to the left; one row and one column more.
    sums: Vec<u32>,
}

#[derive(PartialEq)]
enum Occupancy {
    /// Out of sight, or partly so.
    Unseen,
    Empty,
    Possible,
}

impl<'a> Silhouette<'a> {
    /// Counts the pixels of the class `of`.
    fn new(eye: &'a ViewBuffers, of: Ground) -> Self {
        let stride = eye.width + 1;
        let mut sums = vec![0; stride * (eye.height + 1)];
        for (row, pixels) in eye.ground.chunks_exact(eye.width).enumerate() {
            let mut in_row = 0;
            for (column, ground) in pixels.iter().enumerate() {
                // Unknown pixels carve nothing.
                in_row += u32::from(*ground == of || *ground == Ground::Unknown);
                sums[(row + 1) * stride + column + 1] = sums[row * stride + column + 1] + in_row;
            }
        }
        Silhouette { eye, sums }
    }

    /// About the ball around a cell.
    fn occupancy(&self, center: Vec3, radius: f32) -> Occupancy {
        let eye = self.eye;
        let depth = eye.axis().depth(center);
        if depth <= -radius {
            return Occupancy::Unseen;
        }
        // A cell that the lens is in, or nearly, may be anywhere in the picture.
        let Some((at, _)) = eye.project(center).filter(|_| depth > 1.01 * radius) else {
            return Occupancy::Possible;
        };
        let reach = Vec2::splat(radius) / (depth - radius) * eye.focal;
        let size = Vec2::new(eye.width as f32, eye.height as f32);
        let (low, high) = ((at - reach).floor(), (at + reach).ceil());
        let (first, last) = (low.max(Vec2::ZERO), high.min(size));
        if !(first.x < last.x && first.y < last.y) {
            return Occupancy::Unseen;
        }
        let sum = |x: f32, y: f32| self.sums[y as usize * (eye.width + 1) + x as usize];
        let n = sum(last.x, last.y) + sum(first.x, first.y) - sum(first.x, last.y) - sum(last.x, first.y);
        match n {
            0 if (first, last) != (low, high) => Occupancy::Unseen,
            0 => Occupancy::Empty,
            _ => Occupancy::Possible,
        }
    }
}

struct Carved {
    corner: Vec3,
    side: f32,
    cells: Vec<IVec3>,
}

impl Carved {
    fn middle(&self, cell: IVec3) -> Vec3 {
        self.corner + (cell.as_vec3() + 0.5) * self.side
    }

    /// Halves a cube `levels` times. The ball around a cell decides; that of the last level is the one inside it where
    /// `is_tight`, so that the hull does not grow.
    fn new(silhouettes: &[Silhouette], cube: &Cube, levels: u32, is_tight: bool) -> Self {
        let (corner, side) = (cube.center - cube.half, 2.0 * cube.half);
        let mut carved = Carved { corner, side, cells: vec![IVec3::ZERO] };
        for level in 1..=levels {
            if carved.cells.len() > MOST_CELLS {
                break;
            }
            carved.side /= 2.0;
            let radius = if level == levels && is_tight { 0.5 * carved.side } else { 0.87 * carved.side };
            let corners = (0..8).map(|part| IVec3::new(part & 1, part >> 1 & 1, part >> 2));
            let halves = carved.cells.iter().flat_map(|cell| corners.clone().map(|corner| 2 * *cell + corner));
            let is_kept = |cell: &IVec3| may_be_inside(silhouettes, cube.least_seen, carved.middle(*cell), radius);
            carved.cells = halves.filter(is_kept).collect();
        }
        carved
    }

    /// Carves the space that the eyes look at. A small hull, as before long lenses, is carved in a cube of its own.
    fn around(eyes: &[ViewBuffers], silhouettes: &[Silhouette]) -> Self {
        let mut cube = Cube::around(&eyes.iter().map(ViewBuffers::axis).collect::<Vec<_>>());
        for _ in 0..MOST_ZOOMS {
            let coarse = Carved::new(silhouettes, &cube, COARSE_LEVELS, false);
            let corners = coarse.cells.iter().copied();
            let Some((low, high)) = corners.map(|cell| (cell, cell)).reduce(|a, b| (a.0.min(b.0), a.1.max(b.1))) else {
                break;
            };
            let half = 0.5 * coarse.side * (high - low + 1).max_element() as f32;
            if half > SMALL * cube.half {
                break;
            }
            cube = Cube { center: 0.5 * (coarse.middle(low) + coarse.middle(high)), half, ..cube };
        }
        Carved::new(silhouettes, &cube, LEVELS, true)
    }
}

/// At most `most` random points of the space that the cameras `views` share, in an order by `key`; none unless most of
/// them look at the space between them.
pub(super) fn shared_space(views: &[View], most: usize, key: &[u64]) -> Vec<Vec3> {
    let eyes: Vec<ViewBuffers> = views.iter().map(|view| ViewBuffers::blank(view, BLANK_SIDE)).collect();
    if eyes.is_empty() || !Cube::around(&eyes.iter().map(ViewBuffers::axis).collect::<Vec<_>>()).is_inward {
        return Vec::new();
    }
    let silhouettes: Vec<Silhouette> = eyes.iter().map(|eye| Silhouette::new(eye, Ground::Still)).collect();
    let carved = Carved::around(&eyes, &silhouettes);
    let random = Keyed::new(key);
    let n = carved.cells.len();
    let point = |i: usize| {
        let at = |k: u64| random.uniform(4 * i as u64 + k);
        let cell = carved.cells[((at(3) * n as f64) as usize).min(n - 1)];
        carved.middle(cell) + (Vec3::from_array([0, 1, 2].map(|k| at(k) as f32)) - 0.5) * carved.side
    };
    if n == 0 { Vec::new() } else { (0..most).map(point).collect() }
}

/// At most `most` points of the surface of the hull of this ground, chosen at random with `key`.
pub(super) fn surface(eyes: &[ViewBuffers], of: Ground, most: usize, key: &[u64]) -> Vec<Found> {
    let silhouettes: Vec<Silhouette> = eyes.iter().map(|eye| Silhouette::new(eye, of)).collect();
    let carved = Carved::around(eyes, &silhouettes);
    let inside: HashSet<IVec3> = carved.cells.iter().copied().collect();
    let beside = [IVec3::X, IVec3::Y, IVec3::Z, -IVec3::X, -IVec3::Y, -IVec3::Z];
    let is_surface = |cell: &&IVec3| beside.iter().any(|step| !inside.contains(&(**cell + step)));
    let shell: Vec<Vec3> = carved.cells.iter().filter(is_surface).map(|cell| carved.middle(*cell)).collect();
    let nearest: Vec<Vec<f32>> = eyes.iter().map(|eye| depth_buffer(eye, &shell, carved.side)).collect();
    let chosen = permutation(shell.len(), key).into_iter().take(most).map(|index| shell[index]);
    let found = |position: Vec3| {
        let color = color(eyes, of, &nearest, position, carved.side)?;
        Some(Found { position: position.as_dvec3().to_array(), color })
    };
    chosen.filter_map(found).collect()
}

/// True if a point may belong to the object that was cut out: enough cameras see its place, and few see nothing there.
pub(super) fn may_be_shown(eyes: &[ViewBuffers], found: &Found) -> bool {
    let at = found.at();
    let seen = eyes.iter().filter_map(|eye| Some(eye.ground[eye.sees(at)?.0]));
    let (n_seen, n_empty) =
        seen.fold((0.0, 0.0), |(n, empty), ground| (n + 1.0, empty + f32::from(ground == Ground::Empty)));
    n_seen >= LEAST_CAMERAS.max(LEAST_SEEN * eyes.len() as f32) && n_empty <= MOST_MISSES * n_seen
}

fn may_be_inside(silhouettes: &[Silhouette], least_seen: f32, center: Vec3, radius: f32) -> bool {
    let (mut n_seen, mut n_empty, mut n_left) = (0.0, 0.0, silhouettes.len() as f32);
    for silhouette in silhouettes {
        let occupancy = silhouette.occupancy(center, radius);
        n_seen += f32::from(occupancy != Occupancy::Unseen);
        n_empty += f32::from(occupancy == Occupancy::Empty);
        n_left -= 1.0;
        // The rest cannot change that.
        if n_empty > MOST_MISSES * (n_seen + n_left) || n_seen + n_left < least_seen {
            return false;
        }
    }
    n_seen >= least_seen
}

/// The least depth of the shell behind each pixel.
fn depth_buffer(eye: &ViewBuffers, shell: &[Vec3], side: f32) -> Vec<f32> {
    let mut nearest = vec![f32::INFINITY; eye.width * eye.height];
    for position in shell {
        let Some((at, depth)) = eye.project(*position) else { continue };
        let reach = 0.5 * side / depth * eye.focal;
        let (low, high) = ((at - reach).max(Vec2::ZERO), at + reach);
        for y in low.y as usize..(high.y.ceil().max(0.0) as usize).min(eye.height) {
            for x in low.x as usize..(high.x.ceil().max(0.0) as usize).min(eye.width) {
                let pixel = &mut nearest[y * eye.width + x];
                *pixel = pixel.min(depth);
            }
        }
    }
    nearest
}

/// The median colour over the cameras that see the point unhidden.
fn color(eyes: &[ViewBuffers], of: Ground, nearest: &[Vec<f32>], position: Vec3, side: f32) -> Option<[f32; 3]> {
    let sees = |(eye, nearest): (&ViewBuffers, &Vec<f32>)| {
        let (pixel, depth) = eye.sees(position)?;
        let is_visible = eye.ground[pixel] == of && depth <= nearest[pixel] + 2.0 * side;
        is_visible.then(|| eye.color[pixel])
    };
    median_color(eyes.iter().zip(nearest).filter_map(sees).collect())
}
