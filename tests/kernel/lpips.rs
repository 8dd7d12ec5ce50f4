//! LPIPS and its cotangent on the device, against dual numbers; the loader of its weights; the published numbers. Equal
//! pictures and dead features: the rows N20 and N22 of `tests/conformance`.

use crate::adversary::rounds_otherwise;
use crate::common::prelude::*;
use crate::scene::fault;
use ivv::Error;
use ivv::internals::gpu::Gpu;
use ivv::internals::stage::{Compared, Cotangent, Lpips, Shown, Trunk, record_totals};
use ivv_conformance::fixtures::lpips::{self as fixtures, Pair, TRUNKS, Weights, narrow};

tested! {
    "lpips/lpips_input.comp" by lpips in lpips_and_cotangent_of_noise_are_those_of_dual_numbers;
    "lpips/lpips_conv.comp" by lpips in lpips_and_cotangent_of_noise_are_those_of_dual_numbers;
    "lpips/lpips_pool.comp" by lpips in lpips_and_cotangent_of_noise_are_those_of_dual_numbers;
    "lpips/lpips_tap.comp" by lpips in lpips_and_cotangent_of_noise_are_those_of_dual_numbers;
    "lpips/lpips_pool_bwd.comp" by lpips in lpips_and_cotangent_of_noise_are_those_of_dual_numbers;
    "lpips/lpips_input_bwd.comp" by lpips in lpips_and_cotangent_of_noise_are_those_of_dual_numbers;
}

fn save(folder: &Folder, weights: &Weights) -> PathBuf {
    let path = folder.file("weights.safetensors");
    fixtures::save(&path, weights).unwrap();
    path
}

fn load(gpu: &Gpu, weights: &Weights) -> Lpips {
    fixtures::load(gpu, weights).unwrap()
}

fn dot(a: &[[f64; 3]], b: &[[f64; 3]]) -> f64 {
    a.as_flattened().iter().zip(b.as_flattened()).map(|(a, b)| a * b).sum()
}

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
                let found = pair.on_device(&gpu, &mut lpips).unwrap();
                let d_image = found.d_image();
                let norm = dot(&d_image, &d_image).sqrt();
                assert!(norm > 0.0, "{trunk}, {size:?}: no cotangent");
                let mut random = Random::new(9);
                let w: Vec<[f32; 3]> = pair.image.iter().map(|_| random.vector(-1.0, 1.0)).collect();
                let truth = pair.dual(&weights, &w).unwrap();
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
        let found = pair.on_device(&gpu, &mut load(&gpu, &weights)).unwrap();
        let (d_image, largest) = (found.d_image(), found.largest());
        assert!(largest > 0.0);
        let n = pair.image.len();
        let mut w = vec![[0.0f32; 3]; n];
        // Corners and the middle, each channel once.
        for (k, i) in [0, smallest as usize - 1, n / 2, n / 2 + 1, n - smallest as usize, n - 1].into_iter().enumerate()
        {
            w[i][k % 3] = 1.0;
            let (truth, found) = (pair.dual(&weights, &w).unwrap().tangent, d_image[i][k % 3]);
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
        let expected = alone.on_device(&gpu, &mut lpips).unwrap();
        assert!(expected.value() > 0.0 && expected.largest() > 0.0);
        // In scratch that held a larger crop, and at each corner of a picture.
        let size = [smallest + 9, smallest + 4];
        assert_ne!(Pair::random(8, size, |_| 255).on_device(&gpu, &mut lpips).unwrap().value, expected.value);
        for origin in [[0, 0], [6, 4], [0, 4], [5, 1]] {
            let found = alone.within(size, origin).on_device(&gpu, &mut lpips).unwrap();
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
        let found = pair.on_device(&gpu, &mut lpips).unwrap();
        assert!(found.value() > 0.0 && found.largest() > 0.0);
        assert!(other.on_device(&gpu, &mut lpips).unwrap() == found);
        // With all hidden the pictures are equal.
        other.truth.iter_mut().for_each(|word| *word &= 0xff_ffff);
        let hidden = other.on_device(&gpu, &mut lpips).unwrap();
        assert_eq!((hidden.value(), hidden.largest()), (0.0, 0.0));
    }
}

#[test]
fn lpips_has_the_same_bits_in_every_run() {
    let gpu = gpu();
    for (trunk, _) in TRUNKS {
        let weights = narrow(9, trunk);
        let pair = Pair::random(6, [64, 48], |i| if i % 11 == 0 { 0 } else { 255 });
        let first = pair.on_device(&gpu, &mut load(&gpu, &weights)).unwrap();
        assert!(first.value() > 0.0 && first.largest() > 0.0);
        let otherwise = rounds_otherwise("the metric and the loss are two kernels");
        assert!(first.metric == first.value || otherwise, "the metric is not the loss");
        for _ in 0..2 {
            assert!(pair.on_device(&gpu, &mut load(&gpu, &weights)).unwrap() == first);
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
            let told = fault(record(crop).map(|_| ()), &path);
            assert!(told.contains(&format!("{}x{}", crop[0], crop[1])), "{told}");
            assert!(told.contains(&format!("{smallest}x{smallest}")), "{told}");
        }
        assert!(matches!(record([40_000; 2]), Err(Error::OutOfMemory { .. })));
        assert!(lpips.scratch_bytes([smallest; 2], true).is_ok());
        assert!(lpips.scratch_bytes([smallest - 1; 2], false).is_err());
    }
}

