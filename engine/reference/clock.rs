//! Steps of the cameras' time offsets (SPEC 4, 6).

/// Offset and moments of one camera.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Clock {
    /// Frames.
    pub offset: f64,
    /// First moment of the gradient.
    pub first: f64,
    /// Second moment.
    pub second: f64,
    /// True if the offset is learnt.
    pub is_free: bool,
}

/// The inputs of a step of the offsets beside the gradient.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ClockRule {
    /// Learning rate, frames.
    pub rate: f64,
    /// Weight of the squared offsets.
    pub regulariser: f64,
    /// Largest offset, frames.
    pub bound: f64,
}

/// Step `step` (from 1): `gradient` is the loss's by the offset of `camera`.
pub fn clock_step(clocks: &mut [Clock], camera: usize, gradient: f64, rule: &ClockRule, step: i32) {
    let (beta1, beta2) = (f64::from(0.9_f32), f64::from(0.999_f32));
    for (k, clock) in clocks.iter_mut().enumerate().filter(|(_, clock)| clock.is_free) {
        let g = if k == camera { gradient } else { 0.0 } + 2.0 * rule.regulariser * clock.offset;
        clock.first = beta1 * clock.first + (1.0 - beta1) * g;
        clock.second = beta2 * clock.second + (1.0 - beta2) * g * g;
        let root = (clock.second / (1.0 - beta2.powi(step))).sqrt();
        let change = -rule.rate / (1.0 - beta1.powi(step)) * clock.first / (root + 1e-15);
        clock.offset = (clock.offset + change).clamp(-rule.bound, rule.bound);
    }
    let free = clocks.iter().filter(|clock| clock.is_free);
    let (sum, n) = free.fold((0.0, 0), |(sum, n), clock| (sum + clock.offset, n + 1));
    let mean = sum / f64::max(f64::from(n), 1.0);
    clocks.iter_mut().filter(|clock| clock.is_free).for_each(|clock| clock.offset -= mean);
}
