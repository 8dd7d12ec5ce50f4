//! Runs a reader on damaged files: a case names a seed, one of its parts and a few changes to it.
//!
//! A case is a few numbers, so it can be shrunk, told and run again. Nothing that a reader is given may make it panic, work
//! for long or allocate much.

use super::change::{Change, changed};
use crate::common::prelude::*;
use proptest::collection::vec;
use proptest::prelude::any;
use proptest::strategy::Strategy;
use proptest::test_runner::{Config, RngAlgorithm, TestCaseError, TestError, TestRng, TestRunner};
use std::cell::RefCell;
use std::sync::Once;
use std::sync::mpsc::{RecvTimeoutError, channel};

/// Longest work on one case, seconds. A reader needs milliseconds; the machine may have much else to do.
const LONGEST_S: f64 = 20.0;
/// Most bytes that a reader may have at a time on its own thread: the seeds are of kilobytes.
const MOST_BYTES: u64 = 64 << 20;

pub type Files = BTreeMap<String, Vec<u8>>;

#[derive(Clone)]
pub struct Seed {
    /// What is changed: files, or what files are made of.
    pub parts: Files,
    /// The parts that are changed; their names begin with one of these. Empty for all.
    pub only: Vec<&'static str>,
    /// Makes the files of the parts: compresses, and mends checksums, behind which nothing would be reached.
    pub build: fn(&Files) -> Files,
    /// Reads them in the folder; whether it took them.
    pub read: fn(&Path) -> bool,
}

impl Seed {
    pub fn of(
        parts: impl IntoIterator<Item = (impl Into<String>, impl Into<Vec<u8>>)>,
        read: fn(&Path) -> bool,
    ) -> Self {
        let parts = parts.into_iter().map(|(name, bytes)| (name.into(), bytes.into())).collect();
        Seed { parts, only: Vec::new(), build: super::mend::pictures, read }
    }
}

type Case = (u16, u16, Vec<Change>);

fn cases() -> impl Strategy<Value = Case> {
    (any::<u16>(), any::<u16>(), vec(any::<Change>(), 0..5))
}

fn hex(case: &Case) -> String {
    let (seed, part, changes) = case;
    let all = changes.iter().map(|(kind, at, from, value)| format!("-{kind:x}.{at:x}.{from:x}.{value:x}"));
    format!("{seed:x}.{part:x}{}", all.collect::<String>())
}

fn case_of(text: &str) -> Option<Case> {
    let number = |text: &str| u64::from_str_radix(text, 16).ok();
    let mut fields = text.split('-').map(|field| field.split('.').map(number).collect::<Option<Vec<u64>>>());
    let [seed, part] = fields.next()??.try_into().ok()?;
    let change = |field: Option<Vec<u64>>| {
        let [kind, at, from, value] = field?.try_into().ok()?;
        Some((kind as u8, at as u32, from as u32, value))
    };
    Some((seed as u16, part as u16, fields.map(change).collect::<Option<_>>()?))
}

thread_local! {
    /// What the panic of this thread said, while it is asked for.
    static SAID: RefCell<Option<String>> = const { RefCell::new(None) };
}

/// Runs `run`; what a panic says comes back and is not printed, as hundreds of them are looked at to find the smallest.
fn quietly<T>(run: impl FnOnce() -> T) -> Result<T, String> {
    static HOOK: Once = Once::new();
    HOOK.call_once(|| {
        let before = std::panic::take_hook();
        std::panic::set_hook(Box::new(move |panic| {
            let is_asked = SAID.with_borrow_mut(|said| said.as_mut().map(|said| *said = panic.to_string()).is_some());
            if !is_asked {
                before(panic);
            }
        }));
    });
    SAID.set(Some(String::new()));
    let outcome = std::panic::catch_unwind(std::panic::AssertUnwindSafe(run));
    let said = SAID.take().unwrap_or_default();
    outcome.map_err(|_| said)
}

#[derive(Clone, Copy, Default)]
struct Figures {
    executions: u64,
    taken: u64,
    most_bytes: u64,
    longest_s: f64,
}

/// The folder that the seeds' files lie in, with the files that it has now.
struct Bench {
    folder: PathBuf,
    seeds: Vec<Seed>,
    at: RefCell<(usize, Files)>,
    figures: RefCell<Figures>,
}

impl Bench {
    fn new(folder: PathBuf, seeds: Vec<Seed>) -> Self {
        Bench { folder, seeds, at: RefCell::new((usize::MAX, Files::new())), figures: RefCell::default() }
    }