/// LPIPS of the whole of `pair`, in tiles of buffers that have `most_bytes` at most.
fn score(gpu: &Gpu, lpips: &mut Lpips, pair: &Pair, shown: Shown, most_bytes: u64) -> ivv::Result<f64> {
    let image: Vec<[f32; 4]> = pair.image.iter().map(|[r, g, b]| [*r, *g, *b, 1.0]).collect();
    let (image, truth) = (gpu.upload("image", &image)?, gpu.upload("truth", &pair.truth)?);
    let what = Compared { image: &image, truth: &truth, size: pair.size, origin: pair.origin, crop: pair.crop };
    let mut rec = Recording::new();
    let left = lpips.record_score(gpu, &mut rec, &what, shown, most_bytes)?;
    let totals = gpu.alloc("totals", 1)?;
    record_totals(&mut rec, &[left], &totals);
    gpu.run(&rec)?;
    Ok(f64::from(gpu.read(&totals)?[0][0]))
}

#[test]
fn a_picture_of_which_no_buffer_holds_the_features_is_scored_in_tiles_to_the_same_number() {
    let gpu = gpu();
    for (trunk, smallest) in TRUNKS {
        let mut lpips = load(&gpu, &narrow(7, trunk));
        for (seed, size) in [[603, 70], [64, 531], [smallest + 40, smallest]].into_iter().enumerate() {
            let pair = Pair::random(seed as u64, size, |i| if i % 13 == 0 { 0 } else { 255 });
            let [_, whole] = lpips.score_bytes(size, u64::MAX).unwrap();
            let expected = f64::from(f32::from_bits(pair.on_device(&gpu, &mut lpips).unwrap().metric));
            assert_eq!(score(&gpu, &mut lpips, &pair, Shown::Scaled, whole).unwrap(), expected, "one tile");
            let mut least = whole;
            // Down to tiles that have nothing left to give up.
            for part in 1..=6 {
                let most = whole / 10 * (10 - part);
                match lpips.score_bytes(size, most) {
                    Ok([all, largest]) => {
                        assert!(largest <= most && all >= largest, "{trunk}, {size:?}: {largest} of {most}");
                        let found = score(&gpu, &mut lpips, &pair, Shown::Scaled, most).unwrap();
                        assert!((found / expected - 1.0).abs() < 1e-6, "{trunk}, {size:?}: {found} for {expected}");
                        least = least.min(largest);
                    }
                    Err(fault) => {
                        assert!(matches!(fault, Error::OutOfMemory { limit, .. } if limit == most), "{fault}");
                        let fault = score(&gpu, &mut lpips, &pair, Shown::Scaled, most).unwrap_err();
                        assert!(fault.to_string().contains("lpips_crop"), "{fault}");
                    }
                }
            }
            assert!(seed == 2 || least < whole / 10 * 8, "{trunk}, {size:?}: tiles of {least} bytes, all {whole}");
        }
    }
}

#[test]
fn unscaled_lpips_is_that_of_colours_of_0_to_1() {
    let gpu = gpu();
    for (trunk, _) in TRUNKS {
        let mut lpips = load(&gpu, &narrow(8, trunk));
        let mut pair = Pair::random(5, [61, 47], |_| 255);
        // Odd levels, so that 1/2 + x/2 is a level too.
        pair.truth.iter_mut().for_each(|word| *word |= 0x01_0101);
        let mut halved = pair.clone();
        halved.image.as_flattened_mut().iter_mut().for_each(|x| *x = 0.5 * *x + 0.5);
        let half = |byte: u8| u8::try_from((u32::from(byte) + 255) / 2).unwrap();
        halved.truth.iter_mut().for_each(|word| *word = u32::from_le_bytes(word.to_le_bytes().map(half)));
        let mut of = |pair: &Pair, shown| score(&gpu, &mut lpips, pair, shown, u64::MAX).unwrap();
        // 2 (x/2 + 1/2) - 1 is x.
        let (found, expected) = (of(&pair, Shown::Unscaled), of(&halved, Shown::Scaled));
        assert!((found / expected - 1.0).abs() < 1e-4, "{trunk}: {found} for {expected}");
        assert!((found / of(&pair, Shown::Scaled) - 1.0).abs() > 0.05, "{trunk}: they are not told apart");
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
        crate::common::notes::skip("python3 is not installed");
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
        let found = pair.on_device(&gpu, &mut lpips).unwrap();
        assert!((found.value() - expected).abs() <= 1e-4, "{name}: {} for {expected}", found.value());
        assert_eq!(found.largest() > 0.0, expected > 0.0, "{name}");
    }
}
