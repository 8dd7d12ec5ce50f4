//! Errors of learnt clocks, against true ones.

use crate::common::prelude::*;
use crate::common::program::json;

/// Standard errors that an offset is within, of nineteen out of twenty.
const WITHIN: f64 = 1.96;

#[test]
#[ignore = "slow: six trainings of 400 steps"]
fn clocks_are_within_their_errors_whether_in_step_or_not() {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("train-clocks");
    let _ = std::fs::remove_dir_all(&folder);
    std::fs::create_dir_all(&folder).unwrap();
    let (mut n, mut beyond) = (0, 0);
    // An error that holds because it says nothing would not do: the largest that may be, frames.
    for (shift, largest) in [(None, 0.25), (Some("--offsets"), 0.5)] {
        for seed in ["1", "2", "3"] {
            let name = format!("{seed}{}", shift.unwrap_or_default());
            let (capture, run) = (folder.join(&name), folder.join(format!("{name}-run")));
            let [from, to] = [&capture, &run].map(|path| path.to_str().unwrap());
            let synth = ["synth", "-o", from, "--preset", "tiny", "--seed", seed];
            works(&synth.into_iter().chain(shift).collect::<Vec<_>>());
            works(&["train", from, "-o", to, "--steps", "400", "--max-gaussians", "3000", "--eval-every", "0"]);
            let truth = json(&capture.join("truth.json"));
            let truth_of = |row: &serde_json::Value| {
                let name = row["camera"].as_str().unwrap();
                truth["time_offsets_frames"][name].as_f64().unwrap_or(0.0)
            };
            let rows = json(&run.join("offsets.json"));
            let learnt = rows.as_array().unwrap().iter().filter(|row| row["how"] == "learnt");
            let rows: Vec<[f64; 2]> = learnt
                .map(|row| [row["offset"].as_f64().unwrap() - truth_of(row), row["standard_error"].as_f64().unwrap()])
                .collect();
            assert!(rows.len() > 2, "{rows:?}");
            // The mean of the clocks is nobody's: it is kept at 0.
            let mean = rows.iter().map(|[off, _]| off).sum::<f64>() / rows.len() as f64;
            n += rows.len();
            beyond += rows.iter().filter(|[off, error]| (off - mean).abs() > WITHIN * error).count();
            assert!(rows.iter().all(|[_, error]| *error < largest), "{name}: {rows:?}");
        }
    }
    // One in twenty by chance. Ten of a hundred are still an error that one can rely on.
    assert!(beyond * 10 <= n, "{beyond} of {n} offsets are further off than they say");
}
