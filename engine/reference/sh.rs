//! Real spherical harmonics in 3DGS's order and signs, degree 0 to 3.

use super::real::Real;

/// The 16 basis functions at the unit vector `dir`; coefficient k of a Gaussian multiplies entry k.
pub fn basis<R: Real>(dir: [R; 3]) -> [R; 16] {
    let c = R::from_f64;
    let [x, y, z] = dir;
    let (xx, yy, zz) = (x * x, y * y, z * z);
    let (xy, yz, xz) = (x * y, y * z, x * z);
    [
        c(0.282_094_791_773_878_14),
        c(-0.488_602_511_902_919_9) * y,
        c(0.488_602_511_902_919_9) * z,
        c(-0.488_602_511_902_919_9) * x,
        c(1.092_548_430_592_079_2) * xy,
        c(-1.092_548_430_592_079_2) * yz,
        c(0.315_391_565_252_520_05) * (c(2.0) * zz - xx - yy),
        c(-1.092_548_430_592_079_2) * xz,
        c(0.546_274_215_296_039_6) * (xx - yy),
        c(-0.590_043_589_926_643_5) * y * (c(3.0) * xx - yy),
        c(2.890_611_442_640_554) * xy * z,
        c(-0.457_045_799_464_465_8) * y * (c(4.0) * zz - xx - yy),
        c(0.373_176_332_590_115_4) * z * (c(2.0) * zz - c(3.0) * xx - c(3.0) * yy),
        c(-0.457_045_799_464_465_8) * x * (c(4.0) * zz - xx - yy),
        c(1.445_305_721_320_277) * z * (xx - yy),
        c(-0.590_043_589_926_643_5) * x * (xx - c(3.0) * yy),
    ]
}

/// `max(0, SH(dir) + 0.5)` per channel, from 1, 4, 9 or 16 coefficients `[coefficient][RGB]`. Zero derivative where
/// the clamp holds.
pub fn color<R: Real>(coefficients: &[[R; 3]], dir: [R; 3]) -> [R; 3] {
    let basis = basis(dir);
    std::array::from_fn(|channel| {
        let mut sum = R::zero();
        for (coefficient, b) in coefficients.iter().zip(basis) {
            sum = sum + coefficient[channel] * b;
        }
        (sum + R::from_f64(0.5)).max(R::zero())
    })
}
