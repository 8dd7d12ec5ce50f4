//! Work as data: a list of passes, and the windows between barriers that their accesses allow.

use super::kernel::{Kernel, KernelInfo, Slice};
use super::table::{self, Count};
use crate::vk::Buffer;
use std::collections::HashMap;
use std::hash::{BuildHasherDefault, Hasher};
use std::sync::Arc;

#[derive(Clone)]
pub enum Grid {
    /// At least this many threads.
    Threads(u32),
    Groups(u32),
    /// Three words on the device give the number of workgroups.
    Indirect(Slice),
}

pub enum Work {
    Dispatch { kernel: &'static KernelInfo, slices: Vec<Slice>, push: Vec<u8>, grid: Grid },
    Copy(Slice, Slice),
    Fill(Slice, u32),
}

pub struct Pass {
    /// Section and kernel.
    pub label: String,
    pub count: Count,
    /// Units per counted one: below 1 where several passes share the work; the number of units for [`Count::Recorded`].
    pub scale: f64,
    /// The group of Gaussians it works on, where it is not all of them.
    pub group: Option<usize>,
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
    pub fn new() -> Self {
        Self::default()
    }

    pub fn section(&mut self, name: &'static str) {
        self.section = name;
    }

    pub fn group(&mut self, group: Option<usize>) {
        self.group = group;
    }

    pub fn pass<K: Kernel>(&mut self, args: K, push: K::Push, grid: Grid) {
        self.pass_variant(K::INFO, args, push, grid);
    }

    /// `kernel` has the interface of `args`' own.
    pub(crate) fn pass_variant<K: Kernel>(&mut self, kernel: &'static KernelInfo, args: K, push: K::Push, grid: Grid) {
        assert_eq!(kernel.bindings, K::INFO.bindings, "{} is no variant of {}", kernel.name, K::INFO.name);
        self.pass_untyped(kernel, args.slices(), bytemuck::bytes_of(&push).to_vec(), grid);
    }

    /// As many slices as the kernel has bindings, as many bytes of push constants as it takes.
    pub fn pass_untyped(&mut self, kernel: &'static KernelInfo, slices: Vec<Slice>, push: Vec<u8>, grid: Grid) {
        assert_eq!((slices.len(), push.len()), (kernel.bindings.len(), kernel.push_bytes as usize), "{}", kernel.name);
        let count = table::kernel(kernel.name).map_or(Count::Dispatches, |row| row.count);
        self.push(kernel.name, count, Work::Dispatch { kernel, slices, push, grid });
    }

    pub fn copy(&mut self, from: Slice, to: Slice) {
        assert_eq!(from.size, to.size, "a copy keeps its size");
        self.push("copy", Count::Dispatches, Work::Copy(from, to));
    }

    pub fn fill(&mut self, slice: Slice, value: u32) {
        self.push("fill", Count::Dispatches, Work::Fill(slice, value));
    }

    fn push(&mut self, name: &str, count: Count, work: Work) {
        let label = format!("{}/{name}", self.section);
        self.passes.push(Pass { label, count, scale: 1.0, group: self.group, work });
    }

    pub fn split_off(&mut self, at: usize) -> Recording {
        Recording { passes: self.passes.split_off(at), section: self.section, group: self.group }
    }

    pub fn passes(&self) -> &[Pass] {
        &self.passes
    }

    /// Passes from `first` on that grow with the active Gaussians grow with `count` instead.
    pub(crate) fn count_as(&mut self, first: usize, count: Count) {
        for pass in self.passes.iter_mut().skip(first) {
            if pass.count == Count::Active {
                pass.count = count;
            }
        }
    }

    /// Overrides [`Pass::count`] of the last pass.
    pub fn count(&mut self, count: Count) {
        if let Some(pass) = self.passes.last_mut() {
            pass.count = count;
        }
    }

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
    pub fn kernel(&self) -> Option<&'static KernelInfo> {
        if let Work::Dispatch { kernel, .. } = &self.work { Some(kernel) } else { None }
    }

    fn accesses(&self) -> Vec<(&Slice, bool)> {
        match &self.work {
            Work::Dispatch { kernel, slices, grid, .. } => {
                let bound = slices.iter().zip(kernel.bindings).map(|(slice, b)| (slice, b.access.writes()));
                let args = if let Grid::Indirect(args) = grid { Some((args, false)) } else { None };
                bound.chain(args).collect()
            }
            Work::Copy(from, to) => vec![(from, false), (to, true)],
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
