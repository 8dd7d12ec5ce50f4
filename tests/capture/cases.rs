//! Captures as strangers have them, beside the checkout: each is read, or refused with the step that works.

use super::told;
use crate::common::prelude::*;
use ivv::internals::scene::capture::Report;

/// What a case should be: so many cameras, and what its notes say; or what its fault says.
enum Right {
    Read(usize, &'static [&'static str]),
    Refused(&'static [&'static str]),
}
use Right::{Read, Refused};

/// A case below `cases`, and how it is read.
const CASES: [(&str, Right); 35] = [
    ("captures/absolute", Read(8, &["images that are not where transforms.json says"])),
    ("captures/all_missing", Refused(&["none of the 8 images that it names is there", "found"])),
    ("captures/backslash", Read(8, &["names with backslashes, as Windows writes them: 8"])),
    ("captures/colmap_other", Read(8, &["taken from rgb/000.png"])),
    ("captures/colmap_root", Read(8, &["taken from 000.png"])),
    ("captures/file_named", Read(8, &[])),
    ("captures/file_named/transforms.json", Read(8, &[])),
    ("captures/file_named/scene_b.json", Read(4, &[])),
    ("captures/gbk_name", Read(8, &["names that are not UTF-8: 1; they are"])),
    ("captures/good", Read(8, &[])),
    ("captures/good/sparse", Read(8, &[])),
    ("captures/good_transforms", Read(8, &[])),
    ("captures/k_matrix", Read(8, &[])),
    ("captures/list", Read(8, &[])),
    ("captures/llff", Read(8, &[])),
    ("captures/llff_colmap_mp4", Refused(&["distort", "`ivv prepare"])),
    ("captures/many_models", Read(8, &["sparse has 2 models: 0 with 2 images, 1 with 8 images; taken: 1"])),
    ("captures/mirrored", Read(8, &["poses mirror"])),
    ("captures/moved_beside", Read(8, &["taken from 000.png"])),
    ("captures/nested", Read(8, &["data is read, the only capture in"])),
    ("captures/no_images_file", Refused(&["images.txt: cannot be read"])),
    ("captures/opensfm", Read(8, &[])),
    ("captures/ply_points", Read(8, &[])),
    ("captures/quaternion", Read(8, &["quaternions that are not of length 1: 8 (up to 1.01"])),
    ("captures/rgba", Read(24, &["images with an alpha channel"])),
    ("captures/some_missing", Refused(&["is missing", "--skip-missing: 2 of 8"])),
    ("captures/tele", Read(24, &[])),
    ("captures/test_is_train", Read(8, &["8 of 8 test views are training views"])),
    ("captures/workspace", Read(8, &["dense/0/sparse/images.txt, whose images are, is read instead"])),
    ("footage/masks_beside", Read(3, &["images that have a mask in masks: 3 of 3"])),
    ("footage/other_case", Read(3, &["in upper and lower case"])),
    ("footage/two_models", Read(6, &["0 with 2 images, 1 with 6 images; taken: 1"])),
    ("footage/windows_paths", Read(2, &["names with backslashes"])),
    // Recordings, which `ivv prepare` reads.
    ("captures/pose2sim_like", Refused(&["not a recognised capture"])),
    ("captures/trials", Refused(&["not a recognised capture"])),
];

fn check(path: &Path, right: &Right) -> Result<(), String> {
    let report: Report = check_capture(path, &CaptureSettings::default());
    let notes = report.notes.join("\n");
    let missed = |text: &str, says: &[&str]| says.iter().find(|say| !text.contains(**say)).map(|say| (*say).to_owned());
    match right {
        Read(n, says) => match (report.n_faults, report.n_cameras == *n, missed(&notes, says)) {
            (0, true, None) => Ok(()),
            _ => Err(format!("{} cameras; {notes}\n{}", report.n_cameras, told(&report))),
        },
        Refused(says) => {
            let all = told(&report);
            // What follows from a fault is kept back.
            let n = report.grouped().len();
            if report.n_faults > 0 && n == 1 && missed(&all, says).is_none() {
                Ok(())
            } else {
                Err(format!("{n} kinds: {all}"))
            }
        }
    }
}

#[test]
fn captures_of_strangers_are_read_or_led_on() {
    let Some(cases) = shared("cases") else { return };
    let mut wrong = String::new();
    for (name, right) in &CASES {
        let path = cases.join(name);
        // A set of cases that lacks one says nothing of it.
        if path.exists() {
            wrong += &check(&path, right).err().map(|found| format!("{name}: {found}\n")).unwrap_or_default();
        }
    }
    assert_eq!(wrong, "");
}
