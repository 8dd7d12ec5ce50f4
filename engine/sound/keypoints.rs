//! The mouths in what detectors of persons write: one reader for the JSON of MMPose, RTMLib (by `tools/rtmlib_to_json.py`),
//! OpenPose and Pose2Sim. Their containers are in `engine/sound/README.md`.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use glam::DVec2;

use crate::error::{Error, Result};
use crate::files::{cannot_list, read_text};
use crate::scene::undistort::Lens;

const MAX_BYTES: u64 = 1 << 31;
const MAX_FRAMES: u32 = 1 << 20;
/// How far beyond the picture a detector may guess, relative to its size.
const BEYOND: f64 = 0.05;
/// The part of the mouths that may lie still farther out.
const MAY_BE_OUTSIDE: f64 = 0.05;
const REMEDY: &str = "give the JSON of MMPose, RTMLib, OpenPose or Pose2Sim";

/// Points below this score are not there.
const MIN_SCORE: f64 = 0.3;
/// With fewer points of the mouth its middle is not known.
const MIN_POINTS: usize = 6;
/// Standard deviation of a mouth's middle relative to its width, and the least, pixels.
const RELATIVE_SIGMA: f64 = 0.02;
const MIN_SIGMA: f64 = 1.0;
/// From nose to mouth, relative to the largest distance between nose, eyes and ears.
const NOSE_TO_MOUTH: f64 = 0.6;

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct KeypointSettings {
    /// The number of the first frame, where the files do not tell.
    pub first_frame: Option<u32>,
    /// Width and height of the pictures that the detector saw, where they are not the camera's.
    pub image_size: Option<(u32, u32)>,
}

#[derive(Clone, Debug, Default, PartialEq)]
pub struct Mouths {
    /// In pixels of the camera. A frame that is absent has none.
    pub frames: BTreeMap<u32, Vec<Mouth>>,
}

#[derive(serde::Deserialize)]
struct Person {
    pose_keypoints_2d: Vec<Option<f64>>,
    #[serde(default)]
    face_keypoints_2d: Vec<Option<f64>>,
}

/// A frame, or of a single picture a person.
#[derive(serde::Deserialize)]
struct Item {
    frame_id: Option<u64>,
    instances: Option<Vec<Instance>>,
    keypoints: Option<Vec<Place>>,
    keypoint_scores: Option<Vec<Option<f64>>>,
}

#[derive(serde::Deserialize)]
struct Instance {
    keypoints: Vec<Place>,
    keypoint_scores: Vec<Option<f64>>,
}

/// Pixels; nothing where a detector wrote what is not finite.
type Place = [Option<f64>; 2];

#[derive(serde::Deserialize)]
struct Object {
    instance_info: Option<Vec<Item>>,
    people: Option<Vec<Person>>,
}

/// Persons of a frame whose number is the file's own; of a picture without any.
type Frame = (Option<u64>, Vec<Vec<Keypoint>>);

/// The keypoints of a camera: `<folder>/<camera>.json`, or a file for each frame in `<folder>/<camera>` or `<folder>/<camera>_json`.
pub fn keypoints_of(folder: &Path, camera: &str) -> Option<PathBuf> {
    let names = [format!("{camera}.json"), camera.to_owned(), format!("{camera}_json")];
    names.into_iter().map(|name| folder.join(name)).find(|path| path.exists())
}

impl Mouths {
    /// Reads a file of a clip or a folder with a file for each frame, and brings it to the pixels of `lens`.
    pub fn read(path: &Path, lens: &Lens, settings: &KeypointSettings) -> Result<Mouths> {
        let (frames, counts_from) = if path.is_dir() { read_folder(path)? } else { read_clip(path)? };
        let base = base(path, frames.keys().next().copied(), counts_from, settings)?;
        let mut mouths = Mouths::default();
        for (number, persons) in frames {
            let frame = number.checked_sub(base).and_then(|frame| u32::try_from(frame).ok());
            let Some(frame) = frame.filter(|frame| *frame < MAX_FRAMES) else {
                let reason = format!("has the frame {number}; the first is {base}, and at most {MAX_FRAMES} are read");
                return Err(Error::data(path, "", reason, "give the number of the first frame with --first-frame"));
            };
            for person in persons {
                let found =
                    mouth(&person).map_err(|reason| Error::data(path, format!("frame {number}"), reason, REMEDY))?;
                found.into_iter().for_each(|found| mouths.frames.entry(frame).or_default().push(found));
            }
        }
        mouths.fit(path, lens, settings.image_size)?;
        Ok(mouths)
    }

