//! The one device of a test run, watched by the validation layer. Lanes choose it through the environment:
//! `IVV_TEST_DEVICE`, `IVV_TEST_NO_PUSH_DESCRIPTORS`, `IVV_TEST_SYNC_VALIDATION`, `IVV_TEST_REWRITE`, and the drivers' own
//! variables.

use crate::adversary;
use crate::common::notes::skip;
use ivv::internals::gpu::{COUNTS, Gpu, Options, Rewrite};
use ivv::internals::vk::{DeviceChoice, DeviceKind};
use ivv_conformance::Bench;
use std::cell::RefCell;
use std::sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError};

/// The device for the length of a test; at its end the validation layer must have been silent.
///
/// One thread at a time has it: layer 1.3.239 crashes in vkFreeCommandBuffers when two threads record and free at once
/// (4 of 6 runs with it, 0 of 10 without). A thread may have it several times over.
pub struct Watched(Arc<Gpu>);

/// How often this thread has the device, and the lock while it does.
struct Turn {
    depth: usize,
    lock: Option<MutexGuard<'static, ()>>,
}

static TURNS: Mutex<()> = Mutex::new(());

thread_local! {
    static TURN: RefCell<Turn> = const { RefCell::new(Turn { depth: 0, lock: None }) };
}

impl std::ops::Deref for Watched {
    type Target = Arc<Gpu>;
    fn deref(&self) -> &Arc<Gpu> {
        &self.0
    }
}

impl Drop for Watched {
    fn drop(&mut self) {
        let messages = self.0.device().validation().messages();
        // A lost device tells nothing any more.
        let outside = self.0.counted().unwrap_or_default();
        let mut left = Vec::new();
        TURN.with_borrow_mut(|turn| {
            turn.depth -= 1;
            if turn.depth == 0 {
                let is_left = |(name, bytes): &(String, u64)| *bytes > 0 && name != COUNTS;
                left.extend(self.0.device().memory().0.into_iter().filter(is_left));
                turn.lock = None;
            }
        });
        if !std::thread::panicking() {
            assert_eq!(messages, Vec::<String>::new(), "the validation layer spoke");
            assert_eq!(outside, [], "kernels read or wrote past the end of a buffer, so often");
            assert_eq!(left, [], "buffers outlive the turn: hold the device until they are gone");
        }
    }
}

/// The device of this lane, with validation on and new buffers poisoned.
pub fn gpu() -> Watched {
    static GPU: OnceLock<Arc<Gpu>> = OnceLock::new();
    take_turn();
    Watched(GPU.get_or_init(|| open(&options())).clone())
}

/// The device, if it has timestamps; a skip is noted where it has none.
#[track_caller]
pub fn timed() -> Option<Watched> {
    let gpu = gpu();
    if gpu.caps().timestamp_ns == 0.0 {
        skip("the device has no timestamps");
        return None;
    }
    Some(gpu)
}

/// The device of this lane, taken for a GPU: its kernels have the shapes for GPUs, and subgroups of the device's own width.
pub fn as_gpu() -> Watched {
    static GPU: OnceLock<Arc<Gpu>> = OnceLock::new();
    let own = gpu();
    if own.caps().kind != DeviceKind::Cpu {
        return own;
    }
    let plain = Rewrite { subgroup_size: None, spirv: |kernel| kernel.spirv.to_vec() };
    let rewrite = Rewrite { subgroup_size: Some(own.caps().subgroup_size), ..adversary::rewrite().unwrap_or(plain) };
    take_turn();
    Watched(GPU.get_or_init(|| open(&Options { rewrite: Some(rewrite), ..options() })).clone())
}

/// A device of its own, opened as the lane's, whose kernels are `rewrite`'s.
pub fn rewritten(rewrite: Rewrite) -> Watched {
    opened(&Options { rewrite: Some(rewrite), ..options() })
}

pub fn opened(options: &Options) -> Watched {
    take_turn();
    Watched(open(options))
}

fn open(options: &Options) -> Arc<Gpu> {
    Arc::new(Gpu::open(options).expect("a Vulkan device and the validation layer"))
}

fn take_turn() {
    TURN.with_borrow_mut(|turn| {
        turn.depth += 1;
        if turn.lock.is_none() {
            // A test that failed with the lock leaves nothing half done.
            turn.lock = Some(TURNS.lock().unwrap_or_else(PoisonError::into_inner));
        }
    });
}

/// How this lane opens its device.
pub fn options() -> Options {
    Options {
        device: DeviceChoice {
            device: std::env::var("IVV_TEST_DEVICE").ok(),
            nth: 0,
            validation: true,
            sync_validation: is_set("IVV_TEST_SYNC_VALIDATION"),
            no_push_descriptors: is_set("IVV_TEST_NO_PUSH_DESCRIPTORS"),
            breadcrumbs: true,
            pipeline_cache: None,
            subgroup_size: None,
            surface: Vec::new(),
        },
        poison: true,
        rewrite: adversary::rewrite(),
        reversed: adversary::reversed(),
        counts: adversary::counts(),
        stands_in: None,
    }
}

/// Calls `run` with the bench of rows on this device, which runs the cases that take minutes where they are asked for.
pub fn bench<T>(slow: bool, run: impl FnOnce(&Bench) -> T) -> T {
    run(&Bench { lend: &|| Box::new(gpu()), slow })
}

fn is_set(variable: &str) -> bool {
    std::env::var_os(variable).is_some_and(|value| value != "0")
}
