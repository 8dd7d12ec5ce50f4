//! A run in training, as its page shows it: its numbers, its report so far, and the scene of a checkpoint.

use super::scene::ServedScene;
use crate::run::export_clip::ClipArgs;
use crate::run::source::{Source, final_scene, modified, total_steps};
use bytes::Bytes;
use hyper::body::{Body, Frame};
use ivv::internals::files::read_file;
use ivv::internals::formats::read_scene;
use ivv::internals::train::{Checkpoint, Kind, Log};
use serde_json::{Value, json};
use std::cell::{Cell, RefCell};
use std::convert::Infallible;
use std::path::{Path, PathBuf};
use std::pin::Pin;
use std::rc::Rc;
use std::sync::{Arc, Mutex, PoisonError};
use std::task::{Context, Poll, ready};
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

/// How often the run is polled, and after how many polls without news an empty line tests whether the page is still there.
const POLL: Duration = Duration::from_millis(500);
const QUIET_POLLS: u32 = 20;
/// Scenes in memory: the one on the page and the next one.
const MOST_SCENES: usize = 2;
/// Share of the time for making scenes for the page; the rest is for the training.
const SHARE: f64 = 0.02;
/// The prefix of a final scene's name; a time follows, as a run may end again. Other scenes are named by their step.
const END: &str = "end-";

/// The latest line of the log of a training in this process.
pub type LatestLine = Arc<Mutex<Value>>;

pub struct LiveRun {
    folder: PathBuf,
    latest_line: Option<LatestLine>,
    clip: Arc<ClipArgs>,
    scenes: tokio::sync::Mutex<Vec<(String, ServedScene)>>,
    /// The last line of the log, and when it was read.
    line: RefCell<(Option<SystemTime>, Value)>,
    begun: Instant,
    /// Seconds in which scenes were made.
    spent: Cell<f64>,
    announced: RefCell<Option<String>>,
}

impl LiveRun {
    /// The run in `folder`, which need not be there yet; `latest_line` is from its training, if that is in this process.
    pub fn new(folder: &Path, latest_line: Option<LatestLine>, clip: &ClipArgs) -> Self {
        LiveRun {
            folder: folder.to_owned(),
            latest_line,
            clip: Arc::new(clip.unasked()),
            scenes: tokio::sync::Mutex::default(),
            line: RefCell::default(),
            begun: Instant::now(),
            spent: Cell::new(0.0),
            announced: RefCell::default(),
        }
    }

    /// The state for a page, with the newest scene's name and the report's time, or null.
    fn state(&self) -> Value {
        let line = match &self.latest_line {
            Some(line) => line.lock().unwrap_or_else(PoisonError::into_inner).clone(),
            None => self.last_line(),
        };
        let name = std::path::absolute(&self.folder).ok();
        let name = name.as_deref().and_then(Path::file_name).map(|name| name.to_string_lossy().into_owned());
        let report = modified(&self.folder.join("report.html")).map(millis);
        let scene = self.scene_to_announce();
        let step = line["step"].as_u64().unwrap_or(0);
        json!({
            "name": name, "step": step, "total": total_steps(&self.folder).unwrap_or(step), "seconds": line["seconds"],
            "loss": line["loss"], "psnr": line["psnr"], "gaussians": line["gaussians"],
            "ended": final_scene(&self.folder).is_some(), "scene": scene, "report": report,
        })
    }

    /// The last step in the log on the disk: that of the newest checkpoint.
    fn last_line(&self) -> Value {
        let mut line = self.line.borrow_mut();
        let at = modified(&self.folder.join("train.jsonl"));
        if at != line.0 {
            let log = Log::open(&self.folder, u64::MAX);
            *line = (at, log.lines(Kind::Step).last().cloned().unwrap_or_default());
        }
        line.1.clone()
    }

    /// The name of the scene that pages show: the newest, unless scenes have taken more than their share of the time.
    fn scene_to_announce(&self) -> Option<String> {
        let newest = self.newest();
        let mut announced = self.announced.borrow_mut();
        let is_due = self.spent.get() <= SHARE * self.begun.elapsed().as_secs_f64();
        if announced.is_none() || is_due || newest.as_deref().is_some_and(|newest| newest.starts_with(END)) {
            *announced = newest;
        }
        announced.clone()
    }

    fn newest(&self) -> Option<String> {
        if let Some(end) = final_scene(&self.folder).as_deref().and_then(modified) {
            return Some(format!("{END}{}", millis(end)));
        }
        Checkpoint::newest_step(&self.checkpoints()).ok().flatten().map(|step| step.to_string())
    }

    fn checkpoints(&self) -> PathBuf {
        self.folder.join("checkpoints")
    }

    pub fn report(&self) -> Option<Vec<u8>> {
        read_file(&self.folder.join("report.html")).ok()
    }

    /// The scene of this name as a `.4dgs`; `None` when there is none of it any more, or it cannot be read.
    pub async fn scene(&self, name: &str) -> Option<ServedScene> {
        // One at a time: a second request for it then finds it made.
        let mut scenes = self.scenes.lock().await;
        if let Some((_, scene)) = scenes.iter().find(|(known, _)| known == name) {
            return Some(scene.clone());
        }
        let is_end = name.starts_with(END);
        let file = match name {
            // The scene of an earlier end is gone.
            end if is_end => final_scene(&self.folder).filter(|_| self.newest().as_deref() == Some(end))?,
            step => Checkpoint::file(&self.checkpoints(), step.parse().ok()?),
        };
        let (folder, clip) = (self.folder.clone(), self.clip.clone());
        let begun = Instant::now();
        let made = tokio::task::spawn_blocking(move || {
            let splats = if is_end { read_scene(&file)? } else { Checkpoint::read(&file)?.splats() };
            clip.bytes(&Source::open(&folder)?, splats)
        });
        let made = made.await.ok();
        self.spent.set(self.spent.get() + begun.elapsed().as_secs_f64());
        let bytes = made?.inspect_err(|fault| tracing::warn!("scene {name}: {fault:#}")).ok()?;
        let scene = ServedScene::new(bytes.into());
        if scenes.len() == MOST_SCENES {
            scenes.remove(0);
        }
        scenes.push((name.to_owned(), scene.clone()));
        Some(scene)
    }
}

fn millis(at: SystemTime) -> u64 {
    at.duration_since(UNIX_EPOCH).map_or(0, |since| since.as_millis() as u64)
}

/// The state of a run as server-sent events, until the reader goes.
pub struct Events {
    live: Rc<LiveRun>,
    every: tokio::time::Interval,
    last: String,
    quiet: u32,
}

impl Events {
    pub fn new(live: Rc<LiveRun>) -> Self {
        let mut every = tokio::time::interval(POLL);
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
            } else if self.quiet >= QUIET_POLLS {
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
