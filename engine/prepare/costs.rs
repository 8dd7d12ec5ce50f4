//! About how long the stages take, from the number and the size of pictures alone: seconds of one core, measured with COLMAP 3.8 on 14
//! pictures of 266 x 474 (1,300 features each), 12 of 640 x 360 (600) and 7 of 1280 x 720 (5,100). How much a picture shows is not
//! known before, so that the estimates are rough.

use std::fmt;

use super::triangulate;

/// A picture that is decoded and written: for each million of its pixels; undistorting it takes as much again.
const IMAGE: f64 = 0.25;
/// Features of a picture: its start, and each million of pixels.
const FEATURES: [f64; 2] = [0.1, 1.4];
/// Features of a million pixels, and the most that COLMAP takes.
const PER_MILLION: f64 = 5000.0;
const MOST_FEATURES: f64 = 8192.0;
/// A pair: its start, and each feature of a picture.
const PAIR: [f64; 2] = [0.05, 1e-4];
/// With guided matching a pair takes so many times as long.
const GUIDED: f64 = 1.2;
/// A picture that is placed; and each of those that were placed before, which are adjusted again and again.
const PLACE: [f64; 2] = [0.1, 0.004];
/// Points of a frame: programs that start, and the triangulation of each picture.
const FRAME: [f64; 2] = [0.3, 0.05];

/// Pictures of one size.
#[derive(Clone, Copy, Debug)]
pub(super) struct Batch {
    pub n: usize,
    /// Millions.
    pub pixels: f64,
}

impl Batch {
    pub fn new(n: usize, (width, height): (u32, u32)) -> Self {
        Batch { n, pixels: f64::from(width) * f64::from(height) / 1e6 }
    }

    /// To decode them, and to undistort them.
    pub fn images(self, distort: bool) -> f64 {
        self.n as f64 * self.pixels * if distort { 2.0 * IMAGE } else { IMAGE }
    }

    /// To find their features.
    pub fn features(self) -> f64 {
        self.n as f64 * (FEATURES[0] + FEATURES[1] * self.pixels)
    }

    /// To match pairs of them.
    pub fn pairs(self, n: usize, guided: bool) -> f64 {
        let features = (PER_MILLION * self.pixels).min(MOST_FEATURES);
        n as f64 * (PAIR[0] + PAIR[1] * features) * if guided { GUIDED } else { 1.0 }
    }

    /// To place them.
    pub fn places(self) -> f64 {
        let n = self.n as f64;
        n * (PLACE[0] + n * PLACE[1])
    }

    /// To make a clip of so many frames, each with these pictures, and the points of some.
    pub fn clip(self, frames: usize, with_points: usize, distort: bool) -> f64 {
        frames as f64 * self.images(distort) + with_points as f64 * self.points(triangulate::n_pairs(self.n))
    }

    /// To triangulate the points of one frame with these pictures.
    pub fn points(self, pairs: usize) -> f64 {
        self.features() + self.pairs(pairs, true) + FRAME[0] + self.n as f64 * FRAME[1]
    }
}

/// Seconds, as people read them.
pub(super) struct About(pub f64);

impl fmt::Display for About {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.0 {
            s if s < 90.0 => write!(f, "about {s:.0} s"),
            s if s < 5400.0 => write!(f, "about {:.0} minutes", s / 60.0),
            s => write!(f, "about {:.1} hours", s / 3600.0),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Seconds of one core that COLMAP 3.8 took on a busy machine for what the estimates are of.
    #[test]
    fn estimates_are_of_the_size_of_what_was_measured() {
        let placed = |n: usize, size: (u32, u32)| {
            let pictures = Batch::new(n, size);
            pictures.features() + pictures.pairs(n * (n - 1) / 2, false) + pictures.places()
        };
        let clip = Batch::new(12, (640, 360)).clip(6, 6, false);
        for (about, measured) in [
            (placed(14, (266, 474)), 26.4),
            (placed(7, (1280, 720)), 35.9),
            (placed(12, (640, 360)), 11.8),
            (clip, 77.8),
        ] {
            assert!((0.5..1.6).contains(&(about / measured)), "{about} s instead of {measured} s");
        }
    }

    #[test]
    fn seconds_are_told_in_what_people_count_in() {
        let told = [12.3, 200.0, 9000.0].map(|seconds| About(seconds).to_string());
        assert_eq!(told, ["about 12 s", "about 3 minutes", "about 2.5 hours"]);
    }
}
