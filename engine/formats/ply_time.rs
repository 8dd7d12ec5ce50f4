//! When a Gaussian of a PLY exists and how it moves.

use super::scene::Clock;
use crate::error::{Error, Result};
use crate::files::ply_header::{Element, Header};
use crate::files::ply_rows::Column;
use crate::scene::{ALWAYS, Motion};
use std::path::Path;

/// Ours: a file has the first five or none, and with them the span, `t_from` and `t_to`, or not.
pub(super) const OWN_TIME: [&str; 7] =
    ["velocity_0", "velocity_1", "velocity_2", "t_center", "t_scale", "t_from", "t_to"];
/// FreeTimeGS's (`.ftgs.ply`, version 1), in units of a sequence from 0 to 1.
pub(super) const FREE_TIME: [&str; 5] = ["time", "log_duration", "velocity_0", "velocity_1", "velocity_2"];
/// Those of Spacetime Gaussians; other `motion` and `omega` are higher orders and a turn.
const SPACETIME: [&str; 5] = ["motion_0", "motion_1", "motion_2", "trbf_center", "trbf_scale"];
/// A standard deviation, in sequences, from which on nothing fades.
pub(super) const NEVER_FADES: f64 = 1e6;

pub(super) struct Temporal {
    /// The span, where the file has it, is behind the first five.
    columns: Vec<Column>,
    form: Form,
}

enum Form {
    Own,
    FreeTime(FreeTime),
    /// Columns that must be 0.
    Spacetime(Vec<Column>),
}

struct FreeTime {
    /// The file's sequence in our clip: it ends with its last frame, ours a frame later.
    rate: f64,
    use_velocity: bool,
    min_duration: f64,
}

/// See `FreeTime::rate`.
pub(super) fn rate(frames: u32) -> f64 {
    if frames > 1 { f64::from(frames - 1) / f64::from(frames) } else { 1.0 }
}

/// True for a `motion` above the velocity, or an `omega`.
fn is_higher(name: &str) -> bool {
    let is_number = |text: &str| !text.is_empty() && text.bytes().all(|byte| byte.is_ascii_digit());
    let of = |prefix: &str| name.strip_prefix(prefix).is_some_and(is_number) && !SPACETIME.contains(&name);
    of("motion_") || of("omega_")
}

impl Temporal {
    pub fn find(path: &Path, header: &Header, vertex: &Element) -> Result<Option<Self>> {
        let has = |name: &str| Column::find(vertex, name).is_some();
        let (names, form) = if has("trbf_center") || has("trbf_scale") {
            let higher = vertex.properties.iter().filter(|property| is_higher(&property.name));
            let columns = higher.filter_map(|property| Column::find(vertex, &property.name)).collect();
            (&SPACETIME[..], Form::Spacetime(columns))
        } else if has("time") && has("log_duration") {
            (&FREE_TIME[..], Form::FreeTime(FreeTime::of(path, header)?))
        } else if OWN_TIME[..5].iter().any(|name| has(name)) {
            let n = if OWN_TIME[5..].iter().any(|name| has(name)) { 7 } else { 5 };
            (&OWN_TIME[..n], Form::Own)
        } else {
            return Ok(None);
        };
        let find = |name: &&str| {
            let place = format!("element `vertex`, property `{name}`");
            let missing =
                || Error::data(path, place, "is missing", "export the scene again, with all temporal properties");
            Column::find(vertex, name).ok_or_else(missing)
        };
        Ok(Some(Temporal { columns: names.iter().map(find).collect::<Result<_>>()?, form }))
    }

    pub fn reads(&self, name: &str) -> bool {
        match self.form {
            Form::Own => OWN_TIME.contains(&name),
            Form::FreeTime(_) => FREE_TIME.contains(&name),
            Form::Spacetime(_) => SPACETIME.contains(&name) || is_higher(name),
        }
    }

    pub fn span(&self, bytes: &[u8]) -> Option<[f32; 2]> {
        let [_, _, _, _, _, from, to] = self.columns[..] else { return None };
        Some([from.f32(bytes), to.f32(bytes)])
    }

    /// Colours from 0 to 1 instead of coefficients.
    pub fn has_plain_colors(&self) -> bool {
        matches!(self.form, Form::Spacetime(_))
    }

