//! `ivv-play` on a display of its own: Xvfb, which keeps what is on its screen in a file. `tools/test.sh --play` runs this.
//!
//! All runs are under the validation layer, which must be silent.

#[path = "../../../../tests/faults/built.rs"]
mod built;
mod display;
mod sound;

use display::{Display, Picture, psnr};
use ivv::internals::formats::write_ply;
use ivv::internals::scene::{Intrinsics, View, demo, write_views};
use std::io::Read;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

/// The least likeness of two pictures that are the same, dB.
const SAME: f64 = 40.0;
/// Rows of the time bar, which lies over the picture.
const BAR: usize = 22;
const PATIENCE: Duration = Duration::from_secs(60);

/// The program `ivv`, which the test script builds beside `ivv-play`.
fn ivv() -> PathBuf {
    let program =
        Path::new(env!("CARGO_BIN_EXE_ivv-play")).with_file_name(format!("ivv{}", std::env::consts::EXE_SUFFIX));
    assert!(program.is_file(), "{} is missing: tools/test.sh --play builds it", program.display());
    program
}

/// A folder with a scene and its views, removed at the end.
struct Bed {
    folder: PathBuf,
    views: Vec<View>,
}

impl Bed {
    fn new(name: &str) -> Self {
        let folder = std::env::temp_dir().join(format!("ivv-play-{name}-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        let (splats, mut views) = demo();
        // A time at which all is there.
        views.iter_mut().for_each(|view| view.time = 0.5);
        write_ply(&folder.join("scene.ply"), &splats).unwrap();
        write_views(&folder.join("cameras.json"), &views).unwrap();
        Bed { folder, views }
    }

    fn at(&self, name: &str) -> PathBuf {
        self.folder.join(name)
    }

    /// The picture of `ivv render`.
    fn rendered(&self, view: &View) -> Picture {
        let (cameras, output) = (self.at("one.json"), self.at("rendered"));
        write_views(&cameras, std::slice::from_ref(view)).unwrap();
        let mut command = Command::new(ivv());
        command.arg("render").arg(self.at("scene.ply")).arg("--cameras").arg(cameras).arg("-o").arg(&output);
        told(command.output().unwrap());
        Picture::read(&output.join(format!("{}.png", view.name)))
    }

    /// `ivv-play` of the scene at rest in the middle of a clip, on `display`.
    fn play(&self, display: &Display) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_ivv-play"));
        command.arg(self.at("scene.ply")).arg("--cameras").arg(self.at("cameras.json"));
        command.args(["--seconds", "2", "--at", "1", "--validation"]).env("DISPLAY", &display.name);
        command.env_remove("WAYLAND_DISPLAY").stdin(Stdio::null());
        command
    }

    fn shot(&self, command: &mut Command) -> Picture {
        let file = self.at("shot.png");
        let _ = std::fs::remove_file(&file);
        told(command.args(["--frames", "4", "--screenshot"]).arg(&file).output().unwrap());
        Picture::read(&file)
    }
}

impl Drop for Bed {
    fn drop(&mut self) {
        if !std::thread::panicking() {
            let _ = std::fs::remove_dir_all(&self.folder);
        }
    }
}

/// Standard error of a run that went well; the validation layer, which writes to the log, was silent.
fn told(output: Output) -> String {
    let told = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.success(), "{:?}\n{told}", output.status);
    assert!(!told.contains("vulkan:"), "{told}");
    told
}

/// The view as a window of another size shows it, of the same shape.
fn scaled(view: &View, zoom: f64) -> View {
    let [width, height] = [view.intrinsics.width, view.intrinsics.height].map(|side| (f64::from(side) * zoom) as u32);
    let Intrinsics { fx, fy, cx, cy, .. } = view.intrinsics;
    let [fx, fy, cx, cy] = [fx, fy, cx, cy].map(|pixels| pixels * zoom);
    View { intrinsics: Intrinsics { width, height, fx, fy, cx, cy }, ..view.clone() }
}

fn size(view: &View) -> String {
    format!("{}x{}", view.intrinsics.width, view.intrinsics.height)
}

/// A run that goes on; it must end by itself in time.
struct Playing(Child);

