//! Videos whose pictures tell their own number, so that what a capture shows can be read back.

use crate::common::prelude::*;
use std::fmt::Write as _;
use std::io::Write as _;

/// Sides of a picture, and of a block of it that is a bit of its number.
const SIZE: [u32; 2] = [64, 48];
const BLOCK: u32 = 16;

/// A rig of cameras of 64 x 48 that stand side by side, as COLMAP's text, in `source/`.
pub fn rig(folder: &str, names: &[&str]) -> Folder {
    let folder = Folder::new(folder);
    let (mut cameras, mut images) = (String::new(), String::new());
    for (id, name) in (1..).zip(names) {
        writeln!(cameras, "{id} PINHOLE 64 48 60 60 32 24").unwrap();
        writeln!(images, "{id} 1 0 0 0 {id} 0 1 {id} {name}.png\n").unwrap();
    }
    folder.write("source/cameras.txt", cameras);
    folder.write("source/images.txt", images);
    folder
}

/// A video of `n` frames at `rate` per second; `options` are ffmpeg's, for what it writes.
pub fn coded(path: &Path, n: u32, rate: &str, options: &[&str]) {
    let codec: &[&str] =
        if options.contains(&"-c:v") { &[] } else { &["-c:v", "mpeg4", "-q:v", "2", "-g", "12", "-bf", "2"] };
    made(path, &format!("{n} {rate} {options:?}"), |path| {
        let mut command = Command::new("ffmpeg");
        command.args([
            "-v", "error", "-y", "-f", "rawvideo", "-pix_fmt", "gray", "-s", "64x48", "-r", rate, "-i", "pipe:0",
        ]);
        let mut running = command.args(codec).args(options).arg(path).stdin(Stdio::piped()).spawn().unwrap();
        let mut to = running.stdin.take().unwrap();
        (0..n).for_each(|frame| to.write_all(&picture(frame)).unwrap());
        drop(to);
        assert!(running.wait().unwrap().success());
    });
}

/// Writes the video `what` to `path`: `make` does so once, and later ones are copies.
pub fn made(path: &Path, what: &str, make: impl FnOnce(&Path)) {
    static MADE: Mutex<BTreeMap<(String, PathBuf), Vec<u8>>> = Mutex::new(BTreeMap::new());
    std::fs::create_dir_all(path.parent().unwrap()).unwrap();
    let key = (what.to_owned(), path.extension().unwrap().into());
    if let Some(bytes) = MADE.lock().unwrap().get(&key) {
        return std::fs::write(path, bytes).unwrap();
    }
    make(path);
    MADE.lock().unwrap().insert(key, std::fs::read(path).unwrap());
}

fn picture(number: u32) -> Vec<u8> {
    let [width, height] = SIZE;
    let bit = |x: u32, y: u32| number >> (x / BLOCK + width / BLOCK * (y / BLOCK)) & 1;
    (0..height).flat_map(|y| (0..width).map(move |x| if bit(x, y) == 1 { 220 } else { 30 })).collect()
}

/// By frame, the number that a camera's picture tells; none where it has no picture.
pub fn numbers(capture: &Capture, camera: usize) -> Vec<Option<u32>> {
    let told = |frame: u32| {
        capture.cameras[camera].shots.iter().find(|shot| shot.frame == frame)?;
        let picture = capture.picture(camera, frame).unwrap();
        let [width, height] = [capture.cameras[camera].intrinsics.width, capture.cameras[camera].intrinsics.height];
        let [across, down] = [width / (SIZE[0] / BLOCK), height / (SIZE[1] / BLOCK)];
        let bits = (0..12_u32).map(|bit| {
            let (x, y) = (across * (bit % 4) + across / 2, down * (bit / 4) + down / 2);
            u32::from(picture.pixels[(y * width + x) as usize].to_le_bytes()[1] > 125) << bit
        });
        Some(bits.sum())
    };
    (0..capture.n_frames).map(told).collect()
}

pub fn ffmpeg(arguments: &[&str]) {
    let done = Command::new("ffmpeg").args(["-v", "error", "-y"]).args(arguments).status().unwrap();
    assert!(done.success(), "{arguments:?}");
}
