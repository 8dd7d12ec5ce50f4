//! The inputs of the reference: rules, a camera and raw parameters, all over one kind of number.

use super::math::scaled;
use super::real::Real;
use crate::scene::{FlowModel, Splats, View};
use crate::settings::Constants;

/// The rendering constants of SPEC 3 (see [`Constants`] for their meaning) as numbers of kind `R`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rules<R> {
    pub alpha_min: R,
    pub alpha_max: R,
    pub t_min: R,
    pub blur: R,
    pub near: R,
}

impl<R: Real> Rules<R> {
    /// The device's constants: what f32 holds, not the decimal that was written.
    pub fn new(constants: &Constants) -> Self {
        let c = |x: f32| R::from_f64(f64::from(x));
        Rules {
            alpha_min: c(constants.alpha_min),
            alpha_max: c(constants.alpha_max),
            t_min: c(constants.t_min),
            blur: c(constants.blur),
            near: c(constants.near),
        }
    }
}

/// A [`View`] as numbers of kind `R`. The world-to-camera map is taken to be rigid.
#[derive(Clone, Copy, Debug)]
pub struct Camera<R> {
    /// Rows of the world-to-camera rotation.
    pub rotation: [[R; 3]; 3],
    /// World-to-camera translation, scene units.
    pub translation: [R; 3],
    /// Camera centre in the world, scene units; computed in double precision and narrowed once.
    pub centre: [R; 3],
    /// Pixels, as are `principal` and `size`.
    pub focal: [R; 2],
    pub principal: [R; 2],
    pub size: [R; 2],
    /// Normalised time, without the camera's offset.
    pub time: R,
    /// Normalised time between two frames.
    pub flow_dt: R,
    /// Rotation and translation one frame on, where flow is a displacement.
    pub next: Option<([[R; 3]; 3], [R; 3])>,
}

impl<R: Real> Camera<R> {
    pub fn new(view: &View) -> Self {
        let m = &view.pose.rows();
        let centre: [f64; 3] = std::array::from_fn(|k| -(m[0][k] * m[0][3] + m[1][k] * m[1][3] + m[2][k] * m[2][3]));
        let rotation = |m: &[[f64; 4]; 4]| std::array::from_fn(|i| std::array::from_fn(|k| R::from_f64(m[i][k])));
        let translation = |m: &[[f64; 4]; 4]| std::array::from_fn(|i| R::from_f64(m[i][3]));
        let next = &view.next_pose.as_ref().unwrap_or(&view.pose).rows();
        Camera {
            rotation: rotation(m),
            translation: translation(m),
            centre: centre.map(R::from_f64),
            focal: [view.intrinsics.fx, view.intrinsics.fy].map(R::from_f64),
            principal: [view.intrinsics.cx, view.intrinsics.cy].map(R::from_f64),
            size: [view.intrinsics.width, view.intrinsics.height].map(|n| R::from_f64(f64::from(n))),
            time: R::from_f64(view.time),
            flow_dt: R::from_f64(view.flow_dt),
            next: match view.flow_model {
                FlowModel::Velocity => None,
                FlowModel::Displacement => Some((rotation(next), translation(next))),
            },
        }
    }

    /// t' of SPEC 2: the time that this camera really saw, for an offset in frames.
    pub fn shifted_time(&self, time_offset: R) -> R {
        self.time + time_offset * self.flow_dt
    }

    /// x / z (`axis` 0) or y / z (`axis` 1) of a centre, clamped as the Jacobian of SPEC 3 takes it.
    pub fn clamped(&self, ratio: R, axis: usize) -> R {
        let (size, focal, principal) = (self.size[axis], self.focal[axis], self.principal[axis]);
        let margin = R::from_f64(0.15) * size / focal;
        ratio.max(-(principal / focal + margin)).min((size - principal) / focal + margin)
    }
}

/// The temporal parameters of a dynamic Gaussian (SPEC 2), as in `scene::Motion`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Temporal<R> {
    pub velocity: [R; 3],
    pub t_center: R,
    pub t_scale: R,
}

/// One Gaussian's raw parameters (SPEC 2), as in [`Splats`].
#[derive(Clone, Copy, Debug)]
pub struct Gaussian<'a, R> {
    pub position: [R; 3],
    pub rotation: [R; 4],
    pub scale: [R; 3],
    pub opacity: R,
    pub sh: &'a [[R; 3]],
    /// `None` for a static Gaussian.
    pub motion: Option<Temporal<R>>,
}