    /// `None` of a static Gaussian; an error says why it cannot be held.
    pub fn motion(&self, bytes: &[u8]) -> std::result::Result<Option<Motion>, &'static str> {
        let order = if matches!(self.form, Form::FreeTime(_)) { [2, 3, 4, 0, 1] } else { [0, 1, 2, 3, 4] };
        let [vx, vy, vz, t_center, t_scale] = order.map(|at: usize| self.columns[at].f32(bytes));
        let (velocity, rests) = ([vx, vy, vz], [vx, vy, vz] == [0.0; 3]);
        match &self.form {
            Form::Own => {
                let is_still = rests && t_scale == f32::INFINITY && self.span(bytes).is_none_or(|span| span == ALWAYS);
                Ok((!is_still).then_some(Motion { velocity, t_center, t_scale }))
            }
            Form::FreeTime(FreeTime { rate, use_velocity, min_duration }) => {
                let duration = f64::from(t_scale).exp().max(*min_duration);
                if (rests || !use_velocity) && duration >= 0.99 * NEVER_FADES {
                    return Ok(None);
                }
                let speed = |v: f32| if *use_velocity { (f64::from(v) / rate) as f32 } else { 0.0 };
                Ok(Some(Motion {
                    velocity: velocity.map(speed),
                    t_center: (f64::from(t_center) * rate) as f32,
                    t_scale: (duration * rate * std::f64::consts::SQRT_2).ln() as f32,
                }))
            }
            Form::Spacetime(higher) => {
                if higher.iter().any(|column| column.f32(bytes) != 0.0) {
                    return Err("its motion bends or turns (`motion_3` and above, `omega`)");
                }
                Ok(Some(Motion { velocity, t_center, t_scale }))
            }
        }
    }
}

impl FreeTime {
    fn of(path: &Path, header: &Header) -> Result<Self> {
        let said = |key: &str| header.comments.iter().find_map(|line| line.strip_prefix(key)?.strip_prefix(' '));
        let fault = |key: &str, expected: &str, found: &str| {
            let reason = format!("expected {expected}, found `{found}`");
            Error::data(path, format!("header, comment `{key}`"), reason, "export the scene as version 1 of .ftgs.ply")
        };
        for (key, expected) in [("ftgs_version", "1"), ("time_units", "normalized")] {
            if let Some(found) = said(key).filter(|found| *found != expected) {
                return Err(fault(key, expected, found));
            }
        }
        let number = |key: &str, default: f64, expected: &str, holds: fn(f64) -> bool| match said(key) {
            None => Ok(default),
            Some(text) => text.parse().ok().filter(|n| holds(*n)).ok_or_else(|| fault(key, expected, text)),
        };
        // A Gaussian that is never quite gone contributes nothing below this.
        number("opacity_floor", 0.0, "at most 1/255, since ours fade away", |floor| {
            (0.0..=1.0 / 255.0).contains(&floor)
        })?;
        let frames = number("n_frames", 0.0, "a number of frames", |n| (1.0..=1e9).contains(&n) && n.fract() == 0.0)?;
        Ok(FreeTime {
            rate: rate(frames as u32),
            use_velocity: number("use_velocity", 1.0, "0 or 1", |n| n == 0.0 || n == 1.0)? != 0.0,
            min_duration: number("min_duration", 0.0, "a positive number", |n| n > 0.0 && n.is_finite())?,
        })
    }
}

pub(super) fn free_time_comments(sh_degree: u32, clock: Option<Clock>) -> Vec<String> {
    let degree = format!("sh_degree {sh_degree}");
    // No minimum for short lives.
    let lines =
        ["ftgs_version 1", "time_units normalized", &degree, "use_velocity 1", "min_duration 1e-30", "opacity_floor 0"];
    let frames = clock.map(|clock| format!("n_frames {}", clock.frames));
    lines.map(str::to_owned).into_iter().chain(frames).collect()
}

/// The properties [`FREE_TIME`] of a Gaussian; `None` is a static one.
pub(super) fn free_time(motion: Option<Motion>, clock: Option<Clock>) -> [f32; 5] {
    let rate = clock.map_or(1.0, |clock| rate(clock.frames));
    let Some(Motion { velocity, t_center, t_scale }) = motion else {
        return [0.0, NEVER_FADES.ln() as f32, 0.0, 0.0, 0.0];
    };
    let [x, y, z] = velocity.map(|v| (f64::from(v) * rate) as f32);
    let duration = (f64::from(t_scale).exp() / (std::f64::consts::SQRT_2 * rate)).min(NEVER_FADES);
    [(f64::from(t_center) / rate) as f32, duration.ln() as f32, x, y, z]
}
