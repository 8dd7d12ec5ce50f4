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
}

impl Default for Constants {
    fn default() -> Self {
        Constants { alpha_min: 1.0 / 255.0, alpha_max: 0.99, t_min: 1e-4, blur: 0.3, near: 0.01 }
    }
}
