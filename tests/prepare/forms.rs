//! Photos without cameras in other forms than PNG and JPEG of 8 bits, and what is said where COLMAP places nothing.

use super::pictures::{models, stand_in};
use super::{calls, ivv_prepare, run, settings, video};
use crate::capture::{encode, png};
use crate::common::prelude::*;
use ivv::internals::prepare::{forecast, recognise};
use ivv::internals::random::Keyed;

fn converted(folder: &Folder, from: &str, to: &str) {
    let [from, to] = [from, to].map(|name| folder.0.join(name));
    let mut command = Command::new("ffmpeg");
    command.args(["-v", "error", "-y", "-i"]).arg(&from).args(["-frames:v", "1", "-lossless", "1"]).arg(&to);
    assert!(command.status().unwrap().success());
}

#[test]
fn photos_in_other_forms_are_converted_and_none_is_dropped_in_silence() {
    needs!("ffmpeg");
    let folder = Folder::new("prepare-forms");
    folder.write("own.png", png(64, 48, 9));
    std::fs::create_dir_all(folder.0.join("source")).unwrap();
    for form in ["a.tif", "b.webp"] {
        converted(&folder, "own.png", &format!("source/{form}"));
    }
    // 16 bits a colour.
    let deep: Vec<u8> = (0..64 * 48 * 3).flat_map(|k: u32| (257 * (k % 200) as u16).to_ne_bytes()).collect();
    folder.write("source/d.png", encode(&deep, 64, 48, image::ExtendedColorType::Rgb16));
    folder.write("source/e.png", png(64, 48, 1));
    // A raw picture beside its developed form is that; the other two are not read.
    folder.write("source/e.ARW", "raw");
    folder.write("source/f.HEIC", "no picture");
    folder.write("source/g.nef", "raw");
    models(&folder, ["a.png", "b.png", "d.png"]);
    stand_in(&folder);
    let out = folder.0.join("out");
    let output = ivv_prepare(&folder, &[]);
    let told = String::from_utf8([output.stdout, output.stderr].concat()).unwrap();
    assert!(output.status.success(), "{told}");
    assert!(told.contains("COLMAP places 4 pictures"), "{told}");
    let says = [
        "1 .HEIC and 1 .nef are left out",
        "heif-convert",
        "darktable-cli",
        "1 .tif and 1 .webp: read by ffmpeg",
        "1 pictures of 16 bits",
    ];
    for say in says {
        assert_eq!(told.matches(say).count(), 1, "{say}: {told}");
    }
    assert!(!told.contains(".ARW"), "{told}");
    // What COLMAP is given, it can read: pictures of 8 bits, of the same pixels.
    let given = |name: &str| image::open(out.join("reconstruction/images").join(name)).unwrap();
    let own = image::open(folder.0.join("own.png")).unwrap().into_rgb8();
    for name in ["a.png", "b.png"] {
        assert_eq!(given(name).into_rgb8(), own, "{name}");
    }
    assert_eq!((given("d.png").color(), given("d.png").into_rgb8().as_raw()[7]), (image::ColorType::Rgb8, 7));
    assert_eq!(Capture::open(&out).unwrap().cameras.len(), 3);
    let calls = calls(&folder);
    assert!(calls.contains("out/reconstruction/images"), "{calls}");
}

#[test]
fn a_folder_of_what_is_not_read_is_told_with_what_converts_it() {
    let folder = Folder::new("prepare-heic");
    (0..3).for_each(|k| drop(folder.write(&format!("source/IMG_{k}.ARW"), "raw")));
    assert_eq!(recognise(&folder.0.join("source")).unwrap().what, "photos");
    let told = run(&settings(&folder)).map(|_| ()).unwrap_err().to_string();
    assert!(told.contains("holds 3 .ARW, which are not read here") && told.contains("darktable-cli"), "{told}");
}

#[test]
fn poses_of_others_are_named_where_they_are_not_read() {
    let folder = Folder::new("prepare-others");
    for (name, text, program) in [
        ("cameras.csv", "#name,x,y,alt,heading,pitch,roll\na.png,0,0,0,0,0,0\n", "RealityScan"),
        ("cameras.xml", "<?xml version=\"1.0\"?>\n<document version=\"2.0.0\">\n<chunk label=\"1\">", "Metashape"),
        ("scene.blend", "BLENDER-v300", "Blender"),
        ("cameras.sfm", "{\"version\": []}", "Meshroom"),
    ] {
        let source = folder.0.join(name.replace('.', "-"));
        let place = |file: &str| format!("{}/{file}", name.replace('.', "-"));
        ["a.png", "b.png", "c.png"].iter().for_each(|photo| drop(folder.write(&place(photo), png(64, 48, 0))));
        assert_eq!(recognise(&source).unwrap().what, "photos");
        folder.write(&place(name), text);
        let what = recognise(&source).unwrap().what;
        assert!(what.contains(&format!("poses of {program} in {name} are not read")), "{what}");
        if has_program("colmap") {
            let forecast = forecast(&PrepareSettings::new(&source, &folder.0.join("out"))).unwrap().unwrap();
            assert!(forecast.notes[0].contains(program), "{forecast:?}");
        }
    }
    // A table of something else is none.
    folder.write("plain/a.csv", "time,value\n0,1\n");
    ["a.png", "b.png"].iter().for_each(|photo| drop(folder.write(&format!("plain/{photo}"), png(64, 48, 0))));
    assert_eq!(recognise(&folder.0.join("plain")).unwrap().what, "photos");
}

/// A picture in which every pixel is its own: much to see, and nothing that another has.
fn noise(seed: u64) -> Vec<u8> {
    let coarse: Vec<u8> = (0..40 * 30).map(|k| (256.0 * Keyed::new(&[seed]).uniform(k)) as u8).collect();
    let pixels = (0..160 * 120_usize).flat_map(|k| [coarse[(k / 160) / 4 * 40 + (k % 160) / 4]; 3]);
    encode(&pixels.collect::<Vec<_>>(), 160, 120, image::ExtendedColorType::Rgb8)
}

/// COLMAP itself, on pictures that have nothing in common.
#[test]
fn pictures_that_share_nothing_are_told_by_what_they_share() {
    needs!("colmap");
    let folder = Folder::new("prepare-nothing");
    (0..3_u64).for_each(|k| drop(folder.write(&format!("source/photo {k}.png"), noise(k))));
    let told = run(&settings(&folder)).map(|_| ()).unwrap_err().to_string();
    assert!(told.contains("3 pictures with ") && told.contains(", and 0 of 3 pairs share some"), "{told}");
    assert!(told.contains("photo 1 none") && told.contains("overlap"), "{told}");
    assert!(!told.contains("check the file") && !told.contains("run the"), "{told}");
}

#[test]
fn a_file_that_is_no_video_is_not_tried_again() {
    needs!("ffmpeg");
    let folder = Folder::new("prepare-broken");
    let file = folder.write("source/a.mp4", "no video");
    video(&folder.0.join("source/b.mp4"), 2);
    std::fs::copy(folder.0.join("source/b.mp4"), folder.0.join("source/c.mp4")).unwrap();
    let told = run(&settings(&folder)).map(|_| ()).unwrap_err().to_string();
    assert!(told.contains(&file.display().to_string()) && told.contains("copy the file again"), "{told}");
    assert!(!told.contains("run the command"), "{told}");
    assert!(Path::new(&file).is_file());
}
