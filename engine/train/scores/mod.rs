//! Scores of a scene against the images of test cameras.

mod align;
mod fall;
mod flicker;
mod metrics;

pub use align::ColorMap;
pub use fall::Fall;
pub use metrics::{
    Evaluation, METRICS_OF, Meter, SceneScores, SceneSize, Scores, Sight, ViewScores, evaluate, psnr, spread,
};
