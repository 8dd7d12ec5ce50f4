//! `ivv train --plan`: the steps, memory and bytes of a training, without the training.

use crate::run::capture;
use crate::run::device::DeviceArgs;
use crate::run::workload::work;
use crate::ui::screen::{out, print_json};
use crate::verbs::train::args::Args;
use anyhow::Context;
use ivv::internals::gpu::{Gpu, Options, StandIn};
use ivv::internals::profile::Card;
use ivv::internals::scene::capture::{Capture, share_of_memory};
use ivv::internals::train::{Checkpoint, Limits, Plan, Workload};
use ivv::internals::words::count;
use serde_json::json;
use std::sync::Arc;

/// Prints the plan of the training of `args`, for a clip of `frames` frames if that is given. Writes nothing.
pub fn print(args: &Args, frames: Option<u32>, json: bool) -> anyhow::Result<()> {
    let config = args.settings.resolve()?;
    let path =
        args.capture.as_deref().context("--plan: expected a CAPTURE; a resumed run has its plan in train.json")?;
    let capture = capture::open(path, &args.read.settings())?;
    let card = args.card.as_deref().map(Card::named).transpose().map_err(anyhow::Error::msg)?;
    let gpu = match card {
        Some(card) => card_gpu(card, &args.device)?,
        None => args.device.open()?,
    };
    let frames = frames.unwrap_or(capture.n_frames);
    let times = f64::from(frames) / f64::from(capture.n_frames.max(1));
    let images = (capture.training_frames().len() as f64 * times).round() as u64;
    let cache_bytes = args.cache_bytes.unwrap_or_else(share_of_memory);
    config.check_on(&gpu, config.total(images))?;
    let (work, limits) = work(&capture, &config, &gpu, cache_bytes)?;
    let limits = Limits { memory_bytes: card.map_or(limits.memory_bytes, |card| card.memory.value as u64), ..limits };
    let decoded = (work.image_bytes as f64 * times) as u64;
    let work = Workload {
        image_bytes: decoded,
        cache_bytes: cache_bytes.min(decoded),
        kept_image_bytes: args.device_image_bytes,
        // All Gaussians of a clip may become dynamic.
        dynamic: if frames > 1 { work.gaussians } else { 0 },
        ..work
    };
    let plan = Plan::new(&work, &limits);
    let most = plan.full.gaussians;
    let checkpoint = Checkpoint::bytes(most, if frames > 1 { most } else { 0 }, config.sh_degree);
    let (steps, each) = (config.total(images), file_bytes(&capture));
    let seen = steps.saturating_mul(u64::from(config.batch));
    // Images in the cache are read once.
    let reads = if decoded <= cache_bytes { images.min(seen) } else { seen };
    let (of_images, read) = ((each * images as f64) as u64, (each * reads as f64) as u64);
    if json {
        let plan = json!({
            "cameras": capture.cameras.len(), "frames": frames, "training_images": images, "steps": steps, "batch": config.batch,
            "gaussians": most, "bound_by": plan.bound_by, "device_bytes": plan.full.bytes(),
            "device_image_bytes": plan.image_bytes, "cache_bytes": plan.cache_bytes, "decoded_bytes": decoded,
            "checkpoint_bytes": checkpoint, "image_file_bytes": of_images, "bytes_read": read,
        });
        return print_json(&plan);
    }
    let gigabytes = |bytes: u64| format!("{:.1} GB", bytes as f64 / 1e9);
    let of = if frames == capture.n_frames { String::new() } else { format!(", by {} of them", capture.n_frames) };
    let (cameras, n_frames) = (count(capture.cameras.len(), "camera"), count(frames, "frame"));
    out!("{cameras}, {n_frames}{of}, {}", count(images, "training image"));
    out!("steps    {}, {} each", count(steps, "step"), count(config.batch, "image"));
    let (full, gaussians) = (gigabytes(plan.full.bytes()), count(most, "Gaussian"));
    out!("device   {full} with {gaussians} ({}), and {} of images", plan.bound_by, gigabytes(plan.image_bytes));
    out!("host     {} of decoded images at a time, of {} in all", gigabytes(plan.cache_bytes), gigabytes(decoded));
    let kept = Checkpoint::MOST_KEPT;
    out!("disk     {kept} checkpoints of {}; the images are {}", gigabytes(checkpoint), gigabytes(of_images));
    out!("read     {} of image files, in {}", gigabytes(read), count(reads, "image"));
    out!("time     {steps} times what a step takes: `ivv profile` measures one");
    Ok(())
}

/// A device that stands in for the card: it holds buffers, and nothing runs on it.
fn card_gpu(card: &Card, device: &DeviceArgs) -> ivv::Result<Arc<Gpu>> {
    let stands_in = StandIn { subgroup_size: card.lanes };
    let options = Options { device: device.choice(), stands_in: Some(stands_in), ..Options::default() };
    Ok(Arc::new(Gpu::open(&options)?))
}

/// Bytes of an image file of the training cameras, with its priors, in the mean.
fn file_bytes(capture: &Capture) -> f64 {
    let cameras = capture.cameras.iter().filter(|camera| !camera.is_test);
    let shots: Vec<_> = cameras.flat_map(|camera| &camera.shots).collect();
    let files = shots.iter().flat_map(|shot| {
        [Some(&shot.image), shot.mask.as_ref(), shot.depth.as_ref(), shot.flow.as_ref()].into_iter().flatten()
    });
    let bytes: u64 = files.map(|file| std::fs::metadata(file).map_or(0, |data| data.len())).sum();
    bytes as f64 / shots.len().max(1) as f64
}
