//! LPIPS and its cotangent on the device, against dual numbers; the loader of its weights; the published numbers.

use crate::common::device::gpu;
use crate::common::random::Random;
use crate::scene::{Folder, fault, shared};
use ivv::Error;
use ivv::gpu::{Gpu, Recording};
use ivv::scene::{read_tensors, write_tensors};
use ivv::stage::{Compared, Cotangent, Lpips, Trunk};
use ivv::twin::{self, Dual};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::Command;

const GUARD: [f32; 4] = [1.5, -2.5, 3.5, -4.5];

/// A tensor of a file of weights.
type Weights = BTreeMap<String, (Vec<usize>, Vec<f32>)>;

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

fn narrow(seed: u64, trunk: Trunk) -> Weights {
    match trunk {
        Trunk::AlexNet => weights(seed, trunk, &NARROW_ALEXNET),
        Trunk::SqueezeNet => weights(seed, trunk, &NARROW_SQUEEZENET),
    }
}

/// Writes weights to a file.
fn save(folder: &Folder, weights: &Weights) -> PathBuf {
    let path = folder.file("weights.safetensors");
    let list: Vec<(&str, &[usize], &[f32])> =
        weights.iter().map(|(name, (shape, values))| (name.as_str(), shape.as_slice(), values.as_slice())).collect();
    write_tensors(&path, &list).unwrap();
    path
}

fn load(gpu: &Gpu, weights: &Weights) -> Lpips {
    let folder = Folder::new(&format!("lpips-{:?}", std::thread::current().id()));
    Lpips::load(gpu, &save(&folder, weights)).unwrap()
}

/// A picture, the truth and the part of them that is compared.
#[derive(Clone)]
struct Pair {
    size: [u32; 2],
    origin: [u32; 2],
    crop: [u32; 2],
    image: Vec<[f32; 3]>,
    truth: Vec<u32>,
}

/// What the device makes of a pair.
#[derive(Clone, Debug, PartialEq)]
struct Found {
    value: u32,
    /// Of the whole picture, as bits, so that -0 and 0 differ.
    d_image: Vec<[u32; 3]>,
}

const WEIGHT: f32 = 0.5;

impl Pair {
    /// Noise against noise; `mask` says what the mask holds at a pixel.
    fn random(seed: u64, crop: [u32; 2], mask: impl Fn(usize) -> u32) -> Self {
        let mut random = Random::new(seed);
        let n = (crop[0] * crop[1]) as usize;
        let truth = (0..n).map(|i| random.bits() as u32 & 0xff_ffff | mask(i) << 24).collect();
        let image = (0..n).map(|_| random.vector(0.0, 1.0)).collect();
        Pair { size: crop, origin: [0, 0], crop, image, truth }
    }

    /// A picture of one colour against another.
    fn flat(crop: [u32; 2], image: f32, truth: u8) -> Self {
        let n = (crop[0] * crop[1]) as usize;
        let truth = vec![u32::from_le_bytes([truth, truth, truth, 255]); n];
        Pair { size: crop, origin: [0, 0], crop, image: vec![[image; 3]; n], truth }
    }

