//! The settings that the first Gaussians depend on.

/// Where the first Gaussians come from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Init {
    /// `Flow` if the capture has points of every frame and flow, and `Hull` if it has foreground masks; static ones as
    /// `Frustum`, joined with the points.
    Auto,
    /// Static Gaussians from the points of the reference frame, dynamic ones from those of every frame that the flow
    /// moves (SPEC 5).
    Flow,
    /// As `Flow`, but any view that saw a point move decides: the paper's rule.
    #[serde(rename = "any_view")]
    AnyView,
    /// The points of every frame, each visible around its time.
    Concat,
    Points,
    /// Dynamic Gaussians from visual hulls, frame by frame, and static ones as `Frustum`.
    Hull,
    /// Surfaces on which the cameras' pictures agree.
    Frustum,
    /// Grey points in the ball that the cameras are in.
    Random,
}

impl Init {
    pub fn name(self) -> String {
        serde_json::json!(self).as_str().unwrap_or_default().to_owned()
    }
}

pub struct Settings {
    pub init: Init,
    pub seed: u64,
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
