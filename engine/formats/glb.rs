//! glTF with `KHR_gaussian_splatting`, as a binary file.

use super::convert::level;
use super::format::{Keeps, Writer, static_rows};
use super::four_dgs::World;
use super::spz::SH_SIGNS;
use crate::error::{Error, Result};
use crate::files::write_atomic;
use crate::scene::{SH_C0, Splats};
use glam::{DQuat, DVec3};
use serde_json::{Value, json};
use std::path::Path;

pub(super) const WRITER: Writer = Writer {
    name: "glb",
    ending: Some(".glb"),
    about: "glTF with KHR_gaussian_splatting; one moment",
    keeps: Keeps::NOTHING,
    write: |path, splats, clip, _| write_glb(path, splats, clip.world).map(|()| Vec::new()),
};

const MAGIC: &[u8; 4] = b"glTF";
const VERSION: u32 = 2;
const JSON: &[u8; 4] = b"JSON";
const BINARY: &[u8; 4] = b"BIN\0";
/// Longest file, bytes: lengths are 32 bits.
const MOST_BYTES: u64 = u32::MAX as u64;
const FLOAT: u32 = 5126;
const UNSIGNED_BYTE: u32 = 5121;

#[derive(Default)]
struct Attributes {
    buffer: Vec<u8>,
    views: Vec<Value>,
    accessors: Vec<Value>,
    names: serde_json::Map<String, Value>,
    n: usize,
}

impl Attributes {
    fn floats<const K: usize>(&mut self, name: &str, rows: impl Iterator<Item = [f32; K]>) {
        let bytes = rows.flat_map(|row| row.into_iter().flat_map(f32::to_le_bytes).collect::<Vec<u8>>());
        let kind = ["SCALAR", "VEC2", "VEC3", "VEC4"][K - 1];
        self.push(name, bytes, json!({ "componentType": FLOAT, "type": kind }));
    }

    fn push(&mut self, name: &str, bytes: impl Iterator<Item = u8>, mut accessor: Value) {
        let from = self.buffer.len();
        self.buffer.extend(bytes);
        accessor["bufferView"] = self.views.len().into();
        accessor["count"] = self.n.into();
        self.names.insert(name.to_owned(), self.accessors.len().into());
        self.views.push(json!({ "buffer": 0, "byteOffset": from, "byteLength": self.buffer.len() - from }));
        self.accessors.push(accessor);
    }
}

/// Turns to glTF's axes (right, up, back). The node turns and scales the Gaussians as `world` says: y up, metres. Colours of
/// points serve programs without the extension; nothing else loses anything.
pub fn write_glb(path: &Path, splats: &Splats, world: Option<World>) -> Result<()> {
    let rows = static_rows(path, splats, ".glb")?;
    let k = splats.n_coefficients();
    let n_bytes = rows.len() as u64 * (4 * (3 + 4 + 3 + 1 + 3 * k as u64) + 4);
    if n_bytes + (1 << 16) > MOST_BYTES {
        let reason = format!("{} Gaussians take {n_bytes} bytes, a .glb holds 4 GiB", rows.len());
        return Err(Error::data(path, "", reason, "split the scene, or export it as SPZ"));
    }
    let mut all = Attributes { n: rows.len(), ..Attributes::default() };
    let place = |i: &usize| {
        let [x, y, z] = splats.position[*i];
        [x, -y, -z]
    };
    all.floats("POSITION", rows.iter().map(place));
    let (mut low, mut high) = ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]);
    for position in rows.iter().map(place) {
        low = std::array::from_fn(|axis| low[axis].min(position[axis]));
        high = std::array::from_fn(|axis| high[axis].max(position[axis]));
    }
    all.accessors[0]["min"] = low.to_vec().into();
    all.accessors[0]["max"] = high.to_vec().into();
    let own = |name: &str| format!("KHR_gaussian_splatting:{name}");
    all.floats(&own("SCALE"), rows.iter().map(|&i| splats.scale[i].map(f32::exp)));
    all.floats(&own("ROTATION"), rows.iter().map(|&i| turned(splats.rotation[i])));
    let opacity = |i: usize| 1.0 / (1.0 + (-f64::from(splats.opacity[i])).exp());
    all.floats(&own("OPACITY"), rows.iter().map(|&i| [opacity(i) as f32]));
    for c in 0..k {
        let degree = c.isqrt();
        let name = own(&format!("SH_DEGREE_{degree}_COEF_{}", c - degree * degree));
        let sign = if c == 0 { 1.0 } else { SH_SIGNS[c - 1] };
        all.floats(&name, rows.iter().map(|&i| splats.sh[i * k + c].map(|v| sign * v)));
    }
    let color = |i: usize| {
        let [r, g, b] = splats.sh[i * k].map(|dc| level(linear(0.5 + SH_C0 * f64::from(dc))));
        [r, g, b, level(opacity(i))]
    };
    let bytes = json!({ "componentType": UNSIGNED_BYTE, "type": "VEC4", "normalized": true });
    all.push("COLOR_0", rows.iter().flat_map(|&i| color(i)), bytes);
    write(path, all, &node(world))
}

