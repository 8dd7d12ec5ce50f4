//! The processes of one training, which `mpirun` or `srun` started together.

use crate::ui::interrupt::Stop;
use anyhow::ensure;
use ivv::error::Error;
use ivv::scene::Splats;
use ivv::train::{Config, Ranks, any};
use sha2::{Digest, Sha256};
use std::sync::Arc;

/// What launchers tell each process: how many there are, by Open MPI, by MPICH and its kin, and by Slurm for those of a step.
const SIZES: [&str; 3] = ["OMPI_COMM_WORLD_SIZE", "PMI_SIZE", "SLURM_STEP_NUM_TASKS"];
/// Of these too: which of the processes of its machine it is.
const LOCAL_RANKS: [&str; 4] = ["OMPI_COMM_WORLD_LOCAL_RANK", "MPI_LOCALRANKID", "PMI_LOCAL_RANK", "SLURM_LOCALID"];

/// And of these: how many processes its machine has. Slurm tells of all machines, as in `4(x2),3`.
const LOCAL_SIZES: [&str; 3] = ["OMPI_COMM_WORLD_LOCAL_SIZE", "MPI_LOCALNRANKS", "SLURM_STEP_TASKS_PER_NODE"];

/// The processes that train one scene; of one that was started alone there are no others.
#[derive(Clone, Default)]
pub struct Team(Option<Arc<dyn Ranks>>);

/// The number that a launcher told in one of these variables, the first one in it.
fn told(variables: &[&str]) -> Option<usize> {
    let first = |text: String| text.split(|c: char| !c.is_ascii_digit()).next()?.parse().ok();
    variables.iter().find_map(|name| first(std::env::var(name).ok()?))
}

/// Which of the processes of this machine it is.
pub fn local_rank() -> usize {
    told(&LOCAL_RANKS).unwrap_or(0)
}

impl Team {
    /// All processes that were started with this one; each must call it.
    pub fn join(stop: &Stop) -> anyhow::Result<Self> {
        match told(&SIZES) {
            Some(n @ 2..) => Ok(Team(Some(joined(n, stop)?))),
            _ => Ok(Team(None)),
        }
    }

    /// The other processes, for a session.
    pub fn ranks(&self) -> Option<Arc<dyn Ranks>> {
        self.0.clone()
    }

    /// Processes.
    pub fn size(&self) -> usize {
        self.0.as_ref().map_or(1, |ranks| ranks.size())
    }

    /// Processes that share this machine; all, where nothing tells.
    pub fn local_size(&self) -> usize {
        told(&LOCAL_SIZES).unwrap_or(usize::MAX).clamp(1, self.size())
    }

    /// Whether this is the one that writes.
    pub fn leads(&self) -> bool {
        self.0.as_ref().is_none_or(|ranks| ranks.rank() == 0)
    }

    /// Whether any of the processes says so.
    pub fn any(&self, own: bool) -> ivv::Result<bool> {
        any(self.0.as_deref(), own)
    }

    /// Waits until all processes have called it, however long that takes.
    pub fn meet(&self) {
        if let Some(ranks) = &self.0 {
            ranks.meet();
        }
    }

    /// Leaves the other processes, once all steps are taken.
    pub fn finish(&self) {
        if let Some(ranks) = &self.0 {
            ranks.finish();
        }
    }

    /// Refuses settings whose steps these processes cannot share.
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

    /// Refuses to go on where the processes have other scenes than this one has, `splats`, after step `step`.
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

/// Tells scenes apart by any bit.
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
fn joined(n: usize, _: &Stop) -> anyhow::Result<Arc<dyn Ranks>> {
    anyhow::bail!(
        "this is one of {n} processes that were started together, and this program was built without MPI; build it with \
         `tools/setup.sh mpi` and `cargo build --release --features mpi`, or start one process"
    )
}

#[cfg(feature = "mpi")]
fn joined(n: usize, stop: &Stop) -> anyhow::Result<Arc<dyn Ranks>> {
    let found = crate::run::mpi::Mpi::begin(stop.clone())?;
    ensure!(
        found.size() == n,
        "the launcher started {n} processes, and MPI knows {}; expected as many: use the launcher of the MPI that this program was \
         built with, for Slurm `srun --mpi=pmix` or `--mpi=pmi2`",
        found.size()
    );
    Ok(Arc::new(found))
}
