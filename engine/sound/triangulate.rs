//! From what several cameras see to where it is, with its covariance.

use glam::{DMat3, DVec2, DVec3};

use crate::scene::Pose;

/// Rays that meet at a smaller angle say too little about the depth; cosine of 1 degree.
const MAX_COSINE: f64 = 0.999_847_695_156_391_3;
/// A detection agrees with a place up to this many standard deviations.
const AGREES: f64 = 3.0;
/// Huber's bound, standard deviations.
const HUBER: f64 = 2.0;
const STEPS: usize = 30;
const HALVINGS: usize = 20;

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sight {
    pub camera: usize,
    pub pose: Pose,
    /// Focal lengths, pixels.
    pub focal: DVec2,
    /// The point of the plane at distance 1 that is seen: undistorted.
    pub at: DVec2,
    /// Standard deviation in x and in y, pixels.
    pub sigma: f64,
    /// How much the detector believes in it, 0 to 1.
    pub weight: f64,
}

impl Sight {
    fn direction(&self) -> DVec3 {
        (self.pose.rotation.transpose() * self.at.extend(1.0)).normalize()
    }

    /// Where it sees `point` less where it should, pixels; `None` behind the camera.
    pub fn residual(&self, point: DVec3) -> Option<DVec2> {
        let local = self.pose.to_camera(point);
        (local.z > 0.0).then(|| (local.truncate() / local.z - self.at) * self.focal)
    }

    /// In standard deviations; infinite behind the camera.
    fn error(&self, point: DVec3) -> f64 {
        self.residual(point).map_or(f64::INFINITY, |residual| residual.length() / self.sigma)
    }
}

/// A place on which sights agree.
#[derive(Clone, Debug, PartialEq)]
pub struct Fix {
    pub p: DVec3,
    pub cov: DMat3,
    /// How much wider `cov` is than the sights' standard deviations make it, because the sights disagree by more; at least 1.
    pub excess: f64,
    /// Which sights see it; at most one for each camera.
    pub sights: Vec<usize>,
    /// Root mean square of their distances from it, pixels.
    pub reproj_px: f64,
}

/// The place that all of `sights` see: closest to all rays, refined by Huber's Gauss-Newton on the pixels. `None` with fewer than two
/// sights, with rays that are nearly parallel, or behind a camera. The covariance is wider where sights disagree significantly (0.999).
pub fn triangulate(sights: &[Sight]) -> Option<Fix> {
    refined(sights, (0..sights.len()).collect())
}

/// The places that `sights` of several things agree on, the best first: every pair of cameras proposes one, the one with most agreement
/// is refined and its sights are taken away.
pub fn triangulate_all(sights: &[Sight]) -> Vec<Fix> {
    let mut proposals = proposals(sights);
    let mut is_free = vec![true; sights.len()];
    let mut fixes = Vec::new();
    loop {
        proposals.retain(|(_, pair)| pair.iter().all(|index| is_free[*index]));
        let score = |(point, _): &(DVec3, [usize; 2])| {
            agreeing(sights, &is_free, *point).iter().map(|(_, score)| score).sum::<f64>()
        };
        // The first of equals: the order of sights decides, never chance.
        let best =
            proposals.iter().map(|proposal| (score(proposal), proposal.0)).reduce(|a, b| if b.0 > a.0 { b } else { a });
        let Some((score, point)) = best.filter(|(score, _)| *score > 0.0) else { break };
        let fix = settled(sights, &is_free, point).filter(|_| score > 0.0);
        let Some(fix) = fix else {
            proposals.retain(|proposal| proposal.0 != point);
            continue;
        };
        fix.sights.iter().for_each(|index| is_free[*index] = false);
        fixes.push(fix);
    }
    fixes
}

/// The middle of the shortest line between the rays of each pair of cameras that see it from different sides.
fn proposals(sights: &[Sight]) -> Vec<(DVec3, [usize; 2])> {
    let rays: Vec<DVec3> = sights.iter().map(Sight::direction).collect();
    let mut found = Vec::new();
    for (i, a) in sights.iter().enumerate() {
        for (j, b) in sights.iter().enumerate().skip(i + 1).filter(|(_, b)| b.camera != a.camera) {
            let cosine = rays[i].dot(rays[j]);
            if cosine.abs() > MAX_COSINE {
                continue;
            }
            let between = b.pose.center() - a.pose.center();
            let (along_a, along_b) = (between.dot(rays[i]), between.dot(rays[j]));
            let scale = 1.0 - cosine * cosine;
            let (s, t) = ((along_a - cosine * along_b) / scale, (cosine * along_a - along_b) / scale);
            if s > 0.0 && t > 0.0 {
                let point = 0.5 * (a.pose.center() + s * rays[i] + b.pose.center() + t * rays[j]);
                if a.error(point) < AGREES && b.error(point) < AGREES {
                    found.push((point, [i, j]));
                }
            }
        }
    }
    found
}

/// Of each camera the free sight that agrees best with `point`, if any does, and its part of the score.
fn agreeing(sights: &[Sight], is_free: &[bool], point: DVec3) -> Vec<(usize, f64)> {
    let mut best: Vec<(usize, f64)> = Vec::new();
    for (index, sight) in sights.iter().enumerate().filter(|(index, _)| is_free[*index]) {
        let score = sight.weight * (1.0 - (sight.error(point) / AGREES).powi(2));
        if score.is_nan() || score <= 0.0 {
            continue;
        }
        match best.iter_mut().find(|(other, _)| sights[*other].camera == sight.camera) {
            Some(known) if known.1 >= score => {}
            Some(known) => *known = (index, score),
            None => best.push((index, score)),
        }
    }
    best
}

