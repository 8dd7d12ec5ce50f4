//! What `ivv` does when Vulkan calls fail or the device is lost: the layer of `layer.rs` makes one call fail in each run.
//!
//! Every run must end with 4 or 5 and a message, or with 0 and the result of an undisturbed run; never by a signal, a panic
//! or a time-out, never with a partial result. A training must leave a checkpoint, and go on from it to the same bits.

mod built;
mod runs;
mod sweep;

use crate::common::prelude::*;
use crate::common::program::{command, told};
use runs::{Bed, Ended, Verb};

/// Results of a sweep, by call: how many faults, and how the runs ended.
#[derive(Default)]
struct Figures(BTreeMap<String, BTreeMap<i32, usize>>);

impl Figures {
    fn count(&mut self, call: &str, code: i32) {
        *self.0.entry(call.to_owned()).or_default().entry(code).or_default() += 1;
    }

    fn faults(&self) -> usize {
        self.0.values().flat_map(BTreeMap::values).sum()
    }

    fn print(&self, verb: &str) {
        println!("{verb}: {} faults", self.faults());
        for (call, codes) in &self.0 {
            let codes: Vec<String> = codes.iter().map(|(code, n)| format!("{n} x exit {code}")).collect();
            println!("  {call}: {}", codes.join(", "));
        }
    }
}

#[test]
fn rendering_survives_faults_of_the_device() {
    let bed = Bed::shared();
    sweep::sweep(&bed, Verb::Render, sweep::few, 1).print("render");
}

#[test]
fn training_survives_faults_of_the_device_and_goes_on() {
    let bed = Bed::shared();
    sweep::sweep(&bed, Verb::Train, sweep::few, 3).print("train");
}

#[test]
#[ignore = "slow: hundreds of runs of ivv"]
fn all_verbs_survive_faults_at_many_calls() {
    let bed = Bed::new("wide", &["offsets=true"]);
    for (verb, name) in [(Verb::Render, "render"), (Verb::Train, "train"), (Verb::Eval, "eval")] {
        sweep::sweep(&bed, verb, sweep::many, 1).print(name);
    }
}

/// Where memory runs out in the middle of a training, the device can still be read: nothing is lost.
#[test]
fn a_training_without_memory_leaves_its_last_step() {
    let bed = Bed::shared();
    let mut irregular = 0;
    for (call, tenths, code) in [("vkCreateBuffer", 5, -2), ("vkQueueSubmit", 4, -1), ("vkWaitSemaphores", 6, -1)] {
        // Of two waits for a submission the second, by what destroys it, is not needed.
        let n = (bed.counts()[call] * tenths / 10) | 1;
        let ended = bed.run(Verb::Train, Some(&format!("{call}:{n}:{code}")));
        assert_eq!(ended.code, Some(5), "{}", ended.told);
        let stopped = ended.stopped_after().expect("the message names the last step");
        let left = ended.checkpoint.expect("a checkpoint is left");
        assert_eq!(left, stopped, "{call}: {}", ended.told);
        assert!(left > 0 && left < runs::STEPS, "{call}: {}", ended.told);
        irregular += usize::from(!left.is_multiple_of(runs::EVERY));
        bed.resume_and_compare(&ended);
    }
    assert!(irregular > 0, "the regular checkpoints alone would do");
}

/// Images that stay on the device give way to what needs its memory, and are decoded again: the run ends, with the same bits.
#[test]
fn images_that_stay_on_the_device_give_way() {
    // On whole images throughout: after the first step most buffers that are made are those of images.
    let settings = ["offsets=false", "resolution.reduction=1"];
    let bed = Bed::with_options("images", &settings, &["--device-image-bytes", "1000000"]);
    assert!(bed.trained().written == Bed::new("images-pass", &settings).trained().written, "other bits than without");
    let n_buffers = bed.counts()["vkCreateBuffer"];
    let mut n_ended = 0;
    // From the first images to the last steps.
    for tenths in 2..8 {
        let ended = bed.run(Verb::Train, Some(&format!("vkCreateBuffer:{}:-2", n_buffers * tenths / 10)));
        let code = sweep::judge(&ended).unwrap();
        n_ended += usize::from(code == 0);
        assert!(code != 0 || ended.written == bed.trained().written, "{} gives other bits", ended.fault);
    }
    assert!(n_ended > 2, "{n_ended} runs went on");
}

