//! LPIPS of a pair of pictures through small random networks, on the device and in dual numbers.

use crate::extremes::random::Random;
use crate::files::{read_tensors, write_tensors};
use crate::gpu::{Gpu, Recording};
use crate::stage::{Compared, Cotangent, Lpips, Trunk};
use crate::twin::{self, Dual};
use anyhow::{Result, ensure};
use std::collections::BTreeMap;
use std::path::Path;

const GUARD: [f32; 4] = [1.5, -2.5, 3.5, -4.5];

/// Tensors of a file of weights: shapes and values, by name.
pub type Weights = BTreeMap<String, (Vec<usize>, Vec<f32>)>;

/// Channels of AlexNet's layers; of SqueezeNet's first layer and of its modules, each squeezed and expanded twice. Narrower
/// than they are: no width but one is a multiple of 16.
const NARROW_ALEXNET: [usize; 5] = [12, 20, 16, 8, 4];
const NARROW_SQUEEZENET: [usize; 25] =
    [12, 4, 8, 12, 8, 4, 8, 4, 12, 8, 8, 8, 4, 4, 8, 8, 4, 4, 12, 8, 8, 4, 4, 16, 20];

/// Random weights of a trunk with these widths, so that features neither die nor grow.
fn weights(seed: u64, trunk: Trunk, widths: &[usize]) -> Weights {
    let mut random = Random::new(seed);
    let mut all = Weights::new();
    let mut taps = Vec::new();
    let mut conv = |name: String, outputs: usize, inputs: usize, kernel: usize| {
        let bound = (3.0 / (inputs * kernel * kernel) as f64).sqrt();
        let mut values = |n: usize, low, high| (0..n).map(|_| random.uniform(low, high) as f32).collect::<Vec<_>>();
        let n = outputs * inputs * kernel * kernel;
        all.insert(format!("{name}.weight"), (vec![outputs, inputs, kernel, kernel], values(n, -bound, 1.3 * bound)));
        all.insert(format!("{name}.bias"), (vec![outputs], values(outputs, -0.1, 0.2)));
    };
    match trunk {
        Trunk::AlexNet => {
            let mut inputs = 3;
            for ((layer, kernel), outputs) in [(0, 11), (3, 5), (6, 3), (8, 3), (10, 3)].into_iter().zip(widths) {
                conv(format!("features.{layer}"), *outputs, inputs, kernel);
                taps.push(*outputs);
                inputs = *outputs;
            }
        }
        Trunk::SqueezeNet => {
            conv("features.0".into(), widths[0], 3, 3);
            taps.push(widths[0]);
            let mut inputs = widths[0];
            for (module, widths) in [3, 4, 6, 7, 9, 10, 11, 12].into_iter().zip(widths[1..].chunks(3)) {
                conv(format!("features.{module}.squeeze"), widths[0], inputs, 1);
                conv(format!("features.{module}.expand1x1"), widths[1], widths[0], 1);
                conv(format!("features.{module}.expand3x3"), widths[2], widths[0], 3);
                inputs = widths[1] + widths[2];
                if ![3, 6].contains(&module) {
                    taps.push(inputs);
                }
            }
        }
    }
    for (k, n) in taps.into_iter().enumerate() {
        let values = (0..n).map(|_| random.uniform(0.0, 1.0) as f32).collect();
        all.insert(format!("lin{k}.model.1.weight"), (vec![1, n, 1, 1], values));
    }
    all
}

/// Random weights of a narrow trunk.
pub fn narrow(seed: u64, trunk: Trunk) -> Weights {
    match trunk {
        Trunk::AlexNet => weights(seed, trunk, &NARROW_ALEXNET),
        Trunk::SqueezeNet => weights(seed, trunk, &NARROW_SQUEEZENET),
    }
}

/// Writes weights to a file.
///
/// # Errors
/// Those of writing.
pub fn save(path: &Path, weights: &Weights) -> Result<()> {
    let list: Vec<(&str, &[usize], &[f32])> =
        weights.iter().map(|(name, (shape, values))| (name.as_str(), shape.as_slice(), values.as_slice())).collect();
    Ok(write_tensors(path, &list)?)
}

/// Calls `read` with a file of `weights` that is gone afterwards.
fn with_file<T>(weights: &Weights, read: impl FnOnce(&Path) -> crate::Result<T>) -> Result<T> {
    let name = format!("ivv-lpips-{}-{:?}.safetensors", std::process::id(), std::thread::current().id());
    let path = std::env::temp_dir().join(name);
    let done = save(&path, weights).and_then(|()| Ok(read(&path)?));
    // A small file in the folder for them, should it stay.
    let _ = std::fs::remove_file(&path);
    done
}

/// The network of `weights`.
///
/// # Errors
/// Those of the loader and of the device.
pub fn load(gpu: &Gpu, weights: &Weights) -> Result<Lpips> {
    with_file(weights, |path| Lpips::load(gpu, path))
}

/// A picture, the truth and the part of them that is compared.
#[derive(Clone)]
pub struct Pair {
    /// Width and height.
    pub size: [u32; 2],
    /// First pixel of the part.
    pub origin: [u32; 2],
    /// Width and height of the part.
    pub crop: [u32; 2],
    /// Colours.
    pub image: Vec<[f32; 3]>,
    /// Pixels of the truth: bytes r, g, b and mask.
    pub truth: Vec<u32>,
}

/// What the device makes of a pair.
#[derive(Clone, Debug, PartialEq)]
pub struct Found {
    /// LPIPS, as bits.
    pub value: u32,
    /// Of the whole picture, as bits, so that -0 and 0 differ.
    pub d_image: Vec<[u32; 3]>,
}

