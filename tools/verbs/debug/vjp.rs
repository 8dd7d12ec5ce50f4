//! `ivv debug vjp`.

use crate::run::device::DeviceArgs;
use crate::run::source::Source;
use crate::ui::screen::answer;
use anyhow::ensure;
use ivv::Constants;
use ivv::internals::files::{read_tensors, write_tensors};
use ivv::internals::scene::{Frame, Splats, View, read_views};
use ivv::internals::stage::{Accumulation, Gradients, Renderer};
use serde_json::json;
use std::path::{Path, PathBuf};

#[derive(clap::Args)]
pub struct Args {
    /// A scene file, as for render.
    #[arg(long)]
    scene: PathBuf,
    /// A cameras file; its first view is taken.
    #[arg(long)]
    cameras: PathBuf,
    /// Cotangents of the outputs: safetensors with any of color, alpha, depth, inverse_depth, flow.
    #[arg(long)]
    cotangents: PathBuf,
    /// The gradients, safetensors: one tensor per parameter group in the units of the file, time_offset per frame,
    /// background, and camera_rotation (radians about the camera's axes) and camera_translation (along them).
    #[arg(short, long)]
    output: PathBuf,
    #[command(flatten)]
    constants: crate::run::constants::ConstantArgs,
    #[command(flatten)]
    device: DeviceArgs,
}

pub fn run(args: &Args, json: bool) -> anyhow::Result<()> {
    args.constants.over(Constants::default())?;
    let views = read_views(&args.cameras)?;
    let Some(view) = views.first() else {
        return Err(ivv::Error::data(&args.cameras, "views", "has no view", "add one").into());
    };
    let cotangents = cotangents(args, view)?;
    let source = Source::open(&args.scene)?;
    let constants = args.constants.over(source.look.constants)?;
    let splats = source.scene()?.splats;
    let gpu = args.device.open()?;
    let sums = Accumulation::Slots.on(gpu.caps());
    let mut renderer = Renderer::new(gpu, &splats, constants)?;
    renderer.accumulate(sums)?;
    let (gradients, report) = renderer.vjp(view, &cotangents)?;
    if gradients.n_bad > 0 {
        let remedy = "give smaller cotangents, or see with `ivv inspect` how large the scene's numbers are";
        let what = format!("the gradient of view `{}`", view.name);
        return Err(ivv::Error::NonFinite { what, count: u64::from(gradients.n_bad), remedy }.into());
    }
    write_gradients(&args.output, &gradients, &splats)?;
    let (n, seen, path) = (splats.len(), report.visible, args.output.to_string_lossy());
    let text = format!("{path}: gradients of view `{}`, {seen} of {n} Gaussians visible", view.name);
    answer(json, &json!({ "path": path, "view": view.name, "gaussians": n, "visible": seen }), text);
    Ok(())
}

/// The file's cotangents as a frame; outputs that it does not name have none.
fn cotangents(args: &Args, view: &View) -> anyhow::Result<Frame> {
    let mut tensors = read_tensors(&args.cotangents)?;
    let (width, height) = (view.intrinsics.width, view.intrinsics.height);
    ensure!(width > 0 && height > 0, "the view has no pixels");
    let fault = |place: String, reason: String, remedy: &str| ivv::Error::data(&args.cotangents, place, reason, remedy);
    // `[H][W][channels]` numbers; zeros where the file has none.
    let mut take = |name: &str, channels: usize| -> ivv::Result<Vec<f32>> {
        let (w, h) = (width as usize, height as usize);
        let Some(tensor) = tensors.remove(name) else { return Ok(vec![0.0; w * h * channels]) };
        let shape: &[usize] = if channels == 1 { &[h, w] } else { &[h, w, channels] };
        if tensor.shape != shape {
            let reason = format!("has shape {:?}, expected {shape:?} for this view", tensor.shape);
            return Err(fault(name.to_owned(), reason, "make it for this view"));
        }
        if let Some(at) = tensor.data.iter().position(|x| !x.is_finite()) {
            return Err(fault(format!("{name}[{at}]"), "is not finite".into(), "replace it by a finite number"));
        }
        Ok(tensor.data.iter().map(|x| *x as f32).collect())
    };
    let frame = Frame {
        width,
        height,
        color: take("color", 3)?.as_chunks().0.to_vec(),
        alpha: take("alpha", 1)?,
        depth: take("depth", 1)?,
        inverse_depth: take("inverse_depth", 1)?,
        flow: take("flow", 2)?.as_chunks().0.to_vec(),
    };
    if let Some(name) = tensors.keys().next() {
        let remedy = "name color, alpha, depth, inverse_depth or flow";
        return Err(fault(name.clone(), "unknown output".into(), remedy).into());
    }
    Ok(frame)
}

/// Writes the gradients by parameter, in the order of the file that `splats` came from.
fn write_gradients(path: &Path, gradients: &Gradients, splats: &Splats) -> ivv::Result<()> {
    let (n, k) = (splats.len(), splats.n_coefficients());
    let mut index = vec![0; n];
    for (i, row) in splats.source_row.iter().enumerate() {
        index[*row as usize] = i;
    }
    let d = &gradients.params;
    let gather = |width: usize, values: &[f32]| -> Vec<f32> {
        index.iter().flat_map(|i| &values[i * width..(i + 1) * width]).copied().collect()
    };
    let motion: Vec<_> = index.iter().map(|i| gradients.motion(*i)).collect();
    let velocity: Vec<f32> = motion.iter().flat_map(|m| m.velocity).collect();
    let t_center: Vec<f32> = motion.iter().map(|m| m.t_center).collect();
    let t_scale: Vec<f32> = motion.iter().map(|m| m.t_scale).collect();
    write_tensors(
        path,
        &[
            ("position", &[n, 3], &gather(3, d.position.as_flattened())),
            ("rotation", &[n, 4], &gather(4, d.rotation.as_flattened())),
            ("scale", &[n, 3], &gather(3, d.scale.as_flattened())),
            ("opacity", &[n], &gather(1, &d.opacity)),
            ("sh", &[n, k, 3], &gather(3 * k, d.sh.as_flattened())),
            ("velocity", &[n, 3], &velocity),
            ("t_center", &[n], &t_center),
            ("t_scale", &[n], &t_scale),
            ("time_offset", &[1], &[gradients.time_offset as f32]),
            ("background", &[3], &gradients.background.map(|x| x as f32)),
            ("camera_rotation", &[3], &gradients.camera_rotation.map(|x| x as f32)),
            ("camera_translation", &[3], &gradients.camera_translation.map(|x| x as f32)),
        ],
    )
}
