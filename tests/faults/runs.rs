//! Runs of `ivv` under the layer.

use crate::common::prelude::*;
use ivv::internals::synth::Options;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{PoisonError, Weak};

pub const STEPS: u64 = 8;
pub const EVERY: u64 = 3;
/// A run that takes longer hangs, seconds: it takes two, and the machine may have much else to do.
const TIMEOUT_S: f64 = 90.0;

#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Verb {
    Render,
    Train,
    Eval,
}

pub struct Ended {
    pub fault: String,
    /// Its exit code; none if a signal or the time-out ended it.
    pub code: Option<i32>,
    pub timed_out: bool,
    pub told: String,
    /// Calls of each entry point; empty if it did not get to the end of its instance.
    pub counts: BTreeMap<String, u64>,
    /// Whether the fault was given; none where that is not known.
    pub was_given: Option<bool>,
    /// What it wrote, by file; of a training the scene only.
    pub written: BTreeMap<String, Vec<u8>>,
    pub checkpoint: Option<u64>,
    pub folder: PathBuf,
}

impl Ended {
    pub fn stopped_after(&self) -> Option<u64> {
        let (_, rest) = self.told.split_once("stopped after step ")?;
        rest.split(|c: char| !c.is_ascii_digit()).next()?.parse().ok()
    }
}

/// A capture, a scene and cameras, and a folder for runs; removed at the end.
pub struct Bed {
    folder: Folder,
    layer: PathBuf,
    serial: AtomicUsize,
    settings: Vec<String>,
    options: Vec<String>,
    undisturbed: OnceLock<Ended>,
}

impl Bed {
    /// The one of the tests that run at the same time.
    pub fn shared() -> Arc<Self> {
        static SHARED: Mutex<Weak<Bed>> = Mutex::new(Weak::new());
        let mut shared = SHARED.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(bed) = shared.upgrade() {
            return bed;
        }
        // Learnt offsets cost two thirds of the calls.
        let bed = Arc::new(Self::new("shared", &["offsets=false"]));
        *shared = Arc::downgrade(&bed);
        bed
    }

    pub fn new(name: &str, settings: &[&str]) -> Self {
        Self::with_options(name, settings, &[])
    }

    pub fn with_options(name: &str, settings: &[&str], options: &[&str]) -> Self {
        let further = options.iter().map(|option| (*option).to_owned()).collect();
        let folder = Folder::quick(&format!("faults-{name}"));
        let options =
            Options { cameras: 3, test_cameras: 1, width: 32, height: 32, frames: 2, ..Preset::Tiny.options(7) };
        let capture = folder.file("capture");
        write_capture(&capture, &options, 2, &mut |_, _| {}).unwrap();
        let opened = Capture::open(&capture).unwrap();
        let views = [opened.view(0, 0).unwrap(), opened.view(1, 1).unwrap()];
        write_views(&folder.file("cameras.json"), &views).unwrap();
        let layer = folder.file("layer");
        super::built::layer(&layer);
        let settings = settings.iter().map(|set| (*set).to_owned()).collect();
        let serial = AtomicUsize::new(0);
        let bed = Bed { folder, layer, serial, settings, options: further, undisturbed: OnceLock::new() };
        let ended = bed.run(Verb::Train, None);
        assert_eq!(ended.code, Some(0), "{}", ended.told);
        std::fs::rename(&ended.folder, bed.folder.file("run")).unwrap();
        bed.undisturbed.get_or_init(|| ended);
        bed
    }

    pub fn trained(&self) -> &Ended {
        self.undisturbed.get().expect("it was trained")
    }

    pub fn counts(&self) -> &BTreeMap<String, u64> {
        &self.trained().counts
    }

    /// Runs `verb` in a new folder, with one fault or none.
    pub fn run(&self, verb: Verb, fault: Option<&str>) -> Ended {
        self.run_within(verb, fault, TIMEOUT_S)
    }

