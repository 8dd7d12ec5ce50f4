//! Flicker: changes from one picture of a camera to the next where nothing moves.

use crate::scene::capture::Picture;
use crate::scene::{Frame, Pose};

/// Half the window that changes are averaged over, pixels: that leaves motion and takes noise out.
const REACH: usize = 2;
/// Largest change of a window's mean that counts as static, of 255.
const REST: f64 = 2.0;
const LEAST: f64 = 0.01;

pub(super) struct Instant {
    pub frame: u32,
    pub pose: Pose,
    /// Clamped.
    pub rendered: Vec<[f32; 3]>,
    pub truth: Picture,
    pub foreground: Option<Vec<bool>>,
}

/// Mean absolute change from a picture to the next over the static pixels, in colours of 0 to 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Flicker {
    pub rendered: f64,
    pub truth: f64,
}

impl Instant {
    pub fn new(frame: u32, pose: Pose, rendered: &Frame, truth: Picture, foreground: Option<Vec<bool>>) -> Self {
        let rendered = rendered.color.iter().map(|color| color.map(|x| x.clamp(0.0, 1.0))).collect();
        Instant { frame, pose, rendered, truth, foreground }
    }

    /// None unless both are successive pictures of a camera that stays, and enough is static.
    pub fn flicker_since(&self, before: &Instant) -> Option<Flicker> {
        let is_next = before.frame.checked_add(1) == Some(self.frame) && before.pose == self.pose;
        if !is_next || before.truth.pixels.len() != self.truth.pixels.len() {
            return None;
        }
        let rests = self.rests_since(before);
        let (mut n, mut sums) = (0_usize, [0.0; 2]);
        for pixel in (0..rests.len()).filter(|pixel| rests[*pixel]) {
            n += 1;
            let [now, then] = [self, before].map(|instant| instant.truth.pixels[pixel].to_le_bytes());
            for c in 0..3 {
                sums[0] += f64::from((self.rendered[pixel][c] - before.rendered[pixel][c]).abs());
                sums[1] += f64::from(now[c].abs_diff(then[c])) / 255.0;
            }
        }
        let [rendered, truth] = sums.map(|sum| sum / (3 * n.max(1)) as f64);
        (n as f64 >= LEAST * rests.len() as f64 && n > 0).then_some(Flicker { rendered, truth })
    }

    /// By pixel, true if the window about it is static, and it is neither hidden nor foreground.
    fn rests_since(&self, before: &Instant) -> Vec<bool> {
        let [width, height] = [self.truth.width, self.truth.height].map(|side| side as usize);
        let is_seen = |instant: &Instant, pixel: usize| instant.truth.pixels[pixel] >> 24 != 0;
        let both = |pixel: usize| is_seen(self, pixel) && is_seen(before, pixel);
        let moves = |instant: &Instant, pixel: usize| instant.foreground.as_ref().is_some_and(|mask| mask[pixel]);
        // Summed over all pixels above and to the left: the changes, and the count.
        let mut sums = vec![[0_i64; 4]; (width + 1) * (height + 1)];
        for y in 0..height {
            let mut row = [0_i64; 4];
            for x in 0..width {
                let pixel = y * width + x;
                if both(pixel) {
                    let [now, then] = [self, before].map(|instant| instant.truth.pixels[pixel].to_le_bytes());
                    (0..3).for_each(|c| row[c] += i64::from(now[c]) - i64::from(then[c]));
                    row[3] += 1;
                }
                let above = sums[y * (width + 1) + x + 1];
                sums[(y + 1) * (width + 1) + x + 1] = std::array::from_fn(|k| above[k] + row[k]);
            }
        }
        let rests = |pixel: usize| {
            let (x, y) = (pixel % width, pixel / width);
            let [left, top] = [x, y].map(|at| at.saturating_sub(REACH));
            let (right, bottom) = ((x + REACH + 1).min(width), (y + REACH + 1).min(height));
            let sum = |k: usize| {
                let at = |x: usize, y: usize| sums[y * (width + 1) + x][k];
                (at(right, bottom) + at(left, top) - at(left, bottom) - at(right, top)) as f64
            };
            (0..3).all(|c| sum(c).abs() <= REST * sum(3))
        };
        let counts = |pixel: usize| both(pixel) && !moves(self, pixel) && !moves(before, pixel);
        (0..width * height).map(|pixel| counts(pixel) && rests(pixel)).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Random;

    const SIDE: u32 = 64;

    /// A grey picture with noise of up to `noise` steps, a white square at `square`, rendered without noise but `light`
    /// brighter.
    fn instant(frame: u32, noise: f64, square: u32, light: f32) -> Instant {
        let mut random = Random::new(u64::from(frame) + 7);
        let inside = |pixel: u32| (square..square + 16).contains(&(pixel % SIDE)) && pixel / SIDE < 16;
        let word = |pixel: u32| {
            let grey = if inside(pixel) { 255 } else { (100.0 + random.uniform(-noise, noise)).round() as u32 };
            u32::from_le_bytes([grey as u8, grey as u8, grey as u8, 255])
        };
        let truth = Picture::new(SIDE, SIDE, (0..SIDE * SIDE).map(word).collect());
        let rendered = (0..SIDE * SIDE).map(|pixel| [if inside(pixel) { 1.0 } else { 0.4 + light }; 3]).collect();
        Instant { frame, pose: Pose::default(), rendered, truth, foreground: None }
    }

    #[test]
    fn what_moves_is_no_flicker_and_what_rests_shows_it() {
        let still = instant(4, 0.0, 8, 0.0);
        assert_eq!(instant(5, 0.0, 8, 0.0).flicker_since(&still), Some(Flicker { rendered: 0.0, truth: 0.0 }));
        // The square jumps away. Around it windows change, the rest does not.
        assert_eq!(instant(5, 0.0, 40, 0.0).flicker_since(&still), Some(Flicker { rendered: 0.0, truth: 0.0 }));
        // A twentieth brighter everywhere but in the square, a quarter of a sixteenth of all pixels.
        let found = instant(5, 0.0, 8, 0.05).flicker_since(&still).unwrap();
        assert!((found.rendered - 0.05 * (1.0 - 1.0 / 16.0)).abs() < 1e-6 && found.truth == 0.0, "{found:?}");
    }

    #[test]
    fn noise_of_the_camera_is_its_own_flicker() {
        let found = instant(5, 6.0, 8, 0.0).flicker_since(&instant(4, 6.0, 8, 0.0)).unwrap();
        // The mean distance of two numbers from -6 to 6 is 4.
        let expected = 4.0 / 255.0 * (1.0 - 1.0 / 16.0);
        assert!((found.truth / expected - 1.0).abs() < 0.15 && found.rendered == 0.0, "{found:?}");
    }

    #[test]
    fn pictures_that_do_not_follow_on_another_or_do_not_rest_have_none() {
        let first = instant(4, 0.0, 8, 0.0);
        let moved = Instant {
            pose: Pose { translation: [0.1, 0.0, 0.0].into(), ..Pose::default() },
            ..instant(5, 0.0, 8, 0.0)
        };
        let hidden = |mut instant: Instant| {
            instant.truth.pixels.iter_mut().for_each(|word| *word &= 0xff_ffff);
            instant
        };
        let masked = Instant { foreground: Some(vec![true; (SIDE * SIDE) as usize]), ..instant(5, 0.0, 8, 0.0) };
        for next in [instant(6, 0.0, 8, 0.0), instant(4, 0.0, 8, 0.0), moved, hidden(instant(5, 0.0, 8, 0.0)), masked] {
            assert_eq!(next.flicker_since(&first), None);
        }
    }
}
