//! One dispatch taken out of a recording with the bytes that it works on.

use super::kernel::{KernelInfo, Slice};
use super::record::{Grid, Recording, Work};
use super::run::{Gpu, fold};
use crate::error::Result;

#[derive(Clone, Debug, PartialEq)]
pub struct Dispatch {
    pub kernel: String,
    pub push: Vec<u8>,
    pub groups: [u32; 3],
    pub bindings: Vec<Bound>,
}

#[derive(Clone, Debug, PartialEq)]
pub struct Bound {
    pub name: String,
    /// An earlier place that binds the same bytes, which are given there alone.
    pub same_as: Option<usize>,
    pub before: Vec<u8>,
    /// The bytes after it, where the kernel may write; else none.
    pub after: Option<Vec<u8>>,
}

impl Gpu {
    /// Runs `recording` and waits; gives back its first dispatch of a kernel called `kernel`, if there is one.
    pub(crate) fn run_dumping(&self, mut recording: Recording, kernel: &str) -> Result<Option<Dispatch>> {
        let Some(at) = recording.passes().iter().position(|pass| pass.kernel().is_some_and(|info| info.name == kernel))
        else {
            self.run(&recording)?;
            return Ok(None);
        };
        let mut this = recording.split_off(at);
        let rest = this.split_off(1);
        self.run(&recording)?;
        let Some(Work::Dispatch { kernel, slices, push, grid }) = this.passes().first().map(|pass| &pass.work) else {
            return Ok(None);
        };
        let bytes = |slice: &Slice| self.read(&slice.bytes());
        let mut bindings = Vec::new();
        for (index, (slice, binding)) in slices.iter().zip(kernel.bindings).enumerate() {
            let same_as = slices[..index].iter().position(|earlier| earlier.is(slice));
            let before = if same_as.is_some() { Vec::new() } else { bytes(slice)? };
            bindings.push(Bound { name: binding.name.to_owned(), same_as, before, after: None });
        }
        let groups = match grid {
            Grid::Threads(n) => fold(n.div_ceil(kernel.local)),
            Grid::Groups(n) => fold(*n),
            Grid::Indirect(args) => {
                let words: Vec<u32> = bytemuck::pod_collect_to_vec(&bytes(args)?);
                std::array::from_fn(|k| words.get(k).copied().unwrap_or(0))
            }
        };
        self.run(&this)?;
        for (index, slice) in slices.iter().enumerate() {
            let is_written = |at: &usize| kernel.bindings[*at].access.writes();
            let mut places = (0..slices.len()).filter(|at| slices[*at].is(slice));
            if bindings[index].same_as.is_none() && places.any(|at| is_written(&at)) {
                bindings[index].after = Some(bytes(slice)?);
            }
        }
        let dispatch = Dispatch { kernel: kernel.name.to_owned(), push: push.clone(), groups, bindings };
        self.run(&rest)?;
        Ok(Some(dispatch))
    }
}

pub fn kernel(name: &str) -> Option<&'static KernelInfo> {
    super::generated::ALL.iter().copied().find(|kernel| kernel.name == name)
}
