//! Pictures as cameras and programs write them: turned, of other kinds, of codings that are not read.

use super::model::{sample, sample_project, write, write_images};
use super::{Folder, assert_told, png, told};
use crate::common::prelude::*;
use image::codecs::jpeg::JpegEncoder;

/// A JPEG whose upper left quarter is white, the rest black; with an EXIF orientation where it is not 0.
fn jpeg(width: u32, height: u32, orientation: u8) -> Vec<u8> {
    let is_white = |i: u32| i % width < width / 2 && i / width < height / 2;
    let pixels: Vec<u8> = (0..width * height).flat_map(|i| [if is_white(i) { 255 } else { 0 }; 3]).collect();
    let mut bytes = Vec::new();
    JpegEncoder::new_with_quality(&mut bytes, 100).encode(&pixels, width, height, ExtendedColorType::Rgb8).unwrap();
    if orientation > 0 {
        // One directory of one entry, big-endian.
        let mut tiff = b"MM\0\x2a\0\0\0\x08\0\x01\x01\x12\0\x03\0\0\0\x01\0".to_vec();
        tiff.extend([orientation, 0, 0, 0, 0, 0, 0]);
        let mut segment = vec![0xff, 0xe1, 0, (8 + tiff.len()) as u8];
        segment.extend(b"Exif\0\0");
        segment.extend(tiff);
        bytes.splice(2..2, segment);
    }
    bytes
}

#[test]
fn a_picture_that_fits_its_camera_only_when_turned_is_turned() {
    let folder = Folder::new("exif");
    let mut model = sample();
    (model.cameras[0].3, model.cameras[0].4) = (32, 16);
    write(&folder, &model);
    write_images(&folder);
    // Stored on its side: its first row is shown at the right (6) or at the left (8).
    for (orientation, white) in [(6, (24, 4)), (8, (4, 12))] {
        folder.write("images/b.png", jpeg(16, 32, orientation));
        folder.write("images/c d.png", jpeg(32, 16, 1));
        let report = folder.check();
        assert_eq!(told(&report), "");
        assert!(
            report
                .notes
                .iter()
                .any(|note| note.starts_with("images that carry an EXIF turn, and fit their cameras only so: 1;")),
            "{:?}",
            report.notes
        );
        let picture = folder.open().picture(1, 0).unwrap();
        assert_eq!((picture.width, picture.height), (32, 16));
        for corner in [(4, 4), (24, 4), (4, 12), (24, 12)] {
            let red = picture.pixels[corner.1 * 32 + corner.0] as u8;
            assert_eq!(red > 128, corner == white, "{orientation}: {red} at {corner:?}");
        }
    }
    folder.write("images/b.png", jpeg(16, 32, 1));
    assert_told(&folder.check(), &["b.png: is 16 x 32, its camera is calibrated for 32 x 16"]);
}

#[test]
fn a_picture_of_a_kind_that_is_not_read_is_called_what_it_is() {
    let folder = sample_project("kinds");
    // The frame header of the JPEG, and the bits of a sample in it.
    let whole = jpeg(6, 4, 0);
    let at = whole.windows(2).position(|pair| pair == [0xff, 0xc0]).unwrap();
    let changed = |marker: u8, bits: u8| {
        let mut bytes = whole.clone();
        (bytes[at + 1], bytes[at + 4]) = (marker, bits);
        bytes
    };
    for (bytes, says) in [
        (changed(0xc1, 12), "is a JPEG of 12 bits a sample, which is not read"),
        (changed(0xc9, 8), "is an arithmetically coded JPEG"),
        (changed(0xca, 8), "is an arithmetically coded JPEG"),
        (changed(0xc3, 8), "is a lossless JPEG"),
        (b"RIFF\x10\0\0\0WEBPVP8 ".to_vec(), "is a WebP, neither a PNG nor a JPEG; convert the images"),
        (b"\0\0\0\x18ftypheic\0\0\0\0".to_vec(), "is a HEIC"),
        (b"II\x2a\0\x08\0\0\0\0\0\0\0".to_vec(), "is a TIFF"),
        (b"hello, world!".to_vec(), "is neither a PNG nor a JPEG"),
    ] {
        folder.write("images/b.png", bytes);
        let report = folder.check();
        assert_eq!(report.n_faults, 1, "{}", told(&report));
        assert_told(&report, &[says]);
    }
}

#[test]
fn what_will_be_missed_is_told_before_training() {
    let folder = Folder::new("foretold");
    let mut model = sample();
    model.points.clear();
    (model.cameras[0].3, model.cameras[0].4) = (8, 4);
    write(&folder, &model);
    write_images(&folder);
    folder.write("images/b.png", png(8, 4, 0));
    folder.write("images/c d.png", png(8, 4, 0));
    let settings = CaptureSettings { test_every: 0, ..CaptureSettings::default() };
    let report = check_capture(&folder.0, &settings);
    assert_eq!(told(&report), "");
    for says in ["so nothing will be scored", "there are no points", "images have 2 sizes, from 6 x 4 to 8 x 4"] {
        assert!(report.notes.iter().any(|note| note.contains(says)), "{says}: {:?}", report.notes);
    }
    assert!(Capture::open_with(&folder.0, &settings).is_ok());
}
