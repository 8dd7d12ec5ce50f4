//! Work as data: a list of passes, and the windows between barriers that their accesses allow.

use super::kernel::{Access, Kernel, KernelInfo, Slice};
use super::table::{self, Count};
use crate::vk::Buffer;
use std::collections::HashMap;
use std::hash::{BuildHasherDefault, Hasher};
use std::sync::Arc;

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

/// The work of a pass.
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
    /// Section and kernel, the label that tools show.
    pub label: String,
    /// The count that the pass's time grows with.
    pub count: Count,
    /// Its units per counted one: below 1 where several passes share the work, and the number of units where nothing
    /// counts them ([`Count::Recorded`]).
    pub scale: f64,
    /// The group of Gaussians it works on, where it is not all of them.
    pub group: Option<usize>,
    /// The work.
    pub work: Work,
}

/// Passes in order. Nothing happens before [`super::Gpu::run`].
#[derive(Default)]
pub struct Recording {
    passes: Vec<Pass>,
    section: &'static str,
    group: Option<usize>,
}

impl Recording {
    /// An empty recording.
    pub fn new() -> Self {
        Self::default()
    }

    /// Names the section that the passes from here on belong to.
    pub fn section(&mut self, name: &'static str) {
        self.section = name;
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
    pub(crate) fn pass_variant<K: Kernel>(&mut self, kernel: &'static KernelInfo, args: K, push: K::Push, grid: Grid) {
        assert_eq!(kernel.bindings, K::INFO.bindings, "{} is no variant of {}", kernel.name, K::INFO.name);
        self.pass_untyped(kernel, args.slices(), bytemuck::bytes_of(&push).to_vec(), grid);
    }

    /// Appends `kernel` with what is known only at run time: as many slices as it has bindings, as many bytes of push
    /// constants as it takes.
    pub fn pass_untyped(&mut self, kernel: &'static KernelInfo, slices: Vec<Slice>, push: Vec<u8>, grid: Grid) {
        assert_eq!((slices.len(), push.len()), (kernel.bindings.len(), kernel.push_bytes as usize), "{}", kernel.name);
        let row = table::kernel(kernel.name);
        self.passes.push(Pass {
            label: format!("{}/{}", self.section, kernel.name),
            count: row.map_or(Count::Dispatches, |row| row.count),
            scale: 1.0,
            group: self.group,
            work: Work::Dispatch { kernel, slices, push, grid },
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
        let label = format!("{}/{name}", self.section);
        self.passes.push(Pass { label, count: Count::Dispatches, scale: 1.0, group: self.group, work });
    }

    /// Takes the passes from `at` on out into a recording of their own.
    pub fn split_off(&mut self, at: usize) -> Recording {
        Recording { passes: self.passes.split_off(at), section: self.section, group: self.group }
    }

    /// The passes.
    pub fn passes(&self) -> &[Pass] {
        &self.passes
    }

    /// Passes from `first` on grow with `count` instead of what the table says.
    pub(crate) fn count_as(&mut self, first: usize, count: Count) {
        for pass in self.passes.iter_mut().skip(first) {
            if pass.count == Count::Active {
                pass.count = count;
            }
        }
    }

    /// The pass appended last grows with `count` instead of what the table says.
    pub fn count(&mut self, count: Count) {
        if let Some(pass) = self.passes.last_mut() {
            pass.count = count;
        }
    }

    /// The pass appended last has `scale` units per counted one, see [`Pass::scale`].
    pub fn scale(&mut self, scale: f64) {
        if let Some(pass) = self.passes.last_mut() {
            pass.scale = scale;
        }
    }

    /// The passes, by index, that run between one barrier and the next: each in the earliest window that comes after all
    /// passes before it which write what it touches, or read what it writes. No other arrangement has fewer barriers.
    pub fn windows(&self) -> Vec<Vec<usize>> {
        let mut windows: Vec<Vec<usize>> = Vec::new();
        // By buffer: what was touched, whether it was written, and in which window.
        let mut touched: HashMap<*const Buffer, Vec<(&Slice, bool, usize)>, ByAddress> = HashMap::default();
        for (at, pass) in self.passes.iter().enumerate() {
            let accesses = pass.accesses();
            let conflicts = |(slice, writes): &(&Slice, bool)| {
                let earlier = touched.get(&Arc::as_ptr(&slice.buffer)).map_or(&[][..], Vec::as_slice);
                let after = |(other, wrote, window): &(&Slice, bool, usize)| {
                    ((*writes || *wrote) && other.overlaps(slice)).then_some(window + 1)
                };
                earlier.iter().filter_map(after).max().unwrap_or(0)
            };
            let window = accesses.iter().map(conflicts).max().unwrap_or(0);
            if window == windows.len() {
                windows.push(Vec::new());
            }
            windows[window].push(at);
            for (slice, writes) in accesses {
                let of_buffer = touched.entry(Arc::as_ptr(&slice.buffer)).or_default();
                // A write comes after all that touched its range.
                of_buffer.retain(|(other, ..)| !(writes && other.is_within(slice)));
                of_buffer.push((slice, writes, window));
            }
        }
        windows
    }
}

impl Pass {
    /// The name of its kernel; none of a copy or a fill.
    pub fn kernel(&self) -> Option<&'static str> {
        match &self.work {
            Work::Dispatch { kernel, .. } => Some(kernel.name),
            Work::Copy(..) | Work::Fill(..) => None,
        }
    }

    /// Slices touched, and whether they are written.
    fn accesses(&self) -> Vec<(&Slice, bool)> {
        match &self.work {
            Work::Dispatch { kernel, slices, grid, .. } => {
                let bound = slices.iter().zip(kernel.bindings).map(|(slice, b)| (slice, b.access.writes()));
                let args = if let Grid::Indirect(args) = grid { Some((args, false)) } else { None };
                bound.chain(args).collect()
            }
            Work::Copy(from, to) => vec![(from, false), (to, Access::Write.writes())],
            Work::Fill(slice, _) => vec![(slice, true)],
        }
    }
}

/// Hashes addresses, of which a step looks up some thousand. The standard library's hasher, which withstands keys that are chosen
/// to collide, took most of the search for windows.
type ByAddress = BuildHasherDefault<AddressHasher>;

#[derive(Default)]
struct AddressHasher(u64);

impl Hasher for AddressHasher {
    fn write(&mut self, bytes: &[u8]) {
        bytes.iter().for_each(|byte| self.write_usize(usize::from(*byte)));
    }

    fn write_usize(&mut self, n: usize) {
        // The golden ratio's bits: high and low bits of the product depend on all of `n`.
        self.0 = (self.0 ^ n as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15).rotate_left(32);
    }

    fn finish(&self) -> u64 {
        self.0
    }
}
