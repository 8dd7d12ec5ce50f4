//! Outputs as a window shows them, against the reference and against the PNG of the same picture.

use crate::adversary::slack;
use crate::common::prelude::*;
use ivv::internals::reference::{laid_over, shown};
use ivv::internals::stage::{Layer, Screen};

tested! {
    "screen/show.comp" by shown in every_output_is_the_references_to_the_rounding;
}

const HIGH: f32 = 3.0;
const LAYERS: [Layer; 4] = [Layer::Color, Layer::Alpha, Layer::Depth { high: HIGH }, Layer::Flow { high: HIGH }];
/// What a float can be beside a number in the usual range.
const ODD: [f32; 9] = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 0.0, -0.0, 1.0, 1e30, -1e-30, f32::MIN_POSITIVE];

/// Images of `n` pixels: numbers around the usual range, and at every seventh pixel the odd ones.
fn images(n: usize) -> [Vec<[f32; 4]>; 2] {
    let mut random = Random::new(n as u64);
    [(-0.2, 1.2), (-4.0, 4.0)].map(|(low, high)| {
        let usual = |i: usize| {
            let mut pixel: [f32; 4] = random.vector(low, high);
            if i % 7 == 3 {
                pixel[i % 4] = ODD[i % ODD.len()];
                pixel[(i + 1) % 4] = ODD[(i / 7) % ODD.len()];
            }
            pixel
        };
        (0..n).map(usual).collect()
    })
}

/// A screen with `layer` of the images in it, in two strips, under the overlay.
fn on_device(size: [u32; 2], images: &[Vec<[f32; 4]>; 2], layer: Layer, is_bgra: bool, overlay: &[u32]) -> Vec<u32> {
    let gpu = gpu();
    let [width, height] = size;
    let mut screen = Screen::new(&gpu, width, height, is_bgra).unwrap();
    if !overlay.is_empty() {
        screen.lay(&gpu, overlay).unwrap();
    }
    let first_rows = height / 2;
    for rows in [0..first_rows, first_rows..height].into_iter().filter(|rows| !rows.is_empty()) {
        let [from, to] = [rows.start, rows.end].map(|row| (row * width) as usize);
        let [image0, image1] = images.each_ref().map(|image| gpu.upload("image", &image[from..to]).unwrap());
        let mut rec = Recording::new();
        screen.record(&mut rec, &image0, Some(&image1), layer, [from as u32, (to - from) as u32]);
        gpu.run(&rec).unwrap();
    }
    let words = gpu.read(&screen.pixels).unwrap();
    // The picture of it has the same colours, whatever their order is.
    let picture = screen.read(&gpu).unwrap();
    assert_eq!((picture.width, picture.height, picture.color.len()), (width, height, words.len()));
    for (word, color) in words.iter().zip(&picture.color) {
        let [first, g, third, _] = word.to_le_bytes();
        let [r, b] = if is_bgra { [third, first] } else { [first, third] };
        assert_eq!([r, g, b].map(f32::from), color.map(|level| (255.0 * level).round()));
    }
    words
}

#[test]
fn every_output_is_the_references_to_the_rounding() {
    for size in [[1, 1], [7, 5], [1, 129], [64, 2], [131, 67]] {
        let images = images((size[0] * size[1]) as usize);
        for (layer, code) in LAYERS.into_iter().zip(0..) {
            let found = on_device(size, &images, layer, false, &[]);
            for (i, word) in found.iter().enumerate() {
                let [channels @ .., last] = word.to_le_bytes();
                let truth = shown(images[0][i], images[1][i], code, HIGH);
                let is_near = channels
                    .iter()
                    .zip(truth)
                    .all(|(x, truth)| (f64::from(*x) - truth).abs() <= 0.5 + slack(100.0) * 0.002);
                assert!(is_near && last == 255, "{layer:?}, pixel {i}: {channels:?} for {truth:?}");
            }
        }
        let swapped = on_device(size, &images, Layer::Color, true, &[]);
        for (a, b) in swapped.iter().zip(on_device(size, &images, Layer::Color, false, &[])) {
            let [r, g, b, a_] = b.to_le_bytes();
            assert_eq!(a.to_le_bytes(), [b, g, r, a_]);
        }
    }
}

#[test]
fn colours_are_the_png_s_bit_by_bit() {
    let (width, height) = (97, 31);
    // Every level, its edges, and a float to either side.
    let edges = (0..=255).flat_map(|level| [0.0, 0.5].map(|part| (level as f32 + part) / 255.0));
    let near = |x: f32| [x, x.next_up(), x.next_down()];
    let values: Vec<f32> = edges.flat_map(near).chain(ODD).collect();
    let color = |i: usize| [0, 1, 2].map(|k| values[(3 * i + k) % values.len()]);
    let color: Vec<[f32; 3]> = (0..width * height).map(color).collect();
    let images = [color.iter().map(|[r, g, b]| [*r, *g, *b, 0.0]).collect(), vec![[0.0; 4]; color.len()]];
    let found = on_device([width as u32, height as u32], &images, Layer::Color, false, &[]);
    let file = std::env::temp_dir().join(format!("ivv-show-{}.png", std::process::id()));
    Frame { width: width as u32, height: height as u32, color, ..Frame::default() }.write_png(&file).unwrap();
    let png = image::open(&file).unwrap().to_rgb8();
    std::fs::remove_file(file).unwrap();
    for (word, pixel) in found.iter().zip(png.pixels()) {
        assert_eq!(word.to_le_bytes()[..3], pixel.0);
    }
}

#[test]
fn an_overlay_lies_over_the_last_rows_alone() {
    let size = [13, 9];
    let images = images(13 * 9);
    let overlay: Vec<u32> = (0..13 * 4).map(|i: u32| i.wrapping_mul(0x9e37_79b9)).collect();
    let plain = on_device(size, &images, Layer::Color, false, &[]);
    let found = on_device(size, &images, Layer::Color, false, &overlay);
    let (above, below) = plain.split_at(13 * 5);
    assert_eq!(found[..13 * 5], *above);
    for ((found, plain), over) in found[13 * 5..].iter().zip(below).zip(overlay) {
        let [r, g, b, _] = plain.to_le_bytes();
        assert_eq!(found.to_le_bytes()[..3], laid_over(over, [r, g, b]));
    }
}
