//! The table of keys, for the window and for `ivv-play --help`.

use crate::window::{OUTPUTS, Player};
use ivv::internals::profile::FrameTimes;
use winit::keyboard::KeyCode::{self, *};

/// Seconds of the clip per second.
const SPEEDS: [f64; 6] = [0.1, 0.25, 0.5, 1.0, 1.5, 2.0];
const DIGITS: &[KeyCode] = &[Digit1, Digit2, Digit3, Digit4, Digit5, Digit6, Digit7, Digit8, Digit9];

/// Names of keys; their effect; the keys; and the effect of one, by its index among them. Effects of keys that are held have only
/// words here.
type Row = (&'static str, &'static str, &'static [KeyCode], fn(&mut Player, usize));

const ROWS: &[Row] = &[
    ("drag, arrows", "turn around the scene, or look around in free flight", &[], |_, _| ()),
    ("wheel", "closer, farther; right drag, or a drag with Shift: shift", &[], |_, _| ()),
    ("W A S D Q E", "move: forward, left, back, right, down, up; with Shift faster", &[], |_, _| ()),
    ("Space", "play, pause", &[Space], |p, _| p.clip.set(p.clip.now(), !p.clip.is_playing(), p.clip.speed())),
    ("Home", "from the start", &[Home], |p, _| p.clip.seek(0.0)),
    ("J L", "back, on by a second", &[KeyJ, KeyL], |p, n| p.clip.seek(p.clip.now() + [-1.0, 1.0][n])),
    (", .", "back, on by a frame", &[Comma, Period], |p, n| {
        p.clip.seek(p.clip.now() + [-1.0, 1.0][n] * p.flow_dt * p.clip.length());
    }),
    ("- =", "slower, faster", &[Minus, Equal], |p, n| {
        let speed = SPEEDS.iter().position(|speed| *speed == p.clip.speed()).unwrap_or(3) + 2 * n;
        let speed = SPEEDS[speed.saturating_sub(1).min(SPEEDS.len() - 1)];
        p.clip.set(p.clip.now(), p.clip.is_playing(), speed);
    }),
    ("1 to 9", "views of the training cameras, by number", DIGITS, |p, n| p.go(n)),
    ("[ ] V", "the view before, the next", &[BracketLeft, BracketRight, KeyV], |p, n| {
        let n_views = p.views.len().max(1);
        p.go((p.current + [n_views - 1, 1, 1][n]) % n_views);
    }),
    ("R", "the first view", &[KeyR], |p, n| p.go(n)),
    ("F1 to F4", "colour, alpha, depth, flow", &[F1, F2, F3, F4], |p, n| p.state.output = OUTPUTS[n]),
    ("O", "the next of them", &[KeyO], |p, _| p.state.output = OUTPUTS[(p.state.output as usize + 1) % OUTPUTS.len()]),
    ("G", "free flight", &[KeyG], |p, _| p.navigator.is_flying = !p.navigator.is_flying),
    ("M", "mute", &[KeyM], |p, _| p.state.is_muted = !p.state.is_muted),
    ("F", "full screen", &[KeyF], |p, _| p.fill_the_display()),
    ("I", "times of frames and passes", &[KeyI], |p, _| {
        (p.state.has_stats, p.state.lately) = (!p.state.has_stats, FrameTimes::default());
    }),
    ("Esc", "the end", &[Escape], |p, _| p.end(Ok(()))),
];

/// For `ivv-play --help`.
pub fn help() -> String {
    let rows = ROWS.iter().map(|(keys, what, ..)| format!("  {keys:<14}{what}\n")).collect::<String>();
    format!("Keys and mouse:\n{rows}The bar at the bottom is dragged to a time.")
}

pub fn press(player: &mut Player, key: KeyCode) {
    let found = ROWS.iter().find_map(|(_, _, keys, deed)| Some((deed, keys.iter().position(|k| *k == key)?)));
    if let Some((deed, n)) = found {
        deed(player, n);
    }
}
