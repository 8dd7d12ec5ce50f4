//! Where cameras differ from what their capture says, as an earlier run learnt it.

/// By how much a camera differs from what its capture says.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Calibration {
    /// By how much later than their frames say its pictures were taken, seconds.
    pub offset: f64,
    /// Turn about the axes of the capture's world, radians.
    pub turn: [f64; 3],
    /// Shift along those axes, the capture's units.
    pub shift: [f64; 3],
}
