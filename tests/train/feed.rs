//! Images that stay in the device's memory, and steps that allocate nothing.

use super::Tiny;
use crate::common::device::{opened, options};
use crate::common::prelude::*;
use ivv::internals::gpu::{Gpu, Options};
use ivv::internals::train::Resolution;
use ivv::internals::vk::DeviceChoice;

const STEPS: u64 = 60;
/// Bytes of an image of the tiny capture, with depth and flow.
const IMAGE: u64 = 64 * 48 * (4 + 2 + 4);

fn begin(gpu: &Arc<Gpu>, tiny: &Tiny, config: &Config, bytes: Option<u64>) -> Session<'static> {
    let options = SessionOptions { device_image_bytes: bytes, ..SessionOptions::default() };
    Session::begin(gpu.clone(), &tiny.capture, config.clone(), options).unwrap()
}

fn kept_bytes(gpu: &Gpu) -> u64 {
    gpu.device().memory().0.get("kept images").copied().unwrap_or(0)
}

#[test]
fn images_that_stay_on_the_device_give_the_bits_of_those_that_pass() {
    let gpu = gpu();
    let tiny = Tiny::new("feed");
    // Reduced images leave when whole ones come, and reviews continue with another trainer.
    let required = Required { reviews: 2, grids_at: 0.2 };
    let resolution = Resolution { reduction: 2, until: 0.3 };
    let config = Config { sh_degree: 1, steps: STEPS, max_gaussians: 2_000, required, resolution, ..exact() };
    let run = |bytes| {
        let mut session = begin(&gpu, &tiny, &config, bytes);
        let mut most = 0;
        while session.step().unwrap() {
            most = most.max(kept_bytes(&gpu));
        }
        let splats = session.finish().unwrap();
        (splats, most)
    };
    let (passing, none) = run(Some(0));
    assert_eq!(none, 0);
    let n_images = tiny.capture.training_frames().len() as u64;
    for (bytes, expected) in [(u64::MAX, n_images * IMAGE), (5 * IMAGE, 5 * IMAGE)] {
        let (staying, most) = run(Some(bytes));
        assert_same_splats(format_args!("{bytes} bytes"), &staying, &passing);
        // Some images lack a prior; what leaves is there until its step has ended.
        assert!(most > expected * 2 / 3 && most < expected + IMAGE, "{most} bytes stayed, of {expected}");
    }
    if gpu.caps().kind == DeviceKind::Cpu {
        let mut session = begin(&gpu, &tiny, &config, None);
        assert!(session.step().unwrap() && session.plan().image_bytes == 0, "the host's memory holds them already");
        session.finish().unwrap();
    }
}

#[test]
fn a_step_on_an_image_that_has_stayed_copies_none() {
    let Some(gpu) = timed() else { return };
    let tiny = Tiny::new("feed-copies");
    let config = Config { sh_degree: 0, steps: STEPS, ..exact() };
    let mut session = begin(&gpu, &tiny, &config, Some(u64::MAX));
    let mut copies = || {
        let step = session.profile().unwrap().unwrap();
        step.passes.iter().find(|pass| pass.label == "upload/copy").unwrap().dispatches
    };
    let epoch = tiny.capture.training_frames().len();
    let first: Vec<u64> = (0..epoch).map(|_| copies()).collect();
    // The view with what Adam needs, and the image with its priors.
    assert_eq!(first, vec![2; epoch]);
    for _ in 0..epoch {
        assert_eq!(copies(), 1, "the view with what Adam needs");
    }
}

#[test]
fn a_step_in_the_steady_state_makes_no_buffer() {
    // Each submission of a device with breadcrumbs has a buffer for them.
    let options = options();
    let device = DeviceChoice { breadcrumbs: false, ..options.device };
    let gpu = opened(&Options { device, ..options });
    let tiny = Tiny::new("feed-steady");
    let density = Density { stop: 0.0, ..Density::default() };
    let config = Config { sh_degree: 1, steps: STEPS, density, ..exact() };
    for bytes in [0, u64::MAX] {
        let mut session = begin(&gpu, &tiny, &config, Some(bytes));
        // The first steps make theirs, an epoch those of images that stay, and the middle of the run looks at the time offsets.
        while session.steps() < STEPS / 2 + 3 {
            session.step().unwrap();
        }
        let before = gpu.device().n_buffers_made();
        while session.steps() < STEPS / 2 + 19 {
            session.step().unwrap();
        }
        assert_eq!(gpu.device().n_buffers_made() - before, 0, "in 16 steps with {bytes} bytes of images on the device");
        assert!(before > 0);
        session.finish().unwrap();
    }
}
