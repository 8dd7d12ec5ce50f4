//! A moving rig, followed through the clip: COLMAP places the cameras of some key frames at a time among those of the key frame before;
//! poses between are interpolated. Each placed key frame is a file in `reconstruction/track`.

mod block;
mod motion;

use std::fs;
use std::path::{Path, PathBuf};

use crate::error::{Error, Result};
use crate::files::{make_folder, read_file, write_atomic};
use crate::prepare::colmap::Matched;
use crate::prepare::model::{self, ModelCamera};
use crate::prepare::reconstruct::videos;
use crate::prepare::settings::{OnProgress, PrepareSettings, Progress};
use crate::prepare::source::Footage;
use crate::prepare::source::footage::find;
use crate::prepare::timeline::Timeline;
use crate::prepare::video::{self, Video};
use crate::scene::capture::tracks;
use crate::scene::undistort::Lens;
use crate::scene::{Pose, SeenPoint};

/// Key frames that are placed together, beside the one before them.
const BLOCK: usize = 4;
/// Fewer placed cameras do not tell how the rig has moved.
const LEAST_PLACED: usize = 3;

/// Cameras that are matched with each other within a frame.
const MATCHED: Matched = Matched { all: 12, neighbours: 8 };

struct Tracked {
    /// The name of its video, without ending.
    name: String,
    video: Video,
    lens: Lens,
    first: Pose,
    /// Frame of its video at the first frame of the clip, of those that it has at the clip's rate.
    start: u32,
}

/// A placed key frame, as its file holds it.
#[derive(Clone, serde::Serialize, serde::Deserialize)]
struct Placed {
    poses: Vec<Pose>,
    /// Which of them are the rig's word alone.
    predicted: Vec<bool>,
}

/// The name by which COLMAP knows a picture: one without spaces, which its lists of pairs cannot hold, and a video's name may have.
fn picture(camera: usize, key: usize) -> String {
    format!("{camera:03}/{key:05}.jpg")
}

/// Key frames of a clip of `n` frames: every `step`-th, and the last.
fn keys(n: usize, step: usize) -> Vec<usize> {
    let mut keys: Vec<usize> = (0..n).step_by(step.max(1)).chain(n.checked_sub(1)).collect();
    keys.dedup();
    keys
}

/// The time of the clip, and its frames: those that are asked for and that all videos have.
fn clip(settings: &PrepareSettings, videos: &[(&str, &Video)]) -> Result<(Timeline, Vec<u32>)> {
    let timeline = Timeline::new(videos.iter().copied(), settings).ok_or_else(|| {
        Error::data(&settings.source, "", "holds no video", "give a folder with a video of each camera of the rig")
    })?;
    let available = videos.iter().filter_map(|(name, _)| timeline.n(name)).min().unwrap_or(0);
    let frames: Vec<u32> = settings.frames.of(available).collect();
    if frames.is_empty() {
        let reason = format!("begins at frame {}, the videos have {available} in common", settings.frames.from);
        return Err(Error::data(&settings.source, "--frames", reason, "begin earlier"));
    }
    Ok((timeline, frames))
}

/// Pictures that COLMAP is given beside those of the first key frame, and pairs of them that it matches.
pub(super) fn load(settings: &PrepareSettings, folder: &Path, step: u32) -> Result<(usize, usize)> {
    let probed = videos(folder).map(|(name, path)| Ok((name, video::probe(&path)?)));
    let videos: Vec<(String, Video)> = probed.collect::<Result<_>>()?;
    let named: Vec<(&str, &Video)> = videos.iter().map(|(name, video)| (name.as_str(), video)).collect();
    let left = keys(clip(settings, &named)?.1.len(), step as usize).len() - 1;
    let of_blocks = (0..left).step_by(BLOCK).map(|begin| 1 + BLOCK.min(left - begin));
    let n = videos.len();
    let count = |frames: usize| (n * frames, frames * MATCHED.count(n) + n * frames * (frames - 1) / 2);
    Ok(of_blocks.map(count).fold((0, 0), |sum, block| (sum.0 + block.0, sum.1 + block.1)))
}

pub(super) struct Track<'a> {
    settings: &'a PrepareSettings,
    project: &'a Path,
    progress: OnProgress<'a>,
    cameras: Vec<Tracked>,
    timeline: Timeline,
    frames: Vec<u32>,
    keys: Vec<usize>,
    step: usize,
}

