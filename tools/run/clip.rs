//! The clip of a scene: its length and start, the views to begin from, its sound, and how it is rendered.

use crate::run::appearance::Appearance;
use crate::run::files::config_of;
use crate::run::source::{Source, is_run};
use crate::ui::screen::say;
use anyhow::ensure;
use ivv::internals::formats::{Clip, Clock, FourDgs, Sounds};
use ivv::internals::scene::{View, read_views};
use ivv::internals::train::Run;
use std::path::Path;

const FPS: f64 = 30.0;

pub struct Setting {
    pub clip: Clip,
    /// When the clip begins, seconds of the capture that it was trained on; 0 if no run of a clip as long says it.
    pub start: f64,
}

/// Reads what is known of the scene of `source`, with the length and the cameras file that the user gave.
pub fn setting(source: &Source, seconds: Option<f64>, cameras: Option<&Path>) -> anyhow::Result<Setting> {
    let given = cameras.map(read_views).transpose()?;
    if is_run(source.path) {
        ensure!(seconds.is_none(), "--seconds: the run knows how long its clip is; leave it out");
        let run = Run::read(source.path)?;
        let views = given.map_or_else(|| of_training_cameras(source.path, &run), Ok)?;
        let clock = Some(Clock { fps: run.held.fps, frames: run.held.frames });
        let background = Some(views.first().map_or([0.0; 3], |view| view.background));
        let clip = Clip { clock, views, constants: source.look.constants, background, ..Clip::default() };
        return Ok(Setting { clip, start: start_of(&run) });
    }
    let file = source.clip.as_ref();
    let clock = match seconds {
        Some(seconds) => {
            ensure!(seconds.is_finite() && seconds > 0.0, "--seconds: expected a positive number, found {seconds}");
            let frames = (seconds * FPS).round().clamp(1.0, f64::from(u32::MAX));
            Some(Clock { fps: frames / seconds, frames: frames as u32 })
        }
        None => file.map(FourDgs::clock),
    };
    let views = match given {
        Some(views) => views,
        None => file.map(FourDgs::views).transpose()?.unwrap_or_default(),
    };
    let Appearance { constants, background } = source.look;
    let sounds = file.map_or_else(Sounds::default, FourDgs::sounds);
    let background = Some(background.or(views.first().map(|view| view.background)).unwrap_or_default());
    let is_as_long = |run: &Run| {
        clock.is_some_and(|clock| (clock.seconds() * run.held.fps - f64::from(run.held.frames)).abs() < 0.5)
    };
    let start = start_in_run(source.path, is_as_long);
    let (world, cutoff) = (file.and_then(FourDgs::world), file.and_then(FourDgs::cutoff));
    Ok(Setting { clip: Clip { clock, views, sounds, world, constants, background, cutoff }, start })
}

/// Refuses to show in other `seconds` what comes with `sounds` of its own, which stay as long as they are.
pub fn refuse_stretched(seconds: Option<f64>, sounds: &Sounds) -> anyhow::Result<()> {
    ensure!(
        seconds.is_none() || sounds.is_empty(),
        "--seconds: the file knows how long its clip is, and its sound cannot be stretched; leave it out, or give --sound"
    );
    Ok(())
}

/// When the clip of `run` begins, seconds of its capture: the run may have taken only some of the frames.
fn start_of(run: &Run) -> f64 {
    let frames = run.capture_settings.frames;
    f64::from(frames.from) / (run.held.fps * f64::from(frames.every))
}

/// When the clip of the scene in `file` begins, seconds of its capture, by the run that the file lies in and that `is_its`; else
/// 0.
pub fn start_in_run(file: &Path, is_its: impl Fn(&Run) -> bool) -> f64 {
    let run = file.ancestors().find_map(|folder| Run::read(folder).ok().filter(&is_its));
    run.map_or(0.0, |run| start_of(&run))
}

/// The first view of each filming training camera of the run in `folder`; none, with a message, if its capture is gone.
fn of_training_cameras(folder: &Path, run: &Run) -> anyhow::Result<Vec<View>> {
    if !run.capture.exists() {
        let gone = run.capture.display();
        say!(
            "no views to start from: the run's capture, {gone}, is not there any more; --cameras takes a cameras file"
        );
        return Ok(Vec::new());
    }
    let background = config_of(folder)?.background;
    let capture = run.open_capture(None)?.transformed(&run.world.inverse());
    let filming = capture.cameras.iter().enumerate().filter(|(_, camera)| camera.films());
    let first = filming.filter_map(|(index, camera)| Some((index, camera.shots.first()?.frame)));
    let view = |(index, frame)| Ok(View { background, ..capture.view(index, frame)? });
    first.map(view).collect()
}
