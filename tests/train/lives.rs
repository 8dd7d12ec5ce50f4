//! Training Gaussians of which most do not live at a step's time.

use super::{Tiny, bits, drive, steady};
use crate::adversary::rounds_otherwise;
use crate::common::device::gpu;
use crate::common::random::Random;
use ivv::Constants;
use ivv::scene::{Motion, Splats};
use ivv::stage::AdamMode;
use ivv::train::{Config, Density, Setup, Trainer, from_points};

/// Short-lived Gaussians of every frame of the capture, in order of time, and where each of a mixed order comes from.
fn short_lived(tiny: &Tiny, config: &Config) -> (Splats, Vec<usize>) {
    let mut random = Random::new(5);
    let from = from_points(&tiny.capture.points, &tiny.capture, config);
    let n = 1_500;
    let mut splats = from.in_order(&(0..n).map(|i| i % from.len()).collect::<Vec<_>>());
    for (i, position) in splats.position.iter_mut().enumerate() {
        // None as deep as another.
        *position = position.map(|x| x + random.uniform(-0.05, 0.05) as f32);
        let Motion { t_center, t_scale, .. } = &mut splats.motion[i];
        (*t_center, *t_scale) = (i as f32 / n as f32, random.uniform(-3.5, -2.5) as f32);
    }
    let mut order: Vec<usize> = (0..n).collect();
    order.sort_by_cached_key(|_| random.bits());
    (splats, order)
}

#[test]
fn steps_do_not_tell_in_which_blocks_gaussians_die() {
    if rounds_otherwise("two kernels have the same bits") {
        return;
    }
    let gpu = gpu();
    let tiny = Tiny::new("lives");
    for adam in [AdamMode::Lazy, AdamMode::Sparse, AdamMode::Dense] {
        let density = Density { stop: 0.0, ..Density::default() };
        // A sum over all Gaussians would follow their order.
        let mut config = Config { sh_degree: 1, adam, density, offsets: false, ..steady() };
        config.frame.sh_bits = if adam == AdamMode::Dense { 32 } else { 16 };
        let (splats, order) = short_lived(&tiny, &config);
        let trained = |begin: &Splats| {
            let setup = Setup::new(&tiny.capture, &config);
            let mut trainer =
                Trainer::new(gpu.clone(), begin, Constants::default(), config.clone(), 40, setup).unwrap();
            drive(&mut trainer, &tiny.capture, 1, 40);
            let end = trainer.splats().unwrap();
            assert!(trainer.take_reports().iter().all(|step| step.active > 20 && step.active < 1_000), "{adam:?}");
            end
        };
        let (by_time, mixed) = (trained(&splats), trained(&splats.in_order(&order)));
        let expected = by_time.in_order(&order);
        assert_ne!(bits(&mixed), bits(&splats.in_order(&order)), "{adam:?}: nothing was learnt");
        assert_eq!(bits(&mixed), bits(&expected), "{adam:?}");
    }
}
