//! The small inputs beside the checkout, `../shared/cases`, as someone new would try them. Each has a README that says what is right.

use crate::common::prelude::*;

struct Told {
    text: String,
    code: i32,
}

fn ivv(verb: &str, input: &Path, more: &[&str]) -> Told {
    let mut command = Command::new(env!("CARGO_BIN_EXE_ivv"));
    let output = command.arg(verb).arg(input).args(more).output().unwrap();
    let text = [output.stdout, output.stderr].map(|text| String::from_utf8_lossy(&text).into_owned()).concat();
    Told { text, code: output.status.code().unwrap_or(-1) }
}

/// Prepares an input without points; what was said, and the capture.
fn prepared(folder: &Folder, input: &str, more: &[&str]) -> Option<(Told, PathBuf)> {
    let source = shared(&format!("cases/{input}"))?;
    let out = folder.0.join(input.replace('/', "-"));
    let arguments = [&["-o", out.to_str().unwrap(), "--triangulate", "none"], more].concat();
    Some((ivv("prepare", &source, &arguments), out))
}

#[track_caller]
fn assert_said(told: &Told, code: i32, says: &[&str]) {
    assert_eq!(told.code, code, "{}", told.text);
    for say in says {
        assert!(told.text.contains(say), "nothing says {say:?}:\n{}", told.text);
    }
}

#[test]
fn calibrations_of_the_cases_are_read() {
    needs!("ffmpeg");
    let folder = Folder::new("prepare-cases-calibrations");
    for (input, format) in [
        ("captures/easymocap", "EasyMocap"),
        ("captures/anipose", "anipose"),
        ("captures/pose2sim_like", "Pose2Sim"),
        ("captures/trials/Trial_1", "Pose2Sim"),
    ] {
        let Some((told, out)) = prepared(&folder, input, &[]) else { continue };
        assert_said(&told, 0, &[format, "cameras: 4"]);
        assert_said(&ivv("check", &out, &[]), 0, &["ivv capture folder"]);
    }
    let Some(trials) = shared("cases/captures/trials") else { return };
    let command = format!("ivv prepare {}/Trial_1", trials.display());
    assert_said(&ivv("check", &trials, &[]), 3, &["project of 2 trials", &command]);
    assert_said(
        &prepared(&folder, "captures/trials", &[]).unwrap().0,
        3,
        &["holds 2 trials", "Trial_1, Trial_2", &command],
    );
}

#[test]
fn footage_of_the_cases_is_found() {
    needs!("ffmpeg");
    let folder = Folder::new("prepare-cases-footage");
    for (input, says) in [
        ("footage/folder_per_camera", &["COLMAP rig", "cameras: 2"][..]),
        ("footage/tif_sequence", &["cameras: 2", "4 .tif: read by ffmpeg"]),
        ("footage/space_in_name", &["cameras: 3"]),
    ] {
        let Some((told, _)) = prepared(&folder, input, &[]) else { continue };
        assert_said(&told, 0, says);
    }
}

#[test]
fn photos_of_the_cases_are_read_or_named() {
    needs!("colmap", "ffmpeg");
    let folder = Folder::new("prepare-cases-photos");
    let Some((told, _)) = prepared(&folder, "footage/heic_photos", &[]) else { return };
    // An ffmpeg of today reads them; they are small and of noise, so that COLMAP may place none.
    let is_read = told.text.contains("8 pictures");
    assert!(
        is_read || told.text.contains("3 .HEIC are left out") && told.text.contains("heif-convert"),
        "{}",
        told.text
    );
    assert!(told.code == 0 || told.text.contains(" pairs share some"), "{}", told.text);
}

/// All of COLMAP on three videos whose names have spaces.
#[test]
fn points_of_cameras_with_spaces_in_their_names_are_triangulated() {
    needs!("colmap", "ffmpeg");
    let folder = Folder::new("prepare-cases-spaces");
    let Some(source) = shared("cases/footage/space_in_name") else { return };
    let out = folder.0.join("out");
    let told = ivv("prepare", &source, &["-o", out.to_str().unwrap(), "--frames", "1"]);
    assert_said(&told, 0, &["cameras: 3", "points:"]);
    assert_said(&ivv("check", &out, &[]), 0, &["cameras: 3"]);
}