impl Playing {
    fn end(mut self) -> String {
        let begun = Instant::now();
        while self.0.try_wait().unwrap().is_none() {
            assert!(begun.elapsed() < PATIENCE, "it does not end");
            std::thread::sleep(Duration::from_millis(20));
        }
        let mut output = Output { status: self.0.wait().unwrap(), stdout: Vec::new(), stderr: Vec::new() };
        self.0.stderr.take().unwrap().read_to_end(&mut output.stderr).unwrap();
        told(output)
    }
}

impl Drop for Playing {
    fn drop(&mut self) {
        let _ = self.0.kill();
    }
}

#[test]
fn a_screenshot_is_the_picture_of_ivv_render() {
    let (display, bed) = (Display::new(), Bed::new("shot"));
    for (k, zoom) in [(0, 1.0), (3, 1.5), (7, 0.4)] {
        let view = scaled(&bed.views[k], zoom);
        let mut play = bed.play(&display);
        play.args(["--camera", &view.name, "--size", &size(&view)]);
        let likeness = psnr(&bed.shot(&mut play), &bed.rendered(&view), 0);
        println!("{}: {likeness:.1} dB", size(&view));
        assert!(likeness >= SAME, "{} at {zoom}: {likeness:.1} dB", view.name);
    }
}

#[test]
fn every_output_looks_different_and_times_lie_over_the_picture() {
    let (display, bed) = (Display::new(), Bed::new("outputs"));
    let shots = ["color", "alpha", "depth", "flow"].map(|output| {
        let mut play = bed.play(&display);
        bed.shot(play.args(["--size", "320x240", "--output", output]))
    });
    for a in 0..4 {
        for b in 0..a {
            assert!(psnr(&shots[a], &shots[b], 0) < 25.0, "outputs {a} and {b}");
        }
    }
    let mut play = bed.play(&display);
    let with_times = bed.shot(play.args(["--size", "320x240", "--stats", "--no-vsync"]));
    assert_eq!(psnr(&with_times, &shots[0], 140), f64::INFINITY, "above them the picture is as it was");
    assert!(psnr(&with_times, &shots[0], 0) < 25.0);
}

/// Resized, unmapped and mapped again, with keys and the time bar: what is on the screen is what `ivv render` gives.
#[test]
fn the_screen_shows_the_view_through_resizes_unmapping_and_keys() {
    let (display, bed) = (Display::new(), Bed::new("live"));
    let mut play = bed.play(&display);
    play.args(["--size", "320x240"]).stderr(Stdio::piped());
    let playing = Playing(play.spawn().unwrap());
    // Whatever brings the view about is done again now and then: a key that comes before the window has the focus is lost.
    let shows_after = |view: &View, act: &dyn Fn()| {
        let truth = bed.rendered(view);
        let (begun, mut best) = (Instant::now(), 0.0);
        for glance in 0.. {
            if glance % 40 == 0 {
                act();
            }
            std::thread::sleep(Duration::from_millis(50));
            best = psnr(&display.screen(truth.width, truth.height), &truth, BAR);
            if best >= SAME || begun.elapsed() > PATIENCE {
                break;
            }
        }
        assert!(best >= SAME, "{} of {}: {best:.1} dB", view.name, size(view));
    };
    let shows = |view: &View| shows_after(view, &|| ());
    shows(&bed.views[0]);
    let window = display.tool(&["search", "--sync", "--name", "^ivv$"]);
    for zoom in [2.0, 0.5, 1.25] {
        let view = scaled(&bed.views[0], zoom);
        let [width, height] = [view.intrinsics.width, view.intrinsics.height].map(|side| side.to_string());
        display.tool(&["windowsize", &window, &width, &height]);
        shows(&view);
    }
    display.tool(&["windowunmap", "--sync", &window]);
    std::thread::sleep(Duration::from_millis(500));
    display.tool(&["windowmap", "--sync", &window]);
    shows(&scaled(&bed.views[0], 1.25));
    display.tool(&["windowfocus", "--sync", &window]);
    for (key, view) in [("2", 1), ("4", 3), ("r", 0)] {
        shows_after(&scaled(&bed.views[view], 1.25), &|| drop(display.tool(&["key", key])));
    }
    // A quarter of the track: the clock of the clip, by the mouse.
    let [from, to] = [136.0, 400.0 - 8.0];
    let x = from + 0.25 * (to - from);
    let view = View { time: 0.25, ..scaled(&bed.views[0], 1.25) };
    shows_after(&view, &|| drop(display.tool(&["mousemove", &x.to_string(), "292", "click", "1"])));
    // A drag to one side turns; back again it ends where it began.
    let truth = bed.rendered(&view);
    display.tool(&["mousemove", "200", "100", "mousedown", "1", "mousemove", "260", "100"]);
    let changes = |below: f64, fault: &str| {
        let begun = Instant::now();
        while psnr(&display.screen(truth.width, truth.height), &truth, BAR) > below {
            assert!(begun.elapsed() < PATIENCE, "{fault}");
            std::thread::sleep(Duration::from_millis(20));
        }
    };
    changes(30.0, "a drag turns nothing");
    display.tool(&["mousemove", "200", "100", "mouseup", "1"]);
    shows(&view);
    display.tool(&["key", "space"]);
    changes(35.0, "the clip does not play");
    display.tool(&["key", "Escape"]);
    playing.end();
}

