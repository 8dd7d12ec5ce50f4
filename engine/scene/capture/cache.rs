//! Streams decoded images in a known order under a byte budget.

use std::collections::{BTreeMap, HashMap};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use super::opened::Capture;
use super::picture::{Picture, Source, decode_or_fault, pixel_bytes};
use super::priors::PriorPlan;
use super::report::Fault;
use crate::error::Result;
use crate::parallel::memory;

/// Bytes of a pixel while its image is being decoded: the result and what the decoder gives; with priors.
const DECODING_BYTES: [u64; 2] = [8, 32];
/// Images that each thread may decode ahead by making others leave: no more, because an image just handed back is often the best to leave.
const AHEAD: usize = 3;
const NEVER: usize = usize::MAX;

/// An image of the order of a [`FrameCache`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Asked {
    /// Index of its camera.
    pub camera: usize,
    /// Its frame.
    pub frame: u32,
    /// Pixels along each side that become one, see [`Picture::reduced`]; at most the image's shorter side is taken.
    pub reduction: u32,
}

impl From<(usize, u32)> for Asked {
    fn from((camera, frame): (usize, u32)) -> Self {
        Asked { camera, frame, reduction: 1 }
    }
}

/// Counts of a [`FrameCache`].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CacheStats {
    /// Images decoded.
    pub n_decoded: u64,
    /// Positions of the order for which no image had to be decoded again.
    pub n_hits: u64,
    /// Most bytes held at once: decoded images, and more for each one being decoded.
    pub peak_bytes: u64,
    /// How long [`FrameCache::next_picture`] has waited in all.
    pub waited: Duration,
    /// How long the threads have decoded, summed over them.
    pub decoding: Duration,
}

/// Decodes the images of a capture ahead of their use, in the order of their use, on threads of its own.
///
/// At most `budget_bytes` are held, or one image when the budget is smaller; images that the consumer still holds come on top. The one
/// needed last (Belady) leaves first. Pictures and errors come out in the order that was asked for, the same for any budget and threads.
pub struct FrameCache {
    shared: Arc<Shared>,
    threads: Vec<JoinHandle<()>>,
}

struct Shared {
    sources: Vec<Source>,
    order: Vec<u32>,
    /// For each position of the order, the next position of the same image, or [`NEVER`].
    next_use: Vec<usize>,
    budget: u64,
    /// How far ahead of the consumer images are decoded in the place of others.
    ahead: usize,
    state: Mutex<State>,
    /// A decoded image, for the consumer.
    ready: Condvar,
    /// Room or the end, for the threads.
    work: Condvar,
}

#[derive(Default)]
struct State {
    consumed: usize,
    /// Positions whose image is there or being decoded.
    planned: usize,
    slots: HashMap<u32, Slot>,
    /// The images of `slots` by the position that needs them next.
    by_need: BTreeMap<usize, u32>,
    bytes: u64,
    closed: bool,
    stats: CacheStats,
}

enum Slot {
    Decoding,
    Done(std::result::Result<Arc<Picture>, Fault>),
}

impl FrameCache {
    /// Begins to decode the images of `order` with the priors that `plan` names, on `n_threads` threads (at least one).
    ///
    /// # Errors
    /// `Error::Data` when the capture has no such image.
    pub fn new(
        capture: &Capture,
        order: impl IntoIterator<Item: Into<Asked>>,
        plan: &PriorPlan,
        budget_bytes: u64,
        n_threads: usize,
    ) -> Result<FrameCache> {
        let mut sources = Vec::new();
        let mut known = HashMap::new();
        let mut indices = Vec::new();
        for asked in order {
            let asked: Asked = asked.into();
            let next = sources.len() as u32;
            let index = *known.entry(asked).or_insert(next);
            if index == next {
                let source = capture.source(asked.camera, asked.frame, plan)?;
                let reduction = asked.reduction.min(source.width).min(source.height);
                sources.push(Source { reduction, ..source });
            }
            indices.push(index);
        }
        let mut next_use = vec![NEVER; indices.len()];
        let mut later = vec![NEVER; sources.len()];
        for (position, index) in indices.iter().enumerate().rev() {
            next_use[position] = std::mem::replace(&mut later[*index as usize], position);
        }
        let shared = Arc::new(Shared {
            sources,
            order: indices,
            next_use,
            budget: budget_bytes,
            ahead: AHEAD * n_threads.max(1),
            state: Mutex::default(),
            ready: Condvar::new(),
            work: Condvar::new(),
        });
        let spawn = |_| {
            let shared = Arc::clone(&shared);
            std::thread::spawn(move || shared.decode_all())
        };
        let threads = (0..n_threads.max(1)).map(spawn).collect();
        Ok(FrameCache { shared, threads })
    }

