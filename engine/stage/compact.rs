//! How finely each attribute of a scene needs to be stored: what its pictures lose, rendered.

use super::{Outputs, Renderer};
use crate::error::{Error, Result};
use crate::formats::{Contents, Encoded, FourDgs, Grades};
use crate::gpu::Gpu;
use crate::scene::{Frame, Splats, View};
use crate::settings::Constants;
use std::path::Path;
use std::sync::Arc;

/// A grade is not tried when one before it alone costs so many times what may be lost.
const HOPELESS: f64 = 4.0;
/// Files that are made at most: the finest, each grade alone, and as many as halve all of them down to one.
const MOST_TRIED: usize = 1 + Grades::N * Grades::COARSEST as usize + 7;

#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Goal {
    /// As small as its pictures stay so many dB from those of the scene.
    Psnr(f64),
    /// As good as it is in so many bytes.
    Bytes(u64),
}

#[derive(Debug)]
pub struct Compact {
    pub bytes: Vec<u8>,
    pub grades: Grades,
    /// PSNR of its pictures against those of the scene, dB.
    pub psnr: f64,
    pub n_tried: usize,
}

/// The price of a grade: mean squared error of the pictures beyond that of the finest file, and bytes below that one's.
#[derive(Clone, Copy, Debug)]
struct Step {
    error: f64,
    saved: f64,
}

/// The scene that is stored; `path` is what errors name.
#[derive(Clone, Copy, Debug)]
pub struct Subject<'a> {
    pub path: &'a Path,
    pub splats: &'a Splats,
    /// The same as `splats`, to be stored.
    pub encoded: &'a Encoded,
    pub contents: &'a Contents<'a>,
    pub constants: Constants,
    pub views: &'a [View],
}

struct Judge<'a> {
    gpu: Arc<Gpu>,
    subject: Subject<'a>,
    truth: Vec<Frame>,
    n_tried: usize,
}

impl Judge<'_> {
    fn frames(&self, splats: Splats) -> Result<Vec<Frame>> {
        let mut renderer = Renderer::new(self.gpu.clone(), &splats.by_degree(), self.subject.constants)?;
        self.subject.views.iter().map(|view| Ok(renderer.render(view, Outputs::Color)?.0)).collect()
    }

    /// The file with these grades, and the mean squared error of its pictures.
    fn look(&mut self, grades: Grades) -> Result<(Vec<u8>, f64)> {
        self.n_tried += 1;
        let Subject { path, encoded, contents, .. } = self.subject;
        let bytes = encoded.bytes(path, contents, grades)?;
        let frames = self.frames(FourDgs::of_bytes(path, &bytes)?.splats()?)?;
        let pairs = self.truth.iter().zip(&frames);
        let pairs = pairs.flat_map(|(a, b)| a.color.as_flattened().iter().zip(b.color.as_flattened()));
        let (sum, n) = pairs.fold((0.0, 0usize), |(sum, n), (a, b)| (sum + f64::from(a - b).powi(2), n + 1));
        Ok((bytes, sum / n.max(1) as f64))
    }
}

