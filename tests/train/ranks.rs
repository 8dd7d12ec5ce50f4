//! Steps on several images, by one process or by several that share them.

use super::Tiny;
use crate::common::device::options;
use crate::common::prelude::*;
use ivv::internals::error::{Error, Result};
use ivv::internals::gpu::{Gpu, Options};
use ivv::internals::train::{Ranks, StepReport};
use ivv::internals::vk::DeviceChoice;
use std::sync::{Condvar, PoisonError};

const STEPS: u64 = 24;

/// What a thread waits for another at most.
const PATIENCE: Duration = Duration::from_secs(300);

#[derive(Default)]
struct Table {
    said: Mutex<Said>,
    changed: Condvar,
}

#[derive(Default)]
struct Said {
    round: u64,
    now: Vec<Option<Vec<u8>>>,
    before: Vec<Vec<u8>>,
}

struct Seat {
    table: Arc<Table>,
    rank: usize,
    size: usize,
}

impl Seat {
    fn all(size: usize) -> Vec<Arc<dyn Ranks>> {
        let table = Arc::new(Table::default());
        table.said.lock().unwrap().now.resize(size, None);
        (0..size).map(|rank| Arc::new(Seat { table: table.clone(), rank, size }) as Arc<dyn Ranks>).collect()
    }

    fn exchange(&self, own: &[u8]) -> Result<Vec<Vec<u8>>> {
        let mut said = self.table.said.lock().unwrap_or_else(PoisonError::into_inner);
        let round = said.round;
        said.now[self.rank] = Some(own.to_vec());
        if said.now.iter().all(Option::is_some) {
            said.before = said.now.iter_mut().filter_map(Option::take).collect();
            said.round += 1;
            self.table.changed.notify_all();
        }
        while said.round == round {
            let (next, waited) = self.table.changed.wait_timeout(said, PATIENCE).unwrap();
            if waited.timed_out() {
                return Err(Error::RanksLost { reason: format!("rank {} waited in vain", self.rank) });
            }
            said = next;
        }
        Ok(said.before.clone())
    }
}

impl Ranks for Seat {
    fn rank(&self) -> usize {
        self.rank
    }

    fn size(&self) -> usize {
        self.size
    }

    fn or(&self, words: &mut [u32]) -> Result<()> {
        let all = self.exchange(bytemuck::cast_slice(words))?;
        words.fill(0);
        for other in all {
            let other: Vec<u32> = bytemuck::pod_collect_to_vec(&other);
            assert_eq!(other.len(), words.len(), "all say as much");
            words.iter_mut().zip(other).for_each(|(word, other)| *word |= other);
        }
        Ok(())
    }

    fn sum(&self, numbers: &mut [i64]) -> Result<()> {
        let all = self.exchange(bytemuck::cast_slice(numbers))?;
        numbers.fill(0);
        for other in all {
            let other: Vec<i64> = bytemuck::pod_collect_to_vec(&other);
            assert_eq!(other.len(), numbers.len(), "all say as much");
            numbers.iter_mut().zip(other).for_each(|(number, other)| *number = number.wrapping_add(other));
        }
        Ok(())
    }

    fn gather(&self, own: &[u8]) -> Result<Vec<u8>> {
        Ok(self.exchange(own)?.concat())
    }
}

/// A run in which all is learnt and due that can be.
fn config() -> Config {
    Config {
        batch: 4,
        sh_degree: 1,
        steps: STEPS,
        max_gaussians: 2_000,
        poses: PoseKind::Learnt,
        grids: GridKind::Bilateral,
        average: 0.2,
        ..exact()
    }
}

/// What a run leaves: the scene, the state of all that is learnt, and its reports.
struct End {
    splats: Splats,
    checkpoint: Checkpoint,
    reports: Vec<StepReport>,
}

impl PartialEq for End {
    fn eq(&self, other: &Self) -> bool {
        self.splats == other.splats
            && self.checkpoint == other.checkpoint
            && self
                .reports
                .iter()
                .map(|report| format!("{report:?}"))
                .eq(other.reports.iter().map(|r| format!("{r:?}")))
    }
}

fn end(mut session: Session) -> End {
    while session.step().unwrap() {}
    let checkpoint = session.checkpoint().unwrap();
    let splats = session.finish().unwrap();
    let report = |event| if let Event::Step(report) = event { Some(report) } else { None };
    End { splats, checkpoint, reports: session.take_events().into_iter().filter_map(report).collect() }
}

/// A device of a thread's own, without the validation layer, which two threads at once would crash.
fn own_device() -> Arc<Gpu> {
    let lane = options();
    let device = DeviceChoice { validation: false, sync_validation: false, ..lane.device };
    Arc::new(Gpu::open(&Options { device, ..lane }).unwrap())
}

/// The run of so many processes, from `checkpoint` on where there is one, as each of them has it.
fn shared(tiny: &Tiny, config: &Config, size: usize, checkpoint: Option<&Checkpoint>) -> Vec<End> {
    let run = |ranks: Arc<dyn Ranks>| {
        let options = SessionOptions { ranks: Some(ranks), ..SessionOptions::default() };
        let session = match checkpoint {
            Some(checkpoint) => Session::resume(own_device(), &tiny.capture, checkpoint, options),
            None => Session::begin(own_device(), &tiny.capture, config.clone(), options),
        };
        end(session.unwrap())
    };
    let run = &run;
    std::thread::scope(|scope| {
        let seats = Seat::all(size).into_iter();
        let threads: Vec<_> = seats.map(|ranks| scope.spawn(move || run(ranks))).collect();
        threads.into_iter().map(|thread| thread.join().unwrap()).collect()
    })
}

