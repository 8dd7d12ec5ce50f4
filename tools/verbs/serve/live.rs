//! A run that is watched while it trains: what it says, its report so far, its scene as of a checkpoint.

use super::held::Scene;
use crate::export_clip::ClipArgs;
use crate::shown::{Source, changed, scene_of_end, total};
use bytes::Bytes;
use hyper::body::{Body, Frame};
use ivv::files::read_file;
use ivv::formats::read_scene;
use ivv::train::{Checkpoint, Kind, Log};
use serde_json::{Value, json};
use std::cell::{Cell, RefCell};
use std::convert::Infallible;
use std::path::{Path, PathBuf};
use std::pin::Pin;
use std::rc::Rc;
use std::sync::{Arc, Mutex, PoisonError};
use std::task::{Context, Poll, ready};
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

/// How often the run is looked at while someone watches, and after how many looks without news a line is sent that only finds out
/// whether anyone still does.
const LOOK: Duration = Duration::from_millis(500);
const QUIET: u32 = 20;
/// Scenes that are kept: that which is shown, and that which comes next.
const KEPT: usize = 2;
/// Part of the time in which scenes may be made for whoever watches: the training has the rest.
const SHARE: f64 = 0.02;
/// What the name of the scene of a run that has ended begins with; the time follows, since a run may go on and end again. Those before
/// are named by their step.
const END: &str = "end-";

/// The last line that a training in this process said of itself.
pub type Said = Arc<Mutex<Value>>;

/// A run.
pub struct Live {
    folder: PathBuf,
    said: Option<Said>,
    clip: Arc<ClipArgs>,
    scenes: tokio::sync::Mutex<Vec<(String, Scene)>>,
    /// The last line of the log, and when it was read.
    line: RefCell<(Option<SystemTime>, Value)>,
    /// The steps of the run, and when its settings were written.
    total: Cell<(Option<SystemTime>, Option<u64>)>,
    begun: Instant,
    /// Seconds in which scenes were made.
    spent: Cell<f64>,
    /// The scene that pages are told of.
    told: RefCell<Option<String>>,
}

impl Live {
    /// The run in `folder`, which need not be there yet; `said` is what its training says, where that is in this process.
    pub fn new(folder: &Path, said: Option<Said>, clip: &ClipArgs) -> Self {
        let clip = Arc::new(clip.unasked());
        let (scenes, line) = (tokio::sync::Mutex::default(), RefCell::default());
        Live {
            folder: folder.to_owned(),
            said,
            clip,
            scenes,
            line,
            total: Cell::default(),
            begun: Instant::now(),
            spent: Cell::new(0.0),
            told: RefCell::default(),
        }
    }

    /// What a page receives: step, total, seconds, loss, psnr, gaussians; the newest scene's name and the report's time, null
    /// where there is none.
    fn state(&self) -> Value {
        let line = match &self.said {
            Some(said) => said.lock().unwrap_or_else(PoisonError::into_inner).clone(),
            None => self.last_line(),
        };
        let name = std::path::absolute(&self.folder).ok();
        let name = name.as_deref().and_then(Path::file_name).map(|name| name.to_string_lossy().into_owned());
        let report = changed(&self.folder.join("report.html")).map(millis);
        let scene = self.scene_to_tell();
        let step = line["step"].as_u64().unwrap_or(0);
        json!({
            "name": name, "step": step, "total": self.total().unwrap_or(step), "seconds": line["seconds"],
            "loss": line["loss"], "psnr": line["psnr"], "gaussians": line["gaussians"],
            "ended": scene_of_end(&self.folder).is_some(), "scene": scene, "report": report,
        })
    }

    /// The last step that the log on the disk tells of: that of the newest checkpoint.
    fn last_line(&self) -> Value {
        let mut line = self.line.borrow_mut();
        let at = changed(&self.folder.join("train.jsonl"));
        if at != line.0 {
            let log = Log::open(&self.folder, u64::MAX);
            *line = (at, log.lines(Kind::Step).last().cloned().unwrap_or_default());
        }
        line.1.clone()
    }

