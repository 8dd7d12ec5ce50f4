//! Who of several persons speaks in a recording, by their lips.

/// Lips that speak move faster and slower than this, Hz.
const BAND: [f64; 2] = [1.0, 8.0];
/// Length of what is decided at once, seconds.
const WINDOW: f64 = 1.0;
/// Another takes over with this many times the score of who spoke before.
const TAKES_OVER: f64 = 1.5;

/// The seconds in which each person speaks, together the whole clip: in each window the one whose lips move most (1 to 8 Hz) while the
/// recording is loud.
///
/// `openings` has by person and frame how far the lips are apart, NaN where unseen; `loudness` the recording's RMS by frame. Where
/// nobody's lips move the last speaker goes on.
pub fn gates(openings: &[Vec<f64>], loudness: &[f64], fps: f64) -> Vec<Vec<(f64, f64)>> {
    let n_frames = loudness.len();
    let movement: Vec<Vec<f64>> = openings.iter().map(|opening| movement(opening, fps)).collect();
    let window = ((WINDOW * fps).round() as usize).max(1);
    let mut gates: Vec<Vec<(f64, f64)>> = vec![Vec::new(); openings.len()];
    let mut speaker = 0;
    for start in (0..n_frames).step_by(window) {
        let end = (start + window).min(n_frames);
        let score = |person: &Vec<f64>| -> f64 {
            person.iter().zip(loudness).take(end).skip(start).map(|(movement, loudness)| movement * loudness).sum()
        };
        let scores: Vec<f64> = movement.iter().map(score).collect();
        let best = (0..scores.len()).rev().max_by(|a, b| scores[*a].total_cmp(&scores[*b]));
        speaker = best.filter(|best| scores[*best] > TAKES_OVER * scores[speaker]).unwrap_or(speaker);
        let Some(of_speaker) = gates.get_mut(speaker) else { break };
        let (from, to) = (start as f64 / fps, end as f64 / fps);
        match of_speaker.last_mut() {
            Some(last) if last.1 == from => last.1 = to,
            _ => of_speaker.push((from, to)),
        }
    }
    gates
}

/// The magnitude of an opening between the limits of the band; 0 where it is not seen.
fn movement(opening: &[f64], fps: f64) -> Vec<f64> {
    let slow = mean_over(opening, fps / BAND[0]);
    let fast = mean_over(opening, fps / (2.0 * BAND[1]));
    fast.iter().zip(slow).map(|(fast, slow)| (fast - slow).abs()).map(|v| if v.is_finite() { v } else { 0.0 }).collect()
}

/// The mean of what is seen in a window of `width` frames about each; NaN where nothing is.
fn mean_over(values: &[f64], width: f64) -> Vec<f64> {
    let half = (0.5 * width) as usize;
    let mean = |at: usize| {
        let seen = values[at.saturating_sub(half)..(at + half + 1).min(values.len())].iter().filter(|v| v.is_finite());
        let (sum, n) = seen.fold((0.0, 0.0), |(sum, n), v| (sum + v, n + 1.0));
        sum / n
    };
    (0..values.len()).map(mean).collect()
}
