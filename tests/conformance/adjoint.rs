//! The adjoint test: <cotangent, J w> from dual numbers beside <J^T cotangent, w> from the device.

use super::random::{self, Random};
use super::row::Bench;
use anyhow::{Result, ensure};
use ivv::Constants;
use ivv::internals::reference::{Outputs, Params, Temporal, jvp};
use ivv::internals::scene::{Frame, Splats, View};
use ivv::internals::stage::Gradients;

/// All groups that [`Gradients`] has; the last four exist for dynamic Gaussians only.
pub const GROUPS: [&str; 9] =
    ["position", "rotation", "scale", "opacity", "sh", "velocity", "t_center", "t_scale", "time_offset"];

/// Random cotangents in [-1, 1) of all outputs, zero where `hidden`.
pub fn cotangents(seed: u64, view: &View, hidden: impl Fn(usize) -> bool) -> Frame {
    let mut random = Random::new(seed);
    let mut frame = Frame { width: view.intrinsics.width, height: view.intrinsics.height, ..Frame::default() };
    for i in 0..(view.intrinsics.width * view.intrinsics.height) as usize {
        let pixel: [f32; 8] = random.vector(-1.0, 1.0);
        let [r, g, b, alpha, depth, inverse_depth, x, y] = if hidden(i) { [0.0; 8] } else { pixel };
        frame.color.push([r, g, b]);
        frame.alpha.push(alpha);
        frame.depth.push(depth);
        frame.inverse_depth.push(inverse_depth);
        frame.flow.push([x, y]);
    }
    frame
}

/// The numbers of one group, flat, in the order of [`group`]: a static Gaussian has no temporal ones.
pub fn flat(d: &Gradients, name: &str) -> Vec<f64> {
    let mut all = Params::new(&d.params, &View { time_offset: d.time_offset, ..random::view() });
    group(&mut all, name).into_iter().map(|x| *x).collect()
}

pub fn bits(d: &Gradients) -> Vec<u64> {
    GROUPS.iter().flat_map(|name| flat(d, name)).map(f64::to_bits).collect()
}

pub fn is_finite(d: &Gradients) -> bool {
    bits(d).into_iter().all(|x| f64::from_bits(x).is_finite())
}

pub fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

fn along(cotangents: &Frame, d: &Outputs<f64>) -> f64 {
    let part = |a: &[f32], b: &[f64]| a.iter().zip(b).map(|(a, b)| f64::from(*a) * b).sum::<f64>();
    part(cotangents.color.as_flattened(), d.color.as_flattened())
        + part(&cotangents.alpha, &d.alpha)
        + part(&cotangents.depth, &d.depth)
        + part(&cotangents.inverse_depth, &d.inverse_depth)
        + part(cotangents.flow.as_flattened(), d.flow.as_flattened())
}

/// Compares group `name` of `found` with dual numbers along a random direction and along `found` itself, and gives the
/// larger difference in units of |gradient| |direction|; `None` when both are zero.
pub fn group_error(found: &Gradients, name: &str, splats: &Splats, view: &View, cotangents: &Frame) -> Option<f64> {
    let gradient = flat(found, name);
    let params = Params::<f64>::new(splats, view);
    let mut random = Random::new(77);
    let noise: Vec<f64> = gradient.iter().map(|_| random.uniform(-1.0, 1.0)).collect();
    let norm = dot(&gradient, &gradient).sqrt();
    let mut worst = None;
    for direction in [&noise, &gradient] {
        let length = dot(direction, direction).sqrt();
        if length == 0.0 {
            continue;
        }
        let direction: Vec<f64> = direction.iter().map(|x| x / length).collect();
        let mut tangent = params.zip(&params, |_, _| 0.0);
        for (to, from) in group(&mut tangent, name).into_iter().zip(&direction) {
            *to = *from;
        }
        let (_, derivative) = jvp(splats, &tangent, view, &Constants::default());
        let truth = along(cotangents, &derivative);
        let difference = (truth - dot(&gradient, &direction)).abs();
        if norm == 0.0 && difference == 0.0 {
            continue;
        }
        worst = Some(f64::max(worst.unwrap_or(0.0), difference / norm));
    }
    worst
}

/// Checks every group, and that `least` of them have a gradient; gives the largest error.
pub fn check_adjoint(
    bench: &Bench,
    splats: &Splats,
    view: &View,
    cotangents: &Frame,
    allowed: f64,
    least: usize,
) -> Result<f64> {
    let (found, report) = bench.vjp(splats, view, cotangents)?;
    ensure!(report.intersections > 0 && found.n_bad == 0, "{} bad gradients, {report:?}", found.n_bad);
    let error = |name| group_error(&found, name, splats, view, cotangents).map(|error| (name, error));
    let errors: Vec<(&str, f64)> = GROUPS.into_iter().filter_map(error).collect();
    let shown = errors.iter().map(|(name, error)| format!("{name} {error:.1e}")).collect::<Vec<_>>().join(", ");
    let right = errors.len() >= least && errors.iter().all(|(_, error)| *error <= allowed);
    ensure!(right, "errors of {} groups: {shown}", errors.len());
    Ok(errors.iter().fold(0.0, |worst, (_, error)| f64::max(worst, *error)))
}

/// The numbers of one group of [`GROUPS`], flat, or the `background`.
pub fn group<'a>(params: &'a mut Params<f64>, name: &str) -> Vec<&'a mut f64> {
    let motion =
        |f: fn(&mut Temporal<f64>) -> &mut f64, params: &'a mut Params<f64>| params.motion.iter_mut().map(f).collect();
    match name {
        "position" => params.position.iter_mut().flatten().collect(),
        "rotation" => params.rotation.iter_mut().flatten().collect(),
        "scale" => params.scale.iter_mut().flatten().collect(),
        "opacity" => params.opacity.iter_mut().collect(),
        "sh" => params.sh.iter_mut().flatten().collect(),
        "velocity" => params.motion.iter_mut().flat_map(|m| &mut m.velocity).collect(),
        "t_center" => motion(|m| &mut m.t_center, params),
        "t_scale" => motion(|m| &mut m.t_scale, params),
        "time_offset" => vec![&mut params.time_offset],
        "background" => params.background.iter_mut().collect(),
        other => panic!("no group {other}"),
    }
}
