//! Moving pictures, read back by ffmpeg.

mod command;

use crate::common::prelude::*;
use ivv::internals::video::{Made, Video, VideoSettings};

const FPS: f64 = 30.0;
const SIZE: (u32, u32) = (32, 18);
const FLASH: usize = 17;
const N_FRAMES: usize = 40;

fn frame(color: [f32; 3]) -> Frame {
    let (width, height) = SIZE;
    Frame { width, height, color: vec![color; (width * height) as usize], ..Frame::default() }
}

fn write(path: &Path, sound: Option<&Path>, from: f64) -> Made {
    let sound = sound.map(|file| (file.to_owned(), from));
    let mut video = Video::create(path, VideoSettings { width: SIZE.0, height: SIZE.1, fps: FPS, sound }).unwrap();
    for index in 0..N_FRAMES {
        video.push(&frame(if index == FLASH { [1.0; 3] } else { [0.0; 3] })).unwrap();
    }
    video.finish().unwrap()
}

fn decoded(path: &Path, arguments: &[&str]) -> Vec<u8> {
    let output =
        Command::new("ffmpeg").args(["-v", "error", "-i"]).arg(path).args(arguments).arg("pipe:1").output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    output.stdout
}

/// A WAV file of two channels at 48 kHz with a click at `at` seconds.
fn click(path: &Path, seconds: f64, at: f64) {
    let samples: Vec<i16> = (0..(48_000.0 * seconds) as usize)
        .flat_map(|i| if i.abs_diff((48_000.0 * at).round() as usize) < 3 { [20_000; 2] } else { [0; 2] })
        .collect();
    let data: Vec<u8> = samples.iter().flat_map(|sample| sample.to_le_bytes()).collect();
    let n = data.len() as u32;
    let mut bytes = Vec::new();
    bytes.extend(b"RIFF");
    bytes.extend((36 + n).to_le_bytes());
    bytes.extend(b"WAVEfmt \x10\0\0\0\x01\0\x02\0");
    bytes.extend(48_000_u32.to_le_bytes());
    bytes.extend(192_000_u32.to_le_bytes());
    bytes.extend(b"\x04\0\x10\0data");
    bytes.extend(n.to_le_bytes());
    bytes.extend(data);
    std::fs::write(path, bytes).unwrap();
}

/// T38, the file: the click stands at the flash.
#[test]
fn sound_is_in_step_with_the_pictures() {
    needs!("ffmpeg");
    let folder = Folder::new("video");
    let flash = FLASH as f64 / FPS;
    // Shorter than the pictures, and beginning half of a second before them.
    for (name, seconds, from) in [("a.mp4", 1.0, 0.0), ("b.mkv", 1.0, 0.0), ("c.mov", 3.0, 0.5), ("d.mp4", 3.0, 0.5)] {
        let (sound, path) = (folder.0.join("click.wav"), folder.0.join(name));
        click(&sound, seconds, from + flash);
        assert_eq!(write(&path, Some(&sound), from), Made::Whole(path.clone()));
        let gray = decoded(&path, &["-map", "0:v", "-f", "rawvideo", "-pix_fmt", "gray"]);
        let frames: Vec<f64> = gray
            .chunks((SIZE.0 * SIZE.1) as usize)
            .map(|frame| frame.iter().map(|v| f64::from(*v)).sum::<f64>() / frame.len() as f64)
            .collect();
        assert_eq!(frames.len(), N_FRAMES, "{name}");
        for (index, mean) in frames.iter().enumerate() {
            let is_light = *mean > 128.0;
            assert_eq!(is_light, index == FLASH, "{name}: frame {index} has {mean}");
        }
        let heard = decoded(
            &path,
            &["-map", "0:a", "-af", "aresample=async=1:first_pts=0", "-ac", "1", "-ar", "48000", "-f", "s16le"],
        );
        let heard: Vec<i16> = heard.as_chunks().0.iter().map(|b| i16::from_le_bytes(*b)).collect();
        let loudest = (0..heard.len()).max_by_key(|i| heard[*i].unsigned_abs()).unwrap();
        assert!(heard[loudest].unsigned_abs() > 2000, "{name} is silent");
        let off = loudest as f64 / 48_000.0 - flash;
        // A millisecond, far below the frame that T38 allows.
        assert!(off.abs() < 1e-3, "{name}: the click is {off} s late");
        let length = heard.len() as f64 / 48_000.0;
        assert!((length - N_FRAMES as f64 / FPS).abs() < 1.5 / FPS, "{name}: {length} s of sound");
    }
    let left: Vec<_> = std::fs::read_dir(&folder.0).unwrap().flatten().map(|entry| entry.file_name()).collect();
    assert_eq!(left.len(), 5, "{left:?}");
}

