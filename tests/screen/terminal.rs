//! Progress on a terminal of some width.

use super::{Folder, ivv};
use crate::common::prelude::*;
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use rustix::termios::{Winsize, tcsetwinsize};
use std::io::Read;

fn on_terminal(mut command: Command, columns: u16) -> String {
    let ours = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY).unwrap();
    grantpt(&ours).unwrap();
    unlockpt(&ours).unwrap();
    let name = ptsname(&ours, Vec::new()).unwrap().into_string().unwrap();
    let theirs = File::options().read(true).write(true).open(name).unwrap();
    tcsetwinsize(&ours, Winsize { ws_row: 24, ws_col: columns, ws_xpixel: 0, ws_ypixel: 0 }).unwrap();
    let mut child = command.env("TERM", "xterm").stdout(Stdio::null()).stderr(theirs).spawn().unwrap();
    // The command holds an end of the terminal too; drop it with it, for the reader to see the end.
    drop(command);
    let reader = std::thread::spawn(move || {
        let (mut ours, mut all, mut part) = (File::from(ours), Vec::new(), [0; 4096]);
        // A terminal whose other end is closed gives an error at its end.
        while let Ok(n @ 1..) = ours.read(&mut part) {
            all.extend_from_slice(&part[..n]);
        }
        String::from_utf8(all).unwrap()
    });
    let status = child.wait().unwrap();
    let told = reader.join().unwrap();
    assert!(status.success(), "{told}");
    told
}

/// The lines that stay on a terminal on which nothing wraps.
fn lines(told: &str) -> Vec<String> {
    let kept = |line: &str| line.rsplit("\r\x1b[2K").next().unwrap().trim_end_matches('\r').to_owned();
    told.split('\n').map(kept).collect()
}

#[test]
fn the_bar_fits_the_terminal_and_messages_do_not_touch_it() {
    let folder = Folder::new("terminal");
    let (capture, run) = (folder.capture(), folder.path("run"));
    for columns in [40, 200] {
        // Two evaluations while the bar stands.
        let train = ["train", &capture, "-o", &run, "--steps", "30", "--eval-every", "10", "--max-gaussians", "500"];
        let told = on_terminal(ivv(&[&train[..], &["--overwrite", "--eval-images", "1"]].concat()), columns);
        let bars = told.split(['\r', '\n']).filter_map(|line| line.strip_prefix("\x1b[2K"));
        let bars: Vec<&str> = bars.filter(|bar| bar.contains(['█', '░'])).collect();
        assert!(bars.len() > 2, "{told:?}");
        for bar in bars {
            let bar = bar.split('\x1b').next().unwrap();
            assert!(bar.chars().count() < usize::from(columns), "{columns} columns: {bar:?}");
        }
        let lines = lines(&told);
        assert!(lines.iter().any(|line| line.starts_with("after 10 steps: PSNR")), "{lines:#?}");
        assert!(
            lines.iter().any(|line| line.contains(" 1 test image") && !line.contains("1 test images")),
            "{lines:#?}"
        );
        assert!(!told.contains("\x1b[?7l"), "no trick that leaves a letter in the last column");
        let last_bar = lines.iter().rfind(|line| line.contains("step 30/30")).unwrap();
        assert!(last_bar.starts_with('█') && !last_bar.contains('░'), "{last_bar}");
    }
}

#[test]
fn every_phase_of_a_training_shows_its_name_and_how_far_it_is() {
    let folder = Folder::new("phases");
    let (capture, run) = (folder.capture(), folder.path("run"));
    let train = ["train", &capture, "-o", &run, "--steps", "12", "--eval-every", "6", "--eval-images", "2"];
    let settings = ["--set", "required.reviews=1", "--set", "offsets=true", "--fit-offsets"];
    let told = on_terminal(ivv(&[&train[..], &settings].concat()), 200);
    let shown: Vec<&str> = told.split(['\r', '\n']).filter_map(|line| line.strip_prefix("\x1b[2K")).collect();
    // The tiny capture has two test cameras and four others, of two frames here.
    for phase in [
        "initialisation",
        "step 0/12, compiling the kernels",
        "evaluation 0/2",
        "evaluation 2/2, 0:00 left, ",
        "review of what is required",
        "time offsets of test cameras 0/2",
        "time offsets of test cameras 2/2, 0:00 left, ",
        "errors of time offsets 4/4, 0:00 left, ",
        "evaluation 0/4",
        "evaluation 4/4, 0:00 left, ",
        "evaluation at fitted offsets 4/4, 0:00 left, ",
        "views of the report 4/4, 0:00 left, ",
        "report 1/1, 0:00 left, report.html",
    ] {
        assert!(shown.iter().any(|line| line.contains(phase)), "{phase}: {shown:#?}");
    }
    // An evaluation on the way leaves its scores, no bar.
    let lines = lines(&told);
    assert!(!lines.iter().any(|line| line.contains("evaluation 2/2")), "{lines:#?}");
    assert!(lines.iter().any(|line| line.starts_with("after 6 steps: PSNR")), "{lines:#?}");
}
