//! Bounds of a camera's numbers, far beyond every lens that is made: outside, a calibration is damaged or mistaken, and would make pictures
//! of no size or of billions of pixels.

use std::f64::consts::PI;

use super::lens::{Distortion, Lens};
use crate::scene::Intrinsics;

/// Focal lengths, in multiples of the picture's larger side. A fisheye of 220 degrees has 0.26, a 2,000 mm lens on film 56.
const FOCAL: std::ops::RangeInclusive<f64> = 0.001..=10_000.0;
/// How far the principal point may lie outside the picture, as that of a crop may, in multiples of its side.
const MAX_OUTSIDE: f64 = 100.0;
/// How much one coefficient of distortion may move the farthest corner, in multiples of its distance from the principal point.
const MAX_MOVE: f64 = 1e6;

impl Lens {
    /// The number that is out of its bounds, if one is, and what is allowed.
    pub fn fault(&self) -> Option<String> {
        let Lens { intrinsics: Intrinsics { width, height, fx, fy, cx, cy }, distortion } = *self;
        let larger = f64::from(width.max(height));
        let (least, most) = (FOCAL.start() * larger, FOCAL.end() * larger);
        let outside = |side: u32| (-MAX_OUTSIDE * f64::from(side), MAX_OUTSIDE * f64::from(side) + f64::from(side));
        let ranges = [("fx", fx, (least, most)), ("fy", fy, (least, most))];
        for (name, value, (least, most)) in
            ranges.into_iter().chain([("cx", cx, outside(width)), ("cy", cy, outside(height))])
        {
            // Written positively, so that NaN fails.
            if !(least..=most).contains(&value) {
                let allowed = format!("expected {least} to {most} for {width} x {height}");
                return Some(format!("has {name} = {value:?} pixels, {allowed}"));
            }
        }
        let named = match distortion {
            Distortion::Unified { alpha, .. } if !(0.0..=1.0).contains(&alpha) => Some(("alpha", alpha, "0 to 1")),
            Distortion::Unified { beta, .. } if !(1e-6..=1e6).contains(&beta) => Some(("beta", beta, "1e-6 to 1e6")),
            Distortion::FieldOfView(omega) if !(1e-6..PI).contains(&omega) => Some(("omega", omega, "0 to pi")),
            _ => None,
        };
        if let Some((name, value, allowed)) = named {
            return Some(format!("has the distortion {name} = {value:?}, expected {allowed}"));
        }
        let corner = |center: f64, side: u32, focal: f64| center.abs().max((f64::from(side) - center).abs()) / focal;
        let radius = corner(cx, width, fx).hypot(corner(cy, height, fy));
        let moves = |(name, value, power): (&str, f64, i32)| {
            let most = MAX_MOVE / radius.powi(power);
            let good = value.is_finite() && (value == 0.0 || value.abs() <= most);
            (!good).then(|| format!("has the distortion {name} = {value:?}, expected at most {most:.3e} in size"))
        };
        distortion.coefficients().into_iter().find_map(moves)
    }
}

impl Distortion {
    /// Names and values of the coefficients, and the power of the radius by which each scales a point's distance.
    fn coefficients(&self) -> Vec<(&'static str, f64, i32)> {
        match *self {
            Distortion::Brown { radial, tangential } => {
                let names = ["k1", "k2", "k3", "k4", "k5", "k6", "p1", "p2"];
                let values = radial.into_iter().chain(tangential);
                names
                    .into_iter()
                    .zip(values)
                    .zip([2, 4, 6, 2, 4, 6, 1, 1])
                    .map(|((name, k), power)| (name, k, power))
                    .collect()
            }
            Distortion::Division(k) => vec![("k", k, 2)],
            Distortion::None | Distortion::Unified { .. } | Distortion::FieldOfView(_) => Vec::new(),
            Distortion::Fisheye([k1, k2, k3, k4]) => vec![("k1", k1, 2), ("k2", k2, 4), ("k3", k3, 6), ("k4", k4, 8)],
        }
    }
}
