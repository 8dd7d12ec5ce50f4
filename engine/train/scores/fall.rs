//! Warnings when the scores of the test images fall during a run.

use crate::internals::train::density::recovers;
use crate::internals::train::{Config, Kind, Log};
use serde_json::Value;

/// The mean PSNR falls if it is so far below the best, dB. A good run on photographs dipped by 0.4 dB at most.
const MARGIN: f64 = 0.5;

/// A fall of the test images' mean PSNR below the best so far.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Fall {
    pub step: u64,
    pub psnr: f64,
    pub best_step: u64,
    pub best_psnr: f64,
}

impl Fall {
    /// The fall that begins with the last of `scores`, (step, mean PSNR in dB) of the same images. None if an earlier
    /// evaluation reported it, and after a reset of the opacities in a run of `total` steps.
    pub fn of(scores: &[(u64, f64)], config: &Config, total: u64) -> Option<Self> {
        let (mut best, mut begun, mut last) = ((0, f64::NEG_INFINITY), false, None);
        // NaN is no score.
        for &(step, psnr) in scores.iter().filter(|(_, psnr)| !psnr.is_nan()) {
            last = None;
            if psnr > best.1 {
                best = (step, psnr);
            }
            if psnr >= best.1 - MARGIN {
                begun = false;
            } else if !begun && !recovers(config, step, total) {
                begun = true;
                last = Some(Fall { step, psnr, best_step: best.0, best_psnr: best.1 });
            }
        }
        last
    }

    /// By the evaluations of the same images as the last one.
    pub fn of_log(log: &Log, config: &Config, total: u64) -> Option<Self> {
        let names = |line: &Value| -> Vec<Value> {
            line["views"].as_array().into_iter().flatten().map(|view| view["view"].clone()).collect()
        };
        let images = names(log.lines(Kind::Evaluation).last()?);
        let same = log.lines(Kind::Evaluation).filter(|line| names(line) == images);
        let scores: Vec<(u64, f64)> =
            same.filter_map(|line| Some((line["step"].as_u64()?, line["psnr"].as_f64()?))).collect();
        Self::of(&scores, config, total)
    }
}

impl std::fmt::Display for Fall {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Fall { step, psnr, best_step, best_psnr } = self;
        write!(
            f,
            "the PSNR of the test images fell: {best_psnr:.2} dB after step {best_step}, {psnr:.2} dB after step {step}. \
             Either the scene fits the training images at the cost of other views, or the learning rates are too high. If it \
             does not recover, train with fewer steps (--steps), fewer Gaussians (--max-gaussians) or more training images. \
             The folder `checkpoints` keeps the best"
        )
    }
}