impl<'a> Track<'a> {
    /// `first` is the folder of the model of the first key frame, whose images are named `<camera>.jpg`; `folder` has the videos.
    pub fn new(
        settings: &'a PrepareSettings,
        folder: &Path,
        first: &Path,
        project: &'a Path,
        step: u32,
        progress: OnProgress<'a>,
    ) -> Result<Self> {
        let mut cameras = Vec::new();
        for posed in &model::read(first)? {
            let name = posed.name.with_extension("").to_string_lossy().into_owned();
            let Some(Footage::Video(path)) = find(folder, &name) else { continue };
            let video = video::probe(&path)?;
            cameras.push(Tracked { name, video, lens: posed.lens, first: posed.pose, start: 0 });
        }
        cameras.sort_by(|a, b| a.name.cmp(&b.name));
        let videos: Vec<_> = cameras.iter().map(|camera| (camera.name.as_str(), &camera.video)).collect();
        let (timeline, frames) = clip(settings, &videos)?;
        for camera in &mut cameras {
            let start = timeline.index(&camera.name, &camera.video, frames[0]).unwrap_or(0);
            camera.start = u32::try_from(start).map_err(|_| {
                let reason = format!("`{}` is to begin {} frames before its video", camera.name, -start);
                let remedy = format!("begin at frame {} or later: --frames {0}:", i64::from(frames[0]) - start);
                Error::data(&settings.source, "--shift", reason, remedy)
            })?;
        }
        let keys = keys(frames.len(), step as usize);
        Ok(Track { settings, project, progress, cameras, timeline, frames, keys, step: step as usize })
    }

    /// Places all key frames that are not placed yet, and writes the model of all frames to the folder `to`.
    pub fn make(&self, first: &Path, to: &Path) -> Result<()> {
        make_folder(&self.folder())?;
        let mut placed = vec![Placed { poses: self.first(), predicted: vec![false; self.cameras.len()] }];
        while let Some(key) = self.read(placed.len()) {
            placed.push(key);
        }
        let n = self.keys.len();
        if placed.len() < n {
            self.take_pictures()?;
        }
        while placed.len() < n {
            let begin = placed.len();
            let new = begin..n.min(begin + BLOCK);
            for (key, poses) in new.clone().zip(self.place(new, &placed[begin - 1].poses)?) {
                match self.complete(&poses) {
                    Some(found) => {
                        self.keep(key, &found)?;
                        placed.push(found);
                    }
                    // It may be too far from the block's first frame: the next block begins just before it.
                    None if key > begin => break,
                    None => return Err(self.lost(key, poses.iter().flatten().count())),
                }
            }
        }
        self.write(first, to, &placed)?;
        for scratch in [self.pictures(), self.project.join("block")] {
            let _ = fs::remove_dir_all(scratch);
        }
        Ok(())
    }

    pub fn notes(&self) -> Vec<String> {
        let placed: Vec<Placed> = (1..self.keys.len()).filter_map(|key| self.read(key)).collect();
        let count = |camera: usize| placed.iter().filter(|key| key.predicted[camera]).count();
        let absent = (0..self.cameras.len()).filter(|camera| count(*camera) > 0);
        let absent: Vec<String> =
            absent.map(|camera| format!("{} at {}", self.cameras[camera].name, count(camera))).collect();
        let (n_frames, n_keys) = (self.frames.len(), self.keys.len());
        let mut notes = vec![format!("the rig was followed through {n_frames} frames, {n_keys} of them placed")];
        if !absent.is_empty() {
            let n = placed.len();
            let who = absent.join(", ");
            notes.push(format!(
                "not placed at some of the {n} key frames after the first, and put where the others say: {who}"
            ));
        }
        notes
    }

    fn folder(&self) -> PathBuf {
        self.project.join("track")
    }

    fn pictures(&self) -> PathBuf {
        self.project.join("frames")
    }

    fn file(&self, key: usize) -> PathBuf {
        self.folder().join(format!("{:05}.json", self.frames[self.keys[key]]))
    }

    fn first(&self) -> Vec<Pose> {
        self.cameras.iter().map(|camera| camera.first).collect()
    }

    /// A key frame that was placed before; one whose file is damaged is placed again.
    fn read(&self, key: usize) -> Option<Placed> {
        if key >= self.keys.len() {
            return None;
        }
        let placed: Placed = serde_json::from_slice(&read_file(&self.file(key)).ok()?).ok()?;
        let n = self.cameras.len();
        (placed.poses.len() == n && placed.predicted.len() == n).then_some(placed)
    }