    /// Steps of the run, which it may be given anew.
    fn total(&self) -> Option<u64> {
        let at = changed(&self.folder.join("config.json"));
        let (known_at, known) = self.total.get();
        if known.is_none() || known_at != at {
            self.total.set((at, total(&self.folder)));
        }
        self.total.get().1
    }

    /// The name of the scene that pages are told of: the newest one, unless scenes have been made for longer than their share of
    /// the time; then the one before, until that is made up for.
    fn scene_to_tell(&self) -> Option<String> {
        let newest = self.newest();
        let mut told = self.told.borrow_mut();
        let is_due = self.spent.get() <= SHARE * self.begun.elapsed().as_secs_f64();
        if told.is_none() || is_due || newest.as_deref().is_some_and(|newest| newest.starts_with(END)) {
            *told = newest;
        }
        told.clone()
    }

    /// The name of the newest scene.
    fn newest(&self) -> Option<String> {
        if let Some(end) = scene_of_end(&self.folder).as_deref().and_then(changed) {
            return Some(format!("{END}{}", millis(end)));
        }
        Checkpoint::newest_step(&self.checkpoints()).ok().flatten().map(|step| step.to_string())
    }

    fn checkpoints(&self) -> PathBuf {
        self.folder.join("checkpoints")
    }

    /// The report so far.
    pub fn report(&self) -> Option<Vec<u8>> {
        read_file(&self.folder.join("report.html")).ok()
    }

    /// The scene of this name as a `.4dgs`; `None` when there is none of it any more, or it cannot be read.
    pub async fn scene(&self, name: &str) -> Option<Scene> {
        // One at a time: whoever waits finds it made.
        let mut scenes = self.scenes.lock().await;
        if let Some((_, scene)) = scenes.iter().find(|(known, _)| known == name) {
            return Some(scene.clone());
        }
        let is_end = name.starts_with(END);
        let file = match name {
            // The scene of an earlier end is gone.
            end if is_end => scene_of_end(&self.folder).filter(|_| self.newest().as_deref() == Some(end))?,
            step => Checkpoint::file(&self.checkpoints(), step.parse().ok()?),
        };
        let (folder, clip) = (self.folder.clone(), self.clip.clone());
        let begun = Instant::now();
        let made = tokio::task::spawn_blocking(move || {
            let splats = if is_end { read_scene(&file)? } else { Checkpoint::read(&file)?.splats() };
            clip.bytes(&Source::open(&folder)?, splats)
        });
        let made = made.await;
        self.spent.set(self.spent.get() + begun.elapsed().as_secs_f64());
        let bytes = match made {
            Ok(Ok(bytes)) => bytes,
            Ok(Err(fault)) => {
                tracing::warn!("scene {name}: {fault:#}");
                return None;
            }
            Err(_) => return None,
        };
        let scene = Scene::new(bytes.into());
        if scenes.len() == KEPT {
            scenes.remove(0);
        }
        scenes.push((name.to_owned(), scene.clone()));
        Some(scene)
    }
}

fn millis(at: SystemTime) -> u64 {
    at.duration_since(UNIX_EPOCH).map_or(0, |since| since.as_millis() as u64)
}

/// What a run says, as it says it: server-sent events, until the reader goes.
pub struct Events {
    live: Rc<Live>,
    every: tokio::time::Interval,
    last: String,
    quiet: u32,
}

impl Events {
    /// Those of a run.
    pub fn new(live: Rc<Live>) -> Self {
        let mut every = tokio::time::interval(LOOK);
        every.set_missed_tick_behavior(tokio::time::MissedTickBehavior::Delay);
        Events { live, every, last: String::new(), quiet: 0 }
    }
}

impl Body for Events {
    type Data = Bytes;
    type Error = Infallible;

    fn poll_frame(mut self: Pin<&mut Self>, cx: &mut Context<'_>) -> Poll<Option<Result<Frame<Bytes>, Infallible>>> {
        loop {
            ready!(self.every.poll_tick(cx));
            let now = self.live.state().to_string();
            self.quiet += 1;
            let text = if now != self.last {
                format!("data: {now}\n\n")
            } else if self.quiet >= QUIET {
                ":\n\n".to_owned()
            } else {
                continue;
            };
            self.quiet = 0;
            self.last = now;
            return Poll::Ready(Some(Ok(Frame::data(text.into()))));
        }
    }
}
