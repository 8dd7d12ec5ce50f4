//! Training Gaussians of which most do not live at a step's time.

use super::{Tiny, drive, steady, trainer};
use crate::common::prelude::*;

/// Gaussians whose processing goes block by block.
const BLOCK: usize = 128;

/// Short-lived Gaussians in order of time. The first of each block is where no camera looks, and lives always or never.
fn short_lived(tiny: &Tiny, config: &Config, always: bool) -> Splats {
    let mut random = Random::new(5);
    let from = from_points(&tiny.capture.points, &tiny.capture, config);
    let n = 1_500;
    let mut splats = from.in_order(&(0..n).map(|i| i % from.len()).collect::<Vec<_>>());
    for (i, position) in splats.position.iter_mut().enumerate() {
        *position = position.map(|x| x + random.uniform(-0.05, 0.05) as f32);
        let Motion { t_center, t_scale, .. } = &mut splats.motion[i];
        (*t_center, *t_scale) = (i as f32 / n as f32, random.uniform(-3.5, -2.5) as f32);
        if i % BLOCK == 0 {
            *position = [0.0, 1e4, 0.0];
            (*t_center, *t_scale) = if always { (0.5, 10.0) } else { (-100.0, -3.0) };
        }
    }
    splats
}

#[test]
fn steps_do_not_tell_in_which_blocks_gaussians_die() {
    let tiny = Tiny::on_device("lives");
    for adam in [AdamMode::Lazy, AdamMode::Dense] {
        let density = Density { stop: 0.0, ..Density::default() };
        let config = Config { sh_degree: 1, adam, density, ..steady() };
        let trained = |always| {
            let begin = short_lived(&tiny, &config, always);
            let mut trainer = trainer(&tiny.capture, &config, &begin, 40);
            drive(&mut trainer, &tiny.capture, 1, 40);
            let reports = trainer.take_reports();
            assert!(reports.iter().all(|step| step.active > 20 && step.active < 1_000), "{adam:?}");
            let others: Vec<usize> = (0..begin.len()).filter(|i| i % BLOCK > 0).collect();
            (begin.in_order(&others), trainer.splats().unwrap().in_order(&others))
        };
        let ((begin, dying), (_, living)) = (trained(false), trained(true));
        assert!(begin.position != dying.position, "{adam:?}: nothing was learnt");
        assert_same_splats(format_args!("{adam:?}"), &living, &dying);
    }
}