const WEIGHT: f32 = 0.5;

impl Pair {
    /// Noise against noise; `mask` says what the mask holds at a pixel.
    pub fn random(seed: u64, crop: [u32; 2], mask: impl Fn(usize) -> u32) -> Self {
        let mut random = Random::new(seed);
        let n = (crop[0] * crop[1]) as usize;
        let truth = (0..n).map(|i| random.bits() as u32 & 0xff_ffff | mask(i) << 24).collect();
        let image = (0..n).map(|_| random.vector(0.0, 1.0)).collect();
        Pair { size: crop, origin: [0, 0], crop, image, truth }
    }

    /// A picture of one colour against another.
    pub fn flat(crop: [u32; 2], image: f32, truth: u8) -> Self {
        let n = (crop[0] * crop[1]) as usize;
        let truth = vec![u32::from_le_bytes([truth, truth, truth, 255]); n];
        Pair { size: crop, origin: [0, 0], crop, image: vec![[image; 3]; n], truth }
    }

    /// The same part of a larger picture of noise.
    pub fn within(&self, size: [u32; 2], origin: [u32; 2]) -> Self {
        let mut large = Pair { origin, crop: self.crop, ..Pair::random(99, size, |_| 255) };
        for y in 0..self.crop[1] {
            for x in 0..self.crop[0] {
                let (from, to) = (y * self.crop[0] + x, (origin[1] + y) * size[0] + origin[0] + x);
                large.image[to as usize] = self.image[from as usize];
                large.truth[to as usize] = self.truth[from as usize];
            }
        }
        large
    }

    /// LPIPS of the whole picture with a derivative along `w`.
    ///
    /// # Errors
    /// Those of the file that the weights go through.
    pub fn dual(&self, weights: &Weights, w: &[[f32; 3]]) -> Result<Dual> {
        let tensors = with_file(weights, read_tensors)?;
        let dual = |(x, w): (&[f32; 3], &[f32; 3])| std::array::from_fn(|k| Dual::new(x[k].into(), w[k].into()));
        let image: Vec<[Dual; 3]> = self.image.iter().zip(w).map(dual).collect();
        Ok(twin::lpips(&tensors, &image, &self.truth, self.size.map(|n| n as usize)))
    }

    /// The device's. `d_image` starts with what the engine must leave alone, alpha and all outside of the crop, and 0.
    ///
    /// # Errors
    /// Those of the device, and a pixel that was written and should not have been.
    pub fn on_device(&self, gpu: &Gpu, lpips: &mut Lpips) -> Result<Found> {
        let is_inside = |i: usize| {
            let at = [i as u32 % self.size[0], i as u32 / self.size[0]];
            (0..2).all(|k| at[k] >= self.origin[k] && at[k] < self.origin[k] + self.crop[k])
        };
        let image: Vec<[f32; 4]> = self.image.iter().map(|[r, g, b]| [*r, *g, *b, 0.25]).collect();
        let start = (0..=image.len()).map(|i| if is_inside(i) { [0.0, 0.0, 0.0, GUARD[3]] } else { GUARD });
        let d_image = gpu.upload("d image", &start.collect::<Vec<_>>())?;
        let (image, truth) = (gpu.upload("image", &image)?, gpu.upload("truth", &self.truth)?);
        let what = Compared { image: &image, truth: &truth, size: self.size, origin: self.origin, crop: self.crop };
        let mut rec = Recording::new();
        lpips.record(gpu, &mut rec, &what, Some(Cotangent { d_image: &d_image, weight: WEIGHT }))?;
        gpu.run(&rec)?;
        let value = gpu.read(&lpips.value)?[0];
        let once = gpu.read(&d_image)?;
        for (i, d) in once.iter().enumerate() {
            ensure!(d[3] == GUARD[3], "alpha has a part in LPIPS");
            ensure!(is_inside(i) || *d == GUARD, "pixel {i} outside of the crop was written");
        }
        // A second run adds the same again.
        gpu.run(&rec)?;
        let twice = gpu.read(&d_image)?;
        let is_double = |i| !is_inside(i) || (0..3).all(|c| twice[i][c] == 2.0 * once[i][c]);
        ensure!((0..image.len()).all(is_double), "a second run does not add the same");
        // The metric is the loss without its cotangent.
        let mut rec = Recording::new();
        lpips.record(gpu, &mut rec, &what, None)?;
        ensure!(rec.passes().iter().all(|pass| !pass.label.contains("bwd")), "the metric has a backward pass");
        gpu.run(&rec)?;
        ensure!(gpu.read(&lpips.value)?[0].to_bits() == value.to_bits(), "the metric is not the loss");
        let rgb = |d: &[f32; 4]| [d[0], d[1], d[2]].map(f32::to_bits);
        Ok(Found { value: value.to_bits(), d_image: once[..self.image.len()].iter().map(rgb).collect() })
    }
}

impl Found {
    /// LPIPS.
    pub fn value(&self) -> f64 {
        f32::from_bits(self.value).into()
    }

    /// The cotangent of the picture.
    pub fn d_image(&self) -> Vec<[f64; 3]> {
        self.d_image.iter().map(|d| d.map(|x| f64::from(f32::from_bits(x)) / f64::from(WEIGHT))).collect()
    }

    /// The cotangent's largest magnitude.
    pub fn largest(&self) -> f64 {
        self.d_image().as_flattened().iter().fold(0.0, |most, x| most.max(x.abs()))
    }
}

/// The trunks, and the fewest pixels to a side that each sees.
pub const TRUNKS: [(Trunk, u32); 2] = [(Trunk::AlexNet, 31), (Trunk::SqueezeNet, 17)];
