//! EasyMocap and EasyVolcap (ENeRF, ZJU-MoCap, SelfCap): `intri.yml` and `extri.yml`, which OpenCV wrote, and the pictures of each
//! camera in `images/<camera>/` or `videos/<camera>.mp4`.

use std::collections::BTreeMap;

use super::footage;
use super::opencv::{self, Rotation};
use super::recording::{Footage, Place, Source, SourceCamera};
use crate::files::{cannot_read, read_text};
use crate::prepare::foreign;
use crate::prepare::video;
use crate::scene::Pose;
use crate::scene::capture::{Faults, camera_place, whole_side};
use crate::scene::undistort::Lens;
use glam::DMat3;

const INTRINSICS: &str = "intri.yml";
const EXTRINSICS: &str = "extri.yml";
const REMEDY: &str = "give the files that EasyMocap or EasyVolcap wrote";
/// Elements of two rotations that are the same differ by less.
const SAME_ROTATION: f64 = 1e-3;

pub(super) fn is_easymocap(place: Place) -> bool {
    // A capture folder is read as one.
    let is_own = place.folder.join("capture.toml").is_file();
    !is_own && [INTRINSICS, EXTRINSICS].iter().all(|name| place.folder.join(name).is_file())
}

pub(super) fn read(place: Place, faults: &mut Faults) -> Source {
    let calibration = place.folder.join(INTRINSICS);
    let mut source = Source::of(&calibration);
    let [intrinsics, extrinsics] = [INTRINSICS, EXTRINSICS].map(|name| {
        let path = place.folder.join(name);
        let text = read_text(&path).map_err(|fault| cannot_read(&path, &fault));
        faults.take(text).map_or_else(BTreeMap::new, |text| values(&text))
    });
    let mut disagree = Vec::new();
    for name in intrinsics.keys().filter_map(|key| key.strip_prefix("K_")) {
        let (pose, agree) = match pose(&extrinsics, name) {
            Ok(pose) => pose,
            Err(reason) => {
                let reason = format!("{reason} in {EXTRINSICS}");
                faults.add(&calibration, camera_place(name), reason, REMEDY);
                continue;
            }
        };
        disagree.extend((!agree).then_some(name));
        let Some(footage) = footage::take(place.footage, name, &calibration, faults) else { continue };
        let size = size(&intrinsics, name).map_or_else(|| size_of(&footage), Ok);
        let Some(size) = faults.take(size) else { continue };
        match lens(&intrinsics, name, size) {
            Ok(lens) => source.cameras.push(SourceCamera::still(name, lens, pose, footage)),
            Err(reason) => faults.add(&calibration, camera_place(name), reason, REMEDY),
        }
    }
    if !disagree.is_empty() {
        source.notes.push(format!(
            "{EXTRINSICS}: R and Rot are different rotations of {}: Rot, the matrix, is taken",
            disagree.join(", ")
        ));
    }
    source
}

fn size_of(footage: &Footage) -> crate::error::Result<(u32, u32)> {
    match footage {
        Footage::Video(path) => video::probe(path).map(|video| (video.width, video.height)),
        Footage::Images(shots) => foreign::read_size(&shots[0].image),
    }
}

type Values = BTreeMap<String, Vec<f64>>;

fn size(values: &Values, name: &str) -> Option<(u32, u32)> {
    let side = |kind: &str| whole_side(*values.get(&format!("{kind}_{name}"))?.first()?);
    side("W").zip(side("H"))
}

fn lens(values: &Values, name: &str, (width, height): (u32, u32)) -> Result<Lens, String> {
    let matrix = values.get(&format!("K_{name}")).and_then(|matrix| rows(matrix));
    let matrix = matrix.ok_or_else(|| format!("has a K_{name} that is no 3 x 3 matrix"))?;
    let coefficients = ["dist", "D"].iter().find_map(|kind| values.get(&format!("{kind}_{name}")));
    opencv::lens([width, height], &matrix, coefficients.map_or(&[], Vec::as_slice), false)
}

/// World to camera; true if the two rotations that there may be agree.
fn pose(values: &Values, name: &str) -> Result<(Pose, bool), String> {
    let value = |kind: &str| values.get(&format!("{kind}_{name}"));
    let translation = value("T").and_then(|at| <[f64; 3]>::try_from(at.as_slice()).ok());
    let translation = translation.ok_or_else(|| format!("has no T_{name} of three numbers"))?;
    let vector = value("R").and_then(|turn| <[f64; 3]>::try_from(turn.as_slice()).ok()).map(Rotation::Vector);
    let matrix = value("Rot").or(value("R")).and_then(|matrix| rows(matrix)).map(Rotation::Matrix);
    let rotations = [matrix, vector].into_iter().flatten().map(|rotation| rotation.matrix());
    let rotations: Vec<DMat3> = rotations.collect();
    let rotation = *rotations.first().ok_or_else(|| format!("has neither R_{name} nor Rot_{name}"))?;
    let agree = rotations.iter().all(|other| other.abs_diff_eq(rotation, SAME_ROTATION));
    let turned = rotation * rotation.transpose();
    if !(turned.abs_diff_eq(DMat3::IDENTITY, SAME_ROTATION) && rotation.determinant() > 0.0) {
        return Err(format!("has a rotation that is none: Rot_{name}"));
    }
    Ok((Pose { rotation, translation: translation.into() }, agree))
}

fn rows(numbers: &[f64]) -> Option<[[f64; 3]; 3]> {
    let [a, b, c, d, e, f, g, h, i] = *numbers else { return None };
    Some([[a, b, c], [d, e, f], [g, h, i]])
}

/// The numbers of each key of an OpenCV file, whose first line, `%YAML:1.0`, YAML readers refuse. A matrix is
/// `KEY: !!opencv-matrix` with its elements in `data: [..]`, row by row.
fn values(text: &str) -> Values {
    let mut values = Values::new();
    let mut key = "";
    let mut lines = text.lines();
    while let Some(line) = lines.next() {
        let Some((own, mut rest)) = line.split_once(':') else { continue };
        let is_inner = line.starts_with([' ', '\t']);
        let own = own.trim().trim_matches('"');
        if !is_inner {
            key = own;
        }
        let mut list = String::new();
        if rest.trim_start().starts_with('[') {
            while !rest.contains(']') {
                list += rest;
                let Some(next) = lines.next() else { break };
                rest = next;
            }
            list += rest;
        }
        let numbers = list.trim().trim_start_matches('[').split(']').next().unwrap_or_default();
        let numbers: Option<Vec<f64>> = match (is_inner, own) {
            _ if !list.is_empty() => numbers.split(',').map(number).collect(),
            (false, _) => number(rest).map(|number| vec![number]),
            _ => None,
        };
        if let Some(numbers) = numbers.filter(|_| !is_inner || own == "data") {
            values.insert(key.to_owned(), numbers);
        }
    }
    values
}

fn number(text: &str) -> Option<f64> {
    text.trim().parse().ok().filter(|number: &f64| number.is_finite())
}