    fn built(&self, (seed, part, changes): &Case) -> (usize, Files) {
        let index = usize::from(*seed) % self.seeds.len();
        let Seed { parts, only, build, .. } = &self.seeds[index];
        let is_changed = |name: &&String| only.is_empty() || only.iter().any(|prefix| name.starts_with(prefix));
        let names: Vec<&String> = parts.keys().filter(is_changed).collect();
        let name = names[usize::from(*part) % names.len()];
        let mut parts = parts.clone();
        if let Some(bytes) = parts.get_mut(name) {
            *bytes = changes.iter().fold(std::mem::take(bytes), changed);
        }
        (index, build(&parts))
    }

    /// Lays the files of a case and reads them. They stay: what is there after a crash is what was read.
    fn execute(&self, case: &Case) -> Result<(), TestCaseError> {
        let (index, files) = self.built(case);
        {
            let mut at = self.at.borrow_mut();
            if at.0 != index {
                let _ = std::fs::remove_dir_all(&self.folder);
                *at = (index, Files::new());
            }
            for (name, bytes) in &files {
                if at.1.get(name) != Some(bytes) {
                    let path = self.folder.join(name);
                    std::fs::create_dir_all(path.parent().unwrap()).unwrap();
                    std::fs::write(path, bytes).unwrap();
                }
            }
            at.1 = files;
        }
        let (read, begun) = (self.seeds[index].read, Instant::now());
        let mut outcome = Ok(false);
        // The panic is caught inside: the counter cannot be unwound.
        let bytes = allocation_counter::measure(|| outcome = quietly(|| read(&self.folder))).bytes_max;
        let is_taken = outcome.map_err(|said| TestCaseError::fail(format!("a panic: {said}")))?;
        let mut figures = self.figures.borrow_mut();
        figures.executions += 1;
        figures.taken += u64::from(is_taken);
        figures.most_bytes = figures.most_bytes.max(bytes);
        figures.longest_s = figures.longest_s.max(begun.elapsed().as_secs_f64());
        if bytes > MOST_BYTES {
            return Err(TestCaseError::fail(format!("{bytes} bytes were allocated at a time")));
        }
        Ok(())
    }
}

/// Runs so many cases, or cases for this format's part of IVV_FUZZ_SECONDS; or the one of IVV_FUZZ_REPLAY.
pub fn fuzz(name: &'static str, n: u32, n_formats: usize, seeds: Vec<Seed>) {
    let folder = crate::common::folder::in_memory().join(format!("ivv-fuzz-{name}-{}", std::process::id()));
    if let Ok(text) = std::env::var("IVV_FUZZ_REPLAY") {
        let Some((_, case)) = text.split_once(':').filter(|(format, _)| *format == name) else { return };
        let case = case_of(case).expect("IVV_FUZZ_REPLAY is FORMAT:CASE, as a failure tells it");
        return Bench::new(folder, seeds).execute(&case).unwrap();
    }
    let seconds: Option<f64> = std::env::var("IVV_FUZZ_SECONDS").ok().map(|text| text.parse().expect("seconds"));
    let threads = std::thread::available_parallelism().map_or(1, std::num::NonZero::get);
    let until = seconds.map(|s| Instant::now() + Duration::from_secs_f64(s * threads as f64 / n_formats as f64));
    // What is worked on, for whoever watches.
    let current: Arc<Mutex<Option<(Instant, Case)>>> = Arc::default();
    let (watched, to, at) = (current.clone(), channel(), folder.clone());
    let (done, ended) = to;
    std::thread::spawn(move || {
        let outcome =
            std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| run(&Bench::new(at, seeds), n, until, &watched)));
        let _ = done.send(outcome);
    });
    let outcome = loop {
        match ended.recv_timeout(Duration::from_millis(100)) {
            Ok(outcome) => break outcome,
            Err(RecvTimeoutError::Disconnected) => panic!("{name}: the thread of the cases ended"),
            Err(RecvTimeoutError::Timeout) => {
                let is_long = |(begun, _): &(Instant, Case)| begun.elapsed().as_secs_f64() > LONGEST_S;
                let long = current.lock().unwrap().clone().filter(is_long);
                if let Some((_, case)) = long {
                    let (case, folder) = (hex(&case), folder.display());
                    panic!(
                        "{name}: no end after {LONGEST_S} s\nagain: IVV_FUZZ_REPLAY={name}:{case}\nfiles in {folder}"
                    );
                }
            }
        }
    };
    match outcome {
        Err(cause) => std::panic::resume_unwind(cause),
        Ok(Err((reason, case, bytes))) => panic!(
            "{name}: {reason}\nagain: IVV_FUZZ_REPLAY={name}:{}\nfiles in {}; what was changed, as hex: {bytes}",
            hex(&case),
            folder.display()
        ),
        Ok(Ok(Figures { executions, taken, most_bytes, longest_s })) => {
            println!(
                "{name:<20} {executions:>9} executions, {taken:>9} read without a fault, {:>6} KiB at most, {:>5.0} ms at most",
                most_bytes >> 10,
                1e3 * longest_s
            );
            assert!(taken > 0, "{name}: no seed was read");
            std::fs::remove_dir_all(folder).unwrap();
        }
    }
}

