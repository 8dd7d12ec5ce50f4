use std::collections::BTreeMap;

/// Frames per second of a file that does not say.
const FPS: f64 = 30.0;

/// The clock of a clip: normalised time 0 to 1 is 0 to `frames / fps` seconds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Clock {
    /// Frames per second, positive.
    pub fps: f64,
    /// Frames of the clip, at least 1.
    pub frames: u32,
}

impl Clock {
    /// A scene in which nothing changes: one frame.
    pub const STILL: Clock = Clock { fps: 1.0, frames: 1 };

    /// Length of the clip, seconds.
    pub fn seconds(self) -> f64 {
        f64::from(self.frames) / self.fps
    }

    /// The clock in a file of `seconds`, or else one at the usual rate; one frame for a file without length.
    pub(super) fn of_file(own: Option<&BTreeMap<String, String>>, seconds: f64) -> Clock {
        if seconds <= 0.0 {
            return Clock { fps: FPS, frames: 1 };
        }
        let said = own.and_then(|own| {
            let clock = Clock { fps: own.get("fps")?.parse().ok()?, frames: own.get("frames")?.parse().ok()? };
            ((clock.seconds() - seconds).abs() <= 1e-6 * seconds).then_some(clock)
        });
        said.unwrap_or_else(|| {
            let frames = (seconds * FPS).round().clamp(1.0, f64::from(u32::MAX));
            Clock { fps: frames / seconds, frames: frames as u32 }
        })
    }
}
