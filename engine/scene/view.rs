//! One camera at one time (SPEC 9, "Cameras"), and the files of them.

use serde::Deserialize;
use std::collections::HashSet;
use std::path::Path;

use super::intrinsics::Intrinsics;
use super::pose::Pose;
use crate::error::{Error, Result};
use crate::files::{read_bytes, write_atomic};
use glam::DVec3;

/// A pinhole camera at one time. Double precision on the host, narrowed once for the device.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct View {
    /// Names the output files.
    pub name: String,
    /// The pinhole camera. A cameras file has its fields among the view's own.
    #[serde(flatten)]
    pub intrinsics: Intrinsics,
    /// World to camera. A cameras file has the rows, see [`Pose::rows`].
    #[serde(rename = "world_to_camera")]
    pub pose: Pose,
    /// Normalised time.
    #[serde(default)]
    pub time: f64,
    /// The camera's time offset in frames; it shifts time by `time_offset * flow_dt`.
    #[serde(default)]
    pub time_offset: f64,
    /// Normalised time between two frames, the step that flow is measured over.
    #[serde(default = "one")]
    pub flow_dt: f64,
    /// Colour behind the scene.
    #[serde(default)]
    pub background: [f32; 3],
    /// The definition of the output `flow`.
    #[serde(default, skip_serializing_if = "FlowModel::is_default")]
    pub flow_model: FlowModel,
    /// The pose one frame later, of a camera that moves; [`FlowModel::Displacement`] uses it.
    #[serde(rename = "next_world_to_camera", default, skip_serializing_if = "Option::is_none")]
    pub next_pose: Option<Pose>,
}

/// The cone about the corners of a view's frustum, scene units.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
pub struct Cone {
    pub tip: [f32; 3],
    /// Tangent of the angle between the axis and the cone's side.
    pub reach: f32,
    /// A unit vector.
    pub axis: [f32; 3],
    pub unused: f32,
}

/// The space before a lens in which no Gaussian may be, over the surface that the lens and its neighbours stand on, scene units: where `s`
/// is below `radius` squared and the height `z - slope . o - curvature s / 2` below `depth`, with `o` from the lens, `z` along the axis, and
/// `s` the square of the distance from it.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
pub struct Clearing {
    pub place: [f32; 3],
    pub radius: f32,
    /// The optical axis, of length 1.
    pub axis: [f32; 3],
    /// Of the surface at the lens; positive if the neighbours stand before the lens.
    pub curvature: f32,
    /// Gradient of the surface's height, at right angles to the axis.
    pub slope: [f32; 3],
    pub depth: f32,
}

/// The definition of the output `flow` (SPEC 3).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum FlowModel {
    /// flow_dt J0 (R v): the projected velocity. Of the scene alone, to first order (paper).
    #[default]
    Velocity,
    /// pi'(mu(t' + flow_dt)) - pi(mu(t')): the way of the centre in the picture, by its own motion and the camera's. As `Velocity` for a
    /// centre that is behind the camera one frame later.
    Displacement,
}

impl FlowModel {
    fn is_default(&self) -> bool {
        *self == FlowModel::default()
    }
}

fn one() -> f64 {
    1.0
}

/// Largest width or height of a view, pixels.
const MAX_SIDE: u32 = 1 << 16;
/// With a suffix, a name must fit every common file system.
const MAX_NAME_BYTES: usize = 200;
/// Largest deviation of R R^T from the identity, entry by entry.
const ROTATION_TOLERANCE: f64 = 1e-3;
const POSE_REMEDY: &str =
    "give the rows of a rotation and translation from world to camera (x right, y down, z forward)";

/// A cameras file. Views stay untyped until an error message can have their index.
#[derive(serde::Deserialize)]
struct Document {
    views: Vec<serde_json::Value>,
}

