//! Frames as PNG, OpenEXR and safetensors, and tensors.

use super::{Folder, fault};
use crate::common::golden::{self, CASES};
use crate::common::prelude::*;
use exr::prelude::read_first_flat_layer_from_file;
use ivv::internals::files::{Tensor, read_tensors, write_tensors};

fn frame() -> Frame {
    let (width, height) = (7, 5);
    let n = 35;
    let mut value = -0.5;
    let mut next = || {
        value += 0.011_7_f32;
        value
    };
    let mut frame = Frame {
        width,
        height,
        color: (0..n).map(|_| [next(), next(), next()]).collect(),
        alpha: (0..n).map(|_| next()).collect(),
        depth: (0..n).map(|_| next()).collect(),
        inverse_depth: (0..n).map(|_| next()).collect(),
        flow: (0..n).map(|_| [next(), next()]).collect(),
    };
    frame.color[8][1] = f32::NAN;
    frame.depth[3] = 1e30;
    frame
}

#[test]
fn a_png_holds_the_clamped_colours_rounded_to_the_nearest_level() {
    let folder = Folder::new("png");
    let path = folder.file("frame.png");
    let mut frame = frame();
    frame.color[0] = [0.5, 127.4 / 255.0, 127.6 / 255.0];
    frame.color[1] = [f32::INFINITY, f32::NEG_INFINITY, 1.0];
    frame.write_png(&path).unwrap();
    let image = image::open(&path).unwrap().into_rgb8();
    assert_eq!(image.dimensions(), (7, 5));
    assert_eq!(image.get_pixel(0, 0).0, [128, 127, 128]);
    assert_eq!(image.get_pixel(1, 0).0, [255, 0, 255]);
    assert_eq!(image.get_pixel(1, 1).0[1], 0, "NaN becomes 0");
    for (color, pixel) in frame.color.iter().zip(image.pixels()) {
        for (c, level) in color.iter().zip(pixel.0).filter(|(c, _)| c.is_finite()) {
            assert!((c.clamp(0.0, 1.0) * 255.0 - f32::from(level)).abs() <= 0.5 + 1e-4);
        }
    }
    assert!(image.as_raw().iter().any(|&level| level > 100));
}

#[test]
fn an_exr_holds_every_channel_bit_for_bit() {
    let folder = Folder::new("exr");
    let path = folder.file("frame.exr");
    let frame = frame();
    frame.write_exr(&path).unwrap();
    let layer = read_first_flat_layer_from_file(&path).unwrap().layer_data;
    assert_eq!((layer.size.x(), layer.size.y()), (7, 5));
    let read: BTreeMap<String, Vec<u32>> = layer
        .channel_data
        .list
        .iter()
        .map(|c| (c.name.to_string(), c.sample_data.values_as_f32().map(f32::to_bits).collect()))
        .collect();
    let bits = |values: &mut dyn Iterator<Item = f32>| values.map(f32::to_bits).collect::<Vec<_>>();
    let expected: BTreeMap<String, Vec<u32>> = [
        ("R", bits(&mut frame.color.iter().map(|c| c[0]))),
        ("G", bits(&mut frame.color.iter().map(|c| c[1]))),
        ("B", bits(&mut frame.color.iter().map(|c| c[2]))),
        ("A", bits(&mut frame.alpha.iter().copied())),
        ("depth.Z", bits(&mut frame.depth.iter().copied())),
        ("inverse_depth", bits(&mut frame.inverse_depth.iter().copied())),
        ("flow.X", bits(&mut frame.flow.iter().map(|f| f[0]))),
        ("flow.Y", bits(&mut frame.flow.iter().map(|f| f[1]))),
    ]
    .map(|(name, values)| (name.to_owned(), values))
    .into();
    assert_eq!(read, expected);
}

