//! One run for each fault.

use super::Figures;
use super::runs::{Bed, EVERY, Ended, Verb};
use crate::common::prelude::*;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Calls of an entry point that the wide sweep lets fail, at most.
const CAP: u64 = 24;
const MEMORY: [i32; 2] = [-1, -2];

/// Answers that an entry point may give when it fails; the last is "unknown", which any may give.
fn answers(call: &str) -> Vec<i32> {
    let own: &[i32] = match call {
        "vkQueueSubmit" | "vkWaitSemaphores" | "vkGetQueryPoolResults" => &[-4],
        "vkCreateDevice" => &[-3, -4, -7, -10],
        "vkCreateInstance" => &[-3, -9],
        "vkEnumeratePhysicalDevices" => &[-3],
        "vkMapMemory" => &[-5],
        "vkAllocateMemory" => &[-10],
        "vkAllocateDescriptorSets" => &[-12, -1_000_069_000],
        _ => &[],
    };
    [own, &MEMORY, &[-13]].concat()
}

/// Of each entry point the first, the middle or the last call, in turn, with answers in turn too. [`many`] has all of them.
pub fn few(counts: &BTreeMap<String, u64>) -> Vec<(String, u64, i32)> {
    let one = |(k, (call, n)): (usize, (&String, &u64))| {
        let (place, answers) = ([1, n.div_ceil(2), *n][k % 3], answers(call));
        (call.clone(), place, answers[k / 3 % answers.len()])
    };
    counts.iter().enumerate().map(one).collect()
}

/// Calls of each entry point, evenly spread over all, each with every answer.
pub fn many(counts: &BTreeMap<String, u64>) -> Vec<(String, u64, i32)> {
    let mut all = Vec::new();
    for (call, n) in counts {
        let places = *n.min(&CAP);
        for place in 0..places {
            let at = if places == 1 { 1 } else { 1 + place * (n - 1) / (places - 1) };
            all.extend(answers(call).into_iter().map(|answer| (call.clone(), at, answer)));
        }
    }
    all
}

/// The exit code of a run with a fault.
///
/// # Errors
/// What is wrong with how it ended.
pub fn judge(ended: &Ended) -> Result<i32, String> {
    let fault = |what: String| Err(format!("{}: {what}\n{}", ended.fault, ended.told));
    if ended.timed_out {
        return fault("did not end".to_owned());
    }
    let Some(code) = ended.code else { return fault("ended by a signal".to_owned()) };
    if ended.was_given == Some(false) {
        return fault("the call was not reached".to_owned());
    }
    if ![0, 4, 5].contains(&code) {
        return fault(format!("exit {code}"));
    }
    let says = ended.told.lines().any(|line| line.starts_with("ivv: ") && line.len() > 30);
    if code != 0 && !says {
        return fault(format!("exit {code} without a message"));
    }
    if let Some(empty) = ["needs 0", "``"].into_iter().find(|empty| ended.told.contains(empty)) {
        return fault(format!("the message has an empty place: {empty}"));
    }
    Ok(code)
}

/// Lets each of the calls that `choose` picks fail in a run of its own, two runs at a time. Each `resumed`-th training that
/// failed is resumed.
pub fn sweep(
    bed: &Bed,
    verb: Verb,
    choose: impl Fn(&BTreeMap<String, u64>) -> Vec<(String, u64, i32)>,
    resumed: usize,
) -> Figures {
    let plain = &bed.run(verb, None);
    assert_eq!(plain.code, Some(0), "{}", plain.told);
    assert!(plain.counts.len() > 15 && !plain.written.is_empty(), "{:?}", plain.counts);
    if verb == Verb::Train {
        assert!(plain.written == bed.trained().written && plain.counts == *bed.counts(), "two runs are equal");
    }
    let all = choose(&plain.counts);
    let (next, figures, faults) = (AtomicUsize::new(0), Mutex::new(Figures::default()), Mutex::new(Vec::new()));
    std::thread::scope(|scope| {
        for _ in 0..2 {
            scope.spawn(|| {
                loop {
                    let index = next.fetch_add(1, Ordering::Relaxed);
                    let Some((call, n, answer)) = all.get(index) else { break };
                    match one(bed, verb, plain, &format!("{call}:{n}:{answer}"), index.is_multiple_of(resumed)) {
                        Ok(code) => figures.lock().unwrap().count(call, code),
                        Err(fault) => faults.lock().unwrap().push(fault),
                    }
                }
            });
        }
    });
    let faults = faults.into_inner().unwrap();
    assert!(faults.is_empty(), "{} of {} faults:\n{}", faults.len(), all.len(), faults.join("\n"));
    let figures = figures.into_inner().unwrap();
    assert_eq!(figures.faults(), all.len());
    figures
}

/// One run with a fault: how it ended, what it wrote and what it left.
fn one(bed: &Bed, verb: Verb, plain: &Ended, fault: &str, is_resumed: bool) -> Result<i32, String> {
    let ended = bed.run(verb, Some(fault));
    let code = judge(&ended)?;
    let wrong = |what: &str| Err(format!("{fault}: exit {code}, {what}\n{}", ended.told));
    if code == 0 && ended.written != plain.written {
        return wrong("but other results");
    }
    let is_whole = ended.written.iter().all(|(name, bytes)| plain.written.get(name) == Some(bytes));
    if !is_whole {
        return wrong("and a file that the undisturbed run did not write so");
    }
    if verb == Verb::Train && code != 0 {
        if let Some(stopped) = ended.stopped_after() {
            let Some(left) = ended.checkpoint else {
                // Before the first checkpoint there is no step that could be lost.
                return if stopped == 0 { Ok(code) } else { wrong("steps but no checkpoint") };
            };
            if !(left..=left + EVERY).contains(&stopped) {
                return wrong("and an old checkpoint");
            }
            let is_alive = !ended.told.contains("the device was lost");
            if is_alive && left != stopped {
                return wrong("the device is there, and the last step is not kept");
            }
        }
        if is_resumed && ended.checkpoint.is_some() {
            bed.resume_and_compare(&ended);
        }
    }
    let _ = std::fs::remove_dir_all(&ended.folder);
    Ok(code)
}