/// Between the end of the last step and its checkpoint too.
#[test]
fn a_training_without_memory_at_its_end_leaves_its_last_step() {
    let bed = Bed::shared();
    let n_waits = bed.counts()["vkWaitSemaphores"];
    // Every other wait, from the seventh step on; the scene is scored after some three quarters of them.
    let mut n_late = 0;
    for n in (n_waits * 75 / 100..n_waits * 81 / 100).filter(|n| n % 2 == 1) {
        let ended = bed.run(Verb::Train, Some(&format!("vkWaitSemaphores:{n}:-1")));
        if ended.code == Some(5) && ended.stopped_after() == Some(runs::STEPS) {
            assert_eq!(ended.checkpoint, Some(runs::STEPS), "wait {n} of {n_waits}: {}", ended.told);
            n_late += 1;
        }
    }
    assert!(n_late > 1, "{n_late} of the waits came after the last step");
}

/// The step that could not be waited for ended all the same, and what is due after it, a look at the offsets, is not forgotten.
#[test]
fn what_is_due_after_a_rescued_step_is_done_after_resumption() {
    let bed = Bed::new("owed", &["offsets=true"]);
    let ended = bed.run(Verb::Train, Some("vkGetQueryPoolResults:3:-1"));
    assert_eq!((ended.code, ended.checkpoint), (Some(5), ended.stopped_after()), "{}", ended.told);
    assert_eq!(ended.checkpoint, Some(runs::STEPS / 2), "the offsets are looked at after this step");
    bed.resume_and_compare(&ended);
}

/// Memory that stays short: the checkpoint that was there is kept and named.
#[test]
fn a_training_that_stays_without_memory_names_what_it_has() {
    let bed = Bed::shared();
    let n = bed.counts()["vkCreateBuffer"] * 6 / 10;
    let ended = bed.run(Verb::Train, Some(&format!("vkCreateBuffer:{n}+:-2")));
    assert_eq!(ended.code, Some(5), "{}", ended.told);
    let (stopped, left) = (ended.stopped_after().unwrap(), ended.checkpoint.unwrap());
    assert!(stopped - left <= runs::EVERY && left.is_multiple_of(runs::EVERY), "{}", ended.told);
    bed.resume_and_compare(&ended);
}

#[test]
fn a_training_that_loses_its_device_has_a_checkpoint_no_older_than_the_interval() {
    let bed = Bed::shared();
    for part in [3, 5, 7] {
        let n = bed.counts()["vkWaitSemaphores"] * part / 10;
        let ended = bed.run(Verb::Train, Some(&format!("vkWaitSemaphores:{n}:-4")));
        assert_eq!(ended.code, Some(4), "{}", ended.told);
        assert!(ended.told.contains("the device was lost"), "{}", ended.told);
        let (stopped, left) = (ended.stopped_after().unwrap(), ended.checkpoint.unwrap());
        assert!((left..=left + runs::EVERY).contains(&stopped), "{}", ended.told);
        assert!(ended.told.contains(&format!("{left:08}.ckpt")), "it is named: {}", ended.told);
        assert!(ended.told.contains("--resume"), "{}", ended.told);
        bed.resume_and_compare(&ended);
    }
}

/// What the loader answers to a list of drivers that it cannot read is "out of memory".
#[test]
fn a_driver_file_that_is_no_json_is_no_device() {
    let folder = Folder::new("faults-driver");
    let file = folder.write("driver.json", "no json");
    let mut devices = command(&["devices"]);
    let output = devices.env("VK_DRIVER_FILES", &file).env("VK_ICD_FILENAMES", &file).output().unwrap();
    let told = told(&output);
    assert_eq!(output.status.code(), Some(4), "{told}");
    assert!(told.contains("no usable Vulkan device") && !told.contains("limit is 0"), "{told}");
    assert!(told.contains("the file of a driver may be damaged"), "{told}");
}

/// The sweep notices what it is there to notice.
#[test]
fn a_crash_a_hang_and_a_fault_that_never_comes_are_caught() {
    let bed = Bed::shared();
    let caught = |fault: &str, ended: &Ended| sweep::judge(ended).expect_err(fault);
    let of_run = |fault: &str| caught(fault, &bed.run(Verb::Render, Some(fault)));
    assert!(of_run("vkQueueSubmit:2:abort").contains("signal"));
    assert!(of_run("vkQueueSubmit:1000000:-1").contains("was not reached"));
    let hangs = "vkQueueSubmit:2:skip";
    assert!(caught(hangs, &bed.run_within(Verb::Render, Some(hangs), 3.0)).contains("did not end"));
    let panicked = Ended { code: Some(101), ..bed.run(Verb::Render, Some("vkQueueSubmit:2:-1")) };
    assert!(sweep::judge(&panicked).unwrap_err().contains("101"));
}
