//! One camera at one time (SPEC 9, "Cameras").

/// A pinhole camera at one time. Double precision on the host; narrowed once when it goes to the device.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct View {
    /// Names the output files.
    pub name: String,
    /// Pixels.
    pub width: u32,
    /// Pixels.
    pub height: u32,
    /// Focal length in x, pixels.
    pub fx: f64,
    /// Focal length in y, pixels.
    pub fy: f64,
    /// Principal point in x, pixels; pixel (0, 0) has its centre at (0.5, 0.5).
    pub cx: f64,
    /// Principal point in y, pixels.
    pub cy: f64,
    /// Rows of the 4 x 4 matrix that maps world to camera (x right, y down, z forward).
    pub world_to_camera: [[f64; 4]; 4],
    /// Normalised time.
    #[serde(default)]
    pub time: f64,
    /// The camera's time offset in frames; it shifts time by `time_offset * flow_dt`.
    #[serde(default)]
    pub time_offset: f64,
    /// Normalised time between two frames, the step that flow is measured over.
    #[serde(default = "one")]
    pub flow_dt: f64,
    /// Colour behind the scene.
    #[serde(default)]
    pub background: [f32; 3],
}

fn one() -> f64 {
    1.0
}
