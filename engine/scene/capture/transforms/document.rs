//! The contents of a `transforms.json`, in the dialects of its writers.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use super::REMEDY;
use crate::error;
use crate::files::{parse_json, read_bytes};
use crate::scene::Intrinsics;
use crate::scene::capture::{MAX_SIDE, whole_side};
use crate::scene::undistort::{Distortion, Lens};
use serde_json::Value;

const MATRICES: [&str; 5] = ["K", "k", "intrinsic", "intrinsics", "intrinsic_matrix"];
/// Our keys, and spellings of others for them, in lower case and without `_`.
const MEANT: [(&str, &[&str]); 8] = [
    ("fl_x", &["f1x", "flx", "fx", "focalx", "focallengthx", "focal", "f", "focallength"]),
    ("fl_y", &["f1y", "fly", "fy", "focaly", "focallengthy"]),
    ("cx", &["c1x", "clx", "cx", "ppx", "centerx", "principalx", "px"]),
    ("cy", &["c1y", "cly", "cy", "ppy", "centery", "principaly", "py"]),
    ("w", &["width", "imagewidth", "imgw", "imgwidth", "resx"]),
    ("h", &["height", "imageheight", "imgh", "imgheight", "resy"]),
    ("camera_angle_x", &["cameraanglex", "fovx", "anglex", "hfov"]),
    ("camera_angle_y", &["cameraangley", "fovy", "angley", "vfov"]),
];

macro_rules! given_lens {
    ($($number:ident)*) => {
        /// A lens. Each part may be in the file, in a frame, or nowhere.
        #[derive(Clone, Debug, Default, PartialEq, serde::Deserialize)]
        #[serde(default)]
        pub(super) struct GivenLens {
            camera_model: Option<String>,
            /// instant-ngp's key instead of a model.
            is_fisheye: Option<bool>,
            $(pub $number: Option<f64>,)*
            #[serde(flatten)]
            others: BTreeMap<String, Value>,
        }

        impl GivenLens {
            /// What is given here, else in `file`; no other keys.
            fn or(&self, file: &GivenLens) -> GivenLens {
                GivenLens {
                    camera_model: self.camera_model.clone().or_else(|| file.camera_model.clone()),
                    is_fisheye: self.is_fisheye.or(file.is_fisheye),
                    $($number: self.$number.or(file.$number),)*
                    others: BTreeMap::new(),
                }
            }

            /// Names of the numbers that are given here and in `file` with other values.
            fn differing(&self, file: &GivenLens) -> impl Iterator<Item = &'static str> + use<> {
                let pairs = [$((stringify!($number), self.$number.zip(file.$number)),)*];
                pairs.into_iter().filter(|(_, pair)| pair.is_some_and(|(a, b)| a != b)).map(|(name, _)| name)
            }
        }
    };
}

given_lens!(w h fl_x fl_y cx cy camera_angle_x camera_angle_y k1 k2 k3 k4 p1 p2);

#[derive(serde::Deserialize)]
pub(super) struct Document {
    pub frames: Vec<Frame>,
    pub test_filenames: Option<Vec<String>>,
    pub ply_file_path: Option<String>,
    #[serde(flatten)]
    pub lens: GivenLens,
}

#[derive(serde::Deserialize)]
pub(super) struct Frame {
    pub file_path: String,
    pub mask_path: Option<String>,
    pub depth_file_path: Option<String>,
    /// Rows of numbers, or these one after another.
    #[serde(alias = "transform")]
    pub transform_matrix: Value,
    pub time: Option<f64>,
    #[serde(flatten)]
    pub lens: GivenLens,
}

impl Document {
    /// Reads a file: an object with `frames`, or the list of frames alone.
    pub fn read(file: &Path) -> error::Result<Document> {
        let bytes = read_bytes(file)?;
        // Some programs on Windows begin UTF-8 with a mark.
        let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(&bytes);
        if !bytes.trim_ascii_start().starts_with(b"[") {
            return parse_json(file, bytes, "transforms.json", REMEDY);
        }
        let frames = parse_json(file, bytes, "transforms.json", REMEDY)?;
        Ok(Document { frames, test_filenames: None, ply_file_path: None, lens: GivenLens::default() })
    }

    /// Notes on keys that are not read though they may be meant, and on numbers that contradict each other.
    pub fn notes(&self) -> Vec<String> {
        let mut notes = Vec::new();
        let lenses = || self.frames.iter().map(|frame| &frame.lens);
        let others = lenses().chain([&self.lens]).flat_map(|lens| lens.others.keys().map(String::as_str));
        for key in others.filter(|key| !MATRICES.contains(key)).collect::<BTreeSet<_>>() {
            let plain: String = key.chars().filter(char::is_ascii_alphanumeric).collect::<String>().to_lowercase();
            if let Some((meant, _)) = MEANT.iter().find(|(_, spelled)| spelled.contains(&plain.as_str())) {
                notes.push(format!("`{}` is not read: `{meant}` may be meant", key.escape_debug()));
            }
        }
        let both: BTreeSet<&str> = lenses().flat_map(|lens| lens.differing(&self.lens)).collect();
        if !both.is_empty() {
            let names = both.into_iter().collect::<Vec<_>>().join(", ");
            notes.push(format!(
                "{names} stand in the file and, with other values, in its frames: those of the frames are taken"
            ));
        }
        notes
    }
}