/// The node of Gaussians that were turned by half a turn about x.
fn node(world: Option<World>) -> Value {
    let mut node = json!({ "mesh": 0 });
    if let Some(World { up: [x, y, z], metres_per_unit }) = world {
        let up = DVec3::new(x, -y, -z).normalize_or(DVec3::Y);
        // The half turn that takes the other back.
        let turn = if up == DVec3::NEG_Y {
            DQuat::from_xyzw(1.0, 0.0, 0.0, 0.0)
        } else {
            DQuat::from_rotation_arc(up, DVec3::Y)
        };
        node["rotation"] = turn.to_array().to_vec().into();
        if let Some(metres) = metres_per_unit {
            node["scale"] = vec![metres; 3].into();
        }
    }
    node
}

fn write(path: &Path, all: Attributes, node: &Value) -> Result<()> {
    let Attributes { buffer, views, accessors, names, .. } = all;
    let document = json!({
        "asset": { "version": "2.0", "generator": concat!("ivv ", env!("CARGO_PKG_VERSION")) },
        "extensionsUsed": ["KHR_gaussian_splatting"],
        "scene": 0,
        "scenes": [{ "nodes": [0] }],
        "nodes": [node],
        "meshes": [{ "primitives": [{
            "mode": 0,
            "attributes": names,
            "extensions": { "KHR_gaussian_splatting": { "kernel": "ellipse", "colorSpace": "srgb_rec709_display" } },
        }] }],
        "accessors": accessors,
        "bufferViews": views,
        "buffers": [{ "byteLength": buffer.len() }],
    });
    let mut document = document.to_string().into_bytes();
    // Chunks are whole words.
    document.resize(document.len().next_multiple_of(4), b' ');
    let length = 12 + 8 + document.len() + 8 + buffer.len();
    write_atomic(path, |to| {
        to.write_all(MAGIC)?;
        [VERSION, length as u32, document.len() as u32]
            .iter()
            .try_for_each(|word| to.write_all(&word.to_le_bytes()))?;
        to.write_all(JSON)?;
        to.write_all(&document)?;
        to.write_all(&(buffer.len() as u32).to_le_bytes())?;
        to.write_all(BINARY)?;
        to.write_all(&buffer)
    })
}

/// (w, x, y, z) as a unit quaternion (x, y, z, w) after half a turn of the axes about x.
fn turned([w, x, y, z]: [f32; 4]) -> [f32; 4] {
    let norm = [w, x, y, z].iter().map(|v| f64::from(*v).powi(2)).sum::<f64>().sqrt();
    if norm > 0.0 { [x, -y, -z, w].map(|v| (f64::from(v) / norm) as f32) } else { [0.0, 0.0, 0.0, 1.0] }
}

/// sRGB to linear, clamped to 0 to 1.
fn linear(encoded: f64) -> f64 {
    let v = encoded.clamp(0.0, 1.0);
    if v <= 0.040_45 { v / 12.92 } else { ((v + 0.055) / 1.055).powf(2.4) }
}
