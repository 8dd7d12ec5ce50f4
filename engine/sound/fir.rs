//! The physical mode's filtering: a delay that glides, then responses in blocks, from one filter to the next by a linear
//! crossfade over the block. The signals of old and new filter are alike, so a crossfade of equal power would bulge.
//!
//! A response sounds at its tap [`LEAD`], so the delay that belongs to it is that of the sample when it is heard, not of the
//! sample when it is delayed. Behind a turning head that matters: where the wave from the other side begins to arrive first,
//! the delay has a kink and the response has the opposite one, and both must come at once to cancel.

use std::rc::Rc;

use super::align::LEAD;
use super::hrtf::Filter;
use super::sinc::DelayTable;

/// What is heard at a block's edge.
#[derive(Clone)]
pub struct State {
    /// Responses to both ears; their delays are not used.
    pub filter: Rc<Filter>,
    /// Amplitude.
    pub gain: f64,
}

/// A signal on its way to both ears.
pub struct Voice<'a> {
    table: &'a DelayTable,
    signal: &'a [f32],
    /// The delayed signal at each ear: the past that a response reaches, then the block.
    ears: [Vec<f32>; 2],
    state: State,
    old: Vec<f32>,
    new: Vec<f32>,
}

impl<'a> Voice<'a> {
    /// A voice that has been in `state` for as long as its responses last, at the sample `start` of `signal`; both ears hear
    /// it `delays` samples late.
    pub fn new(table: &'a DelayTable, signal: &'a [f32], start: usize, state: State, delays: [f64; 2]) -> Self {
        let past = state.filter.responses[0].len() - 1;
        let first = (start + LEAD) as f64 - past as f64;
        let ears = delays.map(|late| (0..past).map(|i| table.at(signal, first + i as f64 - late)).collect());
        Voice { table, signal, ears, state, old: Vec::new(), new: Vec::new() }
    }

    /// Adds the block of `out`, whose first sample is the signal's sample `start`, on the way to `next`, where it is
    /// `glide` samples after `start`. Only the last block is shorter than that.
    ///
    /// `delays` gives for a sample by how many samples each ear hears it late (negative where the microphone was farther
    /// away than the head); it is asked for those from [`LEAD`] after the block's first on. Each sample is weighted by
    /// `weight`, a function of its index in the block.
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

    /// Where the voice has got to.
    pub fn state(&self) -> &State {
        &self.state
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
