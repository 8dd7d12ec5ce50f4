//! What a verb is given to look at: a scene file, the folder of a run, or that of a run that has not ended.

use crate::files::read_json;
use crate::look::Look;
use crate::screen::say;
use ivv::formats::{self, FourDgs, FourDgsParts, PlyParts};
use ivv::gpu::Gpu;
use ivv::scene::{Parts, Splats};
use ivv::stage::Renderer;
use ivv::train::{Checkpoint, Config, Run};
use ivv::{Constants, Error};
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::SystemTime;

/// Gaussians that are looked at, in the capture's own frame.
pub enum Gaussians {
    /// In memory.
    Whole(Box<Splats>),
    /// In a file, of which what is seen is read.
    Parts(Box<dyn Parts>),
}

impl Gaussians {
    /// A renderer of them.
    ///
    /// # Errors
    /// As [`Renderer::of_parts`].
    pub fn renderer(self, gpu: Arc<Gpu>, constants: Constants) -> ivv::Result<Renderer> {
        match self {
            Gaussians::Whole(splats) => Renderer::of_clip(gpu, Arc::new(splats.by_degree()), constants),
            Gaussians::Parts(clip) => Renderer::of_parts(gpu, clip, constants),
        }
    }

    /// Some of them, enough to tell where the scene is: all, those that rest, or, where those are few, such as a backdrop alone, those of
    /// the first part.
    ///
    /// # Errors
    /// Those of the file.
    #[cfg(feature = "play")]
    pub fn some(&mut self) -> ivv::Result<std::borrow::Cow<'_, Splats>> {
        use std::borrow::Cow;
        match self {
            Gaussians::Whole(splats) => Ok(Cow::Borrowed(splats)),
            Gaussians::Parts(clip) => match clip.still()? {
                still if clip.parts().first().is_some_and(|part| part.n > still.len()) => clip.part(0).map(Cow::Owned),
                still => Ok(Cow::Owned(still)),
            },
        }
    }

    /// Whether all of them are static.
    pub fn are_static(&self) -> bool {
        match self {
            Gaussians::Whole(splats) => splats.motion.is_empty(),
            Gaussians::Parts(clip) => clip.parts().iter().all(|part| part.n == 0),
        }
    }
}

/// A scene and where it is from, with its Gaussians `G`.
pub struct Shown<G = Splats> {
    /// The file that was read.
    pub file: PathBuf,
    /// In the capture's own frame.
    pub splats: G,
    /// The step that it is of, where the run has not ended.
    pub unfinished: Option<u64>,
    /// The notes of the reader, already printed.
    pub notes: Vec<String>,
}

impl From<Shown> for Shown<Gaussians> {
    fn from(Shown { file, splats, unfinished, notes }: Shown) -> Self {
        Shown { file, splats: Gaussians::Whole(Box::new(splats)), unfinished, notes }
    }
}

/// Whether `path` is the folder of a run.
pub fn is_run(path: &Path) -> bool {
    Run::file(path).is_file()
}

/// Steps of the run in `folder`.
pub fn total(folder: &Path) -> Option<u64> {
    let config: Option<Config> = read_json(&folder.join("config.json"), "").ok();
    let run = Run::read(folder).ok();
    config.zip(run).map(|(config, run)| config.total(run.held.training_images as u64))
}

/// The scene of the run in `folder`, where it has ended: a run that goes on after its end has a checkpoint that is newer than the scene,
/// of a step before its new end, or of that end itself while its scene is still to be made.
pub fn scene_of_end(folder: &Path) -> Option<PathBuf> {
    let scene = folder.join("scene.ply");
    let checkpoints = folder.join("checkpoints");
    let step = Checkpoint::newest_step(&checkpoints).ok().flatten();
    let is_newer = |step| changed(&Checkpoint::file(&checkpoints, step)) > changed(&scene);
    let totals: Option<Value> = read_json(&folder.join("train.json"), "").ok();
    let scored = totals.and_then(|totals| totals["steps"].as_u64());
    let is_before_an_end = |step| total(folder).is_some_and(|end| step < end) || scored.is_some_and(|end| end < step);
    let goes_on = step.is_some_and(|step| is_newer(step) && is_before_an_end(step));
    (scene.is_file() && !goes_on).then_some(scene)
}

/// When `file` was written.
pub fn changed(file: &Path) -> Option<SystemTime> {
    file.metadata().and_then(|data| data.modified()).ok()
}