impl<R: Real> Gaussian<'_, R> {
    /// mu(t') of SPEC 2, scene units.
    pub fn position_at(&self, time: R) -> [R; 3] {
        match self.motion {
            None => self.position,
            Some(motion) => super::math::add(self.position, scaled(motion.velocity, time - motion.t_center)),
        }
    }

    /// opacity(t') of SPEC 2. tau enters as exp(-log tau), which is 0 and not NaN for infinite tau, derivative included.
    pub fn opacity_at(&self, time: R) -> R {
        let base = R::one() / (R::one() + (-self.opacity).exp());
        match self.motion {
            None => base,
            Some(motion) => {
                let u = (time - motion.t_center) * (-motion.t_scale).exp();
                base * (-(u * u)).exp()
            }
        }
    }

    /// Velocity in the world, scene units per unit of normalised time.
    pub fn velocity(&self) -> [R; 3] {
        self.motion.map_or([R::zero(); 3], |motion| motion.velocity)
    }
}

/// Everything that a render can be differentiated by: a scene's parameters, the camera's time offset and the
/// background. Laid out as [`Splats`]: static Gaussians first.
#[derive(Clone, Debug, PartialEq)]
pub struct Params<R> {
    pub n_static: usize,
    /// Coefficients per Gaussian and channel: 1, 4, 9 or 16.
    pub n_coefficients: usize,
    pub position: Vec<[R; 3]>,
    pub rotation: Vec<[R; 4]>,
    pub scale: Vec<[R; 3]>,
    pub opacity: Vec<R>,
    pub sh: Vec<[R; 3]>,
    pub motion: Vec<Temporal<R>>,
    /// The camera's time offset, frames.
    pub time_offset: R,
    pub background: [R; 3],
}

impl<R: Real> Params<R> {
    pub fn new(splats: &Splats, view: &View) -> Self {
        let c = |x: f32| R::from_f64(f64::from(x));
        Params {
            n_static: splats.n_static,
            n_coefficients: splats.n_coefficients(),
            position: splats.position.iter().map(|p| p.map(c)).collect(),
            rotation: splats.rotation.iter().map(|q| q.map(c)).collect(),
            scale: splats.scale.iter().map(|s| s.map(c)).collect(),
            opacity: splats.opacity.iter().copied().map(c).collect(),
            sh: splats.sh.iter().map(|f| f.map(c)).collect(),
            motion: splats
                .motion
                .iter()
                .map(|m| Temporal { velocity: m.velocity.map(c), t_center: c(m.t_center), t_scale: c(m.t_scale) })
                .collect(),
            time_offset: R::from_f64(view.time_offset),
            background: view.background.map(c),
        }
    }

    pub fn len(&self) -> usize {
        self.position.len()
    }

    pub fn is_empty(&self) -> bool {
        self.position.is_empty()
    }

    /// Gaussian `i`, which must be below [`Params::len`].
    pub fn gaussian(&self, i: usize) -> Gaussian<'_, R> {
        Gaussian {
            position: self.position[i],
            rotation: self.rotation[i],
            scale: self.scale[i],
            opacity: self.opacity[i],
            sh: &self.sh[i * self.n_coefficients..(i + 1) * self.n_coefficients],
            motion: i.checked_sub(self.n_static).map(|k| self.motion[k]),
        }
    }

    /// Pairs every number with the one at the same place of `other`, which must have the same shape.
    pub fn zip<S: Real, T>(&self, other: &Params<S>, f: impl Fn(R, S) -> T + Copy) -> Params<T> {
        fn all<R: Real, S: Real, T, const N: usize>(
            a: &[[R; N]],
            b: &[[S; N]],
            f: impl Fn(R, S) -> T + Copy,
        ) -> Vec<[T; N]> {
            a.iter().zip(b).map(|(a, b)| std::array::from_fn(|k| f(a[k], b[k]))).collect()
        }
        Params {
            n_static: self.n_static,
            n_coefficients: self.n_coefficients,
            position: all(&self.position, &other.position, f),
            rotation: all(&self.rotation, &other.rotation, f),
            scale: all(&self.scale, &other.scale, f),
            opacity: self.opacity.iter().zip(&other.opacity).map(|(a, b)| f(*a, *b)).collect(),
            sh: all(&self.sh, &other.sh, f),
            motion: self
                .motion
                .iter()
                .zip(&other.motion)
                .map(|(a, b)| Temporal {
                    velocity: std::array::from_fn(|k| f(a.velocity[k], b.velocity[k])),
                    t_center: f(a.t_center, b.t_center),
                    t_scale: f(a.t_scale, b.t_scale),
                })
                .collect(),
            time_offset: f(self.time_offset, other.time_offset),
            background: std::array::from_fn(|k| f(self.background[k], other.background[k])),
        }
    }
}
