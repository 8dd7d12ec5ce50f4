//! The parts of generated bindings: typed buffers, and kernels as values.

pub use crate::vk::BindingKind;
use crate::vk::{Binding, Buffer, PipelineDesc};
pub use bytemuck::{Pod, Zeroable};
use std::marker::PhantomData;
use std::sync::Arc;

/// How a kernel touches a binding; the barriers follow from it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Access {
    Read,
    Write,
    ReadWrite,
}

impl Access {
    pub fn writes(self) -> bool {
        self != Access::Read
    }
}

#[derive(Debug, PartialEq)]
pub struct BindingInfo {
    pub name: &'static str,
    pub kind: BindingKind,
    pub access: Access,
}

#[derive(Debug)]
pub struct KernelInfo {
    /// Stem of the shader.
    pub name: &'static str,
    pub local: u32,
    pub subgroups: bool,
    pub push_bytes: u32,
    pub spirv: &'static [u8],
    /// Set 0, in order.
    pub bindings: &'static [BindingInfo],
    /// A bit for each binding whose elements are floats.
    pub floats: u32,
}

impl KernelInfo {
    /// With `bindings` of these kinds.
    pub fn pipeline<'a>(&self, bindings: &'a [BindingKind]) -> PipelineDesc<'a> {
        let KernelInfo { name, spirv, push_bytes, subgroups, .. } = *self;
        PipelineDesc { name, spirv, bindings, push_bytes, subgroups }
    }
}

/// The module of a kernel that is a variant of another of its shader: of the same `Args` and `Push`.
macro_rules! variant {
    ($name:ident of $first:ident) => {
        #[doc = concat!("A variant of [`mod@", stringify!($first), "`].")]
        pub mod $name {
            use crate::gpu::kernel::KernelInfo;
            pub const INFO: &KernelInfo = &KernelInfo {
                name: stringify!($name),
                spirv: include_bytes!(concat!(
                    env!("CARGO_MANIFEST_DIR"),
                    "/shaders-glsl/spv/",
                    stringify!($name),
                    ".spv"
                )),
                ..*super::$first::INFO
            };
        }
    };
}
pub(super) use variant;

/// The arguments of a kernel; implemented by the generated `Args`.
pub trait Kernel {
    type Push: Pod;
    const INFO: &'static KernelInfo;
    fn slices(&self) -> Vec<Slice>;
}

/// A range of bytes of a device buffer; cheap to clone.
#[derive(Clone)]
pub struct Slice {
    pub(super) buffer: Arc<Buffer>,
    pub(super) offset: u64,
    pub(super) size: u64,
}

impl Slice {
    pub fn size(&self) -> u64 {
        self.size
    }

    pub fn offset(&self) -> u64 {
        self.offset
    }

    fn end(&self) -> u64 {
        self.offset + self.size
    }

    pub(super) fn overlaps(&self, other: &Slice) -> bool {
        Arc::ptr_eq(&self.buffer, &other.buffer) && self.offset < other.end() && other.offset < self.end()
    }

    pub(super) fn is_within(&self, other: &Slice) -> bool {
        Arc::ptr_eq(&self.buffer, &other.buffer) && self.offset >= other.offset && self.end() <= other.end()
    }

    pub(super) fn is(&self, other: &Slice) -> bool {
        Arc::ptr_eq(&self.buffer, &other.buffer) && (self.offset, self.size) == (other.offset, other.size)
    }

    /// The range as a buffer of items, which must divide it.
    pub fn of<T: Pod>(&self) -> Buf<T> {
        self.bytes().cast()
    }

    pub fn bytes(&self) -> Buf<u8> {
        Buf { slice: self.clone(), item: PhantomData }
    }

    pub fn binding(&self) -> Binding {
        Binding { buffer: self.buffer.clone(), offset: self.offset, size: self.size }
    }
}

/// The buffers of numbers in the layout of the parameters, as kernels bind them.
pub struct PlaneSlices {
    /// Position and opacity; rotation; scale and t_scale.
    pub geometry: Slice,
    pub sh0: Slice,
    pub motion: Slice,
    pub sh1: Slice,
    pub sh2: Slice,
    pub sh3: Slice,
}

/// A typed device buffer; cheap to clone, freed with its last clone.
pub struct Buf<T> {
    slice: Slice,
    item: PhantomData<fn() -> T>,
}

impl<T> Clone for Buf<T> {
    fn clone(&self) -> Self {
        Buf { slice: self.slice.clone(), item: PhantomData }
    }
}

impl<T: Pod> Buf<T> {
    pub(super) fn new(buffer: Arc<Buffer>, len: usize) -> Self {
        let size = (len.max(1) * size_of::<T>()) as u64;
        Buf { slice: Slice { buffer, offset: 0, size }, item: PhantomData }
    }

    pub fn slice(&self) -> Slice {
        self.slice.clone()
    }

    /// Items; an empty buffer has room for one, since bindings cannot be empty.
    pub fn len(&self) -> usize {
        self.slice.size as usize / size_of::<T>()
    }

    /// As [`Buf::len`] says.
    pub fn is_empty(&self) -> bool {
        false
    }

    /// The same bytes as items of another type, which must divide them.
    pub fn cast<U: Pod>(&self) -> Buf<U> {
        assert!(self.slice.size.is_multiple_of(size_of::<U>() as u64) || self.slice.size < size_of::<U>() as u64);
        Buf { slice: self.slice(), item: PhantomData }
    }

    /// `len` items from `first` on, as a buffer of their own. Bindings need an aligned start; copies and indirect
    /// arguments do not.
    pub fn range(&self, first: usize, len: usize) -> Buf<T> {
        assert!(first + len <= self.len(), "range {first}+{len} of a buffer of {}", self.len());
        let item = size_of::<T>() as u64;
        let slice = Slice {
            buffer: self.slice.buffer.clone(),
            offset: self.slice.offset + first as u64 * item,
            size: len as u64 * item,
        };
        Buf { slice, item: PhantomData }
    }
}
