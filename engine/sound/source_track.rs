//! Where a source of sound is over time, and the CSV file of it.

use std::path::Path;

use glam::DVec3;

use crate::error::{Error, Result};
use crate::files::{cannot_read, read_text, write_atomic};

const HEADER: &str = "t,x,y,z,cxx,cxy,cxz,cyy,cyz,czz,views,reproj_px,flag";
const REMEDY: &str = "write the columns that `ivv sound localize` writes";

#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Flag {
    /// By the mouth, in two views or more.
    Seen,
    /// By nothing at this time: the smoothed way across a short gap.
    Filled,
    /// By nothing at this time: the straight line across a longer gap, or the end that is nearest.
    Held,
    /// Not at all: the gap is too long, and the source is taken to be silent.
    Inactive,
    /// By the nose alone.
    Approx,
}

impl Flag {
    const ALL: [(Flag, &str); 5] = [
        (Flag::Seen, "seen"),
        (Flag::Filled, "filled"),
        (Flag::Held, "held"),
        (Flag::Inactive, "inactive"),
        (Flag::Approx, "approx"),
    ];

    pub fn name(self) -> &'static str {
        Flag::ALL.iter().find(|(flag, _)| *flag == self).map_or("", |(_, name)| name)
    }
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SourceSample {
    /// Seconds of the clip.
    pub t: f64,
    /// World, scene units.
    pub p: DVec3,
    /// xx, xy, xz, yy, yz, zz of the covariance of `p`, squared scene units.
    pub cov: [f64; 6],
    /// Cameras that agree on it.
    pub views: u16,
    /// Root mean square of what they disagree by, pixels.
    pub reproj_px: f32,
    pub flag: Flag,
}

#[derive(Clone, Debug, PartialEq)]
pub struct SourceTrack {
    /// Names the source and its file.
    pub id: String,
    /// In order of time; at least one.
    pub samples: Vec<SourceSample>,
    pub fps: f64,
}

impl SourceTrack {
    /// Where the source is at `t` seconds, by the cubic through the samples with central differences as slopes; the ends are held. `None`
    /// beside a sample that is [`Flag::Inactive`].
    pub fn at(&self, t: f64) -> Option<DVec3> {
        let last = self.samples.len().checked_sub(1)?;
        let next = self.samples.partition_point(|sample| sample.t <= t);
        let (i, j) = (next.saturating_sub(1), next.min(last));
        let (a, b) = (&self.samples[i], &self.samples[j]);
        if a.flag == Flag::Inactive || b.flag == Flag::Inactive {
            return None;
        }
        if i == j || b.t <= a.t {
            return Some(a.p);
        }
        let slope = |k: usize| {
            let (from, to) = (k.saturating_sub(1), (k + 1).min(last));
            // What is inactive says nothing of how the others move.
            let [from, to] = [from, to].map(|n| if self.samples[n].flag == Flag::Inactive { k } else { n });
            let (from, to) = (&self.samples[from], &self.samples[to]);
            if to.t > from.t { (to.p - from.p) / (to.t - from.t) } else { DVec3::ZERO }
        };
        let h = b.t - a.t;
        let u = (t - a.t) / h;
        let (u2, u3) = (u * u, u * u * u);
        let ends = (2.0 * u3 - 3.0 * u2 + 1.0) * a.p + (3.0 * u2 - 2.0 * u3) * b.p;
        Some(ends + h * ((u3 - 2.0 * u2 + u) * slope(i) + (u3 - u2) * slope(j)))
    }

    /// Reads a CSV file of these columns; the file's name without ending is the id, the rate is that of the times.
    pub fn read_csv(path: &Path) -> Result<SourceTrack> {
        let text = read_text(path).map_err(|fault| cannot_read(path, &fault))?;
        let mut lines = text.lines().enumerate();
        let header = lines.next().map_or("", |(_, line)| line.trim());
        if header != HEADER {
            return Err(Error::data(path, "line 1", format!("has other columns than {HEADER}"), REMEDY));
        }
        let mut samples: Vec<SourceSample> = Vec::new();
        for (number, line) in lines.filter(|(_, line)| !line.trim().is_empty()) {
            let fault = |reason: String| Error::data(path, format!("line {}", number + 1), reason, REMEDY);
            let sample = sample(line).map_err(fault)?;
            if samples.last().is_some_and(|last| last.t >= sample.t) {
                return Err(fault(format!("is of {} s, not later than the line before", sample.t)));
            }
            samples.push(sample);
        }
        let fps = match samples.as_slice() {
            [] => return Err(Error::data(path, "", "holds no sample", REMEDY)),
            [_] => 1.0,
            [first, .., last] => (samples.len() - 1) as f64 / (last.t - first.t),
        };
        let id = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        Ok(SourceTrack { id, samples, fps })
    }

    /// Writes the file that [`SourceTrack::read_csv`] reads back as equal samples.
    pub fn write_csv(&self, path: &Path) -> Result<()> {
        let mut text = format!("{HEADER}\n");
        for SourceSample { t, p, cov, views, reproj_px, flag } in &self.samples {
            let numbers: Vec<String> = [*t, p.x, p.y, p.z].iter().chain(cov).map(|number| number.to_string()).collect();
            text += &format!("{},{views},{reproj_px},{}\n", numbers.join(","), flag.name());
        }
        write_atomic(path, |to| to.write_all(text.as_bytes()))
    }
}

fn sample(line: &str) -> std::result::Result<SourceSample, String> {
    let cells: Vec<&str> = line.split(',').map(str::trim).collect();
    let &[ref numbers @ .., views, reproj_px, flag] = cells.as_slice() else {
        return Err(format!("has {} columns, not 13", cells.len()));
    };
    let number = |cell: &str| cell.parse::<f64>().ok().filter(|number| number.is_finite());
    let parsed: Vec<f64> = numbers
        .iter()
        .map(|cell| number(cell).ok_or_else(|| format!("has `{}`, no finite number", cell.escape_debug())))
        .collect::<std::result::Result<_, _>>()?;
    let &[t, x, y, z, ref cov @ ..] = parsed.as_slice() else {
        return Err(format!("has {} columns, not 13", cells.len()));
    };
    let cov = <[f64; 6]>::try_from(cov).map_err(|_| format!("has {} columns, not 13", cells.len()))?;
    let found = Flag::ALL.iter().find(|(_, name)| *name == flag);
    Ok(SourceSample {
        t,
        p: DVec3::new(x, y, z),
        cov,
        views: views.parse().map_err(|_| format!("has `{}` views", views.escape_debug()))?,
        reproj_px: number(reproj_px).ok_or_else(|| format!("has `{}` pixels", reproj_px.escape_debug()))? as f32,
        flag: found.ok_or_else(|| format!("has the unknown flag `{}`", flag.escape_debug()))?.0,
    })
}
