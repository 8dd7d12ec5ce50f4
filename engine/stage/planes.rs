//! Planes of numbers per Gaussian, as kernels read them: on the device, on the host, and from one to the other.

use crate::error::Result;
use crate::gpu::generated::constants;
use crate::gpu::{Buf, Gpu, PlaneSlices};
use crate::scene::{Motion, Splats};

pub(super) const PLANE_BLOCK: usize = constants::grid::PLANE_BLOCK as usize;
/// vec4 planes of bands 1 to 3.
pub(super) const BAND_PLANES: [usize; 3] = [3, 4, 6];
/// Planes of the sums of [`super::Response`].
pub(super) const FISHER_PLANES: usize = 6;

/// Something for each set of planes of a Gaussian's parameters, and of gradients and moments in their layout.
pub struct Layout<T> {
    /// Position and opacity; rotation; scale and t_scale.
    pub geometry: T,
    /// The constant band.
    pub sh0: T,
    /// Bands 1 to 3; as many as the degree.
    pub bands: Vec<T>,
    /// Velocity and t_center; dynamic groups only.
    pub motion: Option<T>,
}

pub type Planes = Layout<Buf<[f32; 4]>>;
pub(super) type Arrays = Layout<Vec<[f32; 4]>>;

impl<T> Layout<T> {
    /// Each through `f`, which receives how many planes the parameters have there.
    pub(super) fn try_map<U>(&self, f: impl Fn(usize, &T) -> Result<U>) -> Result<Layout<U>> {
        let bands = self.bands.iter().zip(BAND_PLANES);
        Ok(Layout {
            geometry: f(3, &self.geometry)?,
            sh0: f(1, &self.sh0)?,
            bands: bands.map(|(band, planes)| f(planes, band)).collect::<Result<_>>()?,
            motion: self.motion.as_ref().map(|motion| f(1, motion)).transpose()?,
        })
    }
}

impl Planes {
    /// The values of Gaussians `start..start + n` of `splats`, positions relative to `origin`.
    pub fn upload(gpu: &Gpu, splats: &Splats, start: usize, n: usize, origin: [f64; 3]) -> Result<Self> {
        Arrays::of(splats, origin, start, n).upload(gpu, "parameters")
    }

    /// Buffers of the same shape with undefined contents.
    pub fn like(gpu: &Gpu, other: &Planes, name: &str) -> Result<Self> {
        other.try_map(|_, buffer| gpu.alloc(name, buffer.len()))
    }

    /// Undefined numbers for `n` Gaussians, with `times` the planes of the parameters.
    pub(super) fn alloc(gpu: &Gpu, name: &str, n: usize, degree: usize, dynamic: bool, times: usize) -> Result<Self> {
        let shape = Layout { geometry: (), sh0: (), bands: vec![(); degree], motion: dynamic.then_some(()) };
        // A single plane is flat; its last block is as long as there are items.
        shape.try_map(|planes, ()| match planes * times {
            1 => gpu.alloc(name, n),
            planes => gpu.alloc(name, n.next_multiple_of(PLANE_BLOCK) * planes),
        })
    }

    /// vec4 planes of each of [`Planes::buffers`] of parameters.
    pub(super) fn plane_counts(&self) -> impl Iterator<Item = usize> {
        [3, 1].into_iter().chain(BAND_PLANES.into_iter().take(self.bands.len())).chain(self.motion.as_ref().map(|_| 1))
    }

    /// All of them for a kernel; in the place of one that there is not, the constant band, which it does not touch.
    pub(super) fn slices(&self) -> PlaneSlices {
        let [sh1, sh2, sh3] = [0, 1, 2].map(|band| self.bands.get(band).unwrap_or(&self.sh0).slice());
        let motion = self.motion.as_ref().unwrap_or(&self.sh0).slice();
        PlaneSlices { geometry: self.geometry.slice(), sh0: self.sh0.slice(), motion, sh1, sh2, sh3 }
    }

    /// All buffers, in the same order for planes of one shape.
    pub fn buffers(&self) -> impl Iterator<Item = &Buf<[f32; 4]>> {
        [&self.geometry, &self.sh0].into_iter().chain(&self.bands).chain(&self.motion)
    }
}

impl Arrays {
    pub(super) fn read(gpu: &Gpu, planes: &Planes) -> Result<Self> {
        planes.try_map(|_, buffer| gpu.read(buffer))
    }

