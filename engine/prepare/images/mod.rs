//! The pictures of a capture: decoded or taken over, scaled, undistorted.

mod camera;
mod maker;
mod paired;
mod plan;

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};

use image::ExtendedColorType;
use image::imageops::FilterType;
use serde_json::Value;

use self::camera::Material;
use self::maker::Maker;
use crate::error::{Error, Result};
use crate::files::make_folder;
use crate::parallel::in_parallel;
use crate::prepare::journal::Journal;
use crate::prepare::settings::{ImageFormat, OnProgress, Progress, Share};
use crate::prepare::timeline::Timeline;
use crate::prepare::video::{self, Selection};
use crate::scene::undistort::Lens;

pub(super) use self::camera::Camera;
pub(super) use self::maker::take_over;
pub(super) use self::plan::plan;

pub(super) struct Images {
    pub output: PathBuf,
    pub cameras: Vec<Camera>,
    pub fps: f64,
    pub notes: Vec<String>,
    /// By camera, the part of a shift below a frame: how much later its pictures are, frames. Empty where shifts are whole.
    pub rests: BTreeMap<String, f64>,
    pub select: Selection,
    timeline: Option<Timeline>,
    format: ImageFormat,
    threads: usize,
    made_from: Value,
}

impl Images {
    pub fn n_frames(&self) -> u32 {
        self.select.n
    }

    pub fn absent(&self) -> BTreeMap<String, BTreeSet<u32>> {
        let of = |camera: &Camera| (0..self.select.n).filter(|frame| !camera.has(*frame)).collect::<BTreeSet<u32>>();
        let all = self.cameras.iter().map(|camera| (camera.name.clone(), of(camera)));
        all.filter(|(_, absent)| !absent.is_empty()).collect()
    }

    pub fn test_cameras(&self) -> Vec<String> {
        self.cameras.iter().filter(|camera| camera.is_test).map(|camera| camera.name.clone()).collect()
    }

    pub fn image_name(&self, camera: &Camera, frame: u32) -> String {
        let taken_over = camera.taken_over(frame);
        let extension = taken_over.and_then(|shot| shot.image.extension()?.to_str()).unwrap_or(self.format.extension());
        format!("{}/{frame:05}.{}", camera.name, extension.to_lowercase())
    }

    #[tracing::instrument(level = "info", name = "images", skip_all)]
    pub fn make(&self, share: Share, journal: &Journal, progress: OnProgress) -> Result<()> {
        journal.begin("images", self.made_from.clone())?;
        let n = self.select.n;
        let mut jobs = Vec::new();
        for camera in &self.cameras {
            make_folder(&self.output.join("images").join(&camera.name))?;
            let frames: Vec<u32> = (0..n).filter(|frame| camera.has(*frame)).collect();
            match camera.material {
                Material::Video(..) => jobs.push((camera, frames)),
                Material::Images(_) => jobs.extend(frames.iter().map(|frame| (camera, vec![*frame]))),
            }
        }
        let own = (0..).zip(jobs).filter(|(number, _)| share.has(*number)).map(|(_, job)| job);
        let jobs: Vec<(&Camera, Vec<u32>)> = own.collect();
        let (done, total) = (AtomicUsize::new(0), jobs.iter().map(|(_, frames)| frames.len()).sum());
        let tell = |piece: &str| {
            let done = done.fetch_add(1, Ordering::Relaxed) + 1;
            progress(Progress { stage: "images", done, total, piece });
        };
        let work = |index: usize| {
            let (camera, frames) = &jobs[index];
            match camera.material {
                Material::Video(..) => self.decode_video(camera, &tell),
                Material::Images(_) => frames.iter().try_for_each(|frame| self.convert_image(camera, *frame, &tell)),
            }
        };
        in_parallel(jobs.len(), self.threads, work, |_| {}).map(|_| ())
    }

    pub fn unmade(&self) -> Option<PathBuf> {
        let of_camera = |camera| {
            let frames = (0..self.select.n).filter(move |frame| Camera::has(camera, *frame));
            frames.map(move |frame| self.image_name(camera, frame))
        };
        let all = self.cameras.iter().flat_map(of_camera).map(|name| self.output.join("images").join(name));
        all.into_iter().find(|image| !image.is_file())
    }

