//! Dynamic3DGaussians' layout: `train_meta.json`, `test_meta.json`, `ims/`, `seg/`, `init_pt_cld.npz`.

use std::collections::BTreeMap;
use std::path::Path;

use super::{Camera, CaptureBuilder, CaptureSettings, Faults, MAX_COORDINATE, MAX_FRAMES, Named, Point, Shot, spelled};
use crate::error::{self, Error};
use crate::files::npy::read_npz;
use crate::files::read_json;
use crate::scene::{Intrinsics, Pose};

const REMEDY: &str = "correct the file, or export the capture again";

/// A meta file. The lists are by frame and, in each, by camera.
#[derive(serde::Deserialize)]
struct Meta {
    w: u32,
    h: u32,
    k: Vec<Vec<[[f64; 3]; 3]>>,
    w2c: Vec<Vec<[[f64; 4]; 4]>>,
    #[serde(rename = "fn")]
    names: Vec<Vec<String>>,
    cam_id: Vec<Vec<u32>>,
}

pub(super) fn read(named: &Named, settings: &CaptureSettings, faults: &mut Faults) -> CaptureBuilder {
    let path = named.folder.as_path();
    let mut found = MetaReader { path, settings, cameras: BTreeMap::new(), n_listed: 0, n_respelled: 0 };
    for (name, is_test) in [("train_meta.json", false), ("test_meta.json", true)] {
        let file = path.join(name);
        if is_test && !file.exists() {
            continue;
        }
        if let Some(meta) = faults.take(read_json(&file, "meta file", REMEDY)) {
            found.add(&file, &meta, is_test, faults);
        }
    }
    let mut builder =
        CaptureBuilder { n_frames: found.n_listed, ..CaptureBuilder::still(settings, path.join("train_meta.json")) };
    if found.n_respelled > 0 {
        let (n, names) = (found.n_respelled, "names with backslashes, or that lead out of the capture");
        builder.notes.push(format!("{names}: {n}; read below ims/ with /"));
    }
    builder.pose_remedy = Some("give w2c from world to camera, the camera's axes x right, y down, z forward");
    builder.cameras = found.cameras.into_values().collect();
    drop_absent_end(&mut builder);
    let cloud = path.join("init_pt_cld.npz");
    if cloud.is_file() {
        builder.points = faults.take(points(&cloud)).unwrap_or_default();
    }
    builder
}

struct MetaReader<'a> {
    path: &'a Path,
    settings: &'a CaptureSettings,
    cameras: BTreeMap<u32, Camera>,
    n_listed: u32,
    n_respelled: usize,
}

