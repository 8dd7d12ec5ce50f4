//! `.splatv` of antimatter15's player: 64 bytes a Gaussian, without view dependence.

use super::convert::{byte_of_logit, level};
use super::format::{ELSEWHERE, Keeps, Writer, require_some};
use super::ply::own_time;
use crate::error::{Error, Result};
use crate::files::write_atomic;
use crate::scene::{SH_C0, Splats, View};
use exr::prelude::f16;
use serde_json::json;
use std::path::Path;

pub(super) const WRITER: Writer = Writer {
    name: "splatv",
    ending: Some(".splatv"),
    about: "antimatter15's of dynamic scenes, without view dependence",
    keeps: Keeps { views: true, ..Keeps::NOTHING },
    write: |path, splats, clip, _| write_splatv(path, splats, &clip.views).map(|()| Vec::new()),
};

const MAGIC: u32 = 0x674b;
/// Texels in a row of the texture; four of 16 bytes are a Gaussian.
const TEXTURE_WIDTH: usize = 4096;
const ROW_BYTES: usize = 64;
/// Bending and turning, which ours do not have.
const UNUSED: [[f32; 2]; 5] = [[0.0; 2]; 5];

/// The largest and most opaque first. All but positions are halves or bytes. One that never fades has a tau of 65,504 clips.
pub fn write_splatv(path: &Path, splats: &Splats, views: &[View]) -> Result<()> {
    let remedy = "this is a fault of the program that made the scene";
    splats.check().map_err(|reason| Error::data(path, "", reason, remedy))?;
    splats.refuse_spans(path, "this format", ELSEWHERE)?;
    let mut order: Vec<usize> = (0..splats.len()).filter(|&i| splats.is_finite(i)).collect();
    require_some(path, &order, ".splatv")?;
    if views.is_empty() {
        let remedy = "give --cameras, or the folder of a run, whose capture is there";
        return Err(Error::data(path, "", "expected a view to start from, found none", remedy));
    }
    let size = |i: usize| splats.scale[i].iter().sum::<f32>() - (-splats.opacity[i]).exp().ln_1p();
    order.sort_by(|a, b| size(*b).total_cmp(&size(*a)));
    let height = (order.len() * ROW_BYTES).div_ceil(16 * TEXTURE_WIDTH);
    let mut texture = Vec::with_capacity(16 * TEXTURE_WIDTH * height);
    order.iter().for_each(|&i| push_row(splats, i, &mut texture));
    // Rows of zeros are not drawn.
    texture.resize(16 * TEXTURE_WIDTH * height, 0);
    let chunks = json!([{
        "type": "splat", "size": texture.len(), "texwidth": TEXTURE_WIDTH, "texheight": height,
        "cameras": views.iter().enumerate().map(|(id, view)| camera(id, view)).collect::<Vec<_>>(),
    }]);
    let chunks = chunks.to_string();
    write_atomic(path, |to| {
        to.write_all(&MAGIC.to_le_bytes())?;
        to.write_all(&(chunks.len() as u32).to_le_bytes())?;
        to.write_all(chunks.as_bytes())?;
        to.write_all(&texture)
    })
}

fn push_row(splats: &Splats, i: usize, to: &mut Vec<u8>) {
    let [vx, vy, vz, t_center, t_scale, ..] = own_time(splats, i.checked_sub(splats.n_static));
    splats.position[i].iter().for_each(|x| to.extend(x.to_le_bytes()));
    let norm = splats.rotation[i].iter().map(|v| v * v).sum::<f32>().sqrt().max(f32::MIN_POSITIVE);
    let [w, x, y, z] = splats.rotation[i].map(|v| v / norm);
    let [sx, sy, sz] = splats.scale[i].map(f32::exp);
    [[w, x], [y, z], [sx, sy], [sz, 0.0]].iter().for_each(|pair| push_halves(*pair, to));
    let color = splats.sh[i * splats.n_coefficients()].map(|dc| level(0.5 + SH_C0 * f64::from(dc)));
    to.extend(color);
    to.push(byte_of_logit(splats.opacity[i]));
    // The player divides by it.
    let time = [t_center, t_scale.exp().max(f16::MIN_POSITIVE.to_f32())];
    [[vx, vy], [vz, 0.0]].iter().chain(&UNUSED).chain([&time]).for_each(|pair| push_halves(*pair, to));
}

/// Appends two halves, clamped to their range.
fn push_halves(pair: [f32; 2], to: &mut Vec<u8>) {
    let half = |v: f32| f16::from_f32(v.clamp(f16::MIN.to_f32(), f16::MAX.to_f32()));
    pair.iter().for_each(|v| to.extend(half(*v).to_le_bytes()));
}

/// As 3DGS writes it: position, and axes as columns.
fn camera(id: usize, view: &View) -> serde_json::Value {
    let (pose, lens) = (view.pose, view.intrinsics);
    // The rows of the inverse.
    let rotation = pose.rotation.to_cols_array_2d();
    json!({
        "id": id, "img_name": view.name, "width": lens.width, "height": lens.height, "position": pose.center().to_array(),
        "rotation": rotation, "fx": lens.fx, "fy": lens.fy,
    })
}
