//! Runs that were killed, extended, or started twice: nothing is lost, and nothing else is trained than was asked for.

use super::{Tiny, trainer};
use crate::common::prelude::*;
use crate::common::program::json;
use crate::common::running::Running;
use ivv::internals::stage::GRID_NUMBERS;
use ivv::internals::train::RunLock;

/// A capture with the path of a run folder that is not there yet.
struct Case {
    tiny: Tiny,
    run: PathBuf,
}

impl Case {
    fn new(name: &str) -> Self {
        let tiny = Tiny::of_frames(name, 2);
        let run = tiny.folder.join("run");
        Case { tiny, run }
    }

    fn path(&self) -> &str {
        self.run.to_str().unwrap()
    }

    fn train<'a>(&'a self, more: &[&'a str]) -> Vec<&'a str> {
        let train = ["train", self.tiny.folder.to_str().unwrap(), "-o", self.path(), "--eval-every", "0"];
        [&train[..], more].concat()
    }

    fn resume<'a>(&'a self, more: &[&'a str]) -> Vec<&'a str> {
        [&["train", "--resume", "-o", self.path(), "--eval-every", "0"][..], more].concat()
    }

    fn file(&self, name: &str) -> Vec<u8> {
        std::fs::read(self.run.join(name)).unwrap_or_else(|e| panic!("{name}: {e}"))
    }

    fn totals(&self) -> Value {
        json(&self.run.join("train.json"))
    }

    /// The run as a process that was killed before its first checkpoint left it.
    fn killed_early(&self) {
        for name in ["train.jsonl", "train.json", "scene.ply", "eval.json", "report.html"] {
            std::fs::remove_file(self.run.join(name)).unwrap();
        }
        std::fs::remove_dir_all(self.run.join("checkpoints")).unwrap();
    }
}

const SMALL: [&str; 6] = ["--max-gaussians", "300", "--sh-degree", "1", "--set", "init_points=200"];

#[test]
fn a_run_that_was_killed_before_its_first_checkpoint_begins_again_as_it_was() {
    let case = Case::new("early");
    works(&case.train(&[&SMALL[..], &["--steps", "8", "--test-cameras", "cam01", "--blur", "0.2"]].concat()));
    let (config, run, scene) = (case.file("config.json"), case.file("run.json"), case.file("scene.ply"));
    case.killed_early();
    let told = tells(&case.resume(&[]));
    assert!(told.contains("starts again with its own settings"), "{told}");
    assert_eq!((case.file("config.json"), case.file("run.json")), (config, run));
    assert!(case.file("scene.ply") == scene, "the same bits as without the kill");
}

#[test]
fn a_resume_without_a_checkpoint_tells_what_is_there_and_writes_nothing() {
    let case = Case::new("nothing");
    // A folder that is not there: a mistyped name.
    let told = fails(&case.resume(&[]), 3);
    assert!(told.contains("no such folder") && told.contains(case.path()), "{told}");
    assert!(!case.run.exists(), "no folder is made for a mistyped name");
    // One that is not a run's.
    std::fs::create_dir(&case.run).unwrap();
    std::fs::write(case.run.join("notes.txt"), "").unwrap();
    let told = fails(&case.resume(&[]), 3);
    assert!(told.contains("run.json") && told.contains("it holds notes.txt"), "{told}");
    assert_eq!(std::fs::read_dir(&case.run).unwrap().count(), 1);
    // One that has lost its checkpoints.
    works(&case.train(&[&SMALL[..], &["--steps", "4"]].concat()));
    let config = case.file("config.json");
    std::fs::rename(case.run.join("checkpoints"), case.run.join("elsewhere")).unwrap();
    let told = fails(&case.resume(&[]), 3);
    assert!(told.contains("checkpoints: no such folder") && told.contains("train.jsonl"), "{told}");
    std::fs::create_dir(case.run.join("checkpoints")).unwrap();
    let told = fails(&case.resume(&[]), 3);
    assert!(told.contains("holds no checkpoint"), "{told}");
    // One whose checkpoints cannot be listed: root may list every folder, but not a file.
    std::fs::remove_dir(case.run.join("checkpoints")).unwrap();
    std::fs::write(case.run.join("checkpoints"), "").unwrap();
    let told = fails(&case.resume(&[]), 3);
    assert!(told.contains("checkpoints: cannot be listed"), "{told}");
    assert_eq!(case.file("config.json"), config);
    // Without --resume nothing is trained over it either.
    let told = fails(&case.train(&["--steps", "4"]), 3);
    assert!(told.contains("cannot be listed"), "{told}");
}

#[test]
fn a_resumed_run_needs_no_capture_tells_which_settings_are_newer_and_finds_a_capture_that_moved() {
    let case = Case::new("moved");
    works(&case.train(&[&SMALL[..], &["--steps", "6"]].concat()));
    let (config, scene) = (case.file("config.json"), case.file("scene.ply"));
    assert!(!tells(&case.resume(&[])).contains("another version"));
    assert!(case.file("scene.ply") == scene && case.file("config.json") == config);
    let mut older: Value = serde_json::from_slice(&config).unwrap();
    older.as_object_mut().unwrap().remove("backdrop").unwrap();
    older["frame"].as_object_mut().unwrap().remove("t_cut").unwrap();
    std::fs::write(case.run.join("config.json"), older.to_string()).unwrap();
    let told = tells(&case.resume(&[]));
    assert!(told.contains("now have their defaults: backdrop, frame.t_cut;"), "{told}");
    let elsewhere = case.tiny.folder.with_extension("elsewhere");
    std::fs::rename(&case.tiny.folder, &elsewhere).unwrap();
    let run = elsewhere.join("run");
    let resume = ["train", "--resume", "-o", run.to_str().unwrap(), "--eval-every", "0"];
    let told = fails(&resume, 3);
    assert!(told.contains("no such folder") && told.contains("--resume"), "{told}");
    works(&[&resume[..], &[elsewhere.to_str().unwrap()]].concat());
    // It is found from now on.
    works(&resume);
    assert_same("scene.ply", &std::fs::read(run.join("scene.ply")).unwrap(), &scene);
    std::fs::rename(&elsewhere, &case.tiny.folder).unwrap();
}

#[test]
fn a_run_is_extended_and_other_settings_are_refused() {
    let case = Case::new("extended");
    works(&case.train(&[&SMALL[..], &["--steps", "10", "--seed", "5"]].concat()));
    let before: Config = serde_json::from_slice(&case.file("config.json")).unwrap();
    let told = tells(&case.resume(&["--steps", "16"]));
    assert!(told.contains("16 steps instead of 10") && told.contains("100 % done becomes 62 % done"), "{told}");
    assert_eq!(case.totals()["steps"], 16);
    let after: Config = serde_json::from_slice(&case.file("config.json")).unwrap();
    assert_eq!(after, Config { steps: 16, ..before.clone() });
    let newest = Checkpoint::newest(&case.run.join("checkpoints")).unwrap().unwrap();
    assert_eq!((newest.step, newest.total, &newest.config), (16, 16, &after));
    // By epochs, and as long as it is: the same bits again.
    let images = case.totals()["capture"]["held"]["training_images"].as_u64().unwrap();
    works(&case.resume(&["--epochs", "3"]));
    assert_eq!(case.totals()["steps"], 3 * images);
    let scene = case.file("scene.ply");
    works(&case.resume(&["--epochs", "3", "--seed", "5", "--max-gaussians", "300", "--set", "init_points=200"]));
    assert!(case.file("scene.ply") == scene);

    let config = case.file("config.json");
    let told = fails(&case.resume(&["--steps", "4"]), 2);
    assert!(told.contains(&format!("has done {} steps", 3 * images)) && told.contains('4'), "{told}");
    let contradictions: [(&[&str], &[&str]); 4] = [
        (&["--seed", "6"], &["seed: the run has 5, the option asks for 6"]),
        (
            &["--set", "density.growth=0.5", "--sh-degree", "3"],
            &["density.growth: the run has", "sh_degree: the run has 1"],
        ),
        (&["--test-cameras", "cam00"], &["--test-cameras: the run has", "cam00"]),
        (&["--blur", "0.1"], &["--blur: the run has 0.3, the option asks for 0.1"]),
    ];
    for (flags, expected) in contradictions {
        let told = fails(&case.resume(flags), 2);
        assert!(expected.iter().all(|part| told.contains(part)), "{flags:?}: {told}");
    }
    assert_eq!(case.file("config.json"), config);
}

/// `ivv` as a process whose number is known beforehand: that of the shell that becomes it.
#[cfg(unix)]
fn with_known_number(before: &str, arguments: &[&str], folder: &Path) -> std::process::Output {
    let script = format!("cd {} && {before} && exec \"$0\" \"$@\"", folder.display());
    Command::new("sh").args(["-c", &script, env!("CARGO_BIN_EXE_ivv")]).args(arguments).output().unwrap()
}

/// What a killed process with the number of the present one left, as in a container, where all have the same.
#[test]
#[cfg(unix)]
fn what_a_killed_process_left_is_in_nobodys_way_and_goes() {
    let case = Case::new("left");
    works(&case.train(&[&SMALL[..], &["--steps", "4"]].concat()));
    let leftovers = |name: &str| format!("for i in $(seq 0 60); do : > {name}.$$-$i.tmp; done");
    let all = ["checkpoints/.00000006.ckpt", "checkpoints/.00000008.ckpt", ".scene.ply", ".train.json"].map(leftovers);
    let before = format!("{} && : > .config.json.1-0.tmp && : > .mine.tmp", all.join(" && "));
    let resume = case.resume(&["--steps", "8", "--checkpoint-every", "2"]);
    let output = with_known_number(&before, &resume, &case.run);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let hidden = |folder: &Path| -> Vec<String> {
        let names = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap());
        names.filter(|name| name.starts_with('.') && name != ".lock").collect()
    };
    assert_eq!(hidden(&case.run), [".mine.tmp"], "only what no process of this kind names so stays");
    assert_eq!(hidden(&case.run.join("checkpoints")), Vec::<String>::new());
    // Where nothing sweeps: the names are free all the same.
    let cameras = ["inspect", case.path(), "--cameras", "out.json"];
    let output = with_known_number(&leftovers(".out.json"), &cameras, &case.tiny.folder);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
}

#[test]
fn a_run_folder_has_one_training_at_a_time() {
    let case = Case::new("lock");
    std::fs::create_dir(&case.run).unwrap();
    let lock = RunLock::take(&case.run).unwrap();
    let told = fails(&case.train(&[&SMALL[..], &["--steps", "4"]].concat()), 3);
    let me = format!("process {} on ", std::process::id());
    assert!(told.contains("a training is running in this folder") && told.contains(&me), "{told}");
    assert!(told.contains("for 0 h 0"), "{told}");
    assert!(!case.run.join("config.json").exists(), "nothing is written");
    drop(lock);
    works(&case.train(&[&SMALL[..], &["--steps", "4"]].concat()));
    let (scene, lock) = (case.file("scene.ply"), RunLock::take(&case.run).unwrap());
    for flags in [&["--resume"][..], &["--overwrite", "--steps", "4"]] {
        assert!(fails(&case.train(flags), 3).contains(&me), "{flags:?}");
    }
    assert!(case.file("scene.ply") == scene);
    drop(lock);
}

#[test]
fn a_killed_training_leaves_no_lock() {
    let case = Case::new("kill");
    let train = case.train(&[&SMALL[..], &["--steps", "100000", "--checkpoint-every", "3"]].concat());
    let mut command = Command::new(env!("CARGO_BIN_EXE_ivv"));
    let mut training = Running::start(command.args(train).stdout(Stdio::null()).stderr(Stdio::null()));
    training.wait_for_checkpoint(&case.run.join("checkpoints"), 3);
    let told = fails(&case.resume(&[]), 3);
    assert!(told.contains(&format!("process {} on ", training.0.id())), "{told}");
    training.0.kill().unwrap();
    training.0.wait().unwrap();
    let newest = Checkpoint::newest(&case.run.join("checkpoints")).unwrap().unwrap();
    let total = (newest.step + 2).to_string();
    works(&case.resume(&["--steps", &total]));
    assert_eq!(case.totals()["steps"], newest.step + 2, "shortened, as was asked");
}

#[test]
fn a_trainer_begins_with_more_gaussians_than_four_pairs_of_each_fit_a_binding() {
    let _device = gpu();
    let tiny = Tiny::of_frames("many", 2);
    // At 48 bytes a pair: more than lavapipe's 128 MiB. None of them is in view.
    let n = 700_000;
    let begin = Splats {
        n_static: n,
        position: vec![[0.0, 0.0, 1e4]; n],
        rotation: vec![[1.0, 0.0, 0.0, 0.0]; n],
        scale: vec![[-9.0; 3]; n],
        opacity: vec![0.0; n],
        sh: vec![[0.0; 3]; n],
        source_row: (0..n as u32).collect(),
        ..Splats::new(0)
    };
    let config = Config { sh_degree: 0, max_gaussians: 1_000_000, ..exact() };
    let mut trainer = trainer(&tiny.capture, &config, &begin, 9);
    let (camera, frame) = tiny.capture.training_frames()[0];
    let picture = tiny.capture.picture(camera, frame).unwrap();
    trainer.train(camera, &tiny.capture.view(camera, frame).unwrap(), &picture).unwrap();
    trainer.finish().unwrap();
    assert_eq!((trainer.step(), trainer.n_gaussians()), (1, n as u32));
}

#[test]
fn a_checkpoint_of_many_cameras_is_read_again() {
    let _device = gpu();
    let tiny = Tiny::of_frames("many-cameras", 2);
    let config = Config { sh_degree: 0, ..exact() };
    let begin = from_points(&tiny.capture.points, &tiny.capture, &config);
    let setup = Setup::plain(tiny.capture.extent(), 0.5);
    let mut trainer = Trainer::new(gpu().clone(), &begin, Constants::default(), config, 9, setup).unwrap();
    let mut checkpoint = trainer.checkpoint().unwrap();
    // What the header says of them is longer than a megabyte.
    let n = 200_000;
    (checkpoint.cameras.clocks, checkpoint.cameras.learns_offset) = (vec![[0.0; 4]; n], vec![false; n]);
    checkpoint.write(&tiny.folder).unwrap();
    assert!(Checkpoint::read(&Checkpoint::file(&tiny.folder, 0)).unwrap().cameras == checkpoint.cameras);
}

#[test]
fn colour_maps_that_one_binding_cannot_hold_are_refused_before_the_run() {
    let gpu = gpu();
    let tiny = Tiny::of_frames("maps", 2);
    let config = Config { sh_degree: 0, ..exact() };
    let begin = from_points(&tiny.capture.points, &tiny.capture, &config);
    let most = (gpu.caps().max_binding_bytes / (4 * GRID_NUMBERS as u64)) as usize;
    // Cameras get theirs during the run.
    let begins = |most_grids: usize| {
        let setup = Setup { most_grids, ..Setup::plain(tiny.capture.extent(), 0.5) };
        Trainer::new(gpu.clone(), &begin, Constants::default(), config.clone(), 9, setup).map(drop)
    };
    let refused = begins(most + 1).unwrap_err();
    assert!(refused.exit_code() == 5 && refused.to_string().contains("--set grids=none"), "{refused}");
    begins(most).unwrap();
}

#[test]
fn an_extended_trainer_owes_nothing_of_the_schedule_that_it_leaves() {
    let _device = gpu();
    let tiny = Tiny::of_frames("owes", 2);
    let frames = tiny.capture.training_frames();
    for adam in [AdamMode::Lazy, AdamMode::Dense] {
        let config = Config { adam, sh_degree: 1, ..exact() };
        let begin = from_points(&tiny.capture.points, &tiny.capture, &config);
        let setup = Setup::new(&tiny.capture, &config);
        let new = |total| {
            let config = Config { steps: total, ..config.clone() };
            Trainer::new(gpu().clone(), &begin, Constants::default(), config, total, setup.clone()).unwrap()
        };
        let drive = |trainer: &mut Trainer, until: u64| {
            while trainer.step() < until {
                let (camera, frame) = frames[trainer.step() as usize % frames.len()];
                let picture = tiny.capture.picture(camera, frame).unwrap();
                trainer.train(camera, &tiny.capture.view(camera, frame).unwrap(), &picture).unwrap();
            }
        };
        let mut trainer = new(6);
        drive(&mut trainer, 6);
        let before = trainer.splats().unwrap();
        trainer.extend(Config { steps: 9, ..config.clone() }, 9).unwrap();
        assert_same_splats(format_args!("{adam:?}: extended"), &trainer.splats().unwrap(), &before);
        let checkpoint = trainer.checkpoint().unwrap();
        assert_eq!((checkpoint.step, checkpoint.total, checkpoint.config.steps), (6, 9, 9));
        drive(&mut trainer, 9);
        assert!(trainer.splats().unwrap() != before);
        // To the length that it has: the run that it is.
        if adam == AdamMode::Dense {
            let (mut whole, mut same) = (new(9), new(9));
            drive(&mut whole, 9);
            drive(&mut same, 5);
            same.extend(Config { steps: 9, ..config.clone() }, 9).unwrap();
            drive(&mut same, 9);
            assert_same_splats("extended to its length", &same.splats().unwrap(), &whole.splats().unwrap());
        }
    }
}
