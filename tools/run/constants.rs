//! Rendering constants and the trade of accuracy for time, as options.

use crate::run::settings::contradiction;
use ivv::{Constants, Knobs};

/// Options that trade accuracy for speed; `ivv bench trade` measures them. The defaults are exact.
#[derive(clap::Args)]
pub struct KnobArgs {
    /// Bits of the depths that Gaussians are sorted by: 32, 24, 16, or 0 for 24 on a GPU and 32 on a CPU driver or with a tiny
    /// --near.
    #[arg(long, default_value_t = Knobs::default().depth_bits)]
    depth_bits: u32,
    /// Leave out Gaussians whose opacity at the time of a view is below this.
    #[arg(long, default_value_t = Knobs::default().temporal_cut)]
    temporal_cut: f32,
    /// Finish a pixel when its transmittance falls below this.
    #[arg(long, default_value_t = Knobs::default().t_cut)]
    t_cut: f32,
}

impl KnobArgs {
    /// `constants` with these options. On the command line alpha_min is one of the constants.
    pub fn on(&self, constants: Constants) -> anyhow::Result<Constants> {
        let Self { depth_bits, temporal_cut, t_cut } = *self;
        let knobs = Knobs { depth_bits, temporal_cut, t_cut, ..Knobs::default() };
        knobs.check().map_err(|fault| anyhow::anyhow!("--{}", fault.replacen('_', "-", 1)))?;
        Ok(knobs.on(constants))
    }
}

#[derive(clap::Args)]
pub struct ConstantArgs {
    #[arg(long, help = help("Least alpha with which a Gaussian contributes to a pixel", Constants::default().alpha_min))]
    alpha_min: Option<f32>,
    #[arg(long, help = help("Largest alpha of a Gaussian at a pixel", Constants::default().alpha_max))]
    alpha_max: Option<f32>,
    #[arg(long, help = help("Transmittance below which no further Gaussian is blended", Constants::default().t_min))]
    t_min: Option<f32>,
    #[arg(long, help = help("Variance added to the projected covariance, square pixels", Constants::default().blur))]
    blur: Option<f32>,
    /// Distance of the near plane, scene units; for `train` in a frame where the rig's extent is 3. By default that of the run,
    /// else 0.01.
    #[arg(long)]
    near: Option<f32>,
}

fn help(what: &str, default: f32) -> String {
    format!("{what} [default: {default}]")
}

impl ConstantArgs {
    /// The constants, with those of `d` for options that are not given. The error names the first one out of its range.
    pub fn over(&self, d: Constants) -> anyhow::Result<Constants> {
        let constants = Constants {
            alpha_min: self.alpha_min.unwrap_or(d.alpha_min),
            alpha_max: self.alpha_max.unwrap_or(d.alpha_max),
            t_min: self.t_min.unwrap_or(d.t_min),
            blur: self.blur.unwrap_or(d.blur),
            near: self.near.unwrap_or(d.near),
            ..d
        };
        let Constants { alpha_min, alpha_max, t_min, blur, near, .. } = constants;
        let checks = [
            (alpha_min > 0.0 && alpha_min < 1.0, "alpha-min", "a number above 0 and below 1", alpha_min),
            (alpha_max >= alpha_min && alpha_max < 1.0, "alpha-max", "at least --alpha-min, and below 1", alpha_max),
            ((0.0..1.0).contains(&t_min), "t-min", "a number of at least 0 and below 1", t_min),
            (blur > 0.0 && blur.is_finite(), "blur", "a positive number", blur),
            (near > 0.0 && near.is_finite(), "near", "a positive number", near),
        ];
        for (holds, name, expected, found) in checks {
            anyhow::ensure!(holds, "--{name}: expected {expected}, found {found}");
        }
        Ok(constants)
    }

    pub fn contradictions(&self, run: &Constants) -> Vec<String> {
        let all = [
            ("alpha-min", self.alpha_min, run.alpha_min),
            ("alpha-max", self.alpha_max, run.alpha_max),
            ("t-min", self.t_min, run.t_min),
            ("blur", self.blur, run.blur),
            ("near", self.near, run.near),
        ];
        let differ = |(name, asked, has): (&str, Option<f32>, f32)| {
            let asked = asked.filter(|asked| *asked != has)?;
            Some(contradiction(format_args!("--{name}"), has, asked))
        };
        all.into_iter().filter_map(differ).collect()
    }
}
