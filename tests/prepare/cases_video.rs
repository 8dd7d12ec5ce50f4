//! Small recordings beside the checkout, each of a kind that once went wrong: videos.

use crate::common::prelude::*;

/// What `ivv prepare` says of a case, and the capture that it made; nothing where cases or ffmpeg are absent.
#[track_caller]
fn prepared(case: &str) -> Option<(Folder, String, Capture)> {
    let source = shared(&format!("cases/footage/{case}"))?;
    if !has_program("ffmpeg") {
        return None;
    }
    let folder = Folder::new(&format!("case-{case}"));
    let out = folder.0.join("out");
    let mut command = Command::new(env!("CARGO_BIN_EXE_ivv"));
    command.arg("prepare").arg(source).arg("-o").arg(&out).args(["--triangulate", "none"]);
    let output = command.output().unwrap();
    let told = [output.stdout, output.stderr].map(|text| String::from_utf8_lossy(&text).into_owned()).concat();
    assert!(output.status.success(), "{told}");
    let capture = Capture::open(&out).unwrap();
    Some((folder, told, capture))
}

/// How far the pictures of two cameras of one scene are apart, levels of 255 in the mean.
fn apart(capture: &Capture, frame: u32) -> f64 {
    let [a, b] = [0, 1].map(|camera| capture.picture(camera, frame).unwrap().pixels);
    let off =
        |(a, b): (&u32, &u32)| (0..3).map(|c| u32::from(a.to_le_bytes()[c].abs_diff(b.to_le_bytes()[c]))).sum::<u32>();
    f64::from(a.iter().zip(&b).map(off).sum::<u32>()) / (3 * a.len()) as f64
}

fn of_both(capture: &Capture) -> Vec<u32> {
    let has = |camera: usize, frame: u32| capture.cameras[camera].shots.iter().any(|shot| shot.frame == frame);
    (0..capture.n_frames).filter(|frame| has(0, *frame) && has(1, *frame)).collect()
}

#[test]
fn a_variable_rate_is_paired_by_time_stamp() {
    let Some((_folder, told, capture)) = prepared("vfr") else { return };
    assert!(told.contains("camera `b`") && told.contains("missing"), "{told}");
    let both = of_both(&capture);
    assert!(both.len() > 8, "{told}");
    for frame in both {
        assert!(apart(&capture, frame) < 6.0, "frame {frame}: {}", apart(&capture, frame));
    }
}

#[test]
fn an_edit_list_gives_what_players_show() {
    let Some((_folder, told, capture)) = prepared("edit_list") else { return };
    assert!(told.contains("different numbers of frames") && capture.n_frames > 0, "{told}");
    assert_eq!(of_both(&capture).len(), capture.n_frames as usize);
}

#[test]
fn hlg_is_tone_mapped() {
    let Some((_folder, told, capture)) = prepared("hlg") else { return };
    assert!(told.contains("camera `b`: its video is HLG, BT.2020: tone-mapped to BT.709"), "{told}");
    // 70 before; what is left is the brightest third, which is compressed.
    assert!(apart(&capture, 0) < 35.0, "{}", apart(&capture, 0));
}

#[test]
fn fields_are_made_into_pictures() {
    let Some((_folder, told, capture)) = prepared("interlaced") else { return };
    assert!(told.contains("camera `b`: its video is interlaced (top field first): de-interlaced"), "{told}");
    assert_eq!(of_both(&capture).len(), capture.n_frames as usize);
}