    /// The next picture of the order; waits for it when it is not decoded yet. `None` after the last.
    ///
    /// # Errors
    /// `Error::Data` naming the image or mask that is missing, does not decode or has another size than its camera. The
    /// next call continues with the next picture.
    pub fn next_picture(&mut self) -> Option<Result<Arc<Picture>>> {
        let shared = &*self.shared;
        let mut state = shared.lock();
        let position = state.consumed;
        let index = *shared.order.get(position)?;
        let _waiting = tracing::debug_span!("wait", what = %"image").entered();
        let begin = Instant::now();
        let outcome = loop {
            match state.slots.get(&index) {
                Some(Slot::Done(outcome)) => break outcome.clone(),
                _ => state = shared.ready.wait(state).unwrap_or_else(PoisonError::into_inner),
            }
        };
        state.stats.waited += begin.elapsed();
        state.consumed += 1;
        state.by_need.remove(&position);
        let next = shared.next_use[position];
        if next == NEVER {
            state.remove(index, shared.decoded_bytes(index));
        } else {
            state.by_need.insert(next, index);
        }
        shared.work.notify_all();
        Some(outcome.map_err(Into::into))
    }

    /// Counts so far.
    pub fn stats(&self) -> CacheStats {
        self.shared.lock().stats
    }
}

impl Drop for FrameCache {
    fn drop(&mut self) {
        self.shared.lock().closed = true;
        self.shared.work.notify_all();
        for thread in self.threads.drain(..) {
            // A thread that panicked has reported it; there is nothing to save here.
            let _ = thread.join();
        }
    }
}

impl Shared {
    /// Nothing panics while it holds the lock, so a poisoned state is a whole one.
    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Of an image whose sides are divided by so much.
    fn pixels(&self, index: u32, reduction: u32) -> u64 {
        let source = &self.sources[index as usize];
        u64::from(source.width / reduction) * u64::from(source.height / reduction)
    }

    fn decoded_bytes(&self, index: u32) -> u64 {
        let Source { priors, reduction, .. } = &self.sources[index as usize];
        pixel_bytes(priors.depth.is_some(), priors.flow.is_some()) * self.pixels(index, *reduction)
    }

    fn decoding_bytes(&self, index: u32) -> u64 {
        let has_priors = !self.sources[index as usize].priors.is_empty();
        DECODING_BYTES[usize::from(has_priors)] * self.pixels(index, 1)
    }

    fn decode_all(&self) {
        let mut state = self.lock();
        while !state.closed && state.planned < self.order.len() {
            let Some(index) = self.plan(&mut state) else {
                state = self.work.wait(state).unwrap_or_else(PoisonError::into_inner);
                continue;
            };
            drop(state);
            let begin = Instant::now();
            let source = &self.sources[index as usize];
            let outcome = tracing::debug_span!("decode", image = %source.image.display())
                .in_scope(|| decode_or_fault(source).map(Arc::new));
            let took = begin.elapsed();
            state = self.lock();
            state.stats.n_decoded += 1;
            state.stats.decoding += took;
            let kept = if outcome.is_ok() { self.decoded_bytes(index) } else { 0 };
            state.bytes = state.bytes - self.decoding_bytes(index) + kept;
            state.slots.insert(index, Slot::Done(outcome));
            self.ready.notify_all();
            // The bytes of decoding are free now, so another thread may have room.
            self.work.notify_all();
        }
    }

    /// The image to decode next, with its bytes taken; `None` when there is no room yet or nothing is left.
    fn plan(&self, state: &mut State) -> Option<u32> {
        while let Some(&index) = self.order.get(state.planned) {
            if state.slots.contains_key(&index) {
                state.stats.n_hits += 1;
                state.planned += 1;
                continue;
            }
            let bytes = self.decoding_bytes(index);
            while state.bytes > 0 && state.bytes + bytes > self.budget {
                if state.planned - state.consumed >= self.ahead {
                    return None;
                }
                // Images needed before this one are still to be handed out; those after it can be decoded again.
                let (&need, &victim) = state.by_need.last_key_value().filter(|&(&need, _)| need > state.planned)?;
                state.by_need.remove(&need);
                state.remove(victim, self.decoded_bytes(victim));
            }
            state.by_need.insert(state.planned, index);
            state.planned += 1;
            state.bytes += bytes;
            state.stats.peak_bytes = state.stats.peak_bytes.max(state.bytes);
            state.slots.insert(index, Slot::Decoding);
            return Some(index);
        }
        None
    }
}

/// Bytes of decoded images that a run keeps by default: a quarter of the [`memory`].
pub fn share_of_memory() -> u64 {
    memory() / 4
}

/// Bytes of all training images of `capture`, decoded; each with priors of the depth and of the flow where that is asked for.
pub fn decoded_bytes(capture: &Capture, has_depth: bool, has_flow: bool) -> u64 {
    let pixels = |(camera, _): (usize, u32)| capture.cameras[camera].intrinsics.n_pixels();
    pixel_bytes(has_depth, has_flow) * capture.training_frames().into_iter().map(pixels).sum::<u64>()
}

impl State {
    fn remove(&mut self, index: u32, bytes: u64) {
        if let Some(Slot::Done(Ok(_))) = self.slots.remove(&index) {
            self.bytes -= bytes;
        }
    }
}
