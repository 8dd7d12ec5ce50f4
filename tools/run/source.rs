//! The scene that a verb is given: a scene file, or the folder of a run, which may not have ended.

use crate::run::appearance::Appearance;
use crate::run::files::{config_of, totals};
use crate::ui::screen::say;
use ivv::internals::formats::{self, FourDgs, FourDgsParts, PlyParts};
use ivv::internals::gpu::Gpu;
use ivv::internals::scene::{Parts, Splats};
use ivv::internals::stage::Renderer;
use ivv::internals::train::{Checkpoint, Run};
use ivv::{Constants, Error};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::SystemTime;

pub use crate::run::files::is_run;

/// Gaussians of a scene, in the capture's own frame.
pub enum Gaussians {
    Whole(Box<Splats>),
    /// In a file, which is read as views need it.
    Parts(Box<dyn Parts>),
}

impl Gaussians {
    pub fn renderer(self, gpu: Arc<Gpu>, constants: Constants) -> ivv::Result<Renderer> {
        match self {
            Gaussians::Whole(splats) => Renderer::of_clip(gpu, Arc::new(splats.by_degree()), constants),
            Gaussians::Parts(clip) => Renderer::of_parts(gpu, clip, constants),
        }
    }

    pub fn are_static(&self) -> bool {
        match self {
            Gaussians::Whole(splats) => splats.motion.is_empty(),
            Gaussians::Parts(clip) => clip.parts().iter().all(|part| part.n == 0),
        }
    }
}

/// A scene with its Gaussians `G`, and where it is from.
pub struct LoadedScene<G = Splats> {
    pub file: PathBuf,
    /// In the capture's own frame.
    pub splats: G,
    /// The step of its checkpoint, if the run has not ended.
    pub checkpoint_step: Option<u64>,
    pub notes: Vec<String>,
}

pub fn total_steps(folder: &Path) -> Option<u64> {
    Some(config_of(folder).ok()?.total(Run::read(folder).ok()?.held.training_images as u64))
}

/// The scene of the run in `folder`, if it has ended. A run that was extended has a checkpoint newer than its scene.
pub fn final_scene(folder: &Path) -> Option<PathBuf> {
    let scene = folder.join("scene.ply");
    let checkpoints = folder.join("checkpoints");
    let step = Checkpoint::newest_step(&checkpoints).ok().flatten();
    let is_newer = |step| modified(&Checkpoint::file(&checkpoints, step)) > modified(&scene);
    let scored = totals(folder)["steps"].as_u64();
    let is_before_an_end =
        |step| total_steps(folder).is_some_and(|end| step < end) || scored.is_some_and(|end| end < step);
    let is_extended = step.is_some_and(|step| is_newer(step) && is_before_an_end(step));
    (scene.is_file() && !is_extended).then_some(scene)
}

pub fn modified(file: &Path) -> Option<SystemTime> {
    file.metadata().and_then(|data| data.modified()).ok()
}

/// A scene of which all but the Gaussians was read.
pub struct Source<'a> {
    pub path: &'a Path,
    /// The file without its Gaussians, if it is a `.4dgs`.
    pub clip: Option<FourDgs>,
    pub look: Appearance,
    /// The notes on `look`, already printed.
    notes: Vec<String>,
}

impl<'a> Source<'a> {
    /// Reads how a scene is rendered, and all of a `.4dgs` but its Gaussians.
    pub fn open(path: &'a Path) -> ivv::Result<Self> {
        let clip = if FourDgs::is(path) { Some(FourDgs::open(path)?) } else { None };
        let (look, notes) = Appearance::of(path, clip.as_ref())?;
        Ok(Source { path, clip, look, notes })
    }

    /// Its Gaussians; those of a clip in parts are read as views need them.
    pub fn seen(&self) -> ivv::Result<LoadedScene<Gaussians>> {
        if let Some((file, clip)) = self.parts()? {
            return Ok(LoadedScene { file, splats: Gaussians::Parts(clip), checkpoint_step: None, notes: Vec::new() });
        }
        let LoadedScene { file, splats, checkpoint_step, notes } = self.scene()?;
        Ok(LoadedScene { file, splats: Gaussians::Whole(Box::new(splats)), checkpoint_step, notes })
    }

    /// Its file, if that is a clip in parts.
    pub fn parts(&self) -> ivv::Result<Option<(PathBuf, Box<dyn Parts>)>> {
        let file = if self.path.is_dir() { final_scene(self.path) } else { Some(self.path.to_owned()) };
        let Some(file) = file else { return Ok(None) };
        let clip: Option<Box<dyn Parts>> = match self.clip {
            Some(_) => FourDgsParts::open(&file)?.map(|clip| Box::new(clip) as _),
            None if file.is_file() => PlyParts::open(&file)?.map(|clip| Box::new(clip) as _),
            None => None,
        };
        Ok(clip.map(|clip| (file, clip)))
    }

    /// All of its Gaussians; of a run that has not ended those of the newest checkpoint, whose step a message gives.
    pub fn scene(&self) -> ivv::Result<LoadedScene> {
        let Some(clip) = &self.clip else { return self.of_path() };
        Ok(self.print(self.path, clip.splats()?, clip.notes()))
    }

    fn of_path(&self) -> ivv::Result<LoadedScene> {
        let path = self.path;
        let scene = final_scene(path);
        if scene.is_none() && is_run(path) {
            return newest_checkpoint(path);
        }
        let file = scene.as_deref().unwrap_or(path);
        if file.is_dir() && !file.join("meta.json").is_file() {
            let reason = "expected a run (run.json) or a SOG scene (meta.json), found neither";
            return Err(Error::data(path, "", reason, "give the folder of a run of `ivv train`, or a scene file"));
        }
        let scene = formats::read(file)?;
        Ok(self.print(file, scene.splats, scene.notes))
    }

    fn print(&self, file: &Path, splats: Splats, notes: Vec<String>) -> LoadedScene {
        let new = notes.iter().filter(|note| !self.notes.contains(note));
        new.for_each(|note| say!("{}: {note}", file.display()));
        LoadedScene { splats, file: file.to_owned(), checkpoint_step: None, notes }
    }
}

fn newest_checkpoint(folder: &Path) -> ivv::Result<LoadedScene> {
    let checkpoints = folder.join("checkpoints");
    let Some(checkpoint) = Checkpoint::newest(&checkpoints)? else {
        let remedy = "wait for the first checkpoint, or continue the run with `ivv train --resume -o RUN`";
        return Err(Error::data(folder, "", "the run has no scene.ply and no checkpoint yet", remedy));
    };
    let Checkpoint { step, total, .. } = checkpoint;
    say!("{}: the run has not ended; this is its newest checkpoint, of step {step} of {total}", folder.display());
    let file = Checkpoint::file(&checkpoints, step);
    Ok(LoadedScene { splats: checkpoint.splats(), file, checkpoint_step: Some(step), notes: Vec::new() })
}
