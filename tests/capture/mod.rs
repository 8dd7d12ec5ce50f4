//! Captures: every format is read, every fault is told, and images stream in order.

mod cache;
mod cases;
mod colmap;
mod dialects;
pub mod dynamic;
mod folder;
pub mod hostile;
pub mod model;
mod others;
pub mod photos;
mod pictures;
mod places;
pub mod priors;
mod projects;
mod real;
mod settings;
pub mod transforms;

use crate::common::prelude::*;
use image::ImageEncoder;
use image::codecs::png::PngEncoder;
use ivv::internals::scene::capture::Report;

pub use crate::common::folder::Folder;

/// A change to something valid and what the fault then says.
type Case<T> = (fn(&mut T), &'static str);

impl Folder {
    fn check(&self) -> Report {
        check_capture(&self.0, &CaptureSettings::default())
    }

    fn open(&self) -> Capture {
        Capture::open(&self.0).unwrap()
    }
}

/// A PNG whose pixel i has the colour (first + i, i, 7).
pub fn png(width: u32, height: u32, first: u8) -> Vec<u8> {
    let pixels = (0..width * height).flat_map(|i| [first.wrapping_add(i as u8), i as u8, 7]);
    encode(&pixels.collect::<Vec<_>>(), width, height, ExtendedColorType::Rgb8)
}

pub fn encode(pixels: &[u8], width: u32, height: u32, kind: ExtendedColorType) -> Vec<u8> {
    let mut bytes = Vec::new();
    PngEncoder::new(&mut bytes).write_image(pixels, width, height, kind).unwrap();
    bytes
}

/// The faults as text, one in a line; each has a reason and a remedy.
pub fn told(report: &Report) -> String {
    assert_eq!(report.n_faults, report.faults.len() as u64);
    for fault in &report.faults {
        assert!(!fault.reason.is_empty() && !fault.remedy.is_empty(), "{fault}");
    }
    report.faults.iter().map(|fault| format!("{fault}\n")).collect()
}

/// Asserts that each of `says` is in a fault of the report, and that there is a fault at all.
pub fn assert_told(report: &Report, says: &[&str]) {
    let told = told(report);
    assert!(report.n_faults > 0 && !says.is_empty());
    for say in says {
        assert!(told.contains(say), "no fault says {say:?}:\n{told}");
    }
}
