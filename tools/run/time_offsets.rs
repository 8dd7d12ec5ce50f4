//! The table of the cameras' time offsets, with their standard errors, and the truth if the capture has it.

use crate::run::files::write_json;
use crate::run::scoring::Scorer;
use crate::ui::progress::watch;
use crate::ui::screen::{alert, out};
use ivv::internals::report::statistics::mean;
use ivv::internals::scene::capture::{Camera, Capture};
use ivv::internals::stage::OFFSET_BOUND;
use ivv::internals::train::{Agreement, Notice, OffsetFit, OffsetImages, Phase, Trainer, learnt_offsets};
use std::collections::BTreeMap;
use std::path::Path;

#[derive(Clone, Debug, serde::Serialize, serde::Deserialize)]
pub struct OffsetRow {
    pub camera: String,
    pub how: Origin,
    /// Frames.
    pub offset: f64,
    /// How far off the offset may be, frames; none where the pictures do not say.
    pub standard_error: Option<f64>,
    /// True if the fit ended at the edge of the search, 2 frames: the true offset may be larger.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub at_bound: bool,
    /// Frames, relative to the mean of the learnt cameras, which cannot be observed; if the capture has the truth.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub truth: Option<f64>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Origin {
    Learnt,
    /// Set to 0, because the pictures do not determine it.
    Frozen,
    /// Fitted for a test camera after the training, with a fixed scene.
    Fitted,
}

/// Writes offsets.json into `output`, with the offsets `fitted` to test cameras; empty if the run learns no offset.
pub fn table(
    trainer: &mut Trainer,
    scorer: &Scorer,
    fitted: &BTreeMap<usize, OffsetFit>,
    output: &Path,
) -> ivv::Result<Vec<OffsetRow>> {
    let (_, learns) = trainer.offsets()?;
    if learns.is_empty() {
        return Ok(Vec::new());
    }
    let Scorer { gpu, capture, run, config } = *scorer;
    let images = OffsetImages { gpu, capture, constants: run.constants, background: config.background };
    let mut watch = watch();
    let mut fits = learnt_offsets(trainer, &images, &mut |done, total| {
        watch(Notice::Work { phase: Phase::OffsetErrors, done, total });
    })?;
    fits.extend(fitted);
    let rows = rows(capture, &learns, &fits);
    write_json(&output.join("offsets.json"), &rows)?;
    if let Some(warning) = warning(&rows) {
        alert!("warning: {warning}");
    }
    Ok(rows)
}

fn rows(capture: &Capture, learns: &[bool], fits: &BTreeMap<usize, OffsetFit>) -> Vec<OffsetRow> {
    let truth = &capture.true_offsets;
    let learnt = |camera: usize| learns.get(camera).copied().unwrap_or(false);
    let known = capture.cameras.iter().enumerate().filter(|(index, _)| learnt(*index));
    let mean = mean(known.filter_map(|(_, camera)| truth.get(&camera.name).copied())).unwrap_or(0.0);
    let row = |(index, camera): (usize, &Camera)| {
        let fit = fits.get(&index);
        OffsetRow {
            camera: camera.name.clone(),
            how: match (camera.is_test, learnt(index)) {
                (true, _) => Origin::Fitted,
                (false, true) => Origin::Learnt,
                (false, false) => Origin::Frozen,
            },
            offset: fit.map_or(0.0, |fit| fit.offset),
            at_bound: fit.is_some_and(OffsetFit::is_at_bound),
            standard_error: fit.map(OffsetFit::error).filter(|error| error.is_finite()),
            truth: truth.get(&camera.name).map(|offset| offset - mean),
        }
    };
    // A photograph has no time.
    let is_listed =
        |(index, camera): &(usize, &Camera)| !camera.is_photo && (!camera.is_test || fits.contains_key(index));
    capture.cameras.iter().enumerate().filter(is_listed).map(row).collect()
}

/// The agreement of learnt and true offsets; `None` without truth.
pub fn agreement(rows: &[OffsetRow]) -> Option<Agreement> {
    let learnt = rows.iter().filter(|row| row.how == Origin::Learnt);
    let pairs: Vec<(f64, f64)> = learnt.filter_map(|row| Some((row.offset, row.truth?))).collect();
    Agreement::of(&pairs)
}

fn warning(rows: &[OffsetRow]) -> Option<String> {
    let at_bound: Vec<&str> = rows.iter().filter(|row| row.at_bound).map(|row| row.camera.as_str()).collect();
    let names = at_bound.join(", ");
    (!at_bound.is_empty()).then(|| {
        format!(
            "the clocks of {names} are {OFFSET_BOUND} frames or more from the others', the limit of training: prepare the \
             capture again with --shift CAMERA=FRAMES, or with --shift sound where the videos have sound"
        )
    })
}

pub fn print(rows: &[OffsetRow]) {
    let width = rows.iter().map(|row| row.camera.chars().count()).fold(6, usize::max);
    let has_truth = rows.iter().any(|row| row.truth.is_some());
    let true_head = if has_truth { format!("{:>9}", "true") } else { String::new() };
    out!("{:<width$} {:>9} {:>8} {true_head}  (frames)", "camera", "offset", "+-");
    for row in rows {
        let error = row.standard_error.map_or("?".to_owned(), |error| format!("{error:.3}"));
        let truth = row.truth.map_or(String::new(), |truth| format!("{truth:>9.3}"));
        let how = match row.how {
            Origin::Learnt => "",
            Origin::Frozen => "fixed at 0: not observable in this camera's images",
            Origin::Fitted => "test camera, fitted afterwards",
        };
        let how = if row.at_bound { "at the edge of the search: the true offset may be larger" } else { how };
        out!("{:<width$} {:>9.3} {error:>8} {truth}  {how}", row.camera, row.offset);
    }
    out!(
        "+-: how far off an offset may be, with three quarters of the offsets' spread, which the scene may have taken up instead"
    );
    if let Some(Agreement { rms_error, correlation }) = agreement(rows) {
        let correlation = correlation.map_or(String::new(), |r| format!(", correlation {r:.3}"));
        out!("offsets learnt to {rms_error:.3} frames (root mean square){correlation}");
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn offsets_at_the_bound_are_warned_of_by_name() {
        let row = |camera: &str, offset: f64| {
            let fit = OffsetFit { offset, standard_error: 0.1, rest: 0.0, spread: 0.0 };
            let (camera, standard_error, truth) = (camera.to_owned(), Some(0.1), None);
            OffsetRow { camera, how: Origin::Learnt, offset, standard_error, at_bound: fit.is_at_bound(), truth }
        };
        assert_eq!(warning(&[row("a", 0.3), row("b", -1.5)]), None);
        // The mean of all has moved one of them away from the bound.
        let text = warning(&[row("a", 0.3), row("b", -1.97), row("c", 2.0)]).unwrap_or_default();
        assert!(text.contains("the clocks of b, c are 2 frames or more") && text.contains("--shift sound"), "{text}");
    }
}