    fn keep(&self, key: usize, placed: &Placed) -> Result<()> {
        let text = serde_json::to_vec(placed).map_err(std::io::Error::other);
        write_atomic(&self.file(key), |to| to.write_all(&text?))?;
        let n = placed.predicted.iter().filter(|predicted| !**predicted).count();
        let piece = format!("frame {}: {n} of {}", self.frames[self.keys[key]], self.cameras.len());
        (self.progress)(Progress { stage: "cameras", done: key + 1, total: self.keys.len(), piece: &piece });
        Ok(())
    }

    /// All poses of a key frame, from those that were found; none where they are too few.
    fn complete(&self, found: &[Option<Pose>]) -> Option<Placed> {
        let first = self.first();
        let (motion, agree) = motion::rigid(&first, found, LEAST_PLACED)?;
        let of = |camera: usize| found[camera].filter(|_| agree[camera]).unwrap_or(motion.of(&first[camera]));
        let poses = (0..first.len()).map(of).collect();
        Some(Placed { poses, predicted: agree.iter().map(|agrees| !agrees).collect() })
    }

    fn lost(&self, key: usize, n: usize) -> Error {
        let (frame, before) = (self.frames[self.keys[key]], self.frames[self.keys[key - 1]]);
        let reason = format!(
            "loses the rig at frame {frame}: {n} of {} cameras could be placed among those of frame {before}, or they do not agree; \
             {LEAST_PLACED} are needed",
            self.cameras.len()
        );
        let remedy = if self.step > 1 {
            "place more frames with a smaller --moving and --force".to_owned()
        } else {
            format!(
                "end the clip before it with --frames :{frame} and --force, or use cameras that see more of the still scene"
            )
        };
        Error::data(&self.settings.source, "", reason, remedy)
    }

    fn take_pictures(&self) -> Result<()> {
        for (index, camera) in self.cameras.iter().enumerate() {
            make_folder(&self.pictures().join(format!("{index:03}")))?;
            // Of a lost frame the picture before or after it.
            let of_key = |key: &usize| self.timeline.nearest(&camera.name, &camera.video, self.frames[*key]);
            let pictures: Vec<usize> = self.keys.iter().filter_map(of_key).collect();
            let name = |n: u32| picture(index, n as usize);
            let (folder, threads) = (self.pictures(), self.settings.threads);
            video::write_pictures(&folder, &camera.video, &pictures, threads, name, self.progress)?;
        }
        Ok(())
    }

    fn write(&self, first: &Path, to: &Path, placed: &[Placed]) -> Result<()> {
        let index_of = |name: &Path| {
            let name = name.with_extension("").to_string_lossy().into_owned();
            self.cameras.iter().position(|camera| camera.name == name)
        };
        let points = tracks(first)?.into_iter().map(|(point, by)| {
            let camera_ids = by.iter().filter_map(|name| Some(index_of(name)? as u32 + 1)).collect();
            SeenPoint { position: point.position, rgb: point.color, camera_ids }
        });
        let points: Vec<SeenPoint> = points.collect();
        // A rig is read as counted from 1 where no frame is the first of its video.
        let count_from = u32::from(self.cameras.iter().all(|camera| camera.start > 0));
        let mut cameras = Vec::new();
        for (index, camera) in self.cameras.iter().enumerate() {
            let mut images = Vec::new();
            let mut key = 0;
            for (n, frame) in self.frames.iter().enumerate() {
                while key + 2 < self.keys.len() && self.keys[key + 1] <= n {
                    key += 1;
                }
                let next = (key + 1).min(self.keys.len() - 1);
                let (begin, end) = (self.keys[key], self.keys[next]);
                let part = (n - begin) as f64 / (end - begin).max(1) as f64;
                let pose = motion::between(&placed[key].poses[index], &placed[next].poses[index], part);
                let number = camera.start + (frame - self.frames[0]) + count_from;
                images.push((format!("{}/{number:05}.jpg", camera.name), pose));
            }
            cameras.push(ModelCamera { id: index as u32 + 1, lens: camera.lens, images });
        }
        model::write(to, &cameras, &points)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_last_frame_is_always_placed() {
        assert_eq!(keys(9, 4), [0, 4, 8]);
        assert_eq!(keys(10, 4), [0, 4, 8, 9]);
        assert_eq!(keys(3, 9), [0, 2]);
        assert_eq!((keys(1, 1), keys(0, 1)), (vec![0], vec![]));
    }
}