    fn fit(&mut self, path: &Path, lens: &Lens, image_size: Option<(u32, u32)>) -> Result<()> {
        let (w, h) = (f64::from(lens.intrinsics.width), f64::from(lens.intrinsics.height));
        if let Some((width, height)) = image_size {
            let (from_w, from_h) = (f64::from(width), f64::from(height));
            if (from_w * h - from_h * w).abs() > w.max(h) {
                let reason = format!(
                    "is of {width} x {height} pixels, the camera has {} x {}",
                    lens.intrinsics.width, lens.intrinsics.height
                );
                let remedy = "detect on pictures of the camera's shape, not cropped ones";
                return Err(Error::data(path, "", reason, remedy));
            }
            let scale = DVec2::new(w / from_w, h / from_h);
            for mouth in self.frames.values_mut().flatten() {
                mouth.at *= scale;
                mouth.width *= scale.x;
                mouth.sigma = (mouth.sigma * scale.x).max(scale.x);
            }
        }
        let (n, mut n_outside) = (self.frames.values().flatten().count(), 0);
        for mouth in self.frames.values().flatten() {
            let x = mouth.at.x < -BEYOND * w || mouth.at.x > (1.0 + BEYOND) * w;
            let y = mouth.at.y < -BEYOND * h || mouth.at.y > (1.0 + BEYOND) * h;
            n_outside += usize::from(x || y);
        }
        if n_outside as f64 > MAY_BE_OUTSIDE * n as f64 {
            let reason = format!("has {n_outside} of {n} mouths outside of the camera's {w} x {h} pixels");
            let remedy = "say with --image-size how large the detector's pictures were";
            return Err(Error::data(path, "", reason, remedy));
        }
        Ok(())
    }
}

/// Frames by the numbers of their files or lists; and of a list the number with which its writer begins to count.
type Numbered = (BTreeMap<u64, Vec<Vec<Keypoint>>>, Option<u64>);

/// The number of the first frame: 1 where only MMPose's demo counts that way, 0 where there is a frame 0.
fn base(path: &Path, least: Option<u64>, counts_from: Option<u64>, settings: &KeypointSettings) -> Result<u64> {
    if let Some(first) = settings.first_frame {
        return Ok(first.into());
    }
    match (least, counts_from.unwrap_or(0)) {
        (None, _) => Ok(0),
        (Some(least), known) if least == known => Ok(known),
        (Some(least), _) => {
            let reason = format!("begins with the frame {least}: it is not known whether the clip does too");
            Err(Error::data(path, "", reason, "give the number of the clip's first frame with --first-frame"))
        }
    }
}

fn read_folder(folder: &Path) -> Result<Numbered> {
    let listed = std::fs::read_dir(folder).map_err(|fault| cannot_list(folder, &fault))?;
    let mut frames = BTreeMap::new();
    let is_json = |path: &PathBuf| path.extension().is_some_and(|ending| ending == "json");
    for path in listed.flatten().map(|entry| entry.path()).filter(is_json) {
        let Some(number) = number(&path) else {
            return Err(Error::data(&path, "", "has no number in its name", "name the files after their frames"));
        };
        let persons = read_file(&path)?.0.into_iter().flat_map(|(_, found)| found).collect();
        if frames.insert(number, persons).is_some() {
            let reason = format!("is the second file of frame {number}");
            return Err(Error::data(&path, "", reason, "keep the files of one detector and camera in a folder"));
        }
    }
    Ok((frames, None))
}

fn read_clip(path: &Path) -> Result<Numbered> {
    let (list, counts_from) = read_file(path)?;
    let mut frames: BTreeMap<u64, Vec<Vec<Keypoint>>> = BTreeMap::new();
    for (number, persons) in list {
        let Some(number) = number else {
            let remedy = "put the files of pictures into a folder of the camera's name";
            return Err(Error::data(path, "", "holds one picture and not the frames of a clip", remedy));
        };
        frames.entry(number).or_default().extend(persons);
    }
    Ok((frames, counts_from))
}