/// A run of one process, and the same in its middle. Made once: whoever asks holds the device.
struct Whole {
    tiny: Tiny,
    end: End,
    middle: Checkpoint,
}

fn whole() -> &'static Whole {
    static WHOLE: OnceLock<Whole> = OnceLock::new();
    WHOLE.get_or_init(|| {
        let tiny = Tiny::kept("ranks");
        let mut session = Session::begin(gpu().clone(), &tiny.capture, config(), SessionOptions::default()).unwrap();
        while session.steps() < 10 {
            session.step().unwrap();
        }
        let middle = session.checkpoint().unwrap();
        let end = end(session);
        Whole { tiny, end, middle }
    })
}

#[test]
fn one_two_and_four_processes_leave_the_same_bits_and_each_goes_on_where_others_were() {
    let _device = gpu();
    let Whole { tiny, end: alone, middle } = whole();
    assert_eq!(alone.reports.len() as u64, STEPS);
    assert!(alone.reports.iter().all(|report| report.loss.is_finite() && report.visible > 0));
    for size in [2, 4] {
        for (rank, end) in shared(tiny, &config(), size, None).into_iter().enumerate() {
            assert!(end == *alone, "rank {rank} of {size}");
        }
    }
    // Two processes go on from where one was, in the middle of the run.
    for end in shared(tiny, &config(), 2, Some(middle)) {
        assert_same_splats("resumed by two", &end.splats, &alone.splats);
    }
}

/// One process that others leave after so many exchanges.
struct Alone(Mutex<u32>);

impl Ranks for Alone {
    fn rank(&self) -> usize {
        0
    }

    fn size(&self) -> usize {
        1
    }

    fn or(&self, _: &mut [u32]) -> Result<()> {
        let mut left = self.0.lock().unwrap();
        *left = left.checked_sub(1).ok_or_else(|| Error::RanksLost { reason: "they are gone".to_owned() })?;
        Ok(())
    }

    fn sum(&self, _: &mut [i64]) -> Result<()> {
        Ok(())
    }

    fn gather(&self, own: &[u8]) -> Result<Vec<u8>> {
        Ok(own.to_vec())
    }
}

#[test]
fn a_process_that_loses_the_others_leaves_its_last_step() {
    let device = gpu();
    let Whole { tiny, end: whole, .. } = whole();
    let lost_at = |at: u32| {
        let ranks: Option<Arc<dyn Ranks>> = Some(Arc::new(Alone(Mutex::new(at))));
        let options = SessionOptions { ranks, ..SessionOptions::default() };
        let mut lost = Session::begin(device.clone(), &tiny.capture, config(), options).unwrap();
        let first = lost.trainer().checkpoint().unwrap();
        let error = loop {
            if let Err(error) = lost.step() {
                break error;
            }
        };
        assert!(matches!(error, Error::RanksLost { .. }), "{error}");
        (first, lost.rescue().unwrap())
    };
    let (first, rescued) = lost_at(0);
    assert!(rescued.step == 0 && rescued.params == first.params, "as it began");
    let (_, rescued) = lost_at(13);
    assert_eq!(rescued.step, 13);
    let resumed = Session::resume(device.clone(), &tiny.capture, &rescued, SessionOptions::default()).unwrap();
    let resumed = end(resumed);
    assert_same_splats("after 13 steps", &resumed.splats, &whole.splats);
    assert!(resumed.checkpoint == whole.checkpoint, "after 13 steps");
}

#[test]
fn a_batch_learns_and_lists_that_overflow_leave_no_trace() {
    let gpu = gpu();
    let Whole { tiny, end: whole, .. } = whole();
    let begin = |options| Session::begin(gpu.clone(), &tiny.capture, config(), options).unwrap();
    let [first, last] = [&whole.reports[..4], &whole.reports[STEPS as usize - 4..]]
        .map(|reports| reports.iter().map(|report| report.loss).sum::<f64>());
    assert!(last < 0.8 * first, "{first} to {last}");
    let mut narrow = begin(SessionOptions::default());
    narrow.trainer().limit_intersections(40);
    let mut overflowed = end(narrow);
    assert_ne!(overflowed.checkpoint.room, whole.checkpoint.room);
    overflowed.checkpoint.room = whole.checkpoint.room;
    assert!(overflowed == *whole, "after an overflow");
    let kept = SessionOptions { device_image_bytes: Some(1 << 30), ..SessionOptions::default() };
    assert!(end(begin(kept)) == *whole, "with images on the device");
}

#[test]
fn batches_pass_over_all_images_as_often_as_single_ones() {
    let config = Config { batch: 4, ..exact() };
    assert_eq!((config.total(100), exact().total(100)), (750, 3000));
    assert_eq!(Config { epochs: 1, ..config }.total(5), 2);
    let lazy = Config { batch: 2, adam: AdamMode::Lazy, ..exact() };
    assert!(lazy.check().unwrap_err().contains("batch"));
}

#[cfg(not(feature = "mpi"))]
#[test]
fn one_of_several_processes_without_mpi_says_what_it_lacks() {
    let command = |size: &str| {
        let mut command = std::process::Command::new(env!("CARGO_BIN_EXE_ivv"));
        command.args(["train", "/nowhere", "-o", "/nowhere/run"]).env("OMPI_COMM_WORLD_SIZE", size);
        command.output().unwrap()
    };
    let two = command("2");
    let told = String::from_utf8_lossy(&two.stderr).into_owned();
    assert!(!two.status.success() && told.contains("one of 2 processes"), "{told}");
    assert!(
        !String::from_utf8_lossy(&command("1").stderr).contains("processes"),
        "one process is one that was started alone"
    );
}
