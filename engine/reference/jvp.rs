//! Directional derivatives of a render, exact, by dual numbers.

use super::blend::{Outputs, render};
use super::dual::Dual;
use super::input::{Params, Rules};
use crate::scene::{Splats, View};
use crate::settings::Constants;

/// A direction in the space of everything a render can be differentiated by, in the units of the parameters.
pub type Tangent = Params<f64>;

/// The render of `splats` and its derivative along `tangent`, which must have the shape of `Params::new(splats, view)`.
/// In the derivative's [`Outputs`] the counts and bands are the render's. Gaussians dropped or not added have no
/// derivative; order and membership are held fixed.
pub fn jvp(splats: &Splats, tangent: &Tangent, view: &View, constants: &Constants) -> (Outputs<f64>, Outputs<f64>) {
    jvp_of(&Params::new(splats, view), tangent, view, &Rules::new(constants))
}

/// As [`jvp`], from double-precision parameters and rules.
pub fn jvp_of(
    params: &Params<f64>,
    tangent: &Tangent,
    view: &View,
    rules: &Rules<f64>,
) -> (Outputs<f64>, Outputs<f64>) {
    let rules = Rules {
        alpha_min: Dual::new(rules.alpha_min, 0.0),
        alpha_max: Dual::new(rules.alpha_max, 0.0),
        t_min: Dual::new(rules.t_min, 0.0),
        blur: Dual::new(rules.blur, 0.0),
        near: Dual::new(rules.near, 0.0),
    };
    let outputs = render(&params.zip(tangent, Dual::new), view, &rules);
    (outputs.map(|x| x.value), outputs.map(|x| x.tangent))
}
