//! Adam's moments of every Gaussian on the device, as floats or two to a word (`include/moments.glsl`).

use super::planes::{Arrays, BAND_PLANES, PLANE_BLOCK, plane_of};
use super::{Group, Planes, SceneBuffers};
use crate::error::Result;
use crate::gpu::Gpu;
use crate::gpu::generated::constants::moments::{INFINITY_BITS, LARGEST_BITS};
use crate::scene::Splats;

const SIGN: u32 = 1 << 31;

pub struct Moments {
    /// By group. Of 32 bits in twice the planes of the parameters: 2p the first, 2p + 1 the second of plane p. Of 16 in as many as
    /// the parameters: words that share the bits of a float, as [`moment_word`] has them.
    pub groups: Vec<Planes>,
    pub bits: u32,
}

impl Moments {
    /// Moments of `scene`'s Gaussians, in its order. With 16 bits each is rounded to the nearest.
    pub fn upload(gpu: &Gpu, scene: &SceneBuffers, first: &Splats, second: &Splats, bits: u32) -> Result<Self> {
        let of_group = |group: &Group| {
            let n = group.n as usize;
            let [first, second] = [first, second].map(|of| Arrays::of(of, [0.0; 3], group.start, n));
            let both = |planes: usize, first: &[[f32; 4]], second: &[[f32; 4]]| match bits {
                16 => first.iter().zip(second).map(|(m, v)| std::array::from_fn(|k| moment_word(m[k], v[k]))).collect(),
                _ => interleaved(planes, n, first, second),
            };
            let bands = first.bands.iter().zip(&second.bands).zip(BAND_PLANES);
            let arrays = Arrays {
                geometry: both(3, &first.geometry, &second.geometry),
                sh0: both(1, &first.sh0, &second.sh0),
                bands: bands.map(|((first, second), planes)| both(planes, first, second)).collect(),
                motion: first.motion.as_ref().zip(second.motion.as_ref()).map(|(first, second)| both(1, first, second)),
            };
            arrays.upload(gpu, "moments")
        };
        Ok(Moments { groups: scene.groups.iter().map(of_group).collect::<Result<_>>()?, bits })
    }

    pub(super) fn undefined(&self, gpu: &Gpu, scene: &SceneBuffers) -> Result<Self> {
        let times = self.planes(1);
        let of_group =
            |group: &Group| Planes::alloc(gpu, "moments", group.n as usize, group.degree(), group.is_dynamic(), times);
        Ok(Moments { groups: scene.groups.iter().map(of_group).collect::<Result<_>>()?, bits: self.bits })
    }

    /// Planes of the moments of so many of parameters.
    pub(super) fn planes(&self, of_parameters: usize) -> usize {
        if self.bits == 16 { of_parameters } else { 2 * of_parameters }
    }

    /// The first and the second, in the order of `scene`'s Gaussians, to whom they belong.
    pub fn download(&self, gpu: &Gpu, scene: &SceneBuffers) -> Result<(Splats, Splats)> {
        let arrays = self.groups.iter().map(|planes| Arrays::read(gpu, planes)).collect::<Result<Vec<_>>>()?;
        let part = |of_word: fn(f32) -> f32, second: usize| -> Result<Splats> {
            let groups = scene.groups.iter().zip(&arrays);
            let of_group = |(group, arrays): (&Group, &Arrays)| {
                arrays.try_map(|planes, from| match self.bits {
                    16 => Ok(from.iter().map(|words| words.map(of_word)).collect()),
                    _ => Ok(every_other(from, planes, group.n as usize, second)),
                })
            };
            Ok(scene.assemble(&groups.map(of_group).collect::<Result<Vec<_>>>()?))
        };
        Ok((part(|word| moments_of(word)[0], 0)?, part(|word| moments_of(word)[1], 1)?))
    }
}

/// Both moments of a number in a word: the first above, as bfloat16; the second, which is never negative, below, as the 16 bits
/// after the sign of its float. Each is rounded to the nearest; what is finite stays so.
pub fn moment_word(first: f32, second: f32) -> f32 {
    let rounded = |x: f32, half: u32| match x.to_bits() & !SIGN {
        magnitude @ ..INFINITY_BITS => (magnitude + half).min(LARGEST_BITS),
        _ => INFINITY_BITS,
    };
    let (upper, lower) = (rounded(first, 1 << 15) >> 16 << 16, rounded(second, 1 << 14) >> 15);
    f32::from_bits(first.to_bits() & SIGN | upper | lower)
}

/// The first and the second moment of a word of [`moment_word`].
pub fn moments_of(word: f32) -> [f32; 2] {
    let bits = word.to_bits();
    [f32::from_bits(bits >> 16 << 16), f32::from_bits((bits & 0xffff) << 15)]
}

/// `planes` planes of first and second moments of `n` Gaussians, in turn.
fn interleaved(planes: usize, n: usize, first: &[[f32; 4]], second: &[[f32; 4]]) -> Vec<[f32; 4]> {
    let mut out = vec![[0.0; 4]; 2 * planes * n.next_multiple_of(PLANE_BLOCK)];
    for (i, p) in (0..n).flat_map(|i| (0..planes).map(move |p| (i, p))) {
        out[plane_of(i, 2 * planes, 2 * p)] = first[plane_of(i, planes, p)];
        out[plane_of(i, 2 * planes, 2 * p + 1)] = second[plane_of(i, planes, p)];
    }
    out
}

/// The planes of first (`second` = 0) or second (1) moments among `moments`, in the layout of the parameters.
fn every_other(moments: &[[f32; 4]], planes: usize, n: usize, second: usize) -> Vec<[f32; 4]> {
    let mut out = vec![[0.0; 4]; planes * n.next_multiple_of(PLANE_BLOCK)];
    for (i, p) in (0..n).flat_map(|i| (0..planes).map(move |p| (i, p))) {
        out[plane_of(i, planes, p)] = moments[plane_of(i, 2 * planes, 2 * p + second)];
    }
    out
}
