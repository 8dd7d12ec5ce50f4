//! The mean of the scenes at the end of a run: a scene follows the noise of its last images, the mean of many does not
//! (Polyak and Juditsky 1992; Izmailov et al. 2018).

use super::Config;
use crate::scene::Splats;

/// About so many scenes go into a mean: each is copied from the device.
const SCENES: u64 = 20;

#[derive(Clone, Debug, Default, PartialEq)]
pub struct Average {
    pub n: u64,
    /// Parameter by parameter, in the frame of training; empty while `n` is 0.
    pub mean: Splats,
}

impl Average {
    /// The last step of a run of `total` that may add, remove or reorder Gaussians: the scenes after it are averaged.
    pub fn begins_after(config: &Config, total: u64) -> u64 {
        total - (config.average * total as f64) as u64
    }

    /// True if the scene after step `step` of `total` belongs to the mean.
    pub fn is_due(config: &Config, step: u64, total: u64) -> bool {
        let first = Self::begins_after(config, total);
        let every = ((total - first) / SCENES).max(1);
        step > first && step <= total && (total - step).is_multiple_of(every)
    }

    /// Adds a scene of the same Gaussians in the same order; starts again with a scene of another number of them.
    pub fn add(&mut self, splats: Splats) {
        if self.n == 0 || splats.len() != self.mean.len() || splats.motion.len() != self.mean.motion.len() {
            *self = Average { n: 1, mean: splats };
            return;
        }
        self.n += 1;
        let weight = 1.0 / self.n as f64;
        let Splats { position, rotation, scale, opacity, sh, motion, .. } = &mut self.mean;
        let join = |mean: &mut [f32], x: &[f32]| {
            for (mean, x) in mean.iter_mut().zip(x) {
                *mean = (f64::from(*mean) + (f64::from(*x) - f64::from(*mean)) * weight) as f32;
            }
        };
        join(position.as_flattened_mut(), splats.position.as_flattened());
        join(rotation.as_flattened_mut(), splats.rotation.as_flattened());
        join(scale.as_flattened_mut(), splats.scale.as_flattened());
        join(opacity, &splats.opacity);
        join(sh.as_flattened_mut(), splats.sh.as_flattened());
        join(bytemuck::cast_slice_mut(motion), bytemuck::cast_slice(&splats.motion));
    }

    pub fn scene(&self) -> Option<&Splats> {
        (self.n > 0).then_some(&self.mean)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::internals::train::checkpoint::arrays;
    use crate::scene::Motion;

    #[test]
    fn the_mean_is_of_scenes_spread_evenly_up_to_the_last_step() {
        for (share, total) in [(0.1, 500), (0.1, 3000), (0.1, 15), (1.0, 7), (0.25, 30_000)] {
            let config = Config { average: share, ..Config::default() };
            let first = Average::begins_after(&config, total);
            let due: Vec<u64> = (0..=total + 9).filter(|step| Average::is_due(&config, *step, total)).collect();
            assert!(due.last() == Some(&total) && due[0] > first && due.len() as u64 <= 2 * SCENES, "{due:?}");
            assert!((total - first).abs_diff((share * total as f64) as u64) == 0);
            let gaps: Vec<u64> = due.windows(2).map(|pair| pair[1] - pair[0]).collect();
            assert!(gaps.iter().all(|gap| *gap == gaps[0]) && due[0] - first <= gaps.first().copied().unwrap_or(1));
        }
        let off = Config { average: 0.0, ..Config::default() };
        assert!((0..=100).all(|step| !Average::is_due(&off, step, 100)));
    }

    #[test]
    fn every_parameter_is_the_mean_of_its_values() {
        let scene = |x: f32| Splats {
            n_static: 1,
            position: vec![[x; 3]; 2],
            rotation: vec![[1.0, x, 0.0, 0.0]; 2],
            scale: vec![[-x; 3]; 2],
            opacity: vec![2.0 * x; 2],
            sh: vec![[x, 0.0, 1.0]; 2],
            motion: vec![Motion { velocity: [x; 3], t_center: x, t_scale: -x }],
            source_row: vec![0, 1],
            ..Splats::new(0)
        };
        let mut average = Average::default();
        assert_eq!(average.scene(), None);
        for x in [1.0, 2.0, 6.0] {
            average.add(scene(x));
        }
        let near = |(a, b): (&f32, &f32)| (a - b).abs() < 1e-6;
        let (found, truth) = (average.scene().unwrap(), scene(3.0));
        assert!(average.n == 3 && found.position.len() == 2);
        for ((name, found), (_, truth)) in arrays(found).into_iter().zip(arrays(&truth)) {
            assert!(found.len() == truth.len() && found.iter().zip(truth).all(near), "{name}");
        }
        // Another scene: the mean is of it alone.
        let fewer = scene(5.0).kept(|i| i == 0).into_owned();
        average.add(fewer.clone());
        assert_eq!((average.n, average.scene()), (1, Some(&fewer)));
    }
}
