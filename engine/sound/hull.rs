//! Triangles of directions: the convex hull of points on a sphere, which is their spherical Delaunay triangulation.

use crate::random::Random;
use glam::DVec3;
use std::collections::{HashMap, HashSet};

/// Rings of a measurement hold four and more points on a plane; this moves each a little, always the same way.
const JITTER: f64 = 1e-9;

/// A closed surface of triangles around the origin.
#[derive(Clone, Debug)]
pub struct Hull {
    points: Vec<DVec3>,
    /// Corners, counter-clockwise from outside.
    pub triangles: Vec<[usize; 3]>,
    /// By triangle, its neighbour across the edge opposite each corner.
    across: Vec<[usize; 3]>,
}

impl Hull {
    /// The hull of directions of any length; `None` where they do not surround the origin.
    pub fn new(directions: &[DVec3]) -> Option<Hull> {
        let points: Vec<DVec3> =
            directions.iter().enumerate().map(|(i, to)| (to.normalize() + jitter(i)).normalize()).collect();
        let mut faces = first_faces(&points)?;
        let done: HashSet<usize> = faces.iter().flatten().copied().collect();
        for at in (0..points.len()).filter(|at| !done.contains(at)) {
            add(&points, &mut faces, at);
        }
        if faces.iter().any(|face| plane(&points, face).1 <= 1e-9) {
            return None;
        }
        let mut owner: HashMap<(usize, usize), usize> = HashMap::new();
        for (index, [a, b, c]) in faces.iter().enumerate() {
            owner.extend([((*b, *c), index), ((*c, *a), index), ((*a, *b), index)]);
        }
        let across: Option<Vec<[usize; 3]>> = faces
            .iter()
            .map(|[a, b, c]| Some([*owner.get(&(*c, *b))?, *owner.get(&(*a, *c))?, *owner.get(&(*b, *a))?]))
            .collect();
        Some(Hull { points, triangles: faces, across: across? })
    }

    /// By corner, the corners that it shares an edge with.
    pub fn neighbours(&self) -> Vec<Vec<usize>> {
        let mut all = vec![Vec::new(); self.points.len()];
        // Each edge belongs to two triangles, once in each direction.
        for [a, b, c] in &self.triangles {
            all[*a].push(*b);
            all[*b].push(*c);
            all[*c].push(*a);
        }
        all
    }

    /// The triangle that a direction passes through: its corners and their weights, which are not negative and sum to 1.
    pub fn locate(&self, to: DVec3) -> [(usize, f64); 3] {
        let to = to.try_normalize().unwrap_or(DVec3::X);
        let mut at = 0;
        // From triangle to triangle across the edge that is most in the way; on a convex hull that arrives.
        for _ in 0..self.triangles.len() {
            let inside = self.inside(at, to);
            let worst = if inside[0] <= inside[1] && inside[0] <= inside[2] {
                0
            } else {
                1 + usize::from(inside[2] < inside[1])
            };
            if inside[worst] >= 0.0 {
                return self.weights(at, inside);
            }
            at = self.across[at][worst];
        }
        // Rounding at a corner can make it go in circles: take the triangle that is least wrong.
        let wrong = |at: &usize| self.inside(*at, to).into_iter().fold(f64::INFINITY, f64::min);
        let best = (0..self.triangles.len()).max_by(|a, b| wrong(a).total_cmp(&wrong(b))).unwrap_or(0);
        self.weights(best, self.inside(best, to).map(|value| value.max(0.0)))
    }

    /// Volumes that tell on which side of its edges a direction passes; all are positive inside.
    fn inside(&self, triangle: usize, to: DVec3) -> [f64; 3] {
        let [a, b, c] = self.triangles[triangle].map(|corner| self.points[corner]);
        [to.dot(b.cross(c)), to.dot(c.cross(a)), to.dot(a.cross(b))]
    }

    fn weights(&self, triangle: usize, inside: [f64; 3]) -> [(usize, f64); 3] {
        let sum: f64 = inside.iter().sum();
        let corners = self.triangles[triangle];
        [0, 1, 2].map(|k| (corners[k], inside[k] / sum))
    }
}

fn jitter(index: usize) -> DVec3 {
    let mut random = Random::new(index as u64 + 1);
    DVec3::from_array([(); 3].map(|()| random.uniform(-1.0, 1.0))) * JITTER
}

/// Outward normal and distance from the origin.
fn plane(points: &[DVec3], [a, b, c]: &[usize; 3]) -> (DVec3, f64) {
    let normal = (points[*b] - points[*a]).cross(points[*c] - points[*a]).normalize_or_zero();
    (normal, normal.dot(points[*a]))
}

/// A tetrahedron of points that are far apart.
fn first_faces(points: &[DVec3]) -> Option<Vec<[usize; 3]>> {
    let farthest = |of: &dyn Fn(DVec3) -> f64| {
        (0..points.len()).max_by(|a, b| of(points[*a]).total_cmp(&of(points[*b]))).filter(|at| of(points[*at]) > 1e-3)
    };
    let a = 0;
    let start = *points.first()?;
    let b = farthest(&|p| p.distance(start))?;
    let line = (points[b] - start).normalize();
    let c = farthest(&|p| (p - start).cross(line).length())?;
    let normal = (points[b] - start).cross(points[c] - start).normalize();
    let d = farthest(&|p| (p - start).dot(normal).abs())?;
    let (b, c) = if (points[d] - start).dot(normal) > 0.0 { (c, b) } else { (b, c) };
    Some(vec![[a, b, c], [a, d, b], [b, d, c], [c, d, a]])
}

/// Replaces the faces that a point sees by faces to the point.
fn add(points: &[DVec3], faces: &mut Vec<[usize; 3]>, at: usize) {
    let point = points[at];
    let sees = |face: &[usize; 3]| {
        let (normal, distance) = plane(points, face);
        normal.dot(point) > distance + 1e-14
    };
    let seen: Vec<[usize; 3]> = faces.extract_if(.., |face| sees(face)).collect();
    let edges: HashSet<(usize, usize)> = seen.iter().flat_map(|[a, b, c]| [(*a, *b), (*b, *c), (*c, *a)]).collect();
    for [a, b, c] in &seen {
        for (from, to) in [(*a, *b), (*b, *c), (*c, *a)] {
            if !edges.contains(&(to, from)) {
                faces.push([from, to, at]);
            }
        }
    }
}