impl MetaReader<'_> {
    fn add(&mut self, file: &Path, meta: &Meta, is_test: bool, faults: &mut Faults) {
        let differ = |what: &str, n: [usize; 4]| {
            let [k, w2c, names, ids] = n;
            format!("lists {k} {what} in k, {w2c} in w2c, {names} in fn, {ids} in cam_id")
        };
        let n = [meta.k.len(), meta.w2c.len(), meta.names.len(), meta.cam_id.len()];
        if n.iter().any(|m| *m != n[0]) || n[0] > MAX_FRAMES as usize {
            faults.add(file, "", differ("frames", n), REMEDY);
        }
        let n_frames = n.iter().min().map_or(0, |n| u32::try_from(*n).unwrap_or(MAX_FRAMES));
        self.n_listed = self.n_listed.max(n_frames);
        for t in 0..n_frames as usize {
            let n = [meta.k[t].len(), meta.w2c[t].len(), meta.names[t].len(), meta.cam_id[t].len()];
            if n.iter().any(|m| *m != n[0]) {
                faults.add(file, format!("frame {t}"), differ("cameras", n), REMEDY);
                continue;
            }
            for c in 0..n[0] {
                if let Err(reason) = self.add_shot(meta, t, c, is_test) {
                    faults.add(file, format!("frame {t}, camera {}", meta.cam_id[t][c]), reason, REMEDY);
                }
            }
        }
    }

    fn add_shot(&mut self, meta: &Meta, t: usize, c: usize, is_test: bool) -> Result<(), String> {
        let spelled = spelled(&meta.names[t][c])?;
        self.n_respelled += usize::from(spelled.has_backslash || spelled.leads_out);
        let name = spelled.path;
        let &Meta { w: width, h: height, .. } = meta;
        let (k, rows, id) = (meta.k[t][c], &meta.w2c[t][c], meta.cam_id[t][c]);
        if k[0][1] != 0.0 || k[1][0] != 0.0 || k[2] != [0.0, 0.0, 1.0] {
            return Err(format!("has the intrinsic matrix {k:?}, which is no pinhole without skew"));
        }
        if rows[3] != [0.0, 0.0, 0.0, 1.0] {
            return Err(format!("has {:?} as the last row of w2c, not [0, 0, 0, 1]", rows[3]));
        }
        let pose = Pose::of_rows(rows);
        let mask = self.path.join("seg").join(name.with_extension("png"));
        let foreground = mask.exists().then_some(mask);
        let shot = Shot {
            frame: t as u32,
            image: self.path.join("ims").join(name),
            mask: foreground.clone().filter(|_| self.settings.foreground_masks),
            foreground,
            ..Shot::default()
        };
        let new = Camera {
            name: id.to_string(),
            intrinsics: Intrinsics { width, height, fx: k[0][0], fy: k[1][1], cx: k[0][2], cy: k[1][2] },
            world_to_camera: pose,
            is_test,
            ..Camera::default()
        };
        let camera = self.cameras.entry(id).or_insert_with(|| new.clone());
        if camera.is_test != is_test {
            return Err("is both a training and a test camera".to_owned());
        }
        let numbers = |of: &Camera| (of.intrinsics.focal(), of.intrinsics.principal());
        if numbers(camera) != numbers(&new) {
            return Err("changes its intrinsics in time".to_owned());
        }
        if camera.shots.last().is_some_and(|last| last.frame == shot.frame) {
            return Err("is listed twice in this frame".to_owned());
        }
        // A camera that stands still keeps one pose; from its first movement on, every shot has its own.
        let moves = camera.shots.last().is_some_and(|last| last.world_to_camera.is_some());
        if !moves && camera.world_to_camera != pose {
            let first = camera.world_to_camera;
            camera.shots.iter_mut().for_each(|shot| shot.world_to_camera = Some(first));
        }
        let moves = moves || camera.world_to_camera != pose;
        camera.shots.push(Shot { world_to_camera: moves.then_some(pose), ..shot });
        Ok(())
    }
}

/// Excerpts of a capture keep the lists of all frames: the end of the clip for which no camera has an image is left out.
fn drop_absent_end(builder: &mut CaptureBuilder) {
    let shots = builder.cameras.iter().flat_map(|camera| &camera.shots);
    let Some(last) = shots.filter(|shot| shot.image.exists()).map(|shot| shot.frame).max() else { return };
    if last + 1 < builder.n_frames {
        builder.notes.push(format!("{} frames are listed, images of the first {} exist", builder.n_frames, last + 1));
        builder.n_frames = last + 1;
        builder.cameras.iter_mut().for_each(|camera| camera.shots.retain(|shot| shot.frame <= last));
    }
}

/// Rows of `data`: x, y, z, then red, green and blue in [0, 1], then a label.
fn points(path: &Path) -> error::Result<Vec<Point>> {
    let array = read_npz(path, "data")?;
    let &[_, n_columns] = array.shape.as_slice() else {
        return Err(Error::data(path, "array `data`", format!("has the shape {:?}", array.shape), REMEDY));
    };
    if n_columns < 6 {
        let reason = format!("has {n_columns} columns, position and colour need 6");
        return Err(Error::data(path, "array `data`", reason, REMEDY));
    }
    let mut points = Vec::new();
    for (row, values) in array.values.chunks_exact(n_columns).enumerate() {
        if values[..6].iter().any(|v| !v.is_finite() || v.abs() > MAX_COORDINATE) {
            let reason = format!("is {:?}: not finite or too large", &values[..6]);
            return Err(Error::data(path, format!("array `data`, row {row}"), reason, REMEDY));
        }
        let color = [values[3], values[4], values[5]].map(|c| (c.clamp(0.0, 1.0) * 255.0).round() as u8);
        points.push(Point { position: [values[0], values[1], values[2]], color });
    }
    Ok(points)
}
