//! What a camera's numbers may be. The bounds are far beyond every lens that is made; what lies outside is a damaged or
//! mistaken calibration, and would make pictures of no size or of billions of pixels.

use std::f64::consts::PI;

use super::lens::{Distortion, Lens};
use crate::scene::Intrinsics;

/// Focal lengths, in multiples of the picture's larger side. A fisheye of 220 degrees has 0.26, a 2,000 mm lens on film 56.
const FOCAL: std::ops::RangeInclusive<f64> = 0.001..=10_000.0;
/// How far the principal point may lie outside the picture, in multiples of that side of it: crops of large pictures have it
/// outside.
const MAX_OUTSIDE: f64 = 100.0;
/// How much one coefficient of distortion may move a point at the picture's farthest corner, in multiples of the point's
/// distance from the principal point.
const MAX_MOVE: f64 = 1e6;

impl Lens {
    /// What is wrong with the numbers, if anything, with the name of the number and what is allowed: focal lengths of 0.001 to
    /// 10,000 times the larger side, a principal point at most 100 sides outside the picture, and coefficients that move no
    /// corner by more than 1,000,000 times its distance from the principal point.
    pub fn fault(&self) -> Option<String> {
        let Lens { intrinsics: Intrinsics { width, height, fx, fy, cx, cy }, distortion } = *self;
        let larger = f64::from(width.max(height));
        let (least, most) = (FOCAL.start() * larger, FOCAL.end() * larger);
        for (name, focal) in [("fx", fx), ("fy", fy)] {
            // Written positively, so that NaN fails.
            if !(least..=most).contains(&focal) {
                return Some(format!(
                    "has {name} = {focal:?} pixels, expected {least} to {most} for {width} x {height}"
                ));
            }
        }
        for (name, center, side) in [("cx", cx, width), ("cy", cy, height)] {
            let reach = MAX_OUTSIDE * f64::from(side);
            let (least, most) = (-reach, reach + f64::from(side));
            if !(least..=most).contains(&center) {
                return Some(format!(
                    "has {name} = {center:?} pixels, expected {least} to {most} for {width} x {height}"
                ));
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
    /// Names and values of the coefficients, and the power of the radius by which each moves a point relative to its distance.
    fn coefficients(&self) -> Vec<(&'static str, f64, i32)> {
        match *self {
            Distortion::None => Vec::new(),
            Distortion::Brown { radial: [k1, k2, k3, k4, k5, k6], tangential: [p1, p2] } => vec![
                ("k1", k1, 2),
                ("k2", k2, 4),
                ("k3", k3, 6),
                ("k4", k4, 2),
                ("k5", k5, 4),
                ("k6", k6, 6),
                ("p1", p1, 1),
                ("p2", p2, 1),
            ],
            Distortion::Division(k) => vec![("k", k, 2)],
            Distortion::Unified { .. } | Distortion::FieldOfView(_) => Vec::new(),
            Distortion::Fisheye([k1, k2, k3, k4]) => vec![("k1", k1, 2), ("k2", k2, 4), ("k3", k3, 6), ("k4", k4, 8)],
        }
    }
}
