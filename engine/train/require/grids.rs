//! Which cameras' colours differ so much that they need a bilateral grid.

use crate::error::Result;
use crate::internals::train::{Sight, spread};
use crate::scene::capture::Shot;
use crate::stage::{Outputs, Renderer};

/// Blocks of a picture whose mean colours are compared, across and down: errors within one are alike.
const BLOCKS: [u32; 2] = [6, 4];
const LEAST_PIXELS: f64 = 16.0;
/// Pictures of a camera, evenly spread over the clip: more are no more evidence, as a place is wrong in every frame.
const PICTURES: usize = 8;
/// Of the map: gain and offset of each channel.
const NUMBERS: f64 = 2.0;

#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct GridCheck {
    pub camera: String,
    /// Log-likelihood that a gain and an offset of each channel gain, less their cost.
    pub gain: f64,
    pub is_needed: bool,
}

/// Tries the least that a colour map of `camera` can do (SPEC 12): a gain and an offset of each channel, on the mean
/// colours of blocks of pixels.
pub(super) fn check(renderer: &mut Renderer, sight: &Sight, camera: usize) -> Result<GridCheck> {
    let mut blocks = vec![Block::default(); (BLOCKS[0] * BLOCKS[1]) as usize];
    for Shot { frame, .. } in spread(&sight.capture.cameras[camera].shots, PICTURES) {
        let view = sight.view(camera, frame)?;
        let (shown, _) = renderer.render(&view, Outputs::Color)?;
        let picture = sight.capture.picture(camera, frame)?;
        for (pixel, (color, word)) in (0..).zip(shown.color.iter().zip(&picture.pixels)) {
            let [r, g, b, mask] = word.to_le_bytes();
            if mask > 0 {
                let (x, y) = (
                    pixel % view.intrinsics.width * BLOCKS[0] / view.intrinsics.width,
                    pixel / view.intrinsics.width * BLOCKS[1] / view.intrinsics.height,
                );
                let block = &mut blocks[(y * BLOCKS[0] + x) as usize];
                block.add(color.map(f64::from), [r, g, b].map(|level| f64::from(level) / 255.0));
            }
        }
    }
    let gain = gain(&blocks.iter().filter_map(Block::means).collect::<Vec<_>>());
    Ok(GridCheck { camera: sight.capture.cameras[camera].name.clone(), gain, is_needed: gain > 0.0 })
}

/// Shown and true.
type Means = ([f64; 3], [f64; 3]);

#[derive(Clone, Copy, Debug, Default)]
struct Block {
    n: f64,
    shown: [f64; 3],
    truth: [f64; 3],
}

impl Block {
    fn add(&mut self, shown: [f64; 3], truth: [f64; 3]) {
        self.n += 1.0;
        self.shown.iter_mut().zip(shown).for_each(|(sum, x)| *sum += x);
        self.truth.iter_mut().zip(truth).for_each(|(sum, x)| *sum += x);
    }

    /// None if too little is seen.
    fn means(&self) -> Option<Means> {
        (self.n >= LEAST_PIXELS).then(|| (self.shown.map(|x| x / self.n), self.truth.map(|x| x / self.n)))
    }
}

/// Of a line per channel over the identity, by Schwarz's criterion.
fn gain(blocks: &[Means]) -> f64 {
    let n = blocks.len() as f64;
    if n < 8.0 {
        return 0.0;
    }
    let of_channel = |c: usize| {
        let mean = |of: &dyn Fn(&Means) -> f64| blocks.iter().map(of).sum::<f64>() / n;
        let (x, y) = (mean(&|b| b.0[c]), mean(&|b| b.1[c]));
        let xx = mean(&|b| (b.0[c] - x).powi(2));
        let xy = mean(&|b| (b.0[c] - x) * (b.1[c] - y));
        let yy = mean(&|b| (b.1[c] - y).powi(2));
        let before = mean(&|b| (b.1[c] - b.0[c]).powi(2));
        // What is less than a level of eight bits is no other colour.
        let after = (yy - if xx > 0.0 { xy * xy / xx } else { 0.0 }).max(1.0 / (255.0 * 255.0));
        0.5 * n * (before.max(after) / after).ln() - 0.5 * NUMBERS * n.ln()
    };
    (0..3).map(of_channel).sum()
}

#[cfg(test)]
mod tests {
    use super::{Means, gain};
    use crate::random::Keyed;

    /// Of a camera whose colours are `map` of what is shown, with errors of standard deviation `error`.
    fn blocks(error: f64, map: impl Fn(f64) -> f64) -> Vec<Means> {
        let random = Keyed::new(&[3]);
        let block = |i: u64| {
            let shown: [f64; 3] = std::array::from_fn(|c| random.uniform(100 + 3 * i + c as u64));
            (shown, std::array::from_fn(|c| map(shown[c]) + error * random.normal(1000 + 3 * i + c as u64)))
        };
        (0..24).map(block).collect()
    }

    #[test]
    fn a_gain_of_a_tenth_pays_and_errors_alone_do_not() {
        assert!(gain(&blocks(0.03, |x| x)) < 0.0);
        assert!(gain(&blocks(0.1, |x| x)) < 0.0);
        assert!(gain(&blocks(0.03, |x| 1.1 * x)) > 10.0);
        assert!(gain(&blocks(0.03, |x| x + 0.05)) > 10.0);
        assert_eq!(gain(&blocks(0.03, |x| 1.1 * x)[..7]), 0.0, "too few to tell");
    }
}