/// The fix near `point` whose sights are those that agree with it.
fn settled(sights: &[Sight], is_free: &[bool], mut point: DVec3) -> Option<Fix> {
    let mut fix: Option<Fix> = None;
    // A set that is not stable after a few turns swings between two that are alike.
    for _ in 0..5 {
        let chosen: Vec<usize> = agreeing(sights, is_free, point).into_iter().map(|(index, _)| index).collect();
        if fix.as_ref().is_some_and(|fix| fix.sights == chosen) {
            break;
        }
        let next = refined(sights, chosen)?;
        point = next.p;
        fix = Some(next);
    }
    fix
}

/// The fix of the sights with these indices.
fn refined(sights: &[Sight], chosen: Vec<usize>) -> Option<Fix> {
    let seen: Vec<&Sight> = chosen.iter().map(|index| &sights[*index]).collect();
    let rays: Vec<DVec3> = seen.iter().map(|sight| sight.direction()).collect();
    let wide = |i: usize| rays[..i].iter().any(|other| other.dot(rays[i]).abs() <= MAX_COSINE);
    if !(0..rays.len()).any(wide) {
        return None;
    }
    let mut point = nearest_to_rays(&seen, &rays);
    let mut cost = cost(&seen, point)?;
    for _ in 0..STEPS {
        let (gradient, hessian) = normal_equations(&seen, point);
        let step = hessian.inverse() * gradient;
        // Half of the step as long as the whole would lead uphill or behind a camera.
        let mut shorter = (0..HALVINGS).map(|n| point - step * 0.5_f64.powi(n as i32));
        let next = shorter.find_map(|at| Some((at, self::cost(&seen, at).filter(|c| *c <= cost)?)));
        let Some((at, lower)) = next else { break };
        let moved = (at - point).length();
        (point, cost) = (at, lower);
        if moved <= 1e-14 * (point - seen[0].pose.center()).length() {
            break;
        }
    }
    let (_, hessian) = normal_equations(&seen, point);
    let residuals: Vec<DVec2> = seen.iter().filter_map(|sight| sight.residual(point)).collect();
    let squares: f64 = residuals.iter().map(|residual| residual.length_squared()).sum();
    let excess = excess(2.0 * cost, 2 * seen.len() - 3);
    let cov = hessian.inverse() * excess;
    let reproj_px = (squares / seen.len() as f64).sqrt();
    (point.is_finite() && cov.is_finite()).then_some(Fix { p: point, cov, excess, sights: chosen, reproj_px })
}

/// The factor by which the variance of one is too small: chi squared over its degrees of freedom beyond the 0.999 quantile (Wilson and
/// Hilferty), else 1. Without the test the mean would be biased.
fn excess(chi2: f64, freedom: usize) -> f64 {
    let n = freedom as f64;
    let spread = 2.0 / (9.0 * n);
    let bound = n * (1.0 - spread + 3.09 * spread.sqrt()).powi(3);
    if chi2 > bound { chi2 / n } else { 1.0 }
}

/// The point with the least sum of squared distances from the rays.
fn nearest_to_rays(seen: &[&Sight], rays: &[DVec3]) -> DVec3 {
    let (mut a, mut b) = (DMat3::ZERO, DVec3::ZERO);
    for (sight, ray) in seen.iter().zip(rays) {
        let across = DMat3::IDENTITY - DMat3::from_cols(*ray * ray.x, *ray * ray.y, *ray * ray.z);
        a += across;
        b += across * sight.pose.center();
    }
    a.inverse() * b
}

/// Huber's loss, in half squares; `None` behind a camera.
fn cost(seen: &[&Sight], point: DVec3) -> Option<f64> {
    let loss = |sight: &&Sight| {
        let error = sight.residual(point)?.length() / sight.sigma;
        Some(if error <= HUBER { 0.5 * error * error } else { HUBER * (error - 0.5 * HUBER) })
    };
    seen.iter().map(loss).sum::<Option<f64>>().filter(|sum| sum.is_finite())
}

/// Gradient of the loss and Gauss and Newton's Hessian.
fn normal_equations(seen: &[&Sight], point: DVec3) -> (DVec3, DMat3) {
    let (mut gradient, mut hessian) = (DVec3::ZERO, DMat3::ZERO);
    for sight in seen {
        let Some(residual) = sight.residual(point) else { continue };
        let local = sight.pose.to_camera(point);
        let weight = (HUBER * sight.sigma / residual.length()).min(1.0) / (sight.sigma * sight.sigma);
        let to_world = sight.pose.rotation.transpose();
        for axis in 0..2 {
            let mut slope = DVec3::ZERO;
            slope[axis] = sight.focal[axis] / local.z;
            slope.z = -sight.focal[axis] * local[axis] / (local.z * local.z);
            let row = to_world * slope;
            gradient += weight * residual[axis] * row;
            hessian += DMat3::from_cols(row * row.x, row * row.y, row * row.z) * weight;
        }
    }
    (gradient, hessian)
}
