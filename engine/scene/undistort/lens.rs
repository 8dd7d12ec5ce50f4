//! Lenses as COLMAP and OpenCV describe them, and their inverse.

use crate::scene::Intrinsics;

/// Beyond this tangent of the angle to the optical axis (87 degrees) no ray is followed.
const MAX_TANGENT: f64 = 20.0;
/// Steps in which the first fold of a lens is looked for.
const FOLD_STEPS: u32 = 4000;
const NEWTON_STEPS: usize = 50;
/// Last step of Newton's method, relative to its result.
const CLOSE: f64 = 4.0 * f64::EPSILON;
/// Residual of the inverse, on the plane at distance 1.
const CONVERGED: f64 = 1e-12;
/// How far a pinhole may reach to each side of the principal point, in multiples of the image: wide lenses would make huge pictures whose
/// borders have no detail.
const MAX_GROWTH: f64 = 2.0;
/// Largest width or height of a pinhole, pixels.
const MAX_SIDE: f64 = 65_536.0;

/// Where a lens maps a point (x, y) of the plane at distance 1.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub enum Distortion {
    None,
    /// Brown and Conrady's, as in OpenCV: SIMPLE_RADIAL, RADIAL, OPENCV and FULL_OPENCV of COLMAP.
    Brown {
        /// k1 to k6: r is scaled by `(1 + k1 r^2 + k2 r^4 + k3 r^6) / (1 + k4 r^2 + k5 r^4 + k6 r^6)`.
        radial: [f64; 6],
        tangential: [f64; 2],
    },
    /// Kannala and Brandt's, as in OpenCV: OPENCV_FISHEYE, RADIAL_FISHEYE and SIMPLE_RADIAL_FISHEYE of COLMAP. The angle t
    /// becomes the radius `t (1 + k1 t^2 + k2 t^4 + k3 t^6 + k4 t^8)`.
    Fisheye([f64; 4]),
    /// Fitzgibbon's, DIVISION of COLMAP: r becomes `2 r / (1 + sqrt(1 - 4 k r^2))`.
    Division(f64),
    /// The enhanced unified model of Khomutenko et al., EUCM of COLMAP: r becomes
    /// `r / (alpha sqrt(beta r^2 + 1) + 1 - alpha)`.
    Unified {
        /// 0, a pinhole, to 1.
        alpha: f64,
        /// Positive.
        beta: f64,
    },
    /// Devernay and Faugeras's, FOV of COLMAP: r becomes `atan(2 r tan(omega / 2)) / omega`.
    FieldOfView(f64),
}

impl Distortion {
    /// The distortion with k1 to k6, p1 and p2; [`Distortion::None`] when all are 0.
    pub fn brown(radial: [f64; 6], tangential: [f64; 2]) -> Self {
        if radial.iter().chain(&tangential).all(|k| *k == 0.0) {
            return Distortion::None;
        }
        Distortion::Brown { radial, tangential }
    }

    /// Itself, or [`Distortion::None`] when it is a pinhole.
    pub fn simplified(self) -> Self {
        match self {
            Distortion::Division(0.0) | Distortion::Unified { alpha: 0.0, .. } | Distortion::FieldOfView(0.0) => {
                Distortion::None
            }
            other => other,
        }
    }

