//! A display in memory, and pictures of it.

use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::atomic::{AtomicUsize, Ordering};

/// Rows of red, green and blue.
pub struct Picture {
    pub width: usize,
    pub height: usize,
    pub pixels: Vec<[u8; 3]>,
}

impl Picture {
    pub fn read(file: &Path) -> Self {
        let image = image::open(file).unwrap_or_else(|e| panic!("{}: {e}", file.display())).to_rgb8();
        let (width, height) = (image.width() as usize, image.height() as usize);
        Picture { width, height, pixels: image.pixels().map(|pixel| pixel.0).collect() }
    }
}

/// How like two pictures are but for the last rows, dB; nothing where their sizes differ.
pub fn psnr(a: &Picture, b: &Picture, last_rows: usize) -> f64 {
    if (a.width, a.height) != (b.width, b.height) {
        return 0.0;
    }
    let n = a.width * (a.height - last_rows);
    let square = |(a, b): (&u8, &u8)| f64::from(a.abs_diff(*b)).powi(2);
    let [a, b] = [a, b].map(|picture| picture.pixels[..n].as_flattened());
    let mse = a.iter().zip(b).map(square).sum::<f64>() / (3 * n) as f64;
    if mse == 0.0 { f64::INFINITY } else { 10.0 * (255.0f64.powi(2) / mse).log10() }
}

/// A display of 800 x 600 without a window manager: a window lies in its upper left corner.
pub struct Display {
    pub name: String,
    server: Child,
    folder: PathBuf,
}

impl Display {
    pub fn new() -> Self {
        static SERIAL: AtomicUsize = AtomicUsize::new(0);
        let serial = SERIAL.fetch_add(1, Ordering::Relaxed);
        let folder = std::env::temp_dir().join(format!("ivv-display-{}-{serial}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        let mut xvfb = Command::new("Xvfb");
        xvfb.args(["-displayfd", "1", "-screen", "0", "800x600x24", "-nolisten", "tcp", "-fbdir"]).arg(&folder);
        let server = xvfb.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::null()).spawn();
        let mut server = server.expect("Xvfb: tools/setup.sh play installs it");
        let mut number = String::new();
        BufReader::new(server.stdout.take().unwrap()).read_line(&mut number).unwrap();
        Display { name: format!(":{}", number.trim()), server, folder }
    }

    /// The screen from its upper left corner on. Xvfb keeps it in a file of the format of xwd: 25 big-endian words,
    /// the first of which says where colours begin, which are 12 bytes each; then the pixels.
    pub fn screen(&self, width: usize, height: usize) -> Picture {
        let bytes = std::fs::read(self.folder.join("Xvfb_screen0")).unwrap();
        let word = |k: usize| u32::from_be_bytes(bytes[4 * k..4 * k + 4].try_into().unwrap()) as usize;
        let (header, bits, row_bytes, colors) = (word(0), word(11), word(12), word(19));
        assert_eq!(bits, 32, "bits of a pixel");
        let first = header + 12 * colors;
        let pixel = |i: usize| {
            let at = first + i / width * row_bytes + i % width * 4;
            let [b, g, r] = bytes[at..at + 3].try_into().unwrap();
            [r, g, b]
        };
        Picture { width, height, pixels: (0..width * height).map(pixel).collect() }
    }

    pub fn tool(&self, arguments: &[&str]) -> String {
        let output = Command::new("xdotool").args(arguments).env("DISPLAY", &self.name).output();
        let output = output.expect("xdotool: tools/setup.sh play installs it");
        assert!(output.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
        String::from_utf8_lossy(&output.stdout).trim().to_owned()
    }
}

impl Drop for Display {
    fn drop(&mut self) {
        let _ = self.server.kill();
        let _ = self.server.wait();
        let _ = std::fs::remove_dir_all(&self.folder);
    }
}