/// The last number in a name: of `clip_000000000012_keypoints.json`, 12.
fn number(path: &Path) -> Option<u64> {
    let stem = path.file_stem()?.to_str()?;
    let start = stem.rfind(|c: char| c.is_ascii_digit())? + 1;
    let digits = stem[..start].rsplit(|c: char| !c.is_ascii_digit()).next()?;
    digits.parse().ok()
}

/// The frames of a file, and the number with which its writer begins to count.
fn read_file(path: &Path) -> Result<(Vec<Frame>, Option<u64>)> {
    let fault = |reason: String| Error::data(path, "", reason, REMEDY);
    let size = std::fs::metadata(path).map_err(|e| fault(format!("cannot be read: {e}")))?.len();
    if size > MAX_BYTES {
        return Err(fault(format!("has {size} bytes, at most {MAX_BYTES} are read")));
    }
    let text = read_text(path).map_err(|e| fault(format!("cannot be read: {e}")))?;
    // Python writes what is not finite as no JSON knows it; Pose2Sim does so for points it did not find.
    let text = match text.contains("NaN") || text.contains("Infinity") {
        true => ["NaN", "-Infinity", "Infinity"].iter().fold(text, |text, word| text.replace(word, "null")),
        false => text,
    };
    let items = |items: Vec<Item>| items.into_iter().map(frame).collect::<std::result::Result<Vec<_>, _>>();
    if text.trim_start().starts_with('[') {
        let list: Vec<Item> = serde_json::from_str(&text).map_err(|e| fault(e.to_string()))?;
        return Ok((items(list).map_err(fault)?, Some(0)));
    }
    let object: Object = serde_json::from_str(&text).map_err(|e| fault(e.to_string()))?;
    match (object.instance_info, object.people) {
        (Some(list), _) => Ok((items(list).map_err(fault)?, Some(1))),
        (None, Some(people)) => {
            let persons = people.iter().map(open_pose).collect::<std::result::Result<_, _>>().map_err(fault)?;
            Ok((vec![(None, persons)], None))
        }
        (None, None) => Err(fault("has neither `instance_info` nor `people`".to_owned())),
    }
}

fn frame(item: Item) -> std::result::Result<Frame, String> {
    let instances = match (item.instances, item.keypoints, item.keypoint_scores) {
        (Some(instances), ..) => instances,
        (None, Some(keypoints), Some(keypoint_scores)) => vec![Instance { keypoints, keypoint_scores }],
        _ => return Err("has an element with neither `instances` nor `keypoints` and `keypoint_scores`".to_owned()),
    };
    Ok((item.frame_id, instances.iter().map(mmpose).collect::<std::result::Result<_, _>>()?))
}

fn mmpose(instance: &Instance) -> std::result::Result<Vec<Keypoint>, String> {
    let (n, n_scores) = (instance.keypoints.len(), instance.keypoint_scores.len());
    if n != n_scores {
        return Err(format!("has a person of {n} points and {n_scores} scores"));
    }
    let points = instance.keypoints.iter().zip(&instance.keypoint_scores);
    Ok(points.map(|([x, y], score)| keypoint(*x, *y, *score)).collect())
}

/// The face's points where they stand apart, else those of the body.
fn open_pose(person: &Person) -> std::result::Result<Vec<Keypoint>, String> {
    let points = |flat: &[Option<f64>]| {
        let (triples, rest) = flat.as_chunks::<3>();
        match rest {
            [] => Ok(triples.iter().map(|[x, y, score]| keypoint(*x, *y, *score)).collect::<Vec<_>>()),
            _ => Err(format!("has a list of {} numbers, not of triples", flat.len())),
        }
    };
    let (face, pose) = (points(&person.face_keypoints_2d)?, points(&person.pose_keypoints_2d)?);
    let has_mouth = matches!(mouth(&face), Ok(Some(_)));
    Ok(if has_mouth || pose.is_empty() { face } else { pose })
}

