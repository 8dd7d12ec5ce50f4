//! Where cameras differ from what their capture says, as an earlier run learnt it.

/// The correction of a camera.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Calibration {
    /// Delay of its pictures, seconds.
    pub offset: f64,
    /// Turn about the axes of the capture's world, radians.
    pub turn: [f64; 3],
    /// Shift along those axes, the capture's units.
    pub shift: [f64; 3],
}