/// Reads a cameras file: JSON `{"views": [...]}` with the fields of [`View`]; `time`, `time_offset`, `flow_dt` and
/// `background` may be absent (0, 0, 1, black). Other fields are ignored.
///
/// # Errors
/// [`Error::Data`] naming the view and the field when the file cannot be read or a field is not as [`View`] says: names must be unique and
/// fit for files, sizes 1 to 65,536, focal lengths positive, numbers finite, poses rotations and translations.
pub fn read_views(path: &Path) -> Result<Vec<View>> {
    parse_views(path, &read_bytes(path)?)
}

/// As [`read_views`], of a text in memory; errors name `path`.
pub(crate) fn parse_views(path: &Path, text: &[u8]) -> Result<Vec<View>> {
    let remedy = "write {\"views\": [{\"name\": ..., \"width\": ..., ...}]}";
    let parsed = serde_json::from_slice::<Document>(text);
    let document = parsed.map_err(|fault| Error::data(path, "", format!("not a cameras file: {fault}"), remedy))?;
    let mut views = Vec::new();
    for (index, value) in document.views.into_iter().enumerate() {
        let name = value.get("name").and_then(|name| name.as_str()).unwrap_or_default();
        let place = place_of(index, name);
        check_last_rows(path, &place, &value)?;
        let view = serde_json::from_value::<View>(value);
        views.push(view.map_err(|fault| Error::data(path, place, fault.to_string(), "correct this field"))?);
    }
    check_views(path, &views)?;
    Ok(views)
}

/// Checks what a [`Pose`] does not keep.
fn check_last_rows(path: &Path, place: &str, view: &serde_json::Value) -> Result<()> {
    for field in ["world_to_camera", "next_world_to_camera"] {
        let last = view.get(field).and_then(|rows| <[f64; 4]>::deserialize(rows.get(3)?).ok());
        if let Some(last) = last.filter(|last| *last != [0.0, 0.0, 0.0, 1.0]) {
            let reason = format!("has {last:?} as its last row, not [0, 0, 0, 1]");
            return Err(Error::data(path, format!("{place}, field `{field}`"), reason, POSE_REMEDY));
        }
    }
    Ok(())
}

/// Writes a cameras file that [`read_views`] reads back as equal views.
///
/// # Errors
/// [`Error::Data`] when a view would be refused by [`read_views`] or the file cannot be written.
pub fn write_views(path: &Path, views: &[View]) -> Result<()> {
    check_views(path, views)?;
    write_atomic(path, |to| {
        serde_json::to_writer_pretty(&mut *to, &serde_json::json!({ "views": views }))?;
        writeln!(to)
    })
}

fn place_of(index: usize, name: &str) -> String {
    if name.is_empty() { format!("view {index}") } else { format!("view {index} (`{}`)", name.escape_debug()) }
}

fn check_views(path: &Path, views: &[View]) -> Result<()> {
    if views.is_empty() {
        return Err(Error::data(path, "field `views`", "holds no view", "add at least one"));
    }
    let mut names = HashSet::new();
    for (index, view) in views.iter().enumerate() {
        let fault = view.check().or_else(|| {
            let reason = "is the name of an earlier view too".to_owned();
            (!names.insert(view.name.as_str())).then_some(("name", reason, "give every view its own"))
        });
        if let Some((field, reason, remedy)) = fault {
            let place = format!("{}, field `{field}`", place_of(index, &view.name));
            return Err(Error::data(path, place, reason, remedy));
        }
    }
    Ok(())
}

/// Field, reason, remedy.
pub(super) type Fault = (&'static str, String, &'static str);

/// Normalised time of photographs, at which no dynamic Gaussian is alive.
pub(super) const PHOTO_TIME: f64 = 1e6;

impl View {
    #[doc(hidden)]
    pub fn is_photo(&self) -> bool {
        self.time == PHOTO_TIME
    }

    /// A view from `eye` to `target`, world, with the direction `up` upwards in the picture; see [`Intrinsics::of_fov`]. At time 0,
    /// over black. Where `eye` is at `target` it looks along z; where it looks along `up`, some direction is upwards.
    pub fn look_at(eye: [f64; 3], target: [f64; 3], up: [f64; 3], intrinsics: Intrinsics) -> View {
        let [eye, target, up] = [eye, target, up].map(DVec3::from);
        View {
            name: "view".to_owned(),
            intrinsics,
            pose: Pose::look_at(eye, target, up),
            flow_dt: 1.0,
            ..View::default()
        }
    }