    /// COLMAP's name of the simplest model that holds the parameters.
    pub fn model(&self) -> &'static str {
        match self {
            Distortion::None => "PINHOLE",
            Distortion::Fisheye(_) => "OPENCV_FISHEYE",
            Distortion::Division(_) => "DIVISION",
            Distortion::Unified { .. } => "EUCM",
            Distortion::FieldOfView(_) => "FOV",
            Distortion::Brown { radial: [_, k2, rest @ ..], tangential } => {
                match (rest == &[0.0; 4], tangential == &[0.0; 2], *k2 == 0.0) {
                    (false, _, _) => "FULL_OPENCV",
                    (true, false, _) => "OPENCV",
                    (true, true, false) => "RADIAL",
                    (true, true, true) => "SIMPLE_RADIAL",
                }
            }
        }
    }

    /// True for a map of angles from the optical axis, false for one of radii of the plane at distance 1.
    fn is_angular(&self) -> bool {
        matches!(self, Distortion::Fisheye(_))
    }

    /// The map of a radius (of Brown's without the tangential part) or an angle (fisheye), and its derivative.
    fn radial(&self, at: f64) -> (f64, f64) {
        let square = at * at;
        match self {
            Distortion::None => (at, 1.0),
            Distortion::Brown { radial, .. } => {
                let (scale, slope) = ratio(radial, square);
                (at * scale, scale + 2.0 * square * slope)
            }
            Distortion::Fisheye([k1, k2, k3, k4]) => {
                let value = 1.0 + square * (k1 + square * (k2 + square * (k3 + square * k4)));
                let slope = 1.0 + square * (3.0 * k1 + square * (5.0 * k2 + square * (7.0 * k3 + square * 9.0 * k4)));
                (at * value, slope)
            }
            Distortion::Division(k) => {
                let root = (1.0 - 4.0 * k * square).sqrt();
                let scale = 2.0 / (1.0 + root);
                (at * scale, scale + 2.0 * k * square * scale * scale / root)
            }
            Distortion::Unified { alpha, beta } => {
                let root = (beta * square + 1.0).sqrt();
                let below = alpha * root + 1.0 - alpha;
                (at / below, (below - alpha * beta * square / root) / (below * below))
            }
            Distortion::FieldOfView(omega) => {
                let wide = 2.0 * (omega / 2.0).tan();
                ((at * wide).atan() / omega, wide / (omega * (1.0 + square * wide * wide)))
            }
        }
    }

    /// The radius or angle that is mapped to `value`, at most `reach`.
    fn radial_inverse(&self, value: f64, reach: f64) -> f64 {
        let (mut low, mut high) = (0.0, reach);
        let mut at = value.min(reach);
        for _ in 0..NEWTON_STEPS {
            let (found, slope) = self.radial(at);
            let newton = at - (found - value) / slope;
            // Rounding may put the last step just outside the bracket, from where bisection would lead far away.
            if (newton - at).abs() <= CLOSE * at {
                break;
            }
            if found > value {
                high = at;
            } else {
                low = at;
            }
            // Newton's step where it stays in the bracket, bisection elsewhere.
            at = if newton > low && newton < high { newton } else { 0.5 * (low + high) };
        }
        at
    }

    fn distort(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        match self {
            Distortion::None => [x, y],
            Distortion::Brown { radial, tangential: [p1, p2] } => {
                let square = x * x + y * y;
                let (scale, _) = ratio(radial, square);
                [
                    x * scale + 2.0 * p1 * x * y + p2 * (square + 2.0 * x * x),
                    y * scale + p1 * (square + 2.0 * y * y) + 2.0 * p2 * x * y,
                ]
            }
            _ => {
                let r = x.hypot(y);
                let measure = if self.is_angular() { r.atan() } else { r };
                // In the middle the scale is the slope of the radius.
                let scale = if r > 0.0 { self.radial(measure).0 / r } else { self.radial(0.0).1 };
                [x * scale, y * scale]
            }
        }
    }

    /// The point that [`Distortion::distort`] maps to `at`; `None` where no point within reach does.
    fn undistort(&self, at: [f64; 2], reach: f64) -> Option<[f64; 2]> {
        let r = at[0].hypot(at[1]);
        if r == 0.0 || *self == Distortion::None {
            return Some(at);
        }
        let inverse = self.radial_inverse(r, reach);
        let Distortion::Brown { radial, tangential: [p1, p2] } = self else {
            let found = (self.radial(inverse).0 - r).abs() <= CONVERGED * r.max(1.0);
            let inverse = if self.is_angular() { inverse.tan() } else { inverse };
            return found.then(|| at.map(|v| v / r * inverse));
        };
        // The radial part is where Newton's method in the plane begins.
        let [mut x, mut y] = at.map(|v| v / r * inverse);
        for _ in 0..NEWTON_STEPS {
            let found = self.distort([x, y]);
            let residual = [found[0] - at[0], found[1] - at[1]];
            if residual[0].hypot(residual[1]) <= CONVERGED * r.max(1.0) {
                return (x.hypot(y) <= reach).then_some([x, y]);
            }
            let (scale, slope) = ratio(radial, x * x + y * y);
            let cross = 2.0 * (x * y * slope + p1 * x + p2 * y);
            let a = scale + 2.0 * x * x * slope + 2.0 * p1 * y + 6.0 * p2 * x;
            let d = scale + 2.0 * y * y * slope + 6.0 * p1 * y + 2.0 * p2 * x;
            let determinant = a * d - cross * cross;
            x -= (d * residual[0] - cross * residual[1]) / determinant;
            y -= (a * residual[1] - cross * residual[0]) / determinant;
        }
        None
    }
}

