//! A run on top of another: it takes over the static Gaussians and the learnt cameras of the other.

use super::session::work;
use super::{
    Average, CameraState, Checkpoint, Config, Correction, DueEvents, Notice, Phase, PoseKind, Required, Run,
    StepCapacity, Strategy, Watch, initialise,
};
use crate::error::{Error, Result};
use crate::scene::Splats;
use crate::scene::capture::{Calibration, Capture, Frames};
use crate::stage::PoseRows;
use glam::DVec3;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// A dynamic Gaussian is taken over if it reaches this temporal factor at a frame of the clip.
const VISIBLE: f64 = 0.1;

/// An ended run that others build on: they train dynamic Gaussians on its static ones and its cameras.
pub struct Base {
    folder: PathBuf,
    run: Run,
    config: Config,
    /// In the capture's own world; times are those of the run.
    splats: Splats,
    cameras: CameraState,
}

impl Base {
    /// Reads the run in `folder`, which must have ended.
    pub fn read(folder: &Path) -> Result<Self> {
        let run = Run::read(folder)?;
        let fault = |reason: &str| Err(Error::data(folder, "--base", reason, "train it to its end first"));
        let Some(checkpoint) = Checkpoint::newest(&folder.join("checkpoints"))? else {
            return fault("holds no checkpoint");
        };
        if checkpoint.step < checkpoint.total {
            return fault("is a run that has not ended");
        }
        Ok(Base {
            folder: folder.to_owned(),
            splats: checkpoint.splats(),
            run,
            config: checkpoint.config,
            cameras: checkpoint.cameras,
        })
    }

    /// `config`, without learning anew what is taken over.
    pub fn config(&self, config: Config) -> Config {
        Config {
            holds_static: true,
            offsets: false,
            poses: PoseKind::Given,
            sh_degree: self.config.sh_degree,
            grids: self.config.grids,
            // Reviews concern all Gaussians.
            required: Required { reviews: 0, grids_at: 0.0 },
            ..config
        }
    }

    /// A warning if hardly any of its Gaussians are static: a run on top of it then takes over and trains nearly all.
    pub fn moves(&self) -> Option<String> {
        let (n, n_static) = (self.splats.len(), self.splats.n_static);
        (self.run.held.frames > 1 && 10 * n_static < n).then(|| {
            format!(
                "{}: {n_static} of {n} Gaussians are static; expected most of them: a run on top of this one trains the others \
                 anew. Give foreground masks, or train it with --set required.reviews=2",
                self.folder.display()
            )
        })
    }

    /// `capture`, in its own world, with the cameras that the run learnt; refused if it has other cameras.
    pub fn calibrated(&self, capture: Capture) -> Result<Capture> {
        let tests: Vec<&String> = capture.cameras.iter().filter(|c| c.is_test).map(|c| &c.name).collect();
        if capture.cameras.len() != self.run.held.cameras || !tests.iter().copied().eq(&self.run.test_cameras) {
            let reason = format!(
                "is of {} cameras without those for testing ({}), the capture has {} ({})",
                self.run.held.cameras,
                self.run.test_cameras.join(", "),
                capture.cameras.len(),
                tests.iter().map(|name| name.as_str()).collect::<Vec<_>>().join(", ")
            );
            return Err(Error::data(&self.folder, "--base", reason, "give a run on the same cameras"));
        }
        let seconds = 1.0 / self.run.held.fps;
        let of = |index: usize| {
            let offset = self.cameras.clocks.get(index).map_or(0.0, |clock| f64::from(clock[0]) * seconds);
            // The last row is that of all cameras.
            let rows: &[PoseRows] = self.cameras.poses.split_last().map_or(&[], |(_, rows)| rows);
            let learnt = rows.get(index).map(|rows| Correction::of(rows).in_capture(&self.run.world));
            let Correction { turn, shift } = learnt.unwrap_or(Correction { turn: DVec3::ZERO, shift: DVec3::ZERO });
            // Turns are of a fraction of a degree, so their order does not matter.
            let before = self.run.calibration.get(&capture.cameras[index].name).copied().unwrap_or_default();
            let sum = |learnt: DVec3, before: [f64; 3]| (learnt + DVec3::from(before)).to_array();
            Calibration {
                offset: before.offset + offset,
                turn: sum(turn, before.turn),
                shift: sum(shift, before.shift),
            }
        };
        let cameras = capture.cameras.iter().enumerate().filter(|(_, camera)| !camera.is_test);
        let learnt = cameras.map(|(index, camera)| (camera.name.clone(), of(index)));
        let learnt: BTreeMap<_, _> = learnt.filter(|(_, known)| *known != Calibration::default()).collect();
        Ok(capture.calibrated(&learnt))
    }

    /// The beginning of `run`, of `total` steps on `capture`, which is in its own world: the static Gaussians of this
    /// run, its dynamic ones that live in the capture's part of the clip, and new dynamic ones.
    pub fn begin(
        &self,
        capture: &Capture,
        run: &Run,
        config: Config,
        total: u64,
        watch: &mut Watch,
    ) -> Result<Checkpoint> {
        let trained = run.in_training(capture.clone());
        let made = initialise(&trained, &config, &mut work(watch, Phase::Initialisation))?;
        watch(Notice::Initialised(&made));
        let part = capture.settings().frames;
        let mut params = run.world.splats(&self.living(&part, capture.n_frames));
        params.degree.clear();
        params.append(made.splats);
        params.source_row = (0..params.len() as u32).collect();
        let zeros = params.zeros();
        Ok(Checkpoint {
            step: 0,
            total,
            config,
            world: run.world,
            origin: [0.0; 3],
            first: zeros.clone(),
            second: zeros,
            state: vec![[0.0; 4]; params.len()],
            params,
            cameras: CameraState { clocks: vec![], learns_offset: vec![], poses: vec![], ..self.cameras.clone() },
            due: DueEvents::default(),
            room: StepCapacity::default(),
            average: Average::default(),
        })
    }

    /// The static Gaussians, and the dynamic ones that are visible at one of the `n` frames of `part`, on its clock.
    fn living(&self, part: &Frames, n: u32) -> Splats {
        let own = self.run.capture_settings.frames;
        let span = |frames: &Frames, n: u32| f64::from(n) * f64::from(frames.every);
        let scale = span(&own, self.run.held.frames) / span(part, n);
        let shift = (f64::from(own.from) - f64::from(part.from)) / span(part, n);
        let on_clock = self.splats.clone().on_clock(scale, shift);
        let lives = |i: usize| (0..n).any(|frame| on_clock.weight_at(i, f64::from(frame) / f64::from(n)) >= VISIBLE);
        on_clock.kept(|i| i < on_clock.n_static || lives(i)).into_owned()
    }
}

impl Config {
    /// Refuses what would change static Gaussians that stay as they began.
    ///
    /// # Errors
    /// [`Error::Data`] naming the setting.
    pub fn check_held(&self) -> Result<()> {
        let (draws, reviews) = (self.density.strategy == Strategy::Mcmc, self.required.reviews > 0);
        let changed = match (self.holds_static, draws, reviews) {
            (true, true, _) => "density.strategy=mcmc, which would change those that it copies",
            (true, _, true) => "required.reviews, which would reduce them",
            _ => return Ok(()),
        };
        let reason = format!("leaves static Gaussians as they are, and was given with {changed}");
        Err(Error::data(Path::new("settings"), "a run on top of another (--base)", reason, "leave one of the two out"))
    }
}
