//! Work as data: a list of passes, and the barriers that their accesses require.

use super::kernel::{Access, Kernel, KernelInfo, Slice};
use super::table::{Count, KERNELS};

/// How many workgroups a pass has.
#[derive(Clone)]
pub enum Grid {
    /// At least this many threads.
    Threads(u32),
    /// This many workgroups.
    Groups(u32),
    /// As three words on the device say when it gets there.
    Indirect(Slice),
}

/// What a pass does.
pub enum Work {
    /// Runs a kernel.
    Dispatch {
        /// The kernel.
        kernel: &'static KernelInfo,
        /// Its buffers.
        slices: Vec<Slice>,
        /// Its push constants.
        push: Vec<u8>,
        /// Its workgroups.
        grid: Grid,
    },
    /// Copies the first slice to the second.
    Copy(Slice, Slice),
    /// Sets every word of the slice.
    Fill(Slice, u32),
}

/// One pass.
pub struct Pass {
    /// Stage and kernel, the label that tools show.
    pub label: String,
    /// What the pass's time grows with.
    pub count: Count,
    /// The group of Gaussians it works on, where it is not all of them.
    pub group: Option<usize>,
    /// The work.
    pub work: Work,
}

/// Passes in order. Nothing happens before [`super::Gpu::run`].
#[derive(Default)]
pub struct Recording {
    passes: Vec<Pass>,
    stage: &'static str,
    group: Option<usize>,
}

impl Recording {
    /// An empty recording.
    pub fn new() -> Self {
        Self::default()
    }

    /// Names the stage that the passes from here on belong to.
    pub fn stage(&mut self, name: &'static str) {
        self.stage = name;
    }

    /// The passes from here on work on one group of Gaussians, or on all of them again.
    pub fn group(&mut self, group: Option<usize>) {
        self.group = group;
    }

    /// Appends a kernel.
    pub fn pass<K: Kernel>(&mut self, args: K, push: K::Push, grid: Grid) {
        self.pass_variant(K::INFO, args, push, grid);
    }

    /// Appends `kernel`, a variant with the interface of `args`' own.
    pub fn pass_variant<K: Kernel>(&mut self, kernel: &'static KernelInfo, args: K, push: K::Push, grid: Grid) {
        assert_eq!(kernel.bindings, K::INFO.bindings, "{} is no variant of {}", kernel.name, K::INFO.name);
        let row = KERNELS.iter().find(|row| row.name == kernel.name);
        self.passes.push(Pass {
            label: format!("{}/{}", self.stage, kernel.name),
            count: row.map_or(Count::Dispatches, |row| row.count),
            group: self.group,
            work: Work::Dispatch { kernel, slices: args.slices(), push: bytemuck::bytes_of(&push).to_vec(), grid },
        });
    }

    /// Appends a copy between slices of equal size.
    pub fn copy(&mut self, from: Slice, to: Slice) {
        assert_eq!(from.size, to.size, "a copy keeps its size");
        self.push_plain("copy", Work::Copy(from, to));
    }

    /// Appends a fill of whole words.
    pub fn fill(&mut self, slice: Slice, value: u32) {
        self.push_plain("fill", Work::Fill(slice, value));
    }

    fn push_plain(&mut self, name: &str, work: Work) {
        let label = format!("{}/{name}", self.stage);
        self.passes.push(Pass { label, count: Count::Dispatches, group: self.group, work });
    }

    /// The passes.
    pub fn passes(&self) -> &[Pass] {
        &self.passes
    }

    /// Passes from `first` on grow with `count` instead of what the table says.
    pub fn count_as(&mut self, first: usize, count: Count) {
        for pass in self.passes.iter_mut().skip(first) {
            if pass.count == Count::Active {
                pass.count = count;
            }
        }
    }

    /// For each pass, whether a barrier must precede it: one is due when it reads or writes what a pass since the last
    /// barrier wrote, or writes what one read.
    pub fn barriers(&self) -> Vec<bool> {
        let mut since: Vec<(Slice, bool)> = Vec::new();
        self.passes
            .iter()
            .map(|pass| {
                let accesses = pass.accesses();
                let due = accesses
                    .iter()
                    .any(|(slice, writes)| since.iter().any(|(s, w)| (*writes || *w) && s.overlaps(slice)));
                if due {
                    since.clear();
                }
                since.extend(accesses);
                due
            })
            .collect()
    }
}

impl Pass {
    /// Slices touched, and whether they are written.
    fn accesses(&self) -> Vec<(Slice, bool)> {
        match &self.work {
            Work::Dispatch { kernel, slices, grid, .. } => {
                let bound = slices.iter().zip(kernel.bindings).map(|(slice, b)| (slice.clone(), b.access.writes()));
                let args = if let Grid::Indirect(args) = grid { Some((args.clone(), false)) } else { None };
                bound.chain(args).collect()
            }
            Work::Copy(from, to) => vec![(from.clone(), false), (to.clone(), Access::Write.writes())],
            Work::Fill(slice, _) => vec![(slice.clone(), true)],
        }
    }
}