    pub fn run_within(&self, verb: Verb, fault: Option<&str>, seconds: f64) -> Ended {
        let serial = self.serial.fetch_add(1, Ordering::Relaxed);
        let folder = self.folder.file(&format!("out{serial}"));
        let counts_file = folder.with_extension("counts");
        let mut command = self.command(verb, &folder);
        command.env("VK_LAYER_PATH", &self.layer).env("VK_INSTANCE_LAYERS", "VK_LAYER_IVV_faults");
        command.env("IVV_FAULT_COUNTS", &counts_file);
        if let Some(fault) = fault {
            command.env("IVV_FAULT", fault);
        }
        let (code, timed_out) = self.end(command, seconds);
        let text = std::fs::read_to_string(&counts_file).unwrap_or_default();
        let mut counts: BTreeMap<String, u64> = text
            .lines()
            .filter_map(|line| line.split_once(' '))
            .map(|(name, n)| (name.to_owned(), n.parse().unwrap()))
            .collect();
        let was_given = counts.remove("fault").map(|given| given == 1);
        let told = std::fs::read_to_string(folder.with_extension("told")).unwrap();
        let newest = Checkpoint::newest(&folder.join("checkpoints"));
        Ended {
            fault: fault.unwrap_or("none").to_owned(),
            code,
            timed_out,
            told,
            counts,
            was_given,
            written: written(verb, &folder),
            checkpoint: newest.expect("no checkpoint is damaged").map(|checkpoint| checkpoint.step),
            folder,
        }
    }

    /// Resumes a training that has a checkpoint; it must end, with the scene of the undisturbed one.
    pub fn resume_and_compare(&self, ended: &Ended) {
        let mut command = self.command(Verb::Train, &ended.folder);
        command.arg("--resume");
        let (code, _) = self.end(command, TIMEOUT_S);
        let told = std::fs::read_to_string(ended.folder.with_extension("told")).unwrap();
        assert_eq!(code, Some(0), "{}, resumed: {told}", ended.fault);
        assert!(
            written(Verb::Train, &ended.folder) == self.trained().written,
            "{}, resumed: another scene",
            ended.fault
        );
    }

    fn command(&self, verb: Verb, output: &Path) -> Command {
        let at = |name: &str| self.folder.file(name);
        let mut command = Command::new(env!("CARGO_BIN_EXE_ivv"));
        match verb {
            Verb::Render => {
                command.arg("render").arg(at("run/scene.ply")).arg("--cameras").arg(at("cameras.json"));
                command.args(["--format", "exr"]);
            }
            Verb::Train => {
                command.arg("train").arg(at("capture"));
                // A round after each step: in so short a run there would be none.
                let settings = ["init=random", "init_points=60", "grids=none", "density.strategy=mcmc", "adam=lazy"];
                let settings =
                    settings.into_iter().chain(["density.every=1"]).chain(self.settings.iter().map(String::as_str));
                command.args(settings.flat_map(|set| ["--set", set]));
                command.args(&self.options);
                command.args(["--max-gaussians", "200", "--sh-degree", "1", "--eval-every", "0"]);
                command.args(["--steps", &STEPS.to_string(), "--checkpoint-every", &EVERY.to_string()]);
            }
            Verb::Eval => {
                // It writes into the folder of its run.
                std::fs::create_dir_all(output).unwrap();
                for name in ["config.json", "run.json", "scene.ply", "train.json", "train.jsonl"] {
                    std::fs::copy(at("run").join(name), output.join(name)).unwrap();
                }
                command.arg("eval").arg(output);
            }
        }
        if verb != Verb::Eval {
            command.arg("-o").arg(output);
        }
        if let Ok(device) = std::env::var("IVV_TEST_DEVICE") {
            command.args(["--device", &device]);
        }
        let told = std::fs::File::create(output.with_extension("told")).unwrap();
        command.env("XDG_CACHE_HOME", at("cache")).env_remove("VK_INSTANCE_LAYERS").env_remove("IVV_FAULT");
        command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(told);
        command
    }

    fn end(&self, mut command: Command, seconds: f64) -> (Option<i32>, bool) {
        let mut child = command.spawn().unwrap();
        let begun = Instant::now();
        while begun.elapsed().as_secs_f64() < seconds {
            if let Some(status) = child.try_wait().unwrap() {
                return (status.code(), false);
            }
            std::thread::sleep(Duration::from_millis(5));
        }
        child.kill().unwrap();
        child.wait().unwrap();
        (None, true)
    }
}

/// What a run wrote: all files, of a training the scene, of an evaluation the pictures.
fn written(verb: Verb, folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let mut all = BTreeMap::new();
    let mut folders = vec![if verb == Verb::Eval { folder.join("renders") } else { folder.to_owned() }];
    while let Some(next) = folders.pop() {
        for entry in std::fs::read_dir(&next).into_iter().flatten().flatten() {
            let (path, name) = (entry.path(), entry.file_name().into_string().unwrap());
            assert!(!name.contains("tmp"), "a temporary is left: {name}");
            if path.is_dir() {
                folders.push(path);
            } else if verb != Verb::Train || name == "scene.ply" {
                let name = path.strip_prefix(folder).unwrap().to_str().unwrap().to_owned();
                all.insert(name, std::fs::read(path).unwrap());
            }
        }
    }
    all
}