/// The ratio of polynomials in the squared radius, and its derivative by that.
fn ratio([k1, k2, k3, k4, k5, k6]: &[f64; 6], s: f64) -> (f64, f64) {
    let above = 1.0 + s * (k1 + s * (k2 + s * k3));
    let below = 1.0 + s * (k4 + s * (k5 + s * k6));
    let (above_slope, below_slope) = (k1 + s * (2.0 * k2 + s * 3.0 * k3), k4 + s * (2.0 * k5 + s * 3.0 * k6));
    (above / below, (above_slope * below - above * below_slope) / (below * below))
}

/// A pinhole behind a distortion.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Lens {
    #[serde(flatten)]
    pub intrinsics: Intrinsics,
    pub distortion: Distortion,
}

impl Lens {
    /// With [`Intrinsics::scaled`].
    pub fn resized(&self, width: u32, height: u32) -> Lens {
        Lens { intrinsics: self.intrinsics.scaled(width, height), ..*self }
    }

    /// The pinhole of the undistorted pictures. It keeps the focal lengths, and shows the largest rectangle inside the image's border, to
    /// each side at most twice as far as the image. Where the inverse does not converge on the border, the rectangle may have pixels that
    /// nothing shows, see [`super::Undistortion::validity`]. `None` when nothing is left, or a side would have more than 65,536 pixels.
    pub fn pinhole(&self) -> Option<Lens> {
        if self.distortion == Distortion::None {
            return Some(*self);
        }
        let reach = self.reach();
        let Intrinsics { width, height, fx, fy, cx, cy } = self.intrinsics;
        let (w, h) = (f64::from(width), f64::from(height));
        // Pixel centres on the border, so that nothing is interpolated beyond them.
        let row = |y: f64| (0..width).filter_map(move |x| Some(self.plane([f64::from(x) + 0.5, y], reach)?[1]));
        let column = |x: f64| (0..height).filter_map(move |y| Some(self.plane([x, f64::from(y) + 0.5], reach)?[0]));
        let left = column(0.5).fold(-MAX_GROWTH * (cx - 0.5) / fx, f64::max);
        let right = column(w - 0.5).fold(MAX_GROWTH * (w - 0.5 - cx) / fx, f64::min);
        let top = row(0.5).fold(-MAX_GROWTH * (cy - 0.5) / fy, f64::max);
        let bottom = row(h - 0.5).fold(MAX_GROWTH * (h - 0.5 - cy) / fy, f64::min);
        let side = |length: f64| (0.0..MAX_SIDE).contains(&length).then(|| length as u32 + 1);
        let intrinsics = Intrinsics {
            width: side((right - left) * fx)?,
            height: side((bottom - top) * fy)?,
            fx,
            fy,
            cx: 0.5 - left * fx,
            cy: 0.5 - top * fy,
        };
        Some(Lens { intrinsics, distortion: Distortion::None })
    }

    /// The radius or angle up to which the map rises, for [`Lens::pixel`] and [`Lens::plane`]; beyond it the picture would fold over itself.
    pub fn reach(&self) -> f64 {
        let end = if self.distortion.is_angular() { MAX_TANGENT.atan() } else { MAX_TANGENT };
        let at = |step: u32| end * f64::from(step) / f64::from(FOLD_STEPS);
        let rises = |step: u32| {
            let (value, slope) = self.distortion.radial(at(step));
            value.is_finite() && value >= 0.0 && slope > 0.0
        };
        at((1..=FOLD_STEPS).find(|&step| !rises(step)).map_or(FOLD_STEPS, |step| step - 1))
    }

    /// The pixel that shows a point of the plane at distance 1; `None` beyond `reach`.
    pub fn pixel(&self, at: [f64; 2], reach: f64) -> Option<[f64; 2]> {
        let r = at[0].hypot(at[1]);
        let measure = if self.distortion.is_angular() { r.atan() } else { r };
        if self.distortion != Distortion::None && measure > reach {
            return None;
        }
        let [x, y] = self.distortion.distort(at);
        let Intrinsics { fx, fy, cx, cy, .. } = self.intrinsics;
        Some([x * fx + cx, y * fy + cy])
    }

    /// The point of the plane at distance 1 that a pixel shows; `None` when it shows none or the inverse does not converge.
    pub fn plane(&self, [x, y]: [f64; 2], reach: f64) -> Option<[f64; 2]> {
        let Intrinsics { fx, fy, cx, cy, .. } = self.intrinsics;
        self.distortion.undistort([(x - cx) / fx, (y - cy) / fy], reach)
    }
}
