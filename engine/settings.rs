//! The rendering constants of SPEC 3: settings that belong to a run, not to a scene or a view.

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

/// What a frame may do in vain, leave out or round. By default it does nothing in vain and leaves out nothing that shows: the
/// picture is that of SPEC 3.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Knobs {
    /// The tiles that a Gaussian is listed for. Exact throughout.
    pub tile_bound: TileBound,
    /// Whether the blend skips the Gaussians of a tile's list that miss a subgroup's block of pixels. Exact throughout.
    pub block_cull: bool,
    /// Whether a Gaussian whose opacity is below alpha_min at a frame's time is left out before it is projected. If not, it is
    /// projected, and listed for the tiles of its square where that is the bound, as engines do that fade Gaussians in and out
    /// by their opacity alone. Exact throughout.
    pub time_cull: bool,
    /// Bits of the keys that Gaussians are sorted by: 32, all of the depth; 24 tell depths 1e-6 of them apart, 16 5e-4, up to
    /// 65,536 times the near plane. What they do not tell apart is in order of its index.
    pub depth_bits: u32,
    /// Bits of the coefficients of spherical harmonics above the constant one that projection reads: 32, or 16, halves that
    /// are made of the parameters, which keep all bits, whenever those change.
    pub sh_bits: u32,
    /// Contributions below this are left out too, where it is above alpha_min.
    pub alpha_cut: f32,
    /// A pixel whose transmittance has fallen below this is finished: what is left out would have had less than this weight
    /// in all. (t_min alone drops the Gaussian that would bring it below, however much that covers.)
    pub t_cut: f32,
    /// A Gaussian whose opacity is below this at a frame's time is left out, where it is above alpha_min.
    pub temporal_cut: f32,
}

/// The tiles that a Gaussian is listed for: those that the region where alpha reaches alpha_min touches, and more.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum TileBound {
    /// No more: the ellipse, row of tiles by row.
    #[default]
    Ellipse,
    /// Those of its bounding box.
    Rectangle,
    /// Those of 3DGS: of a square about the widest axis, whatever the opacity; wide enough to lose nothing (3DGS cuts at three
    /// standard deviations).
    Square,
}

impl Default for Knobs {
    fn default() -> Self {
        Knobs {
            tile_bound: TileBound::Ellipse,
            block_cull: true,
            time_cull: true,
            depth_bits: 32,
            sh_bits: 32,
            alpha_cut: 0.0,
            t_cut: 0.0,
            temporal_cut: 0.0,
        }
    }
}

impl Knobs {
    /// `constants` with these knobs, whose cut of alpha raises alpha_min.
    pub fn on(self, constants: Constants) -> Constants {
        let alpha_min = constants.alpha_min.max(self.alpha_cut);
        Constants { alpha_min, knobs: self, ..constants }
    }

    /// The first knob that cannot be.
    ///
    /// # Errors
    /// Its name and what is wrong.
    pub fn check(&self) -> Result<(), String> {
        if ![16, 24, 32].contains(&self.depth_bits) {
            return Err(format!("depth_bits is {}: it is 32, 24 or 16", self.depth_bits));
        }
        if ![16, 32].contains(&self.sh_bits) {
            return Err(format!("sh_bits is {}: it is 32 or 16", self.sh_bits));
        }
        if !self.time_cull && self.temporal_cut > 0.0 {
            return Err("temporal_cut leaves out what time_cull=false keeps: set one of them".to_owned());
        }
        let cuts = [("alpha_cut", self.alpha_cut), ("t_cut", self.t_cut), ("temporal_cut", self.temporal_cut)];
        match cuts.into_iter().find(|(_, cut)| !(0.0..0.5).contains(cut)) {
            Some((name, cut)) => Err(format!("{name} is {cut}: a cut is at least 0 and below 0.5")),
            None => Ok(()),
        }
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