type Failure = (String, Case, String);

fn run(
    bench: &Bench,
    n: u32,
    until: Option<Instant>,
    current: &Mutex<Option<(Instant, Case)>>,
) -> Result<Figures, Failure> {
    for index in 0..bench.seeds.len() as u16 {
        // A seed that is not taken reaches nothing.
        let before = bench.figures.borrow().taken;
        let failed = bench.execute(&(index, 0, Vec::new())).err();
        let case = (index, 0, Vec::new());
        if failed.is_some() || bench.figures.borrow().taken == before {
            return Err((format!("the seed {index} itself is refused: {failed:?}"), case, String::new()));
        }
    }
    let mut round = 0u64;
    loop {
        // The default suite has always the same cases; a longer run goes on from them.
        let mut seed = [7; 32];
        seed[..8].copy_from_slice(&round.to_le_bytes());
        let config = Config { cases: n, failure_persistence: None, max_shrink_iters: 400, ..Config::default() };
        let mut runner = TestRunner::new_with_rng(config, TestRng::from_seed(RngAlgorithm::ChaCha, &seed));
        let outcome = runner.run(&cases(), |case| {
            *current.lock().unwrap() = Some((Instant::now(), case.clone()));
            let outcome = bench.execute(&case);
            *current.lock().unwrap() = None;
            outcome
        });
        match outcome {
            Ok(()) => {}
            Err(TestError::Fail(reason, case)) => {
                let (index, files) = bench.built(&case);
                let good = (bench.seeds[index].build)(&bench.seeds[index].parts);
                let bytes = files.iter().find(|(name, bytes)| good.get(*name) != Some(bytes)).map(|(_, bytes)| bytes);
                let bytes = bytes.into_iter().flatten().take(4096).map(|byte| format!("{byte:02x}")).collect();
                return Err((reason.to_string(), case, bytes));
            }
            Err(TestError::Abort(reason)) => return Err((reason.to_string(), (0, 0, Vec::new()), String::new())),
        }
        round += 1;
        if until.is_none_or(|until| Instant::now() >= until) {
            return Ok(*bench.figures.borrow());
        }
    }
}

#[test]
fn a_case_is_told_and_given_again() {
    let case: Case = (3, 65_535, vec![(255, 0, u32::MAX, u64::MAX), (0, 1, 2, 3)]);
    assert_eq!(case_of(&hex(&case)), Some(case));
    assert_eq!(case_of("3.g"), None);
}

/// The control: a reader that panics at half of the values of one byte, and one that believes a count.
#[test]
fn a_panic_and_an_allocation_are_found_and_shrunk() {
    let message = |read: fn(&Path) -> bool| {
        let seeds = vec![Seed::of([("a.bin", vec![1u8; 40])], read)];
        let found = quietly(|| fuzz("control", 5000, 1, seeds)).expect_err("it is found");
        let folder = crate::common::folder::in_memory().join(format!("ivv-fuzz-control-{}", std::process::id()));
        std::fs::remove_dir_all(folder).unwrap();
        found
    };
    let panics = message(|folder| {
        let bytes = std::fs::read(folder.join("a.bin")).unwrap();
        assert!(bytes.get(3).is_none_or(|byte| *byte < 128), "byte 3");
        true
    });
    assert!(panics.contains("byte 3") && panics.contains("IVV_FUZZ_REPLAY=control:"), "{panics}");
    // Few changes are left of several.
    let changes = panics.split("control:").nth(2).unwrap().lines().next().unwrap().matches('-').count();
    assert!((1..=2).contains(&changes), "{panics}");
    let greedy = message(|folder| {
        let bytes = std::fs::read(folder.join("a.bin")).unwrap();
        let n = bytes.first().map_or(0, |n| usize::from(*n) << 20);
        std::hint::black_box(vec![0u8; n]);
        true
    });
    assert!(greedy.contains("bytes were allocated"), "{greedy}");
}