fn keypoint(x: Option<f64>, y: Option<f64>, score: Option<f64>) -> Keypoint {
    let number = |value: Option<f64>| value.unwrap_or(f64::NAN);
    (DVec2::new(number(x), number(y)), number(score))
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mouth {
    /// Its middle, pixels of the picture that the detector saw.
    pub at: DVec2,
    /// Standard deviation in x and in y, pixels.
    pub sigma: f64,
    /// Mean score of its points, 0 to 1.
    pub weight: f64,
    /// From corner to corner, pixels; 0 where a corner is not seen.
    pub width: f64,
    /// Distance of the lips relative to the width; none where they are not seen.
    pub opening: Option<f64>,
    /// Only the nose is seen; `at` is where it is.
    pub approx: bool,
}

struct Layout {
    /// First of twelve points of the outer lip and eight of the inner; both begin at the speaker's right corner, upper lip first.
    lips: Option<usize>,
    /// Nose, and what else of the head gives its size.
    head: &'static [usize],
}

const COCO_HEAD: &[usize] = &[0, 1, 2, 3, 4];
const BODY_25_HEAD: &[usize] = &[0, 15, 16, 17, 18];

/// COCO has 17 points, Halpe 26 or 136, OpenPose 25, the face 68 or 70, COCO-WholeBody 133 or, with a neck, 134.
fn layout(n_points: usize) -> Option<Layout> {
    let (lips, head) = match n_points {
        17 | 26 => (None, COCO_HEAD),
        25 => (None, BODY_25_HEAD),
        68 | 70 => (Some(48), &[][..]),
        133 => (Some(71), COCO_HEAD),
        134 => (Some(72), COCO_HEAD),
        136 => (Some(74), COCO_HEAD),
        _ => return None,
    };
    Some(Layout { lips, head })
}

/// A point with its score. Scores of SimCC heads are no probabilities and exceed 1.
type Keypoint = (DVec2, f64);

/// The mouth among the points of a person; `None` where too little is seen, `Err` where the number of points is of no known layout.
fn mouth(points: &[Keypoint]) -> std::result::Result<Option<Mouth>, String> {
    if points.is_empty() {
        return Ok(None);
    }
    let layout = layout(points.len()).ok_or_else(|| {
        format!("has a person of {} points; 17, 25, 26, 68, 70, 133, 134 and 136 are known", points.len())
    })?;
    let seen = |index: usize| {
        let (at, score) = points[index];
        (score >= MIN_SCORE && at.is_finite()).then_some((at, score.min(1.0)))
    };
    let by_lips = layout.lips.and_then(|first| by_lips(first, &seen));
    Ok(by_lips.or_else(|| by_nose(layout.head, &seen)))
}

fn by_lips(first: usize, seen: &dyn Fn(usize) -> Option<Keypoint>) -> Option<Mouth> {
    let found: Vec<Keypoint> = (first..first + 20).filter_map(seen).collect();
    if found.len() < MIN_POINTS {
        return None;
    }
    let total: f64 = found.iter().map(|(_, score)| score).sum();
    let at = found.iter().map(|(at, score)| *at * *score).sum::<DVec2>() / total;
    let between = |a: usize, b: usize| Some((seen(first + a)?.0 - seen(first + b)?.0).length());
    let width = between(0, 6).unwrap_or(0.0);
    let opening = between(14, 18).filter(|_| width > 0.0).map(|lips| lips / width);
    let sigma = MIN_SIGMA.max(RELATIVE_SIGMA * width);
    Some(Mouth { at, sigma, weight: total / found.len() as f64, width, opening, approx: false })
}

fn by_nose(head: &[usize], seen: &dyn Fn(usize) -> Option<Keypoint>) -> Option<Mouth> {
    let (nose, weight) = seen(*head.first()?)?;
    let others: Vec<DVec2> = head.iter().filter_map(|index| Some(seen(*index)?.0)).collect();
    let pairs = others.iter().flat_map(|a| others.iter().map(|b| (*a - *b).length()));
    let size = pairs.fold(0.0, f64::max);
    let sigma = NOSE_TO_MOUTH * size;
    (size > 0.0).then(|| Mouth {
        at: nose,
        sigma: sigma.max(MIN_SIGMA),
        weight,
        width: 0.0,
        opening: None,
        approx: true,
    })
}
