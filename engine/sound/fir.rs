//! The physical mode's filtering: a delay that glides, then responses in blocks with a linear crossfade from one filter to the next.
//!
//! A response sounds at its tap [`LEAD`], so its delay is that of the sample when it is heard. Behind a turning head the delay has a
//! kink and the response the opposite one, and both must come at once to cancel.

use std::rc::Rc;

use super::align::LEAD;
use super::hrtf::Filter;
use super::sinc::DelayTable;

#[derive(Clone)]
pub struct State {
    /// Responses to both ears; their delays are not used.
    pub filter: Rc<Filter>,
    pub gain: f64,
}

pub struct Voice<'a> {
    table: &'a DelayTable,
    signal: &'a [f32],
    /// The delayed signal at each ear: the past that a response reaches, then the block.
    ears: [Vec<f32>; 2],
    /// At the end of the last block.
    pub state: State,
    old: Vec<f32>,
    new: Vec<f32>,
}

impl<'a> Voice<'a> {
    /// A voice that has long been in `state` at the sample `start` of `signal`; both ears hear it `delays` samples late.
    pub fn new(table: &'a DelayTable, signal: &'a [f32], start: usize, state: State, delays: [f64; 2]) -> Self {
        let past = state.filter.responses[0].len() - 1;
        let first = (start + LEAD) as f64 - past as f64;
        let ears = delays.map(|late| (0..past).map(|i| table.at(signal, first + i as f64 - late)).collect());
        Voice { table, signal, ears, state, old: Vec::new(), new: Vec::new() }
    }

    /// Adds the block `out`, whose first sample is the signal's `start`, on the way to `next`, `glide` samples after `start`; only the last
    /// block is shorter. `delays` gives the delay of each ear by sample, from [`LEAD`] after `start` on; `weight` is by index in the block.
    pub fn block(
        &mut self,
        start: usize,
        next: State,
        glide: usize,
        delays: impl Fn(usize) -> [f64; 2],
        out: &mut [[f32; 2]],
        weight: impl Fn(usize) -> f32,
    ) {
        let (table, signal, n) = (self.table, self.signal, out.len());
        let past = next.filter.responses[0].len() - 1;
        for at in start + LEAD..start + LEAD + n {
            for (heard, late) in self.ears.iter_mut().zip(delays(at)) {
                heard.push(table.at(signal, at as f64 - late));
            }
        }
        for ear in 0..2 {
            let heard = &mut self.ears[ear];
            respond(heard, &next.filter.responses[ear], n, &mut self.new);
            let is_same = Rc::ptr_eq(&self.state.filter, &next.filter);
            if !is_same {
                respond(heard, &self.state.filter.responses[ear], n, &mut self.old);
            }
            for (i, frame) in out.iter_mut().enumerate() {
                let a = i as f32 / glide as f32;
                let gain = self.state.gain as f32 * (1.0 - a) + next.gain as f32 * a;
                let value = if is_same { self.new[i] } else { (1.0 - a) * self.old[i] + a * self.new[i] };
                frame[ear] += weight(i) * gain * value;
            }
            let used = heard.len() - past;
            heard.drain(..used);
        }
        self.state = next;
    }
}

/// The last `n` samples of `signal` filtered by `response`.
fn respond(signal: &[f32], response: &[f32], n: usize, out: &mut Vec<f32>) {
    out.clear();
    out.resize(n, 0.0);
    let end = signal.len();
    let from = |k: usize| &signal[end - n - k..end - k];
    // Four taps at once: the sums stay in registers for longer.
    let (fours, rest) = response.as_chunks::<4>();
    for (four, taps) in fours.iter().enumerate() {
        let k = 4 * four;
        let (a, b, c, d) = (from(k), from(k + 1), from(k + 2), from(k + 3));
        for (i, to) in out.iter_mut().enumerate() {
            *to += taps[0] * a[i] + taps[1] * b[i] + taps[2] * c[i] + taps[3] * d[i];
        }
    }
    for (k, tap) in (4 * fours.len()..).zip(rest) {
        out.iter_mut().zip(from(k)).for_each(|(to, x)| *to += tap * x);
    }
}
