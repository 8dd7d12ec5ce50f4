//! The CPU truth against the golden cases, against itself, and against brute force.

mod golden;

use ivv::twin::{Outputs, Params};

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

/// A direction of the shape of `params`, all zero.
pub fn zero_like(params: &Params<f64>) -> Params<f64> {
    params.zip(params, |_, _| 0.0)
}