/// Finds the grades with which the scene fulfils `goal`, by what its pictures lose. Each attribute is first coarsened alone; what
/// the losses allow together is then taken where it saves most bytes for its loss, and measured. `progress` receives how many
/// files have been rendered, and how many there can be. Fails where no grades fulfil the goal or there is no view.
pub fn compact(
    gpu: &Arc<Gpu>,
    subject: &Subject,
    goal: Goal,
    progress: &mut dyn FnMut(usize, usize),
) -> Result<Compact> {
    let path = subject.path;
    let mut judge = Judge { gpu: gpu.clone(), subject: *subject, truth: Vec::new(), n_tried: 0 };
    if subject.views.is_empty() {
        let remedy = "give --cameras, or the folder of a run, whose capture is there";
        return Err(Error::data(path, "", "expected views to look from, found none", remedy));
    }
    judge.truth = judge.frames(subject.splats.clone())?;
    let (finest, floor) = judge.look(Grades::default())?;
    let fault = |reason: String| Error::data(path, "", reason, "ask for less");
    if matches!(goal, Goal::Bytes(most) if finest.len() as u64 <= most) {
        return Ok(Compact { psnr: psnr_of(floor), bytes: finest, grades: Grades::default(), n_tried: judge.n_tried });
    }
    let budget = match goal {
        Goal::Psnr(db) if floor > error_of(db) => {
            return Err(fault(format!("expected {db} dB, the finest file has {:.1} dB", psnr_of(floor))));
        }
        Goal::Psnr(db) => error_of(db) - floor,
        Goal::Bytes(_) => 1.0,
    };
    let mut tables: Vec<Vec<Step>> = vec![vec![Step { error: 0.0, saved: 0.0 }]; Grades::N];
    for (attribute, table) in tables.iter_mut().enumerate() {
        for grade in 1..=Grades::COARSEST {
            let mut grades = Grades::default();
            *grades.of(attribute) = grade;
            let (bytes, error) = judge.look(grades)?;
            progress(judge.n_tried, MOST_TRIED);
            let step = Step { error: (error - floor).max(0.0), saved: finest.len() as f64 - bytes.len() as f64 };
            // Nothing of this attribute is stored, or nothing more is won.
            if step.saved <= table.last().map_or(0.0, |last| last.saved) {
                break;
            }
            table.push(step);
            if step.error > HOPELESS * budget {
                break;
            }
        }
    }
    let order = order(&tables);
    // The losses add up only about, so the last steps are taken back, or more are taken, by what is seen.
    let (mut low, mut high) = (0, order.len());
    let mut smallest = finest.len() as u64;
    let mut best = (finest, floor, Grades::default());
    while low < high {
        let middle = (low + high).div_ceil(2);
        let mut grades = Grades::default();
        order[..middle].iter().for_each(|(attribute, grade)| *grades.of(*attribute) = *grade);
        let (bytes, error) = judge.look(grades)?;
        progress(judge.n_tried, MOST_TRIED);
        smallest = smallest.min(bytes.len() as u64);
        // More steps are taken while the pictures allow it, or as long as the file is too large.
        let (fulfils, goes_on) = match goal {
            Goal::Psnr(db) => (error <= error_of(db), error <= error_of(db)),
            Goal::Bytes(most) => (bytes.len() as u64 <= most, bytes.len() as u64 > most),
        };
        if fulfils {
            best = (bytes, error, grades);
        }
        if goes_on { low = middle } else { high = middle - 1 }
    }
    let (bytes, error, grades) = best;
    if let Goal::Bytes(most) = goal
        && bytes.len() as u64 > most
    {
        return Err(fault(format!("expected at most {most} bytes, the smallest file that was found has {smallest}")));
    }
    Ok(Compact { psnr: psnr_of(error), bytes, grades, n_tried: judge.n_tried })
}

/// Attributes and grades in the order in which they are taken: whatever saves most bytes for its loss comes next.
fn order(tables: &[Vec<Step>]) -> Vec<(usize, u8)> {
    let mut at = vec![0; tables.len()];
    let mut order = Vec::new();
    loop {
        // Of an attribute the best next grade may be some grades away.
        let next = tables.iter().enumerate().flat_map(|(attribute, table)| {
            let now = table[at[attribute]];
            table.iter().enumerate().skip(at[attribute] + 1).map(move |(grade, step)| {
                let worth = (step.saved - now.saved) / (step.error - now.error).max(1e-12);
                (worth, attribute, grade)
            })
        });
        let Some((_, attribute, grade)) = next.max_by(|a, b| a.0.total_cmp(&b.0)) else { return order };
        at[attribute] = grade;
        order.push((attribute, grade as u8));
    }
}

fn error_of(db: f64) -> f64 {
    10f64.powf(-db / 10.0)
}

fn psnr_of(error: f64) -> f64 {
    -10.0 * error.max(1e-12).log10()
}
