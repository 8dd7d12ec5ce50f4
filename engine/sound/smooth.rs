//! Kalman's filter over places of nearly constant velocity, and Rauch, Tung and Striebel's smoother.

use glam::{DMat3, DVec3};

/// Two by two blocks of a matrix over (place, velocity).
type Blocks = [[DMat3; 2]; 2];

/// Place and velocity with their covariance.
#[derive(Clone, Copy, Debug)]
pub struct State {
    pub p: DVec3,
    /// World, per second.
    pub v: DVec3,
    pub(super) cov: Blocks,
}

#[derive(Clone, Copy, Debug)]
pub struct Motion {
    /// Spectral density of the acceleration, scene units squared per second cubed.
    pub density: f64,
    /// Standard deviation of the velocity of what has just been found, scene units per second.
    pub speed: f64,
}

impl State {
    pub fn new(p: DVec3, cov: DMat3, motion: Motion) -> State {
        let unknown = DMat3::from_diagonal(DVec3::splat(motion.speed * motion.speed));
        State { p, v: DVec3::ZERO, cov: [[cov, DMat3::ZERO], [DMat3::ZERO, unknown]] }
    }

    pub fn predicted(&self, dt: f64, motion: Motion) -> State {
        let [[a, b], [bt, c]] = self.cov;
        let noise = |factor: f64| DMat3::from_diagonal(DVec3::splat(motion.density * factor));
        let across = b + dt * c + noise(dt * dt / 2.0);
        let place = a + dt * (b + bt) + dt * dt * c + noise(dt * dt * dt / 3.0);
        State { p: self.p + dt * self.v, v: self.v, cov: [[place, across], [across.transpose(), c + noise(dt)]] }
    }

    pub fn updated(&self, p: DVec3, cov: DMat3) -> State {
        let [[a, b], [bt, c]] = self.cov;
        let inverse = (a + cov).inverse();
        let (gain_p, gain_v) = (a * inverse, bt * inverse);
        let off = p - self.p;
        let place = symmetric(a - gain_p * a);
        let across = b - gain_p * b;
        let velocity = symmetric(c - gain_v * b);
        State {
            p: self.p + gain_p * off,
            v: self.v + gain_v * off,
            cov: [[place, across], [across.transpose(), velocity]],
        }
    }

    /// Squared Mahalanobis distance of a sight at `p`, and the logarithm of the determinant of its covariance.
    pub fn distance(&self, p: DVec3, cov: DMat3) -> (f64, f64) {
        let total = self.cov[0][0] + cov;
        let off = p - self.p;
        (off.dot(total.inverse() * off), total.determinant().ln())
    }
}

/// The smoothed states of a thing seen at some of the steps of `dt` seconds, the first and the last among them.
pub fn smooth(seen: &[Option<(DVec3, DMat3)>], dt: f64, motion: Motion) -> Vec<State> {
    let mut filtered: Vec<State> = Vec::with_capacity(seen.len());
    let mut predicted: Vec<State> = Vec::with_capacity(seen.len());
    for sight in seen {
        let prior = filtered.last().map(|last| last.predicted(dt, motion));
        let state = match (prior, sight) {
            (Some(prior), Some((p, cov))) => prior.updated(*p, *cov),
            (Some(prior), None) => prior,
            (None, Some((p, cov))) => State::new(*p, *cov, motion),
            (None, None) => continue,
        };
        predicted.push(prior.unwrap_or(state));
        filtered.push(state);
    }
    let mut smoothed = filtered.clone();
    for i in (0..filtered.len().saturating_sub(1)).rev() {
        let (here, ahead, later) = (filtered[i], predicted[i + 1], smoothed[i + 1]);
        let [[a, b], [bt, c]] = here.cov;
        // The covariance with the state one step later, times the inverse of that one's own.
        let gain = multiplied([[a + dt * b, b], [bt + dt * c, c]], inverted(ahead.cov));
        let (off_p, off_v) = (later.p - ahead.p, later.v - ahead.v);
        let change = multiplied(multiplied(gain, minus(later.cov, ahead.cov)), transposed(gain));
        smoothed[i] = State {
            p: here.p + gain[0][0] * off_p + gain[0][1] * off_v,
            v: here.v + gain[1][0] * off_p + gain[1][1] * off_v,
            cov: [[symmetric(a + change[0][0]), b + change[0][1]], [bt + change[1][0], symmetric(c + change[1][1])]],
        };
    }
    smoothed
}

fn symmetric(m: DMat3) -> DMat3 {
    0.5 * (m + m.transpose())
}

fn multiplied(x: Blocks, y: Blocks) -> Blocks {
    [0, 1].map(|row| [0, 1].map(|column| x[row][0] * y[0][column] + x[row][1] * y[1][column]))
}

fn transposed(x: Blocks) -> Blocks {
    [0, 1].map(|row| [0, 1].map(|column: usize| x[column][row].transpose()))
}

fn minus(x: Blocks, y: Blocks) -> Blocks {
    [0, 1].map(|row| [0, 1].map(|column: usize| x[row][column] - y[row][column]))
}

/// By the complement of the first block.
fn inverted([[a, b], [c, d]]: Blocks) -> Blocks {
    let inverse = a.inverse();
    let schur = (d - c * inverse * b).inverse();
    let (left, right) = (inverse * b * schur, schur * c * inverse);
    [[inverse + left * c * inverse, -left], [-right, schur]]
}
