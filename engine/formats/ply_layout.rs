//! The columns of a PLY that make a Gaussian.

use super::convert::logit_of_byte;
use super::ply_known::{compensation, judge, stem};
use super::ply_time::Temporal;
use super::scene::cut_harmonics;
use crate::error::{Error, Result};
use crate::files::ply_header::{Element, Header, Scalar};
use crate::files::ply_rows::Column;
use crate::scene::{Splats, dc_of_color};
use std::path::Path;

/// The highest degree that is kept, and the highest that a file may have.
const DEGREE: usize = 3;
const MOST_DEGREE: usize = 8;
/// Thickness of the discs of 2DGS, as a part of their smaller radius: too thin to see, and every format can store it.
const FLAT: f64 = 1e-3;

pub(super) struct Layout {
    pub(super) sh_degree: u32,
    pub(super) notes: Vec<String>,
    position: [Column; 3],
    dc: [Column; 3],
    /// The factor of `dc` where they are colours from 0 to 1 instead of coefficients.
    color_unit: Option<f64>,
    /// Channel-major: `rest[channel * (K - 1) + coefficient - 1]`.
    rest: Vec<Column>,
    /// Coefficients of degrees above [`DEGREE`].
    beyond: Vec<Column>,
    opacity: Column,
    scale: [Column; 2],
    /// Absent in 2DGS, whose discs are flat.
    third_scale: Option<Column>,
    rotation: [Column; 4],
    /// Standard deviation of mip-splatting's low-pass filter.
    filter: Option<Column>,
    temporal: Option<Temporal>,
}

impl Layout {
    pub(super) fn new(path: &Path, header: &Header, vertex: &Element) -> Result<Self> {
        let place = |name: &str| format!("element `vertex`, property `{name}`");
        if let Some(list) = vertex.properties.iter().find(|p| p.list_length.is_some()) {
            let remedy = "export it with plain properties only";
            return Err(Error::data(path, place(&list.name), "is a list", remedy));
        }
        let column = |name: &str| {
            let remedy = "give a Gaussian splatting scene, not a point cloud or a mesh";
            Column::find(vertex, name).ok_or_else(|| Error::data(path, place(name), "is missing", remedy))
        };
        let has = |name: &str| Column::find(vertex, name).is_some();
        let temporal = Temporal::find(path, header, vertex)?;
        let is_read = |name: &str| {
            READ.contains(&name) || stem(name) == "f_rest" || temporal.as_ref().is_some_and(|t| t.reads(name))
        };
        let mut notes = Vec::new();
        // For a mesh or a point cloud, the fault is what it lacks.
        if ["opacity", "scale_0", "rot_0", "f_dc_0"].into_iter().any(has) {
            notes = judge(path, header, vertex, &["vertex"], is_read)?;
        }
        let (rest, beyond) = rest(path, vertex)?;
        let sh_degree = (rest.len() / 3 + 1).isqrt() as u32 - 1;
        let bytes = |name: &str| Column::find(vertex, name).filter(|column| column.is(Scalar::U8));
        let (dc, color_unit) = match ["red", "green", "blue"].map(bytes) {
            [Some(r), Some(g), Some(b)] if !has("f_dc_0") && has("rot_0") => {
                notes.push("its colours are `red`, `green` and `blue`, without harmonics".to_owned());
                ([r, g, b], Some(1.0 / 255.0))
            }
            _ => {
                let is_plain = temporal.as_ref().is_some_and(Temporal::has_plain_colors);
                ([column("f_dc_0")?, column("f_dc_1")?, column("f_dc_2")?], is_plain.then_some(1.0))
            }
        };
        let is_flat = !has("scale_2") && ["scale_0", "scale_1", "rot_3", "opacity"].into_iter().all(has);
        if is_flat {
            notes.push(format!(
                "its Gaussians are the flat discs of 2DGS (no `scale_2`): they are read with {FLAT} of their smaller radius as \
                 thickness, and blurred as others are"
            ));
        }
        notes.extend(compensation(header));
        Ok(Layout {
            sh_degree,
            notes,
            position: [column("x")?, column("y")?, column("z")?],
            dc,
            color_unit,
            rest,
            beyond,
            opacity: column("opacity")?,
            scale: [column("scale_0")?, column("scale_1")?],
            third_scale: if is_flat { None } else { Some(column("scale_2")?) },
            rotation: [column("rot_0")?, column("rot_1")?, column("rot_2")?, column("rot_3")?],
            filter: Column::find(vertex, FILTER),
            temporal,
        })
    }

    pub(super) fn is_cut(&self, bytes: &[u8]) -> bool {
        self.beyond.iter().any(|column| column.f32(bytes) != 0.0)
    }