    pub(super) fn upload(&self, gpu: &Gpu, name: &str) -> Result<Planes> {
        self.try_map(|_, data| gpu.upload(name, data))
    }

    pub(super) fn write_into(&self, out: &mut Splats, start: usize, n: usize) {
        let k = out.n_coefficients();
        for i in 0..n {
            let at = start + i;
            let [a, q, s] = [0, 1, 2].map(|plane| self.geometry[plane_of(i, 3, plane)]);
            out.position[at] = [a[0], a[1], a[2]];
            out.opacity[at] = a[3];
            out.rotation[at] = q;
            out.scale[at] = [s[0], s[1], s[2]];
            out.sh[at * k] = [self.sh0[i][0], self.sh0[i][1], self.sh0[i][2]];
            for (band, data) in self.bands.iter().enumerate().map(|(b, data)| (b + 1, data)) {
                let float = |f: usize| data[plane_of(i, BAND_PLANES[band - 1], f / 4)][f % 4];
                for c in 0..2 * band + 1 {
                    out.sh[at * k + band * band + c] = [float(3 * c), float(3 * c + 1), float(3 * c + 2)];
                }
            }
            if let Some(motion) = &self.motion {
                let m = motion[i];
                out.motion[at - out.n_static] = Motion { velocity: [m[0], m[1], m[2]], t_center: m[3], t_scale: s[3] };
            }
        }
    }

    /// The values of Gaussians `start..start + n` of `splats`, all of one bucket, positions relative to `origin`.
    pub(super) fn of(splats: &Splats, origin: [f64; 3], start: usize, n: usize) -> Self {
        let dynamic = start >= splats.n_static;
        let motion_of = |i: usize| splats.motion[start + i - splats.n_static];
        let geometry = planes(n, |i| {
            let g = start + i;
            let p: [f32; 3] = std::array::from_fn(|k| (f64::from(splats.position[g][k]) - origin[k]) as f32);
            let s = splats.scale[g];
            let t_scale = if dynamic { motion_of(i).t_scale } else { 0.0 };
            [[p[0], p[1], p[2], splats.opacity[g]], splats.rotation[g], [s[0], s[1], s[2], t_scale]]
        });
        let k = splats.n_coefficients();
        let coefficient = |i: usize, c: usize| splats.sh[(start + i) * k + c];
        let sh0: Vec<[f32; 4]> = (0..n).map(|i| coefficient(i, 0)).map(|[r, g, b]| [r, g, b, 0.0]).collect();
        // Band l holds coefficients l^2 .. (l+1)^2, their colours one after the other.
        let float = |i: usize, band: usize, f: usize| {
            let c = f / 3;
            if c < 2 * band + 1 { coefficient(i, band * band + c)[f % 3] } else { 0.0 }
        };
        let vec4 = |i: usize, band: usize, p: usize| std::array::from_fn(|j| float(i, band, 4 * p + j));
        let band = |band| match band {
            1 => planes::<3>(n, |i| std::array::from_fn(|p| vec4(i, 1, p))),
            2 => planes::<4>(n, |i| std::array::from_fn(|p| vec4(i, 2, p))),
            _ => planes::<6>(n, |i| std::array::from_fn(|p| vec4(i, 3, p))),
        };
        let bands = (1..=splats.degree_of(start)).map(band).collect();
        let of_motion = |m: Motion| [m.velocity[0], m.velocity[1], m.velocity[2], m.t_center];
        let motion = dynamic.then(|| (0..n).map(|i| of_motion(motion_of(i))).collect());
        Arrays { geometry, sh0, bands, motion }
    }
}

/// Place of plane `p` of item `i` among `planes` planes; as `plane_index` of include/grid.glsl has it.
pub(super) fn plane_of(i: usize, planes: usize, p: usize) -> usize {
    (i / PLANE_BLOCK * planes + p) * PLANE_BLOCK + i % PLANE_BLOCK
}

/// `n` items of `planes` vec4 each, from `value(item)[plane]`, in blocks of [`PLANE_BLOCK`].
fn planes<const P: usize>(n: usize, value: impl Fn(usize) -> [[f32; 4]; P]) -> Vec<[f32; 4]> {
    let mut out = vec![[0.0; 4]; n.next_multiple_of(PLANE_BLOCK) * P];
    for i in 0..n {
        for (p, v) in value(i).into_iter().enumerate() {
            out[plane_of(i, P, p)] = v;
        }
    }
    out
}
