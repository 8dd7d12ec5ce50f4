//! Standard error, written by a thread of its own, so that a pipe that nobody reads, or a paused terminal, delays neither work nor
//! signals. The queue is bounded: it drops progress first, and other lines only if the reader takes nothing for a while.

use std::collections::VecDeque;
use std::io::{self, Write};
use std::sync::{Condvar, Mutex, MutexGuard, OnceLock, PoisonError};
use std::time::{Duration, Instant};

/// Most bytes in the queue.
const MOST_BYTES: usize = 1 << 20;
/// Bytes in the queue from which on progress is dropped.
const BUSY: usize = 1 << 12;
/// How long the reader may take nothing before writers stop waiting for it.
const PATIENCE: Duration = Duration::from_secs(2);

struct Queue {
    waiting: VecDeque<String>,
    bytes: usize,
    /// True if the thread is writing, and for so long that nobody waits for it.
    is_writing: bool,
    is_stuck: bool,
    /// Texts that were written, or could not be.
    n_done: u64,
    /// Texts that found no room.
    n_lost: u64,
}

static QUEUE: Mutex<Queue> =
    Mutex::new(Queue { waiting: VecDeque::new(), bytes: 0, is_writing: false, is_stuck: false, n_done: 0, n_lost: 0 });
static MORE: Condvar = Condvar::new();
static DONE: Condvar = Condvar::new();

fn queue() -> MutexGuard<'static, Queue> {
    QUEUE.lock().unwrap_or_else(PoisonError::into_inner)
}

pub fn put(text: String) {
    let mut queue = wait(queue(), |queue| queue.has_room(&text, MOST_BYTES));
    if queue.has_room(&text, MOST_BYTES) {
        queue.add(text);
    } else {
        queue.n_lost += 1;
    }
}

/// Queues `text`, unless the queue is long: a later line of progress follows.
pub fn put_progress(text: String) {
    let mut queue = queue();
    if queue.has_room(&text, BUSY) {
        queue.add(text);
    }
}

/// Waits until the queue is empty, but not for a reader that takes nothing.
pub fn finish() {
    drop(wait(queue(), |queue| queue.waiting.is_empty() && !queue.is_writing));
}

/// Waits until `is_met`, or until the reader takes nothing.
fn wait(mut queue: MutexGuard<'static, Queue>, is_met: impl Fn(&Queue) -> bool) -> MutexGuard<'static, Queue> {
    let (mut n_done, mut since) = (queue.n_done, Instant::now());
    while !is_met(&queue) && !queue.is_stuck {
        queue = DONE.wait_timeout(queue, PATIENCE).unwrap_or_else(PoisonError::into_inner).0;
        if queue.n_done > n_done {
            (n_done, since) = (queue.n_done, Instant::now());
        }
        queue.is_stuck = since.elapsed() >= PATIENCE;
    }
    queue
}

impl Queue {
    fn has_room(&self, text: &str, most: usize) -> bool {
        self.waiting.is_empty() || self.bytes + text.len() <= most
    }

    fn add(&mut self, text: String) {
        static HAS_THREAD: OnceLock<bool> = OnceLock::new();
        let begin = || std::thread::Builder::new().name("stderr".to_owned()).spawn(write_all).is_ok();
        if !HAS_THREAD.get_or_init(begin) {
            return write(&text);
        }
        self.bytes += text.len();
        self.waiting.push_back(text);
        MORE.notify_one();
    }
}

fn write_all() {
    let mut queue = queue();
    loop {
        let Some(mut text) = queue.waiting.pop_front() else {
            queue = MORE.wait(queue).unwrap_or_else(PoisonError::into_inner);
            continue;
        };
        queue.bytes -= text.len();
        if let (true, n @ 1..) = (queue.waiting.is_empty(), queue.n_lost) {
            text += &format!("{n} lines are missing here: nobody read them\n");
            queue.n_lost = 0;
        }
        queue.is_writing = true;
        drop(queue);
        write(&text);
        queue = self::queue();
        (queue.is_writing, queue.is_stuck) = (false, false);
        queue.n_done += 1;
        DONE.notify_all();
    }
}

/// Standard error may be closed, full or gone.
fn write(text: &str) {
    let mut to = io::stderr().lock();
    let _ = to.write_all(text.as_bytes()).and_then(|()| to.flush());
}
