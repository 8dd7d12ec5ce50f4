//! Scenes as lists of single Gaussians: easy to make, to leave one out and to reorder.

use super::random;
use ivv::internals::scene::{Intrinsics, Motion, Pose, SH_C0, Splats, View};

/// One Gaussian in raw parameters (SPEC 2).
#[derive(Clone, Debug)]
pub struct One {
    pub position: [f32; 3],
    /// Quaternion, w first, of any length.
    pub rotation: [f32; 4],
    /// Logs of the standard deviations.
    pub scale: [f32; 3],
    /// Logit.
    pub opacity: f32,
    /// Coefficients of its colour: 1, 4, 9 or 16.
    pub sh: Vec<[f32; 3]>,
    /// `None` for a static Gaussian.
    pub motion: Option<Motion>,
}

/// A static Gaussian as round as a ball, of degree 0, with the given standard deviation, scene units, and opacity in (0, 1).
pub fn ball(position: [f32; 3], deviation: f64, opacity: f64, color: [f64; 3]) -> One {
    One {
        position,
        rotation: [1.0, 0.0, 0.0, 0.0],
        scale: [deviation.ln() as f32; 3],
        opacity: logit(opacity),
        sh: vec![sh_of(color)],
        motion: None,
    }
}

/// An ordinary Gaussian, to stand behind all others.
pub fn backdrop() -> One {
    ball([0.3, 0.1, 6.0], 0.6, 0.7, [0.9, 0.3, 0.1])
}

pub fn logit(opacity: f64) -> f32 {
    (opacity / (1.0 - opacity)).ln() as f32
}

/// The constant coefficient that shows as `color`.
pub fn sh_of(color: [f64; 3]) -> [f32; 3] {
    color.map(|c| ((c - 0.5) / SH_C0) as f32)
}

/// The scene of `all`, static ones first, otherwise in the order given.
pub fn scene_of(all: &[One]) -> Splats {
    let n_coefficients = all.first().map_or(1, |one| one.sh.len());
    let mut splats = Splats::new(n_coefficients.isqrt() as u32 - 1);
    let (fixed, moving): (Vec<_>, Vec<_>) = all.iter().partition(|one| one.motion.is_none());
    splats.n_static = fixed.len();
    for (i, one) in fixed.into_iter().chain(moving).enumerate() {
        splats.position.push(one.position);
        splats.rotation.push(one.rotation);
        splats.scale.push(one.scale);
        splats.opacity.push(one.opacity);
        splats.sh.extend(&one.sh);
        splats.motion.extend(one.motion);
        splats.source_row.push(i as u32);
    }
    splats
}

pub fn ones(splats: &Splats) -> Vec<One> {
    let k = splats.n_coefficients();
    (0..splats.len())
        .map(|i| One {
            position: splats.position[i],
            rotation: splats.rotation[i],
            scale: splats.scale[i],
            opacity: splats.opacity[i],
            sh: splats.sh[i * k..(i + 1) * k].to_vec(),
            motion: i.checked_sub(splats.n_static).map(|m| splats.motion[m]),
        })
        .collect()
}

/// A camera at the origin that looks along z, `width` x `height` pixels, focal length 64 px, centred.
pub fn camera(width: u32, height: u32) -> View {
    let [cx, cy] = [width, height].map(|side| f64::from(side) / 2.0);
    View {
        name: format!("{width}x{height}"),
        intrinsics: Intrinsics { width, height, fx: 64.0, fy: 64.0, cx, cy },
        pose: Pose::default(),
        time: 0.5,
        time_offset: 0.0,
        flow_dt: 0.125,
        background: [0.2, 0.4, 0.1],
        ..random::view()
    }
}

pub fn with(mut view: View, change: impl FnOnce(&mut Intrinsics)) -> View {
    change(&mut view.intrinsics);
    view
}

/// The world position that `view`, a camera at the origin looking along z, shows at pixel (`x`, `y`) at depth `z`.
pub fn at_pixel(view: &View, x: f64, y: f64, z: f64) -> [f32; 3] {
    [(x - view.intrinsics.cx) / view.intrinsics.fx * z, (y - view.intrinsics.cy) / view.intrinsics.fy * z, z]
        .map(|v| v as f32)
}