#[test]
fn safetensors_hold_every_output_in_its_shape() {
    let folder = Folder::new("safetensors");
    let path = folder.file("frame.safetensors");
    let mut frame = frame();
    frame.color[8][1] = 0.25;
    frame.write_safetensors(&path).unwrap();
    let tensors = read_tensors(&path).unwrap();
    let wide = |values: &[f32]| values.iter().map(|&v| f64::from(v)).collect::<Vec<_>>();
    let expected: BTreeMap<String, Tensor> = [
        ("alpha", vec![5, 7], wide(&frame.alpha)),
        ("color", vec![5, 7, 3], wide(frame.color.as_flattened())),
        ("depth", vec![5, 7], wide(&frame.depth)),
        ("flow", vec![5, 7, 2], wide(frame.flow.as_flattened())),
        ("inverse_depth", vec![5, 7], wide(&frame.inverse_depth)),
    ]
    .map(|(name, shape, data)| (name.to_owned(), Tensor { shape, data }))
    .into();
    assert_eq!(tensors, expected);
    let first = fs::read(&path).unwrap();
    frame.write_safetensors(&path).unwrap();
    assert_same("written again", &fs::read(&path).unwrap(), &first);
}

#[test]
fn a_frame_that_is_empty_or_torn_is_not_written() {
    let folder = Folder::new("torn");
    let path = folder.file("frame");
    let (mut torn, mut colorless) = (frame(), frame());
    torn.flow.pop();
    colorless.color.pop();
    for bad in [torn, colorless.clone(), Frame::default()] {
        for write in [Frame::write_exr, Frame::write_safetensors] {
            assert!(fault(write(&bad, &path), &path).contains("pixels with arrays of"));
            assert!(!path.exists());
        }
    }
    // A PNG needs the colour alone.
    for bad in [colorless, Frame::default()] {
        assert!(fault(bad.write_png(&path), &path).contains("pixels with arrays of"));
        assert!(!path.exists());
    }
    assert!(fault(write_tensors(&path, &[("t", &[2, 3], &[0.0; 5])]), &path).contains("tensor `t`"));
}

#[test]
fn damaged_tensor_files_give_errors() {
    let folder = Folder::new("damaged-tensors");
    let path = folder.file("t.safetensors");
    write_tensors(&path, &[("t", &[2, 3], &[1.0, 2.0, 3.0, 4.0, 5.0, 6.0]), ("scalar", &[], &[7.0])]).unwrap();
    let read = read_tensors(&path).unwrap();
    assert_eq!(read["t"].data, [1.0, 2.0, 3.0, 4.0, 5.0, 6.0]);
    assert_eq!(read["scalar"], Tensor { shape: vec![], data: vec![7.0] });
    let whole = fs::read(&path).unwrap();
    for n in 0..whole.len() {
        let path = folder.write("cut.safetensors", &whole[..n]);
        fault(read_tensors(&path), &path);
    }
    let header = 8 + u64::from_le_bytes(*whole.first_chunk().unwrap()) as usize;
    for at in 0..header {
        for flip in [0x01, 0x10, 0x80, 0xff] {
            let mut bytes = whole.clone();
            bytes[at] ^= flip;
            let path = folder.write("flip.safetensors", &bytes);
            if let Ok(tensors) = read_tensors(&path) {
                assert!(tensors.values().all(|t| t.data.len() == t.shape.iter().product::<usize>()));
            } else {
                fault(read_tensors(&path), &path);
            }
        }
    }
    let text = String::from_utf8_lossy(&whole[8..header]).replace("F32", "I32");
    let path = folder.write("int.safetensors", [&whole[..8], text.as_bytes(), &whole[header..]].concat());
    assert!(fault(read_tensors(&path), &path).contains("has the type I32"));
}

#[test]
fn the_golden_tensors_are_read_in_double_precision() {
    for case in CASES {
        let Some(folder) = golden::folder(case) else { continue };
        let tensors = read_tensors(&folder.join("outputs.safetensors")).unwrap();
        let color = &tensors["color"];
        assert_eq!((color.shape.len(), color.shape[2]), (3, 3), "{case}");
        assert_eq!(color.data.len(), color.shape.iter().product::<usize>());
        assert!(color.data.iter().all(|c| c.is_finite()) && color.data.iter().any(|&c| c > 0.1));
        for name in ["gradients", "cotangents"] {
            assert!(!read_tensors(&folder.join(format!("{name}.safetensors"))).unwrap().is_empty());
        }
    }
}
