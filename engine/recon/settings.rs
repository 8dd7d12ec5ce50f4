//! Where the first Gaussians come from, and the numbers that they depend on.

/// Where the first Gaussians come from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Init {
    /// All that the capture has: dynamic Gaussians from points and flow of every frame (`Flow`) and, without those or
    /// if most cameras look inward, from foreground masks (`Hull`); static ones from the surfaces that the pictures
    /// show (`Frustum`), joined with the points.
    Auto,
    /// Static Gaussians from the points of the reference frame, dynamic ones from those of every frame, told apart by
    /// the flow (SPEC 5).
    Flow,
    /// As `Flow`, but a point moves if the flow at it exceeds the threshold in any view that saw it: the paper's rule.
    #[serde(rename = "any_view")]
    AnyView,
    /// The points of every frame, each visible around its time.
    Concat,
    /// The capture's points.
    Points,
    /// Dynamic Gaussians from visual hulls, frame by frame, and static ones as `Frustum`.
    Hull,
    /// Surfaces on which the cameras' pictures agree.
    Frustum,
    /// Grey points in the ball that the cameras are in.
    Random,
}

impl Init {
    /// Its name among the settings.
    pub fn name(self) -> &'static str {
        match self {
            Init::Auto => "auto",
            Init::Flow => "flow",
            Init::AnyView => "any_view",
            Init::Concat => "concat",
            Init::Points => "points",
            Init::Hull => "hull",
            Init::Frustum => "frustum",
            Init::Random => "random",
        }
    }
}

/// The numbers of a run that the first Gaussians depend on.
pub struct Settings {
    /// Where they come from.
    pub init: Init,
    /// Seed of the random points.
    pub seed: u64,
    /// Highest degree of the spherical harmonics.
    pub sh_degree: u32,
    /// Static Gaussians are wanted, too.
    pub trains_static: bool,
    /// Gaussians from surfaces, at most.
    pub n_points: usize,
    /// All Gaussians, at most.
    pub most: usize,
    /// How long points at rest are visible, clips; 0 makes them static.
    pub static_tau: f64,
}