    /// With [`Intrinsics::reduced`].
    pub fn reduced(&self, factor: u32) -> View {
        View { intrinsics: self.intrinsics.reduced(factor), ..self.clone() }
    }

    #[doc(hidden)]
    pub fn fitted(&self, size: [u32; 2]) -> View {
        View { intrinsics: self.intrinsics.fitted(size), ..self.clone() }
    }

    #[doc(hidden)]
    pub fn cone(&self, origin: [f64; 3]) -> Cone {
        let Intrinsics { fx, fy, cx, cy, .. } = self.intrinsics;
        let size = self.intrinsics.size();
        let reach = (cx.max(size.x - cx) / fx).hypot(cy.max(size.y - cy) / fy) as f32;
        let tip = (self.pose.center() - DVec3::from(origin)).as_vec3().to_array();
        Cone { tip, reach, axis: self.pose.forward().as_vec3().to_array(), unused: 0.0 }
    }

    pub(super) fn check(&self) -> Option<Fault> {
        let unfit = |c: char| c == '/' || c == '\\' || c.is_control();
        if self.name.is_empty() || self.name.len() > MAX_NAME_BYTES {
            let reason = format!("has {} bytes, 1 to {MAX_NAME_BYTES} are allowed", self.name.len());
            return Some(("name", reason, "it names the output files: give a short one"));
        }
        if self.name.contains(unfit) || self.name.contains("..") {
            let reason = "has a path separator, a control character or `..`".to_owned();
            return Some(("name", reason, "it names the output files: use a plain file name"));
        }
        let Intrinsics { width, height, fx, fy, cx, cy } = self.intrinsics;
        for (field, side) in [("width", width), ("height", height)] {
            if !(1..=MAX_SIDE).contains(&side) {
                return Some((field, format!("is {side}, 1 to {MAX_SIDE} is allowed"), "give the size in pixels"));
            }
        }
        for (field, focal) in [("fx", fx), ("fy", fy)] {
            if !(focal.is_finite() && focal > 0.0) {
                return Some((field, format!("is {focal}, not a positive number"), "give the focal length in pixels"));
            }
        }
        let numbers = [("cx", cx), ("cy", cy), ("time", self.time), ("time_offset", self.time_offset)];
        for (field, number) in numbers.into_iter().chain([("flow_dt", self.flow_dt)]) {
            if !number.is_finite() {
                return Some((field, format!("is {number}"), "give a finite number"));
            }
        }
        if self.background.iter().any(|c| !c.is_finite()) {
            return Some(("background", format!("is {:?}", self.background), "give three finite numbers"));
        }
        let next = self.next_pose.as_ref();
        check_pose("world_to_camera", &self.pose)
            .or_else(|| next.and_then(|next| check_pose("next_world_to_camera", next)))
    }
}

fn check_pose(field: &'static str, Pose { rotation, translation }: &Pose) -> Option<Fault> {
    if !(rotation.is_finite() && translation.is_finite()) {
        return Some((field, "has an entry that is not finite".to_owned(), POSE_REMEDY));
    }
    for i in 0..3 {
        for j in 0..=i {
            let product = rotation.row(i).dot(rotation.row(j));
            let expected = if i == j { 1.0 } else { 0.0 };
            let error = (product - expected).abs();
            if error.is_nan() || error > ROTATION_TOLERANCE {
                let reason = format!("has no rotation: rows {j} and {i} have the product {product}, not {expected}");
                return Some((field, reason, POSE_REMEDY));
            }
        }
    }
    if rotation.determinant() < 0.0 {
        return Some((field, "mirrors: the determinant of its rotation is -1".to_owned(), POSE_REMEDY));
    }
    None
}
