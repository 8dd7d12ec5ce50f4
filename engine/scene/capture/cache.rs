//! Streams decoded images in a known order under a byte budget.

use std::collections::{BTreeMap, HashMap};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use super::{Capture, Fault, Picture, PriorPlan, Source, picture, pixel_bytes};
use crate::error::Result;
use crate::parallel::memory;

/// Bytes of a pixel while its image is being decoded: the result and what the decoder gives; with priors.
const DECODING_BYTES: [u64; 2] = [8, 32];
/// Images that each thread may decode ahead in the place of others: no more, because an image just handed out is often the best to drop.
const AHEAD: usize = 3;
const NEVER: usize = usize::MAX;

#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Asked {
    pub camera: usize,
    pub frame: u32,
    /// Pixels along each side that become one, at most the image's shorter side, see [`Picture::reduced`].
    pub reduction: u32,
}

impl From<(usize, u32)> for Asked {
    fn from((camera, frame): (usize, u32)) -> Self {
        Asked { camera, frame, reduction: 1 }
    }
}

#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CacheStats {
    pub n_decoded: u64,
    /// Positions of the order whose image did not have to be decoded.
    pub n_hits: u64,
    /// Most bytes held at once: decoded images, and more for each one being decoded.
    pub peak_bytes: u64,
    pub waited: Duration,
    /// Summed over the threads.
    pub decoding: Duration,
}

/// Decodes the images of a capture ahead of their use, in the order of their use, on threads of its own. It holds at most `budget_bytes`,
/// or one image, beside those that the consumer holds, and drops first what is needed last (Belady). Pictures and errors come out in the
/// order that was asked for.
pub struct FrameCache {
    shared: Arc<Shared>,
    threads: Vec<JoinHandle<()>>,
}

struct Shared {
    sources: Vec<Source>,
    order: Vec<u32>,
    /// By position of the order, the next position of the same image, or [`NEVER`].
    next_use: Vec<usize>,
    budget: u64,
    /// How far ahead of the consumer images are decoded in the place of others.
    ahead: usize,
    state: Mutex<State>,
    ready: Condvar,
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
    /// Begins to decode the images of `order` with the priors that `plan` names. It fails when the capture has no such image.
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

    /// The next picture of the order, `None` after the last; waits until it is decoded. After an error the next call continues.
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

    pub fn stats(&self) -> CacheStats {
        self.shared.lock().stats
    }
}

impl Drop for FrameCache {
    fn drop(&mut self) {
        self.shared.lock().closed = true;
        self.shared.work.notify_all();
        for thread in self.threads.drain(..) {
            let _ = thread.join();
        }
    }
}

impl Shared {
    /// Nothing panics while it holds the lock, so a poisoned state is a whole one.
    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

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
                .in_scope(|| picture::decode(source).map(Arc::new));
            let took = begin.elapsed();
            state = self.lock();
            state.stats.n_decoded += 1;
            state.stats.decoding += took;
            let kept = if outcome.is_ok() { self.decoded_bytes(index) } else { 0 };
            state.bytes = state.bytes - self.decoding_bytes(index) + kept;
            state.slots.insert(index, Slot::Done(outcome));
            self.ready.notify_all();
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
                // Images needed after this one can be decoded again.
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

/// Bytes of decoded images that a run keeps by default.
pub fn share_of_memory() -> u64 {
    memory() / 4
}

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