/// What a verb is given, before the Gaussians of it are asked for.
pub struct Source<'a> {
    /// A scene file, or the folder of a run.
    pub path: &'a Path,
    /// Where it is a `.4dgs`: what is in it beside Gaussians is asked for first.
    pub clip: Option<FourDgs>,
    /// How it is rendered.
    pub look: Look,
    /// The notes on `look`, already printed.
    told: Vec<String>,
}

impl<'a> Source<'a> {
    /// Reads how a scene is rendered, and all of a `.4dgs` but its Gaussians.
    ///
    /// # Errors
    /// Those of the file, or of the run that it is of.
    pub fn open(path: &'a Path) -> ivv::Result<Self> {
        let clip = if FourDgs::is(path) { Some(FourDgs::open(path)?) } else { None };
        let (look, told) = Look::of(path, clip.as_ref())?;
        Ok(Source { path, clip, look, told })
    }

    /// Its Gaussians, of which only those are read that are seen where the file is a clip in parts.
    ///
    /// # Errors
    /// As [`open`].
    pub fn seen(&self) -> ivv::Result<Shown<Gaussians>> {
        if let Some((file, clip)) = self.parts()? {
            return Ok(Shown { file, splats: Gaussians::Parts(clip), unfinished: None, notes: Vec::new() });
        }
        self.scene().map(Into::into)
    }

    /// Its file, where that is a clip in parts.
    ///
    /// # Errors
    /// As [`open`].
    pub fn parts(&self) -> ivv::Result<Option<(PathBuf, Box<dyn Parts>)>> {
        let file = if self.path.is_dir() { scene_of_end(self.path) } else { Some(self.path.to_owned()) };
        let Some(file) = file else { return Ok(None) };
        let clip: Option<Box<dyn Parts>> = match self.clip {
            Some(_) => FourDgsParts::open(&file)?.map(|clip| Box::new(clip) as Box<dyn Parts>),
            None if file.is_file() => PlyParts::open(&file)?.map(|clip| Box::new(clip) as Box<dyn Parts>),
            None => None,
        };
        Ok(clip.map(|clip| (file, clip)))
    }

    /// Its Gaussians, as [`open`].
    ///
    /// # Errors
    /// As [`open`].
    pub fn scene(&self) -> ivv::Result<Shown> {
        let Some(clip) = &self.clip else { return self.of_path() };
        Ok(self.print(self.path, clip.splats()?, clip.notes()))
    }

    /// The scene of anything but a `.4dgs`.
    fn of_path(&self) -> ivv::Result<Shown> {
        let path = self.path;
        let read = |file: &Path| -> ivv::Result<Shown> {
            let scene = formats::read(file)?;
            Ok(self.print(file, scene.splats, scene.notes))
        };
        if let Some(scene) = scene_of_end(path) {
            return read(&scene);
        }
        if is_run(path) {
            return newest(path);
        }
        if path.is_dir() && !path.join("meta.json").is_file() {
            let reason = "expected a run (run.json) or a SOG scene (meta.json), found neither";
            return Err(Error::data(path, "", reason, "give the folder of a run of `ivv train`, or a scene file"));
        }
        read(path)
    }

    /// Prints the notes of the reader that are not printed yet.
    fn print(&self, file: &Path, splats: Splats, notes: Vec<String>) -> Shown {
        let new = notes.iter().filter(|note| !self.told.contains(note));
        new.for_each(|note| say!("{}: {note}", file.display()));
        Shown { splats, file: file.to_owned(), unfinished: None, notes }
    }
}

/// Reads the scene of `path`; of a run without scene.ply, or one that goes on after its end, its newest checkpoint, and says of which
/// step that is.
///
/// # Errors
/// Those of the files; [`Error::Data`] when a folder is neither a run's nor a scene, or a run has no checkpoint either.
pub fn open(path: &Path) -> ivv::Result<Shown> {
    Source::open(path)?.scene()
}

/// The newest checkpoint of the run in `folder`.
fn newest(folder: &Path) -> ivv::Result<Shown> {
    let checkpoints = folder.join("checkpoints");
    let Some(checkpoint) = Checkpoint::newest(&checkpoints)? else {
        let remedy = "wait for the first checkpoint, or continue the run with `ivv train --resume -o RUN`";
        return Err(Error::data(folder, "", "the run has no scene.ply and no checkpoint yet", remedy));
    };
    let Checkpoint { step, total, .. } = checkpoint;
    say!("{}: the run has not ended; this is its newest checkpoint, of step {step} of {total}", folder.display());
    let file = Checkpoint::file(&checkpoints, step);
    Ok(Shown { splats: checkpoint.splats(), file, unfinished: Some(step), notes: Vec::new() })
}
