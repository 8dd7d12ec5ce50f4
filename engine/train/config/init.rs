//! Where the first Gaussians come from.

/// Where the first Gaussians come from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Init {
    /// All that the capture has: what moves from points and flow of every frame (`Flow`) or, without them, from foreground
    /// masks (`Hull`); what stands still from the surfaces that the pictures show (`Frustum`), joined with the points.
    Auto,
    /// What stands still from the points of the reference frame, what moves from those of every frame, told apart by the
    /// flow (SPEC 5).
    Flow,
    /// As `Flow`, but a point moves if the flow at it exceeds the threshold in any view that saw it: the paper's rule.
    #[serde(rename = "any_view")]
    AnyView,
    /// The points of every frame, each visible around its time.
    Concat,
    /// The capture's points.
    Points,
    /// The visual hull of what moves, frame by frame, and the rest as `Frustum`.
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