    pub fn write_sound(&self) -> Result<()> {
        for camera in &self.cameras {
            if let Material::Video(video, _) = &camera.material {
                // Seconds, by the clock of the camera's video.
                let from = self.timeline.as_ref().map_or(0.0, |clip| clip.time(&camera.name, self.select.start));
                let length = f64::from(self.select.n) / self.fps;
                let to = self.output.join(format!("audio/{}.wav", camera.name));
                if video.has_sound && !to.exists() {
                    make_folder(&self.output.join("audio"))?;
                    video::sound(video, from, length, &to)?;
                }
            }
        }
        Ok(())
    }

    fn decode_video(&self, camera: &Camera, tell: &dyn Fn(&str)) -> Result<()> {
        let Material::Video(video, pictures) = &camera.material else { return Ok(()) };
        let maker = Maker::new(&self.output, camera);
        let image = |frame: u32| self.output.join("images").join(self.image_name(camera, frame));
        let is_done = |frame: u32| image(frame).is_file() && maker.mask_is_done(frame);
        let all = (0..self.select.n).zip(pictures).filter_map(|(frame, picture)| Some((frame, (*picture)?)));
        let all: Vec<(u32, usize)> = all.collect();
        // What an earlier run decoded is not decoded again.
        let first = all.iter().position(|(frame, _)| !is_done(*frame)).unwrap_or(all.len());
        let (done, rest) = all.split_at(first);
        done.iter().for_each(|(frame, _)| tell(&self.image_name(camera, *frame)));
        // A picture that is the nearest to two frames is decoded once.
        let mut wanted: Vec<usize> = rest.iter().map(|(_, picture)| *picture).collect();
        wanted.dedup();
        let threads = (self.threads / self.cameras.len().max(1)).max(1);
        let size = (camera.lens.intrinsics.width, camera.lens.intrinsics.height);
        let mut rest = rest.iter().copied().peekable();
        video::decode(video, &wanted, camera.part, size, threads, |place, rgb| {
            while let Some((frame, _)) = rest.next_if(|(_, picture)| *picture == wanted[place]) {
                if !image(frame).is_file() {
                    let (pixels, _) = rgb.as_chunks::<3>();
                    self.write(&image(frame), &maker.image(pixels), &camera.pinhole, ExtendedColorType::Rgb8)?;
                }
                maker.write_mask(frame, camera.masks.get(frame as usize).map(PathBuf::as_path))?;
                tell(&self.image_name(camera, frame));
            }
            Ok(())
        })
    }

    fn convert_image(&self, camera: &Camera, frame: u32, tell: &dyn Fn(&str)) -> Result<()> {
        let Material::Images(shots) = &camera.material else { return Ok(()) };
        let Some(shot) = &shots[frame as usize] else { return Ok(()) };
        let maker = Maker::new(&self.output, camera);
        let name = self.image_name(camera, frame);
        let to = self.output.join("images").join(&name);
        if !to.is_file() {
            if camera.taken_over(frame).is_some() {
                take_over(&shot.image, &to)?;
            } else {
                let image = maker.scaled(&shot.image, FilterType::Triangle)?;
                if !image.color().has_alpha() {
                    let pixels = maker.image(image.into_rgb8().as_raw().as_chunks::<3>().0);
                    self.write(&to, &pixels, &camera.pinhole, ExtendedColorType::Rgb8)?;
                } else if self.format == ImageFormat::Png {
                    let pixels = maker.image(image.into_rgba8().as_raw().as_chunks::<4>().0);
                    self.write(&to, &pixels, &camera.pinhole, ExtendedColorType::Rgba8)?;
                } else {
                    let reason = "has an alpha channel, which JPEG does not hold";
                    return Err(Error::data(&shot.image, "", reason, "give --format png"));
                }
            }
        }
        maker.write_mask(frame, shot.mask.as_deref())?;
        for (folder, mask) in [("foreground", &shot.foreground), ("covisible", &shot.covisible)] {
            if let Some(mask) = mask {
                maker.write_plane(folder, frame, mask, *mask == shot.image)?;
            }
        }
        maker.write_priors(frame, shot)?;
        tell(&name);
        Ok(())
    }

    fn write<const C: usize>(&self, to: &Path, pixels: &[[u8; C]], lens: &Lens, kind: ExtendedColorType) -> Result<()> {
        let size = (lens.intrinsics.width, lens.intrinsics.height);
        self.format.write(to, pixels.as_flattened(), size, kind)
    }
}