/// Runs with a fault of a call; the manifest of the layer that gives it is in `layer`.
fn with_fault(bed: &Bed, display: &Display, layer: &Path, fault: &str) -> Output {
    let explicit = "/usr/share/vulkan/explicit_layer.d:/etc/vulkan/explicit_layer.d";
    let mut play = bed.play(display);
    play.args(["--size", "320x240", "--frames", "6", "--screenshot"]).arg(bed.at("shot.png"));
    play.env("VK_LAYER_PATH", format!("{}:{explicit}", layer.display()));
    play.env("VK_INSTANCE_LAYERS", "VK_LAYER_IVV_faults").env("IVV_FAULT", fault);
    play.env("IVV_FAULT_COUNTS", bed.at("counts")).output().unwrap()
}

#[test]
fn a_lost_or_outdated_surface_is_made_anew_and_a_lost_device_is_an_error() {
    let (display, bed) = (Display::new(), Bed::new("lost"));
    let layer = bed.at("layer");
    built::layer(&layer);
    let truth = bed.rendered(&bed.views[0]);
    let (outdated, lost) = (-1_000_001_004, -1_000_000_000);
    for call in ["vkAcquireNextImageKHR", "vkQueuePresentKHR"] {
        for (n, code) in [(1, outdated), (3, outdated), (3, lost), (6, lost)] {
            told(with_fault(&bed, &display, &layer, &format!("{call}:{n}:{code}")));
            let counts = std::fs::read_to_string(bed.at("counts")).unwrap();
            assert!(counts.starts_with("fault 1"), "{call}:{n}:{code} was not reached");
            let likeness = psnr(&Picture::read(&bed.at("shot.png")), &truth, 0);
            assert!(likeness >= SAME, "{call}:{n}:{code}: {likeness:.1} dB");
        }
        let output = with_fault(&bed, &display, &layer, &format!("{call}:2:-4"));
        assert_eq!(output.status.code(), Some(4), "{output:?}");
        assert!(String::from_utf8_lossy(&output.stderr).contains("the device was lost"), "{output:?}");
    }
}

/// If this fails, the silence that the other tests ask for means nothing.
#[test]
fn the_validation_layer_can_be_heard() {
    let (display, bed) = (Display::new(), Bed::new("heard"));
    let mut play = bed.play(&display);
    play.args(["--size", "64x48", "--frames", "2"]);
    play.env("VK_LAYER_ENABLES", "VK_VALIDATION_FEATURE_ENABLE_BEST_PRACTICES_EXT");
    let output = play.output().unwrap();
    assert!(output.status.success());
    assert!(String::from_utf8_lossy(&output.stderr).contains("vulkan: WARNING"), "{output:?}");
}

#[test]
fn no_display_a_wrong_view_and_a_wrong_time_are_told() {
    let (display, bed) = (Display::new(), Bed::new("told"));
    for (arguments, display, word) in [
        (&["--frames", "1"][..], "", "DISPLAY"),
        (&["--camera", "none"], &display.name, "there are: "),
        (&["--at", "3"], &display.name, "0 to 2"),
        (&["--size", "0x5"], &display.name, "WxH"),
        (&["--screenshot", "x.png"], &display.name, "--frames"),
    ] {
        let mut play = Command::new(env!("CARGO_BIN_EXE_ivv-play"));
        play.arg(bed.at("scene.ply")).arg("--cameras").arg(bed.at("cameras.json")).args(["--seconds", "2"]);
        let output = play.args(arguments).env("DISPLAY", display).env_remove("WAYLAND_DISPLAY").output().unwrap();
        let told = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.code() == Some(2) && told.contains(word), "{arguments:?}: {told}");
    }
}
