//! The parts of generated bindings: typed buffers, and kernels as values.

pub use crate::vk::BindingKind;
use crate::vk::{Binding, Buffer};
pub use bytemuck::{Pod, Zeroable};
use std::marker::PhantomData;
use std::sync::Arc;

/// How a kernel touches a binding; the barriers follow from it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Access {
    /// Loads only.
    Read,
    /// Stores only.
    Write,
    /// Loads, stores or atomics.
    ReadWrite,
}

impl Access {
    /// True if the kernel may store.
    pub fn writes(self) -> bool {
        self != Access::Read
    }
}

/// One binding of a kernel.
#[derive(Debug, PartialEq)]
pub struct BindingInfo {
    /// The block's name in snake case.
    pub name: &'static str,
    /// Storage or uniform.
    pub kind: BindingKind,
    /// From the shader's qualifiers.
    pub access: Access,
}

/// A kernel as the device sees it.
#[derive(Debug)]
pub struct KernelInfo {
    /// Stem of the shader, the table row, the label.
    pub name: &'static str,
    /// Threads per workgroup.
    pub local: u32,
    /// True if it uses subgroup operations.
    pub subgroups: bool,
    /// Bytes of push constants.
    pub push_bytes: u32,
    /// The committed SPIR-V.
    pub spirv: &'static [u8],
    /// Set 0, in order.
    pub bindings: &'static [BindingInfo],
    /// A bit for each binding whose elements are floats.
    pub floats: u32,
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
    /// Push constants.
    type Push: Pod;
    /// The kernel.
    const INFO: &'static KernelInfo;
    /// The buffers, in the order of [`KernelInfo::bindings`].
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
    /// Bytes.
    pub fn size(&self) -> u64 {
        self.size
    }

    /// Bytes of its buffer before it.
    pub fn offset(&self) -> u64 {
        self.offset
    }

    /// True if the two share a byte.
    pub(super) fn overlaps(&self, other: &Slice) -> bool {
        Arc::ptr_eq(&self.buffer, &other.buffer)
            && self.offset < other.offset + other.size
            && other.offset < self.offset + self.size
    }

    /// True if it is a part of `other`, or all of it.
    pub(super) fn is_within(&self, other: &Slice) -> bool {
        Arc::ptr_eq(&self.buffer, &other.buffer)
            && self.offset >= other.offset
            && self.offset + self.size <= other.offset + other.size
    }

    /// True if the two are the same range of the same buffer.
    pub(super) fn is(&self, other: &Slice) -> bool {
        Arc::ptr_eq(&self.buffer, &other.buffer) && (self.offset, self.size) == (other.offset, other.size)
    }

    /// The range as a buffer of items, which must divide it.
    pub fn of<T: Pod>(&self) -> Buf<T> {
        self.bytes().cast()
    }

    /// The range as a buffer of bytes.
    pub fn bytes(&self) -> Buf<u8> {
        Buf { slice: self.clone(), item: PhantomData }
    }

    pub(super) fn binding(&self) -> Binding {
        Binding { buffer: self.buffer.clone(), offset: self.offset, size: self.size }
    }
}

/// The buffers of numbers in the layout of the parameters, as kernels bind them.
pub struct PlaneSlices {
    /// Position and opacity; rotation; scale and t_scale.
    pub geometry: Slice,
    /// The constant band.
    pub sh0: Slice,
    /// Velocity and t_center.
    pub motion: Slice,
    /// Band 1.
    pub sh1: Slice,
    /// Band 2.
    pub sh2: Slice,
    /// Band 3.
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

    /// The bytes.
    pub fn slice(&self) -> Slice {
        self.slice.clone()
    }

    /// Items; an empty buffer has room for one, since bindings cannot be empty.
    pub fn len(&self) -> usize {
        self.slice.size as usize / size_of::<T>()
    }

    /// Never: see [`Buf::len`].
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
