//! The time of a clip that plays, and begins again at its end.

use std::time::Instant;

#[derive(Clone, Copy, Debug)]
pub struct Playhead {
    length: f64,
    speed: f64,
    is_playing: bool,
    version: u64,
    time: f64,
    since: Instant,
}

impl Playhead {
    /// At `time` of a clip of `length` seconds, from where it plays at its own speed or stands. A clip without length stands.
    pub fn new(length: f64, time: f64, is_playing: bool) -> Self {
        // Never NaN, of which there is no clamping.
        let (length, is_playing) = (length.max(0.0), is_playing && length > 0.0);
        let time = time.max(0.0).min(length);
        Playhead { length, speed: 1.0, is_playing, version: 0, time, since: Instant::now() }
    }

    /// Seconds; 0 of what does not change.
    pub fn length(&self) -> f64 {
        self.length
    }

    /// Seconds of the clip per second, while it plays.
    pub fn speed(&self) -> f64 {
        self.speed
    }

    pub fn is_playing(&self) -> bool {
        self.is_playing
    }

    /// Grows with every [`Playhead::set`].
    pub fn version(&self) -> u64 {
        self.version
    }

    /// Seconds of the clip at `moment`, which may be to come; less than the length while it plays.
    pub fn at(&self, moment: Instant) -> f64 {
        let passed = if self.is_playing { moment.saturating_duration_since(self.since).as_secs_f64() } else { 0.0 };
        let time = self.time + self.speed * passed;
        if self.is_playing { time.rem_euclid(self.length) } else { time }
    }

    pub fn now(&self) -> f64 {
        self.at(Instant::now())
    }

    /// Continues from `time` at so many seconds of the clip per second, or stands there.
    pub fn set(&mut self, time: f64, is_playing: bool, speed: f64) {
        let version = self.version + 1;
        *self = Playhead { speed, version, ..Playhead::new(self.length, time, is_playing) };
    }

    pub fn seek(&mut self, time: f64) {
        self.set(time, self.is_playing, self.speed);
    }
}