    pub(super) fn notes_of_rows(&self, n_cut: usize, n: usize) -> Vec<String> {
        let mut notes = Vec::new();
        if n_cut > 0 {
            let degree = ((self.rest.len() + self.beyond.len()) / 3 + 1).isqrt() - 1;
            notes.push(cut_harmonics(degree as u32, n_cut, n));
        }
        if self.filter.is_some() && n > 0 {
            notes.push(format!(
                "the 3D filter of mip-splatting (`{FILTER}`) is worked into scales and opacities of {n} Gaussians; its 2D filter, \
                 for which it was trained, is not in ivv"
            ));
        }
        notes
    }

    /// Appends the Gaussian of a row; an error says why it cannot be held.
    pub(super) fn push(
        &self,
        row: u32,
        bytes: &[u8],
        still: &mut Splats,
        moving: &mut Splats,
    ) -> std::result::Result<(), &'static str> {
        let motion = self.temporal.as_ref().map_or(Ok(None), |temporal| temporal.motion(bytes))?;
        let to = if motion.is_some() { moving } else { still };
        let span = self.temporal.as_ref().and_then(|temporal| temporal.span(bytes));
        to.span.extend(span.filter(|_| motion.is_some()));
        to.motion.extend(motion);
        to.source_row.push(row);
        to.position.push(self.position.map(|c| c.f32(bytes)));
        to.rotation.push(self.rotation.map(|c| c.f32(bytes)));
        let (scale, opacity) = self.size(bytes);
        to.scale.push(scale);
        to.opacity.push(opacity);
        let color = self.dc.map(|c| c.f32(bytes));
        to.sh.push(self.color_unit.map_or(color, |unit| color.map(|c| dc_of_color(f64::from(c) * unit))));
        let per_channel = self.rest.len() / 3;
        for k in 0..per_channel {
            to.sh.push(std::array::from_fn(|channel| self.rest[channel * per_channel + k].f32(bytes)));
        }
        Ok(())
    }

    /// Log-scales and logit of the opacity.
    fn size(&self, bytes: &[u8]) -> ([f32; 3], f32) {
        let [a, b] = self.scale.map(|c| c.f32(bytes));
        let third = self.third_scale.map_or_else(|| (f64::from(a.min(b)) + FLAT.ln()) as f32, |c| c.f32(bytes));
        let (scale, opacity) = ([a, b, third], within(self.opacity.f32(bytes)));
        let Some(filter) = self.filter.map(|c| c.f64(bytes)) else { return (scale, opacity) };
        let filtered = scale.map(|s| 0.5 * ((2.0 * f64::from(s)).exp() + filter * filter).ln());
        // The opacity that a Gaussian loses as it grows.
        let lost: f64 = scale.iter().zip(filtered).map(|(s, filtered)| f64::from(*s) - filtered).sum();
        let left = lost.exp() / (1.0 + (-f64::from(opacity)).exp());
        (filtered.map(|s| s as f32), within((left / (1.0 - left)).ln() as f32))
    }
}

const FILTER: &str = "filter_3D";
/// The properties that are read, beside harmonics and time.
const READ: [&str; 15] = [
    "x", "y", "z", "f_dc_0", "f_dc_1", "f_dc_2", "opacity", "scale_0", "scale_1", "scale_2", "rot_0", "rot_1", "rot_2",
    "rot_3", FILTER,
];

/// The harmonics that are kept, and those of higher degrees, channel-major.
fn rest(path: &Path, vertex: &Element) -> Result<(Vec<Column>, Vec<Column>)> {
    let n = vertex.properties.iter().filter(|p| p.name.starts_with("f_rest_")).count();
    let fits = |degree: &usize| 3 * ((degree + 1).pow(2) - 1) == n;
    let Some(degree) = (0..=MOST_DEGREE).find(fits) else {
        let place = "element `vertex`, property `f_rest_*`";
        let reason = format!("{n} properties; degrees 0 to 4 have 0, 9, 24, 45 or 72");
        return Err(Error::data(path, place, reason, "export the scene with degree 3 or less"));
    };
    let column = |i: usize| {
        let name = format!("f_rest_{i}");
        let place = format!("element `vertex`, property `{name}`");
        let missing = || Error::data(path, place, "is missing", "export the scene again, with all harmonics");
        Column::find(vertex, &name).ok_or_else(missing)
    };
    let all: Vec<Column> = (0..n).map(column).collect::<Result<_>>()?;
    let kept = (degree.min(DEGREE) + 1).pow(2) - 1;
    let channels = || all.chunks_exact((n / 3).max(1));
    Ok((channels().flat_map(|c| &c[..kept]).copied().collect(), channels().flat_map(|c| &c[kept..]).copied().collect()))
}

/// A finite logit: programs that convert bytes write infinite ones.
fn within(logit: f32) -> f32 {
    if logit.is_infinite() { logit_of_byte(if logit > 0.0 { 255 } else { 0 }) } else { logit }
}
