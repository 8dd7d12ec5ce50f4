use fourdgs::GaussianSet;
use fourdgs::quantization::{
    Bounds, Profile, Steps, dequantize_rotation, life_class, motion_step, mu_step, quantize_rotation, rint, support_k,
};

/// How many times the grid of each attribute is halved. With 0 the largest errors are: of a position 0.02 of the median
/// standard deviation, of standard deviations and lives 0.5 %, of colours and opacities half a step of 255.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize)]
pub struct Grades {
    /// Places.
    pub position: u8,
    /// Logs of the standard deviations.
    pub scale: u8,
    /// Quaternions.
    pub rotation: u8,
    /// Base colours.
    pub color: u8,
    /// Base opacities.
    pub opacity: u8,
    /// Velocities.
    pub motion: u8,
    /// Times and logs of the lives.
    pub time: u8,
    /// Harmonics of degree 1, 2 and 3; 6 leaves a band out, and those above it.
    pub bands: [u8; 3],
}

impl Grades {
    /// A band that is not stored. The format has at least three bits for one that is.
    #[doc(hidden)]
    pub const LEFT_OUT: u8 = 6;
    #[doc(hidden)]
    pub const COARSEST: u8 = 6;
    #[doc(hidden)]
    pub const N: usize = 10;

    const NAMES: [&str; Self::N] =
        ["position", "scale", "rotation", "color", "opacity", "motion", "time", "sh 1", "sh 2", "sh 3"];

    /// By number, in the order of the fields.
    #[doc(hidden)]
    pub fn of(&mut self, attribute: usize) -> &mut u8 {
        match attribute {
            0 => &mut self.position,
            1 => &mut self.scale,
            2 => &mut self.rotation,
            3 => &mut self.color,
            4 => &mut self.opacity,
            5 => &mut self.motion,
            6 => &mut self.time,
            band => &mut self.bands[(band - 7).min(2)],
        }
    }

    /// The degree that is stored of `degree`.
    #[doc(hidden)]
    pub fn degree(&self, degree: u8) -> u8 {
        let stored = self.bands.iter().take_while(|grade| **grade < Self::LEFT_OUT).count();
        degree.min(stored as u8)
    }

    /// Bits of each stored band.
    pub(super) fn bits(&self, degree: u8) -> Vec<u8> {
        self.bands[..usize::from(self.degree(degree))].iter().map(|grade| 8 - grade).collect()
    }

    /// Steps of logs do not depend on the scene.
    pub(super) fn scale(&self, value: f32) -> f32 {
        if self.scale == 0 {
            return value;
        }
        of_log(value, Steps::of(&Bounds::for_profile(Profile::Fine, 1.0)).scale_log * times(self.scale))
    }

    pub(super) fn place(&self, value: f32, steps: &Steps) -> f32 {
        if self.position == 0 { value } else { to(value, steps.pos * times(self.position)) as f32 }
    }

    /// The Gaussians with every number on the grid of its grade, which the format's own grid holds exactly.
    pub(super) fn on(&self, set: &GaussianSet, steps: &Steps, cutoff: f64) -> GaussianSet {
        let mut set = set.clone();
        set.scales.iter_mut().for_each(|s| *s = self.scale(*s));
        set.positions.iter_mut().for_each(|x| *x = self.place(*x, steps));
        if self.rotation > 0 {
            for q in set.rotations.chunks_exact_mut(4) {
                let step = steps.rot * times(self.rotation);
                let (largest, bins) = quantize_rotation([0, 1, 2, 3].map(|k: usize| f64::from(q[k])), step);
                q.copy_from_slice(&dequantize_rotation(largest, &bins, step));
            }
        }
        for color in set.colors.chunks_exact_mut(4) {
            if self.color > 0 {
                color[..3].iter_mut().for_each(|c| *c = to(*c, steps.rgb * times(self.color)).min(1.0) as f32);
            }
            if self.opacity > 0 {
                color[3] = to(color[3], steps.alpha * times(self.opacity)).min(1.0) as f32;
            }
        }
        for i in 0..set.mu_t.len() {
            let is_lasting = set.sigma_t[i].is_infinite();
            if self.time > 0 && !is_lasting {
                set.sigma_t[i] = of_log(set.sigma_t[i], steps.sigma_log * times(self.time));
            }
            let bin = if is_lasting { 0 } else { rint(f64::from(set.sigma_t[i]).max(1e-30).ln() / steps.sigma_log) };
            if self.time > 0 {
                let step = mu_step(bin, steps.sigma_log, is_lasting, steps.time) * times(self.time);
                set.mu_t[i] = to(set.mu_t[i], step) as f32;
            }
            if self.motion > 0 {
                let window = f64::from(set.win_hi[i]) - f64::from(set.win_lo[i]);
                let class = life_class(bin, steps.sigma_log, is_lasting, window, support_k(cutoff));
                let step = motion_step(class, steps.motion) * times(self.motion);
                set.motions[3 * i..3 * i + 3].iter_mut().for_each(|v| *v = to(*v, step) as f32);
            }
        }
        set
    }
}

impl std::fmt::Display for Grades {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let mut grades = *self;
        let told = (0..Self::N).map(|k| format!("{} {}", Self::NAMES[k], grades.of(k)));
        f.write_str(&told.collect::<Vec<_>>().join(", "))
    }
}

fn to(value: f32, step: f64) -> f64 {
    rint(f64::from(value) / step) as f64 * step
}

fn of_log(value: f32, step: f64) -> f32 {
    (rint(f64::from(value).ln() / step) as f64 * step).exp() as f32
}

/// Steps of the format in a step of a grade.
fn times(grade: u8) -> f64 {
    f64::from(1u32 << grade.min(Grades::COARSEST))
}
