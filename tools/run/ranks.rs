//! The processes of one training, started together by `mpirun` or `srun`.

use crate::ui::interrupt::Stop;
use anyhow::ensure;
use ivv::internals::error::Error;
use ivv::internals::scene::Splats;
use ivv::internals::train::{Config, Ranks, any};
use sha2::{Digest, Sha256};
use std::sync::Arc;

/// Variables of launchers for the number of processes: of Open MPI, MPICH and its kin, and Slurm for a step.
const SIZES: [&str; 3] = ["OMPI_COMM_WORLD_SIZE", "PMI_SIZE", "SLURM_STEP_NUM_TASKS"];
/// The same for the number of a process on its machine.
const LOCAL_RANKS: [&str; 4] = ["OMPI_COMM_WORLD_LOCAL_RANK", "MPI_LOCALRANKID", "PMI_LOCAL_RANK", "SLURM_LOCALID"];

/// The same for the processes of its machine. Slurm lists all machines, as in `4(x2),3`.
const LOCAL_SIZES: [&str; 3] = ["OMPI_COMM_WORLD_LOCAL_SIZE", "MPI_LOCALNRANKS", "SLURM_STEP_TASKS_PER_NODE"];

/// The processes that train one scene; empty if this one was started alone.
#[derive(Clone, Default)]
pub struct Team(Option<Arc<dyn Ranks>>);

/// The first number in the first of these variables that has one.
fn launcher_number(variables: &[&str]) -> Option<usize> {
    let first = |text: String| text.split(|c: char| !c.is_ascii_digit()).next()?.parse().ok();
    variables.iter().find_map(|name| first(std::env::var(name).ok()?))
}

pub fn local_rank() -> usize {
    launcher_number(&LOCAL_RANKS).unwrap_or(0)
}

impl Team {
    /// All processes that were started with this one. Each must call it.
    pub fn join(stop: &Stop) -> anyhow::Result<Self> {
        match launcher_number(&SIZES) {
            Some(n @ 2..) => Ok(Team(Some(join_mpi(n, stop)?))),
            _ => Ok(Team(None)),
        }
    }

    pub fn ranks(&self) -> Option<Arc<dyn Ranks>> {
        self.0.clone()
    }

    pub fn size(&self) -> usize {
        self.0.as_ref().map_or(1, |ranks| ranks.size())
    }

    /// Number of processes on this machine; all, if no launcher says.
    pub fn local_size(&self) -> usize {
        launcher_number(&LOCAL_SIZES).unwrap_or(usize::MAX).clamp(1, self.size())
    }

    /// True if this process writes the run folder.
    pub fn leads(&self) -> bool {
        self.0.as_ref().is_none_or(|ranks| ranks.rank() == 0)
    }

    pub fn any(&self, own: bool) -> ivv::Result<bool> {
        any(self.0.as_deref(), own)
    }

    /// Waits until all processes have called it.
    pub fn meet(&self) {
        if let Some(ranks) = &self.0 {
            ranks.meet();
        }
    }

    /// Leaves the other processes, after the last step.
    pub fn finish(&self) {
        if let Some(ranks) = &self.0 {
            ranks.finish();
        }
    }

    /// Refuses a batch that these processes cannot share.
    pub fn check(&self, config: &Config) -> anyhow::Result<()> {
        let (n, batch) = (self.size(), config.batch as usize);
        let above = batch.div_ceil(n) * n;
        ensure!(
            batch.is_multiple_of(n),
            "batch is {batch}, and {n} processes share the images of a step; expected a multiple of {n}: give --set batch={above}, \
             or start another number of processes"
        );
        Ok(())
    }

    /// Refuses to continue if another process has another scene than `splats` after `step`.
    pub fn agree(&self, splats: &Splats, step: u64) -> ivv::Result<()> {
        let Some(ranks) = &self.0 else { return Ok(()) };
        let own = hash(splats);
        let all = ranks.gather(&own)?;
        match all.chunks_exact(own.len()).position(|other| other != &own[..]) {
            None => Ok(()),
            Some(rank) => Err(Error::RanksLost {
                reason: format!(
                    "after step {step} the scene of process {rank} is not that of process {}; expected the same bits: give all \
                     of them the same device and driver, and accumulation=fixed_point",
                    ranks.rank()
                ),
            }),
        }
    }
}

pub fn hash(splats: &Splats) -> sha2::digest::Output<Sha256> {
    let Splats { position, rotation, scale, opacity, sh, motion, .. } = splats;
    let parts: [&[u8]; 6] = [
        bytemuck::cast_slice(position),
        bytemuck::cast_slice(rotation),
        bytemuck::cast_slice(scale),
        bytemuck::cast_slice(opacity),
        bytemuck::cast_slice(sh),
        bytemuck::cast_slice(motion),
    ];
    parts.iter().fold(Sha256::new(), |hash, part| hash.chain_update(part)).finalize()
}

#[cfg(not(feature = "mpi"))]
fn join_mpi(n: usize, _: &Stop) -> anyhow::Result<Arc<dyn Ranks>> {
    anyhow::bail!(
        "this is one of {n} processes that were started together, and this program was built without MPI; build it with \
         `tools/setup.sh mpi` and `cargo build --release --features mpi`, or start one process"
    )
}

#[cfg(feature = "mpi")]
fn join_mpi(n: usize, stop: &Stop) -> anyhow::Result<Arc<dyn Ranks>> {
    let found = crate::run::mpi::Mpi::begin(stop.clone())?;
    ensure!(
        found.size() == n,
        "the launcher started {n} processes, and MPI knows {}; expected as many: use the launcher of the MPI that this program was \
         built with, for Slurm `srun --mpi=pmix` or `--mpi=pmi2`",
        found.size()
    );
    Ok(Arc::new(found))
}
