//! The CPU truth against the golden cases, against itself, and against brute force.

mod adam;
mod bilateral;
mod blend;
mod cull;
mod derivatives;
mod extremes;
mod golden;
mod integers;
mod needles;
mod precision;
mod ssim;
mod tiles;

use crate::common::prelude::*;
use ivv::internals::reference::Outputs;

/// The float tensors of `outputs`, flat, by their names in SPEC 9.
pub fn tensors(outputs: &Outputs<f64>) -> [(&'static str, Vec<f64>); 5] {
    [
        ("color", outputs.color.as_flattened().to_vec()),
        ("alpha", outputs.alpha.clone()),
        ("depth", outputs.depth.clone()),
        ("inverse_depth", outputs.inverse_depth.clone()),
        ("flow", outputs.flow.as_flattened().to_vec()),
    ]
}

/// |a - b| / |b| in the Euclidean norm; b must not be zero.
pub fn relative_l2(a: &[f64], b: &[f64]) -> f64 {
    assert_eq!(a.len(), b.len());
    let norm = b.iter().map(|y| y * y).sum::<f64>().sqrt();
    assert!(norm > 0.0, "nothing to compare with");
    a.iter().zip(b).map(|(x, y)| (x - y).powi(2)).sum::<f64>().sqrt() / norm
}

pub fn zero_like(params: &Params<f64>) -> Params<f64> {
    params.zip(params, |_, _| 0.0)
}

/// One round static Gaussian of degree 0 at `position`, standard deviation 0.1, opacity 0.88, white.
pub fn single(position: [f32; 3]) -> Splats {
    Splats {
        n_static: 1,
        sh_degree: 0,
        degree: vec![],
        position: vec![position],
        rotation: vec![[1.0, 0.0, 0.0, 0.0]],
        scale: vec![[0.1f32.ln(); 3]],
        opacity: vec![2.0],
        sh: vec![[1.8; 3]],
        motion: vec![],
        source_row: vec![0],
        ..Splats::default()
    }
}

pub fn with_motion(splats: &Splats, motion: Motion) -> Splats {
    assert_eq!(splats.n_static, splats.len());
    Splats { n_static: 0, motion: vec![motion; splats.len()], ..splats.clone() }
}