    /// The same part of a larger picture of noise.
    fn within(&self, size: [u32; 2], origin: [u32; 2]) -> Self {
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
    fn dual(&self, weights: &Weights, w: &[[f32; 3]]) -> Dual {
        let folder = Folder::new(&format!("lpips-twin-{:?}", std::thread::current().id()));
        let tensors = read_tensors(&save(&folder, weights)).unwrap();
        let dual = |(x, w): (&[f32; 3], &[f32; 3])| std::array::from_fn(|k| Dual::new(x[k].into(), w[k].into()));
        let image: Vec<[Dual; 3]> = self.image.iter().zip(w).map(dual).collect();
        twin::lpips(&tensors, &image, &self.truth, self.size.map(|n| n as usize))
    }

    /// The device's. `d_image` starts with what the engine must leave alone, alpha and all outside of the crop, and 0.
    fn on_device(&self, gpu: &Gpu, lpips: &mut Lpips) -> Found {
        let is_inside = |i: usize| {
            let at = [i as u32 % self.size[0], i as u32 / self.size[0]];
            (0..2).all(|k| at[k] >= self.origin[k] && at[k] < self.origin[k] + self.crop[k])
        };
        let image: Vec<[f32; 4]> = self.image.iter().map(|[r, g, b]| [*r, *g, *b, 0.25]).collect();
        let start = (0..=image.len()).map(|i| if is_inside(i) { [0.0, 0.0, 0.0, GUARD[3]] } else { GUARD });
        let d_image = gpu.upload("d image", &start.collect::<Vec<_>>()).unwrap();
        let (image, truth) = (gpu.upload("image", &image).unwrap(), gpu.upload("truth", &self.truth).unwrap());
        let what = Compared { image: &image, truth: &truth, size: self.size, origin: self.origin, crop: self.crop };
        let mut rec = Recording::new();
        lpips.record(gpu, &mut rec, &what, Some(Cotangent { d_image: &d_image, weight: WEIGHT })).unwrap();
        gpu.run(&rec).unwrap();
        let value = gpu.read(&lpips.value).unwrap()[0];
        let once = gpu.read(&d_image).unwrap();
        for (i, d) in once.iter().enumerate() {
            assert_eq!(d[3], GUARD[3], "alpha has no part in LPIPS");
            assert!(is_inside(i) || *d == GUARD, "pixel {i} lies outside of the crop");
        }
        // A second run adds the same again.
        gpu.run(&rec).unwrap();
        let twice = gpu.read(&d_image).unwrap();
        assert!((0..image.len()).all(|i| !is_inside(i) || (0..3).all(|c| twice[i][c] == 2.0 * once[i][c])));
        // The metric is the loss without its cotangent.
        let mut rec = Recording::new();
        lpips.record(gpu, &mut rec, &what, None).unwrap();
        assert!(rec.passes().iter().all(|pass| !pass.label.contains("bwd")));
        gpu.run(&rec).unwrap();
        assert_eq!(gpu.read(&lpips.value).unwrap()[0].to_bits(), value.to_bits());
        let rgb = |d: &[f32; 4]| [d[0], d[1], d[2]].map(f32::to_bits);
        Found { value: value.to_bits(), d_image: once[..self.image.len()].iter().map(rgb).collect() }
    }
}

impl Found {
    fn value(&self) -> f64 {
        f32::from_bits(self.value).into()
    }

    fn d_image(&self) -> Vec<[f64; 3]> {
        self.d_image.iter().map(|d| d.map(|x| f64::from(f32::from_bits(x)) / f64::from(WEIGHT))).collect()
    }

