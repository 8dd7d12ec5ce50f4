//! Settings that belong to a run, not to a scene or a view: what a setting is, and the rendering constants of SPEC 3.

mod setting;

pub use setting::{Range, Setting};
pub(crate) use setting::{as_written, settings};

/// Rendering constants of SPEC 3. Two renders agree only when theirs do.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Constants {
    /// A Gaussian contributes to a pixel exactly when its alpha there is at least this.
    pub alpha_min: f32,
    /// Alpha is clamped to this, which bounds 1 / (1 - alpha) in the backward pass.
    pub alpha_max: f32,
    /// A Gaussian that would bring the transmittance below this is not added and the pixel is finished.
    pub t_min: f32,
    /// Variance added to the projected covariance's diagonal, square pixels.
    pub blur: f32,
    /// Gaussians whose centre has a camera depth of at most this are dropped, scene units.
    pub near: f32,
    /// How frames are computed; no part of what they are.
    #[serde(default)]
    pub knobs: Knobs,
}

settings! {
    /// What a frame may compute needlessly, leave out or round. By default it wastes nothing and leaves out nothing that shows: the
    /// picture is that of SPEC 3.
    #[derive(Copy)]
    pub struct Knobs in "frame." {
        /// Precision of the depth by which Gaussians are sorted. 0: by the device, 24 on a GPU and 32 on a CPU driver; 32 too
        /// where the near plane is below 2.33e-5.
        depth_bits: u32 = 0, "bits", Range::OneOf(&[0, 16, 24, 32]);
        /// Contributions to a pixel below this are left out.
        alpha_cut: f32 = 0.0, "", Range::CUT;
        /// A pixel that lets less light through than this is finished.
        t_cut: f32 = 0.0, "", Range::CUT;
        /// Gaussians fainter than this at a frame's time are left out.
        temporal_cut: f32 = 0.0, "", Range::CUT;
    } with {
        /// No setting: only tests have less than all.
        #[serde(skip)]
        culls: Culls,
    }
}

/// Culls that change no picture, for tests that compare frames with and without them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Culls {
    pub tile_bound: TileBound,
    pub block_cull: bool,
    /// True if culling drops the Gaussians that are invisible at a frame's time. Without it `temporal_cut` leaves out nothing.
    pub time_cull: bool,
}

impl Default for Culls {
    fn default() -> Self {
        Culls { tile_bound: TileBound::Ellipse, block_cull: true, time_cull: true }
    }
}

/// The tiles that a Gaussian is listed for: those that the region where alpha reaches alpha_min touches, and more.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TileBound {
    /// No more: the ellipse, row of tiles by row.
    Ellipse,
    /// Those of its bounding box.
    Rectangle,
    /// Those of 3DGS: of a square about the widest axis, whatever the opacity, wide enough to lose nothing.
    Square,
}

impl Knobs {
    /// `constants` with these knobs, whose cut of alpha raises alpha_min.
    #[doc(hidden)]
    pub fn on(self, constants: Constants) -> Constants {
        let alpha_min = constants.alpha_min.max(self.alpha_cut);
        Constants { alpha_min, knobs: self, ..constants }
    }

    #[doc(hidden)]
    pub fn check(&self) -> Result<(), String> {
        let group = serde_json::json!({ "frame": as_written(self)? });
        let check = |setting: &Setting| setting.of(&group).map_or(Ok(()), |value| setting.check(value));
        Self::SETTINGS.iter().try_for_each(check).map_err(|fault| fault.replacen("frame.", "", 1))
    }
}

impl Default for Constants {
    fn default() -> Self {
        Constants {
            alpha_min: 1.0 / 255.0,
            alpha_max: 0.99,
            t_min: 1e-4,
            blur: 0.3,
            near: 0.01,
            knobs: Knobs::default(),
        }
    }
}