#[test]
fn colours_arrive() {
    needs!("ffmpeg");
    let folder = Folder::new("video-colours");
    let color = [0.8_f32, 0.3, 0.1];
    for name in ["a.mp4", "a.y4m"] {
        let path = folder.0.join(name);
        let settings = VideoSettings { width: SIZE.0, height: SIZE.1, fps: 24000.0 / 1001.0, sound: None };
        let mut video = Video::create(&path, settings).unwrap();
        (0..3).for_each(|_| video.push(&frame(color)).unwrap());
        video.finish().unwrap();
        let filter = "scale=in_color_matrix=bt709:in_range=tv";
        let pixels = decoded(&path, &["-vf", filter, "-f", "rawvideo", "-pix_fmt", "rgb24"]);
        assert_eq!(pixels.len(), 3 * 3 * (SIZE.0 * SIZE.1) as usize);
        let (sums, n) = (pixels.as_chunks::<3>().0, pixels.len() / 3);
        for channel in 0..3 {
            let mean = sums.iter().map(|p| f64::from(p[channel])).sum::<f64>() / n as f64;
            assert!((mean - 255.0 * f64::from(color[channel])).abs() < 3.0, "{name}: channel {channel} is {mean}");
        }
    }
}

#[test]
fn a_file_of_pictures_needs_no_program() {
    let folder = Folder::new("video-y4m");
    let path = folder.0.join("a.y4m");
    let settings = VideoSettings { width: 3, height: 1, fps: 29.97, sound: None };
    let mut video = Video::create(&path, settings.clone()).unwrap();
    let color = vec![[0.0; 3], [1.0, 1.0, 1.0], [f32::NAN, -1.0, 2.0]];
    let pixels = Frame { width: 3, height: 1, color, ..Frame::default() };
    video.push(&pixels).unwrap();
    assert!(!path.exists());
    assert!(video.push(&frame([0.0; 3])).unwrap_err().to_string().contains("32 x 18"));
    assert_eq!(video.finish().unwrap(), Made::Pictures { file: path.clone(), command: None });
    let bytes = std::fs::read(&path).unwrap();
    let (header, rest) = bytes.split_at(bytes.len() - 15);
    assert_eq!(header, b"YUV4MPEG2 W3 H1 F30000:1001 Ip A1:1 C444 XCOLORRANGE=LIMITED\n");
    // Blue by BT.709: 16 + 219 * 0.0722, 240, 128 - 112 * 0.0722 / 0.7874.
    assert_eq!(rest, [b"FRAME\n".as_slice(), &[16, 235, 32, 128, 128, 240, 128, 128, 118]].concat());
    // One that is not finished leaves nothing.
    let _ = Video::create(&folder.0.join("b.y4m"), settings.clone()).unwrap();
    assert_eq!(std::fs::read_dir(&folder.0).unwrap().count(), 1);
    let refused =
        |name: &str, settings: VideoSettings| Video::create(&folder.0.join(name), settings).err().unwrap().to_string();
    assert!(refused("a.avi", settings.clone()).contains(".mp4, .mov, .mkv or .y4m"));
    assert!(refused("a.mp4", settings.clone()).contains("3 x 1"));
    assert!(refused("a.y4m", VideoSettings { fps: f64::NAN, ..settings.clone() }).contains("NaN frames per second"));
    assert!(refused("none/a.y4m", settings.clone()).contains("cannot be written"));
    let empty = Video::create(&folder.0.join("c.y4m"), settings).unwrap();
    assert!(empty.finish().unwrap_err().to_string().contains("no frame"));
}

#[test]
fn what_ffmpeg_refuses_is_told() {
    needs!("ffmpeg");
    let folder = Folder::new("video-refused");
    let sound = folder.write("no.wav", "this is no sound");
    let settings = VideoSettings { width: 32, height: 18, fps: FPS, sound: Some((sound, 0.0)) };
    let mut video = Video::create(&folder.0.join("a.mp4"), settings).unwrap();
    let pushed = (0..2000).try_for_each(|_| video.push(&frame([0.5; 3])));
    let error = pushed.and_then(|()| video.finish().map(|_| ())).unwrap_err().to_string();
    assert!(error.contains("ffmpeg failed") && error.contains("no.wav"), "{error}");
    assert_eq!(std::fs::read_dir(&folder.0).unwrap().count(), 1);
}