    fn largest(&self) -> f64 {
        self.d_image().as_flattened().iter().fold(0.0, |most, x| most.max(x.abs()))
    }
}

fn dot(a: &[[f64; 3]], b: &[[f64; 3]]) -> f64 {
    a.as_flattened().iter().zip(b.as_flattened()).map(|(a, b)| a * b).sum()
}

const TRUNKS: [(Trunk, u32); 2] = [(Trunk::AlexNet, 31), (Trunk::SqueezeNet, 17)];

#[test]
fn lpips_and_cotangent_of_noise_are_those_of_dual_numbers() {
    let gpu = gpu();
    for (trunk, smallest) in TRUNKS {
        let weights = narrow(3, trunk);
        let mut lpips = load(&gpu, &weights);
        assert_eq!(lpips.trunk(), trunk);
        let smallest = [smallest; 2];
        for (seed, size) in [smallest, smallest.map(|n| n + 1), [47, 33], [34, 50]].into_iter().enumerate() {
            for mask in [|_| 255, |i| if i % 7 < 3 { 0 } else { 255 }] as [fn(usize) -> u32; 2] {
                let pair = Pair::random(seed as u64, size, mask);
                let found = pair.on_device(&gpu, &mut lpips);
                let d_image = found.d_image();
                let norm = dot(&d_image, &d_image).sqrt();
                assert!(norm > 0.0, "{trunk}, {size:?}: no cotangent");
                let mut random = Random::new(9);
                let w: Vec<[f32; 3]> = pair.image.iter().map(|_| random.vector(-1.0, 1.0)).collect();
                let truth = pair.dual(&weights, &w);
                assert!(truth.value > 0.01, "{trunk}, {size:?}: {truth:?}");
                let error = (found.value() - truth.value).abs() / truth.value;
                assert!(error <= 1e-5, "{trunk}, {size:?}: {} for {truth:?}", found.value());
                let w: Vec<[f64; 3]> = w.iter().map(|w| w.map(f64::from)).collect();
                let error = (truth.tangent - dot(&d_image, &w)).abs() / (norm * dot(&w, &w).sqrt());
                assert!(error <= 1e-5, "{trunk}, {size:?}: cotangent off by {error:.1e}");
                for (d, word) in found.d_image.iter().zip(&pair.truth) {
                    assert!(word >> 24 != 0 || *d == [0; 3], "a hidden pixel has a cotangent");
                }
            }
        }
    }
}

#[test]
fn numbers_of_lpips_cotangent_are_those_of_dual_numbers() {
    let gpu = gpu();
    for (trunk, smallest) in TRUNKS {
        let weights = narrow(5, trunk);
        let pair = Pair::random(1, [smallest, smallest + 2], |_| 255);
        let found = pair.on_device(&gpu, &mut load(&gpu, &weights));
        let (d_image, largest) = (found.d_image(), found.largest());
        assert!(largest > 0.0);
        let n = pair.image.len();
        let mut w = vec![[0.0f32; 3]; n];
        // Corners and the middle, each channel once.
        for (k, i) in [0, smallest as usize - 1, n / 2, n / 2 + 1, n - smallest as usize, n - 1].into_iter().enumerate()
        {
            w[i][k % 3] = 1.0;
            let (truth, found) = (pair.dual(&weights, &w).tangent, d_image[i][k % 3]);
            w[i][k % 3] = 0.0;
            assert!((found - truth).abs() <= 1e-5 * largest, "{trunk}, pixel {i}: {found} for {truth}");
        }
    }
}

#[test]
fn lpips_of_a_crop_is_that_of_the_crop_alone() {
    let gpu = gpu();
    for (trunk, smallest) in TRUNKS {
        let mut lpips = load(&gpu, &narrow(4, trunk));
        let alone = Pair::random(2, [smallest + 3, smallest], |i| if i % 5 == 0 { 0 } else { 255 });
        let expected = alone.on_device(&gpu, &mut lpips);
        assert!(expected.value() > 0.0 && expected.largest() > 0.0);
        // In scratch that held a larger crop, and at each corner of a picture.
        let size = [smallest + 9, smallest + 4];
        assert_ne!(Pair::random(8, size, |_| 255).on_device(&gpu, &mut lpips).value, expected.value);
        for origin in [[0, 0], [6, 4], [0, 4], [5, 1]] {
            let found = alone.within(size, origin).on_device(&gpu, &mut lpips);
            assert_eq!(found.value, expected.value, "{trunk}, {origin:?}");
            let rows = found.d_image.chunks(size[0] as usize).skip(origin[1] as usize).take(smallest as usize);
            let part: Vec<[u32; 3]> =
                rows.flat_map(|row| row[origin[0] as usize..][..alone.crop[0] as usize].to_vec()).collect();
            assert!(part == expected.d_image, "{trunk}, {origin:?}: other cotangents");
        }
    }
}

#[test]
fn a_pixel_that_the_mask_hides_has_no_part_in_lpips() {
    let gpu = gpu();
    for (trunk, smallest) in TRUNKS {
        let mut lpips = load(&gpu, &narrow(6, trunk));
        let pair = Pair::random(3, [smallest; 2], |i| if i % 3 == 1 { 0 } else { 255 });
        let mut other = pair.clone();
        for (color, word) in other.image.iter_mut().zip(&pair.truth) {
            if word >> 24 == 0 {
                *color = [17.0, -3.0, 1e3];
            }
        }
        let found = pair.on_device(&gpu, &mut lpips);
        assert!(found.value() > 0.0 && found.largest() > 0.0);
        assert!(other.on_device(&gpu, &mut lpips) == found);
        // With all hidden the pictures are equal.
        other.truth.iter_mut().for_each(|word| *word &= 0xff_ffff);
        let hidden = other.on_device(&gpu, &mut lpips);
        assert_eq!((hidden.value(), hidden.largest()), (0.0, 0.0));
    }
}

#[test]
fn n20_a_picture_equal_to_the_truth_has_lpips_0_and_exactly_no_cotangent() {
    let gpu = gpu();
    for (trunk, smallest) in TRUNKS {
        let mut lpips = load(&gpu, &narrow(7, trunk));
        for size in [[smallest; 2], [37, 41]] {
            let mut pair = Pair::random(4, size, |i| if i % 5 == 2 { 0 } else { 255 });
            // As the device decodes it: a product is rounded alike everywhere, a division need not be.
            let decoded = |word: u32| std::array::from_fn(|c| f32::from(word.to_le_bytes()[c]) * (1.0 / 255.0));
            pair.image = pair.truth.iter().map(|word| decoded(*word)).collect();
            let found = pair.on_device(&gpu, &mut lpips);
            assert_eq!(found.value, 0, "{trunk}, {size:?}: LPIPS {}", found.value());
            assert!(found.d_image.iter().all(|d| *d == [0; 3]), "{trunk}, {size:?}: {:e}", found.largest());
        }
    }
}

#[test]
fn n22_black_pictures_and_dead_features_have_lpips_0_and_finite_cotangents() {
    let gpu = gpu();
    for (trunk, smallest) in TRUNKS {
        let size = [smallest + 2, smallest];
        let weights = narrow(8, trunk);
        let black = Pair::flat(size, 0.0, 0).on_device(&gpu, &mut load(&gpu, &weights));
        assert_eq!((black.value, black.largest()), (0, 0.0), "{trunk}: black");
        // No feature of any layer is alive.
        let mut dead = weights.clone();
        for (name, (_, values)) in &mut dead {
            if name.ends_with("bias") {
                values.fill(-1e3);
            }
        }
        let noise = Pair::random(5, size, |_| 255);
        let found = noise.on_device(&gpu, &mut load(&gpu, &dead));
        assert_eq!((found.value, found.largest()), (0, 0.0), "{trunk}: dead features");
        // Black kills the first layer, as the truth does not; then a little light, which the norm barely sees.
        let mut first = weights.clone();
        for (name, value) in [("features.0.weight", 1.0), ("features.0.bias", 0.0)] {
            if let Some((_, values)) = first.get_mut(name) {
                values.iter_mut().for_each(|x| *x = value * x.abs());
            }
        }
        let mut lpips = load(&gpu, &first);
        let black = Pair::flat(size, 0.0, 255);
        let found = black.on_device(&gpu, &mut lpips);
        assert!(found.value() > 0.1, "{trunk}: dead against alive: {}", found.value());
        assert_eq!(found.largest(), 0.0, "{trunk}: dead against alive");
        for light in [1e-7, 1e-6, 1e-5] {
            // What the trunk sees as 0 in each channel, and a little more.
            let grey = |c: usize| 0.5 + [-0.030, -0.088, -0.188][c] / 2.0 + light;
            let mut pair = black.clone();
            pair.image.fill([grey(0), grey(1), grey(2)]);
            let found = pair.on_device(&gpu, &mut lpips);
            assert!(found.value() > 0.0 && found.value().is_finite(), "{trunk}, {light}: {}", found.value());
            assert!(found.largest().is_finite(), "{trunk}, {light}: {}", found.largest());
        }
    }
}

#[test]
fn lpips_has_the_same_bits_in_every_run() {
    let gpu = gpu();
    for (trunk, _) in TRUNKS {
        let weights = narrow(9, trunk);
        let pair = Pair::random(6, [64, 48], |i| if i % 11 == 0 { 0 } else { 255 });
        let first = pair.on_device(&gpu, &mut load(&gpu, &weights));
        assert!(first.value() > 0.0 && first.largest() > 0.0);
        for _ in 0..2 {
            assert!(pair.on_device(&gpu, &mut load(&gpu, &weights)) == first);
        }
    }
}

#[test]
fn a_crop_that_is_too_small_or_too_large_is_refused() {
    let gpu = gpu();
    let folder = Folder::new("lpips-crops");
    for (trunk, smallest) in TRUNKS {
        let path = save(&folder, &narrow(1, trunk));
        let mut lpips = Lpips::load(&gpu, &path).unwrap();
        let (image, truth) = (gpu.alloc("image", 1).unwrap(), gpu.alloc("truth", 1).unwrap());
        let mut record = |crop| {
            let what = Compared { image: &image, truth: &truth, size: [40_000; 2], origin: [0, 0], crop };
            lpips.record(&gpu, &mut Recording::new(), &what, None)
        };
        for crop in [[smallest - 1, 64], [64, smallest - 1], [0, 0]] {
            let told = fault(record(crop), &path);
            assert!(told.contains(&format!("{}x{}", crop[0], crop[1])), "{told}");
            assert!(told.contains(&format!("{smallest}x{smallest}")), "{told}");
        }
        assert!(matches!(record([40_000; 2]), Err(Error::OutOfMemory { .. })));
        assert!(lpips.scratch_bytes([smallest; 2], true).is_ok());
        assert!(lpips.scratch_bytes([smallest - 1; 2], false).is_err());
    }
}

#[test]
fn lpips_takes_the_scratch_that_it_tells_and_keeps_it() {
    let gpu = gpu();
    let used = || {
        let by_name = gpu.device().memory().0;
        by_name.iter().filter(|(name, _)| name.contains("lpips ")).map(|(_, bytes)| *bytes).sum::<u64>()
    };
    for (trunk, _) in TRUNKS {
        for with_cotangent in [false, true] {
            let mut lpips = load(&gpu, &narrow(1, trunk));
            let (image, truth) = (gpu.alloc("image", 1).unwrap(), gpu.alloc("truth", 1).unwrap());
            let d_image = gpu.alloc("d image", 1).unwrap();
            let before = used();
            let mut record = |crop| {
                let what = Compared { image: &image, truth: &truth, size: [96; 2], origin: [0, 0], crop };
                let cotangent = with_cotangent.then_some(Cotangent { d_image: &d_image, weight: 1.0 });
                lpips.record(&gpu, &mut Recording::new(), &what, cotangent).unwrap();
                used() - before
            };
            let taken = record([96, 80]);
            assert_eq!(record([40, 50]), taken, "{trunk}: a smaller crop needs nothing new");
            let told = lpips.scratch_bytes([96, 80], with_cotangent).unwrap();
            // Buffers are rounded up, and those that are not needed have room for one item.
            assert!(told > 96 * 80 * 32 && taken.abs_diff(told) < told / 50, "{trunk}: {taken} for {told}");
        }
    }
}

#[test]
fn a_file_that_holds_no_weights_of_lpips_is_refused() {
    let gpu = gpu();
    let folder = Folder::new("lpips-files");
    let good = narrow(2, Trunk::SqueezeNet);
    let load = |change: &dyn Fn(&mut Weights)| {
        let mut weights = good.clone();
        change(&mut weights);
        let path = save(&folder, &weights);
        fault(Lpips::load(&gpu, &path).map(|lpips| lpips.trunk()), &path)
    };
    let told = load(&|weights| weights.retain(|name, _| !name.starts_with("features.3")));
    assert!(told.contains("neither AlexNet nor SqueezeNet"), "{told}");
    assert!(told.contains("tools/lpips_weights.py"), "{told}");
    for name in ["features.0.bias", "features.12.expand3x3.weight", "lin6.model.1.weight"] {
        let told = load(&|weights| drop(weights.remove(name)));
        assert!(told.contains(name) && told.contains("missing"), "{told}");
        let told = load(&|weights| weights.get_mut(name).unwrap().1[2] = f32::NAN);
        assert!(told.contains(name) && told.contains("value 2 is not finite"), "{told}");
        let told = load(&|weights| {
            let (shape, values) = weights.get_mut(name).unwrap();
            *shape = vec![values.len(), 1];
        });
        assert!(told.contains(name) && told.contains("has the shape"), "{told}");
    }
    let told = load(&|weights| weights.get_mut("lin0.model.1.weight").unwrap().1[3] = -1e-3);
    assert!(told.contains("lin0.model.1.weight") && told.contains("value 3 is negative"), "{told}");
    let told = load(&|weights| {
        let (shape, values) = weights.get_mut("features.0.weight").unwrap();
        shape[0] = 5;
        values.truncate(5 * 27);
    });
    assert!(told.contains("features.0.weight") && told.contains("multiple of 4"), "{told}");
    let path = folder.write("no.safetensors", "no tensors");
    fault(Lpips::load(&gpu, &path).map(|lpips| lpips.trunk()), &path);
    let path = folder.file("absent.safetensors");
    fault(Lpips::load(&gpu, &path).map(|lpips| lpips.trunk()), &path);
}

/// A picture of the published examples.
fn example(path: &Path) -> (Vec<[f32; 3]>, Vec<u32>, [u32; 2]) {
    let picture = image::open(path).unwrap().to_rgb8();
    let image = picture.pixels().map(|p| p.0.map(|x| f32::from(x) * (1.0 / 255.0))).collect();
    let truth = picture.pixels().map(|p| u32::from_le_bytes([p.0[0], p.0[1], p.0[2], 255])).collect();
    (image, truth, [picture.width(), picture.height()])
}

#[test]
fn the_published_examples_have_the_published_lpips() {
    let Some(data) = shared("data/lpips") else { return };
    let folder = Folder::new("lpips-published");
    let tool = Path::new(env!("CARGO_MANIFEST_DIR")).join("tools/lpips_weights.py");
    let convert = |trunk: &Path, linear: &str| {
        let linear = data.join("lpips/weights/v0.1").join(linear);
        Command::new("python3").arg(&tool).args([trunk, &linear, &folder.file("squeeze.safetensors")]).output()
    };
    let trunk = data.join("squeeze.backbone.pth");
    let Ok(mixed) = convert(&trunk, "alex.pth") else {
        eprintln!("skipped: python3 is not installed");
        return;
    };
    assert_eq!(mixed.status.code(), Some(3), "linear layers of another trunk");
    assert!(String::from_utf8_lossy(&mixed.stderr).contains("alex.pth"));
    let damaged = folder.write("damaged.pth", &std::fs::read(&trunk).unwrap()[..1_000_000]);
    assert_eq!(convert(&damaged, "squeeze.pth").unwrap().status.code(), Some(3));
    assert!(!folder.file("squeeze.safetensors").exists());
    let done = convert(&trunk, "squeeze.pth").unwrap();
    assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
    let gpu = gpu();
    let mut lpips = Lpips::load(&gpu, &folder.file("squeeze.safetensors")).unwrap();
    let (_, truth, size) = example(&data.join("imgs/ex_ref.png"));
    for (name, expected) in [("ex_p0", 0.711_048), ("ex_p1", 0.147_902), ("ex_ref", 0.0)] {
        let (image, _, _) = example(&data.join("imgs").join(name).with_extension("png"));
        let pair = Pair { size, origin: [0, 0], crop: size, image, truth: truth.clone() };
        let found = pair.on_device(&gpu, &mut lpips);
        assert!((found.value() - expected).abs() <= 1e-4, "{name}: {} for {expected}", found.value());
        assert_eq!(found.largest() > 0.0, expected > 0.0, "{name}");
    }
}
