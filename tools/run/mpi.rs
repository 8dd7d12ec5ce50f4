//! [`Ranks`] by MPI. A thread of its own makes the calls: if the others are gone, training can stop waiting and write a checkpoint.

use crate::ui::interrupt::Stop;
use anyhow::Context;
use ivv::internals::error::{Error, Result};
use ivv::internals::train::Ranks;
use mpi::Threading;
use mpi::collective::SystemOperation;
use mpi::topology::SimpleCommunicator;
use mpi::traits::{Communicator, CommunicatorCollectives, Equivalence};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

const POLL: Duration = Duration::from_millis(50);
/// How long to wait for the others after such a request: Open MPI kills all processes after a second.
const PATIENCE: Duration = Duration::from_millis(250);
/// Most numbers of a call: MPI counts with 31 bits.
const MOST: usize = 1 << 26;

type Job = Box<dyn FnOnce(&SimpleCommunicator) + Send>;

pub struct Mpi {
    rank: usize,
    size: usize,
    stop: Stop,
    /// `None` after the end.
    jobs: Mutex<Option<Sender<Job>>>,
    thread: Mutex<Option<JoinHandle<()>>>,
}

impl Mpi {
    pub fn begin(stop: Stop) -> anyhow::Result<Self> {
        let (jobs, todo) = channel::<Job>();
        let (answer, answers) = channel();
        let thread = std::thread::Builder::new().name("mpi".to_owned()).spawn(move || work(&todo, &answer))?;
        let (rank, size) = answers.recv().context("MPI_Init failed")?;
        Ok(Mpi { rank, size, stop, jobs: Mutex::new(Some(jobs)), thread: Mutex::new(Some(thread)) })
    }

    /// Where the result of `job` will come, which waits until all other processes make the same call; nowhere if MPI has ended.
    fn send<T: Send + 'static>(&self, job: impl FnOnce(&SimpleCommunicator) -> T + Send + 'static) -> Receiver<T> {
        let (answer, answers) = channel();
        let job: Job = Box::new(move |world| {
            // The caller may have stopped waiting.
            let _ = answer.send(job(world));
        });
        if let Some(jobs) = &*lock(&self.jobs) {
            let _ = jobs.send(job);
        }
        answers
    }

    /// The result of `job`, unless this process is asked to end while another one does not answer.
    fn ask<T: Send + 'static>(&self, job: impl FnOnce(&SimpleCommunicator) -> T + Send + 'static) -> Result<T> {
        let lost = |reason: &str| Error::RanksLost { reason: reason.to_owned() };
        let answers = self.send(job);
        let mut asked = None;
        loop {
            match answers.recv_timeout(POLL) {
                Ok(result) => return Ok(result),
                Err(RecvTimeoutError::Disconnected) => return Err(lost("MPI has ended")),
                Err(RecvTimeoutError::Timeout) => {}
            }
            if self.stop.is_asked() && asked.get_or_insert_with(Instant::now).elapsed() > PATIENCE {
                return Err(lost("this one was asked to end, and another one does not answer"));
            }
        }
    }

    fn reduce<T>(&self, numbers: &mut [T], operation: fn() -> SystemOperation) -> Result<()>
    where
        T: Copy + Default + Equivalence + Send + 'static,
    {
        for part in numbers.chunks_mut(MOST) {
            let own = part.to_vec();
            let all = self.ask(move |world| {
                let mut all = vec![T::default(); own.len()];
                world.all_reduce_into(&own[..], &mut all[..], operation());
                all
            })?;
            part.copy_from_slice(&all);
        }
        Ok(())
    }
}

fn work(todo: &Receiver<Job>, answer: &Sender<(usize, usize)>) {
    let Some((universe, _)) = mpi::initialize_with_threading(Threading::Funneled) else { return };
    let world = universe.world();
    if answer.send((world.rank() as usize, world.size() as usize)).is_ok() {
        todo.iter().for_each(|job| job(&world));
    }
}

impl Ranks for Mpi {
    fn rank(&self) -> usize {
        self.rank
    }

    fn size(&self) -> usize {
        self.size
    }

    fn or(&self, words: &mut [u32]) -> Result<()> {
        self.reduce(words, SystemOperation::bitwise_or)
    }

    fn sum(&self, numbers: &mut [i64]) -> Result<()> {
        self.reduce(numbers, SystemOperation::sum)
    }

    fn gather(&self, own: &[u8]) -> Result<Vec<u8>> {
        let (own, size) = (own.to_vec(), self.size);
        self.ask(move |world| {
            let mut all = vec![0; own.len() * size];
            world.all_gather_into(&own[..], &mut all[..]);
            all
        })
    }

    fn meet(&self) {
        // If MPI has ended there is nobody to wait for.
        let _ = self.send(|world| world.barrier()).recv();
    }

    fn finish(&self) {
        // The closed channel ends the thread, which leaves MPI when all others do.
        lock(&self.jobs).take();
        let thread = lock(&self.thread).take();
        thread.map(JoinHandle::join);
    }
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