pub(super) struct Unfit {
    pub reason: String,
    pub needs_size: bool,
}

pub(super) fn unfit(reason: String) -> Unfit {
    Unfit { reason, needs_size: false }
}

/// The numbers of an array, or of an array of rows.
pub(super) fn numbers(value: &Value) -> Option<Vec<f64>> {
    let row = |row: &Value| match row {
        Value::Array(row) => row.iter().map(Value::as_f64).collect(),
        number => number.as_f64().map(|number| vec![number]),
    };
    value.as_array()?.iter().map(row).collect::<Option<Vec<_>>>().map(|rows| rows.concat())
}

impl GivenLens {
    /// The matrix of intrinsics, if there is one: fx, fy, cx, cy.
    fn matrix(&self) -> Result<Option<[f64; 4]>, Unfit> {
        let Some(value) = MATRICES.iter().find_map(|key| self.others.get(*key)) else { return Ok(None) };
        match numbers(value).as_deref() {
            Some(&[fx, skew, cx, zero, fy, cy, ..]) if skew == 0.0 && zero == 0.0 => Ok(Some([fx, fy, cx, cy])),
            Some(&[fx, fy, cx, cy]) => Ok(Some([fx, fy, cx, cy])),
            _ => Err(unfit(format!("has the matrix of intrinsics {value}, which is no pinhole without skew"))),
        }
    }

    /// The lens as given here, else in `file`, else by the size of the images.
    pub fn resolved(&self, file: &GivenLens, size: Option<(u32, u32)>) -> Result<Lens, Unfit> {
        let with_matrix = |lens: &GivenLens| {
            let [fl_x, fl_y, cx, cy] = lens.matrix()?.map_or([None; 4], |matrix| matrix.map(Some));
            Ok(lens.or(&GivenLens { fl_x, fl_y, cx, cy, ..GivenLens::default() }))
        };
        let (own, mut file) = (with_matrix(self)?, with_matrix(file)?);
        // An angle of the frame goes before a focal length of the file.
        if own.fl_x.is_none() && own.camera_angle_x.is_some() {
            (file.fl_x, file.fl_y) = (None, None);
        }
        let (w, h) = size.map(|(w, h)| (w.into(), h.into())).unzip();
        own.or(&file).or(&GivenLens { w, h, ..GivenLens::default() }).lens()
    }

    fn lens(&self) -> Result<Lens, Unfit> {
        let [k1, k2, k3, k4, p1, p2] =
            [self.k1, self.k2, self.k3, self.k4, self.p1, self.p2].map(Option::unwrap_or_default);
        let usual = if self.is_fisheye == Some(true) { "OPENCV_FISHEYE" } else { "OPENCV" };
        let distortion = match self.camera_model.as_deref().unwrap_or(usual) {
            "PINHOLE" | "SIMPLE_PINHOLE" | "SIMPLE_RADIAL" | "RADIAL" | "OPENCV" if k4 == 0.0 => {
                Distortion::brown([k1, k2, k3, 0.0, 0.0, 0.0], [p1, p2])
            }
            "OPENCV_FISHEYE" => Distortion::Fisheye([k1, k2, k3, k4]),
            "SIMPLE_RADIAL_FISHEYE" | "RADIAL_FISHEYE" => Distortion::Fisheye([k1, k2, 0.0, 0.0]),
            model => {
                let model = model.escape_debug();
                return Err(unfit(format!("has the model {model} with k4 = {k4}, which is not undistorted here")));
            }
        };
        let (Some(w), Some(h)) = (self.w, self.h) else {
            return Err(Unfit { needs_size: true, ..unfit("gives no w and h".to_owned()) });
        };
        let (Some(width), Some(height)) = (whole_side(w), whole_side(h)) else {
            return Err(unfit(format!("has {w} x {h} pixels, whole numbers of 1 to {MAX_SIDE} are allowed")));
        };
        let by_angle = |side: f64, angle: f64| side / (2.0 * (angle / 2.0).tan());
        let Some(fx) = self.fl_x.or_else(|| Some(by_angle(w, self.camera_angle_x?))) else {
            return Err(unfit("gives neither fl_x nor camera_angle_x nor a matrix K".to_owned()));
        };
        let fy = self.fl_y.or_else(|| Some(by_angle(h, self.camera_angle_y?))).unwrap_or(fx);
        let (cx, cy) = (self.cx.unwrap_or(w / 2.0), self.cy.unwrap_or(h / 2.0));
        let intrinsics = Intrinsics { width, height, fx, fy, cx, cy };
        Ok(Lens { intrinsics, distortion })
    }
}
