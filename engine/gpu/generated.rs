//! Bindings of the kernels, generated from the shaders by `IVV_BLESS=1 cargo build --features shaders`.

use bytemuck::{Pod, Zeroable};

/// `AdamParams` of the shaders.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct AdamParams {
    /// `rates0` of the shader.
    pub rates0: [f32; 4],
    /// `rates1` of the shader.
    pub rates1: [f32; 4],
    /// `rates2` of the shader.
    pub rates2: [f32; 4],
    /// `beta1` of the shader.
    pub beta1: f32,
    /// `beta2` of the shader.
    pub beta2: f32,
    /// `inverse_c2` of the shader.
    pub inverse_c2: f32,
    /// `eps` of the shader.
    pub eps: f32,
    /// `lowest_t_scale` of the shader.
    pub lowest_t_scale: f32,
    /// `opacity_reg` of the shader.
    pub opacity_reg: f32,
    /// `scale_reg` of the shader.
    pub scale_reg: f32,
    /// `step` of the shader.
    pub step: f32,
}
const _: () = {
    assert!(size_of::<AdamParams>() == 80);
    assert!(std::mem::offset_of!(AdamParams, rates0) == 0);
    assert!(std::mem::offset_of!(AdamParams, rates1) == 16);
    assert!(std::mem::offset_of!(AdamParams, rates2) == 32);
    assert!(std::mem::offset_of!(AdamParams, beta1) == 48);
    assert!(std::mem::offset_of!(AdamParams, beta2) == 52);
    assert!(std::mem::offset_of!(AdamParams, inverse_c2) == 56);
    assert!(std::mem::offset_of!(AdamParams, eps) == 60);
    assert!(std::mem::offset_of!(AdamParams, lowest_t_scale) == 64);
    assert!(std::mem::offset_of!(AdamParams, opacity_reg) == 68);
    assert!(std::mem::offset_of!(AdamParams, scale_reg) == 72);
    assert!(std::mem::offset_of!(AdamParams, step) == 76);
};

/// `Status` of the shaders.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct Status {
    /// `failed` of the shader.
    pub failed: u32,
    /// `n_active` of the shader.
    pub n_active: u32,
    /// `n_visible` of the shader.
    pub n_visible: u32,
    /// `n_intersections` of the shader.
    pub n_intersections: u32,
    /// `max_tile_list` of the shader.
    pub max_tile_list: u32,
    /// `n_bad` of the shader.
    pub n_bad: u32,
    /// `capacity_active` of the shader.
    pub capacity_active: u32,
    /// `capacity_intersections` of the shader.
    pub capacity_intersections: u32,
}
const _: () = {
    assert!(size_of::<Status>() == 32);
    assert!(std::mem::offset_of!(Status, failed) == 0);
    assert!(std::mem::offset_of!(Status, n_active) == 4);
    assert!(std::mem::offset_of!(Status, n_visible) == 8);
    assert!(std::mem::offset_of!(Status, n_intersections) == 12);
    assert!(std::mem::offset_of!(Status, max_tile_list) == 16);
    assert!(std::mem::offset_of!(Status, n_bad) == 20);
    assert!(std::mem::offset_of!(Status, capacity_active) == 24);
    assert!(std::mem::offset_of!(Status, capacity_intersections) == 28);
};

/// `ViewParams` of the shaders.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct ViewParams {
    /// `row0` of the shader.
    pub row0: [f32; 4],
    /// `row1` of the shader.
    pub row1: [f32; 4],
    /// `row2` of the shader.
    pub row2: [f32; 4],
    /// `intrinsics` of the shader.
    pub intrinsics: [f32; 4],
    /// `clamp_uv` of the shader.
    pub clamp_uv: [f32; 4],
    /// `background` of the shader.
    pub background: [f32; 4],
    /// `next0` of the shader.
    pub next0: [f32; 4],
    /// `next1` of the shader.
    pub next1: [f32; 4],
    /// `next2` of the shader.
    pub next2: [f32; 4],
    /// `time` of the shader.
    pub time: f32,
    /// `near` of the shader.
    pub near: f32,
    /// `blur` of the shader.
    pub blur: f32,
    /// `alpha_min` of the shader.
    pub alpha_min: f32,
    /// `alpha_max` of the shader.
    pub alpha_max: f32,
    /// `t_min` of the shader.
    pub t_min: f32,
    /// `width` of the shader.
    pub width: u32,
    /// `height` of the shader.
    pub height: u32,
    /// `first_row` of the shader.
    pub first_row: u32,
    /// `n_rows` of the shader.
    pub n_rows: u32,
    /// `tiles_x` of the shader.
    pub tiles_x: u32,
    /// `tiles_y` of the shader.
    pub tiles_y: u32,
    /// `flow_model` of the shader.
    pub flow_model: u32,
    /// `depth_to_alpha` of the shader.
    pub depth_to_alpha: f32,
    /// `bounds` of the shader.
    pub bounds: u32,
    /// `depth_shift` of the shader.
    pub depth_shift: u32,
    /// `t_cut` of the shader.
    pub t_cut: f32,
    /// `unused0` of the shader.
    pub unused0: f32,
    /// `unused1` of the shader.
    pub unused1: f32,
    /// `unused2` of the shader.
    pub unused2: f32,
}
const _: () = {
    assert!(size_of::<ViewParams>() == 224);
    assert!(std::mem::offset_of!(ViewParams, row0) == 0);
    assert!(std::mem::offset_of!(ViewParams, row1) == 16);
    assert!(std::mem::offset_of!(ViewParams, row2) == 32);
    assert!(std::mem::offset_of!(ViewParams, intrinsics) == 48);
    assert!(std::mem::offset_of!(ViewParams, clamp_uv) == 64);
    assert!(std::mem::offset_of!(ViewParams, background) == 80);
    assert!(std::mem::offset_of!(ViewParams, next0) == 96);
    assert!(std::mem::offset_of!(ViewParams, next1) == 112);
    assert!(std::mem::offset_of!(ViewParams, next2) == 128);
    assert!(std::mem::offset_of!(ViewParams, time) == 144);
    assert!(std::mem::offset_of!(ViewParams, near) == 148);
    assert!(std::mem::offset_of!(ViewParams, blur) == 152);
    assert!(std::mem::offset_of!(ViewParams, alpha_min) == 156);
    assert!(std::mem::offset_of!(ViewParams, alpha_max) == 160);
    assert!(std::mem::offset_of!(ViewParams, t_min) == 164);
    assert!(std::mem::offset_of!(ViewParams, width) == 168);
    assert!(std::mem::offset_of!(ViewParams, height) == 172);
    assert!(std::mem::offset_of!(ViewParams, first_row) == 176);
    assert!(std::mem::offset_of!(ViewParams, n_rows) == 180);
    assert!(std::mem::offset_of!(ViewParams, tiles_x) == 184);
    assert!(std::mem::offset_of!(ViewParams, tiles_y) == 188);
    assert!(std::mem::offset_of!(ViewParams, flow_model) == 192);
    assert!(std::mem::offset_of!(ViewParams, depth_to_alpha) == 196);
    assert!(std::mem::offset_of!(ViewParams, bounds) == 200);
    assert!(std::mem::offset_of!(ViewParams, depth_shift) == 204);
    assert!(std::mem::offset_of!(ViewParams, t_cut) == 208);
    assert!(std::mem::offset_of!(ViewParams, unused0) == 212);
    assert!(std::mem::offset_of!(ViewParams, unused1) == 216);
    assert!(std::mem::offset_of!(ViewParams, unused2) == 220);
};

/// derives from each Gaussian the numbers that culling reads: centre, reach, and time window.
pub mod bound_static {
    use super::super::kernel::*;
    /// `Push` of the shaders.
    #[repr(C)]
    #[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
    pub struct Push {
        /// `n` of the shader.
        pub n: u32,
        /// `alpha_min` of the shader.
        pub alpha_min: f32,
        /// `temporal_cut` of the shader.
        pub temporal_cut: f32,
    }
    const _: () = {
        assert!(size_of::<Push>() == 12);
        assert!(std::mem::offset_of!(Push, n) == 0);
        assert!(std::mem::offset_of!(Push, alpha_min) == 4);
        assert!(std::mem::offset_of!(Push, temporal_cut) == 8);
    };
    /// The kernel's buffers.
    pub struct Args<'a> {
        /// Reads.
        pub geometry: &'a Buf<[f32; 4]>,
        /// Writes.
        pub bound: &'a Buf<[f32; 4]>,
        /// ReadWrites.
        pub n_bad: &'a Buf<u32>,
    }
    impl Kernel for Args<'_> {
        type Push = Push;
        const INFO: &'static KernelInfo = INFO;
        fn slices(&self) -> Vec<Slice> {
            vec![self.geometry.slice(), self.bound.slice(), self.n_bad.slice()]
        }
    }
    /// What the device needs to know.
    pub const INFO: &KernelInfo = &KernelInfo {
        name: "bound_static",
        push_bytes: size_of::<Push>() as u32,
        spirv: include_bytes!("../../shaders-glsl/spv/bound_static.spv"),
        local: 128,
        subgroups: false,
        floats: 0x3,
        bindings: &[
            BindingInfo { name: "geometry", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "bound", kind: BindingKind::Storage, access: Access::Write },
            BindingInfo { name: "n_bad", kind: BindingKind::Storage, access: Access::ReadWrite },
        ],
    };
}

/// derives from each Gaussian the numbers that culling reads: centre, reach, and time window.
pub mod bound_dynamic {
    use super::super::kernel::*;
    /// `Push` of the shaders.
    #[repr(C)]
    #[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
    pub struct Push {
        /// `n` of the shader.
        pub n: u32,
        /// `alpha_min` of the shader.
        pub alpha_min: f32,
        /// `temporal_cut` of the shader.
        pub temporal_cut: f32,
    }
    const _: () = {
        assert!(size_of::<Push>() == 12);
        assert!(std::mem::offset_of!(Push, n) == 0);
        assert!(std::mem::offset_of!(Push, alpha_min) == 4);
        assert!(std::mem::offset_of!(Push, temporal_cut) == 8);
    };
    /// The kernel's buffers.
    pub struct Args<'a> {
        /// Reads.
        pub geometry: &'a Buf<[f32; 4]>,
        /// Writes.
        pub bound: &'a Buf<[f32; 4]>,
        /// ReadWrites.
        pub n_bad: &'a Buf<u32>,
        /// Reads.
        pub motion: &'a Buf<[f32; 4]>,
        /// Writes.
        pub window: &'a Buf<f32>,
    }
    impl Kernel for Args<'_> {
        type Push = Push;
        const INFO: &'static KernelInfo = INFO;
        fn slices(&self) -> Vec<Slice> {
            vec![
                self.geometry.slice(),
                self.bound.slice(),
                self.n_bad.slice(),
                self.motion.slice(),
                self.window.slice(),
            ]
        }
    }
    /// What the device needs to know.
    pub const INFO: &KernelInfo = &KernelInfo {
        name: "bound_dynamic",
        push_bytes: size_of::<Push>() as u32,
        spirv: include_bytes!("../../shaders-glsl/spv/bound_dynamic.spv"),
        local: 128,
        subgroups: false,
        floats: 0x1b,
        bindings: &[
            BindingInfo { name: "geometry", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "bound", kind: BindingKind::Storage, access: Access::Write },
            BindingInfo { name: "n_bad", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "motion", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "window", kind: BindingKind::Storage, access: Access::Write },
        ],
    };
}

/// marks the Gaussians of a group that may touch the strip at the view's time.
pub mod cull_static {
    use super::super::kernel::*;
    /// `Push` of the shaders.
    #[repr(C)]
    #[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
    pub struct Push {
        /// `n` of the shader.
        pub n: u32,
        /// `first` of the shader.
        pub first: u32,
    }
    const _: () = {
        assert!(size_of::<Push>() == 8);
        assert!(std::mem::offset_of!(Push, n) == 0);
        assert!(std::mem::offset_of!(Push, first) == 4);
    };
    /// The kernel's buffers.
    pub struct Args<'a> {
        /// Reads.
        pub view: &'a Buf<super::ViewParams>,
        /// Reads.
        pub bound: &'a Buf<[f32; 4]>,
        /// Writes.
        pub bits: &'a Buf<u32>,
        /// Writes.
        pub counts: &'a Buf<u32>,
    }
    impl Kernel for Args<'_> {
        type Push = Push;
        const INFO: &'static KernelInfo = INFO;
        fn slices(&self) -> Vec<Slice> {
            vec![self.view.slice(), self.bound.slice(), self.bits.slice(), self.counts.slice()]
        }
    }
    /// What the device needs to know.
    pub const INFO: &KernelInfo = &KernelInfo {
        name: "cull_static",
        push_bytes: size_of::<Push>() as u32,
        spirv: include_bytes!("../../shaders-glsl/spv/cull_static.spv"),
        local: 128,
        subgroups: true,
        floats: 0x2,
        bindings: &[
            BindingInfo { name: "view", kind: BindingKind::Uniform, access: Access::Read },
            BindingInfo { name: "bound", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "bits", kind: BindingKind::Storage, access: Access::Write },
            BindingInfo { name: "counts", kind: BindingKind::Storage, access: Access::Write },
        ],
    };
}

/// marks the Gaussians of a group that may touch the strip at the view's time.
pub mod cull_dynamic {
    use super::super::kernel::*;
    /// `Push` of the shaders.
    #[repr(C)]
    #[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
    pub struct Push {
        /// `n` of the shader.
        pub n: u32,
        /// `first` of the shader.
        pub first: u32,
    }
    const _: () = {
        assert!(size_of::<Push>() == 8);
        assert!(std::mem::offset_of!(Push, n) == 0);
        assert!(std::mem::offset_of!(Push, first) == 4);
    };
    /// The kernel's buffers.
    pub struct Args<'a> {
        /// Reads.
        pub view: &'a Buf<super::ViewParams>,
        /// Reads.
        pub bound: &'a Buf<[f32; 4]>,
        /// Writes.
        pub bits: &'a Buf<u32>,
        /// Writes.
        pub counts: &'a Buf<u32>,
        /// Reads.
        pub motion: &'a Buf<[f32; 4]>,
        /// Reads.
        pub window: &'a Buf<f32>,
    }
    impl Kernel for Args<'_> {
        type Push = Push;
        const INFO: &'static KernelInfo = INFO;
        fn slices(&self) -> Vec<Slice> {
            vec![
                self.view.slice(),
                self.bound.slice(),
                self.bits.slice(),
                self.counts.slice(),
                self.motion.slice(),
                self.window.slice(),
            ]
        }
    }
    /// What the device needs to know.
    pub const INFO: &KernelInfo = &KernelInfo {
        name: "cull_dynamic",
        push_bytes: size_of::<Push>() as u32,
        spirv: include_bytes!("../../shaders-glsl/spv/cull_dynamic.spv"),
        local: 128,
        subgroups: true,
        floats: 0x32,
        bindings: &[
            BindingInfo { name: "view", kind: BindingKind::Uniform, access: Access::Read },
            BindingInfo { name: "bound", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "bits", kind: BindingKind::Storage, access: Access::Write },
            BindingInfo { name: "counts", kind: BindingKind::Storage, access: Access::Write },
            BindingInfo { name: "motion", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "window", kind: BindingKind::Storage, access: Access::Read },
        ],
    };
}

/// lists the marked Gaussians in index order, and the others if asked for.
pub mod compact {
    use super::super::kernel::*;
    /// `Push` of the shaders.
    #[repr(C)]
    #[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
    pub struct Push {
        /// `n` of the shader.
        pub n: u32,
        /// `capacity` of the shader.
        pub capacity: u32,
        /// `wants_idle` of the shader.
        pub wants_idle: u32,
    }
    const _: () = {
        assert!(size_of::<Push>() == 12);
        assert!(std::mem::offset_of!(Push, n) == 0);
        assert!(std::mem::offset_of!(Push, capacity) == 4);
        assert!(std::mem::offset_of!(Push, wants_idle) == 8);
    };
    /// The kernel's buffers.
    pub struct Args<'a> {
        /// Reads.
        pub bits: &'a Buf<u32>,
        /// Reads.
        pub offsets: &'a Buf<u32>,
        /// Writes.
        pub active_id: &'a Buf<u32>,
        /// Writes.
        pub idle_id: &'a Buf<u32>,
    }
    impl Kernel for Args<'_> {
        type Push = Push;
        const INFO: &'static KernelInfo = INFO;
        fn slices(&self) -> Vec<Slice> {
            vec![self.bits.slice(), self.offsets.slice(), self.active_id.slice(), self.idle_id.slice()]
        }
    }
    /// What the device needs to know.
    pub const INFO: &KernelInfo = &KernelInfo {
        name: "compact",
        push_bytes: size_of::<Push>() as u32,
        spirv: include_bytes!("../../shaders-glsl/spv/compact.spv"),
        local: 128,
        subgroups: true,
        floats: 0x0,
        bindings: &[
            BindingInfo { name: "bits", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "offsets", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "active_id", kind: BindingKind::Storage, access: Access::Write },
            BindingInfo { name: "idle_id", kind: BindingKind::Storage, access: Access::Write },
        ],
    };
}

/// turns the number of active Gaussians into grids, and finds each group's range in the active list.
pub mod prepare_active {
    use super::super::kernel::*;
    /// `Push` of the shaders.
    #[repr(C)]
    #[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
    pub struct Push {
        /// `n_groups` of the shader.
        pub n_groups: u32,
        /// `capacity` of the shader.
        pub capacity: u32,
        /// `n_blocks` of the shader.
        pub n_blocks: u32,
    }
    const _: () = {
        assert!(size_of::<Push>() == 12);
        assert!(std::mem::offset_of!(Push, n_groups) == 0);
        assert!(std::mem::offset_of!(Push, capacity) == 4);
        assert!(std::mem::offset_of!(Push, n_blocks) == 8);
    };
    /// The kernel's buffers.
    pub struct Args<'a> {
        /// ReadWrites.
        pub n_active: &'a Buf<u32>,
        /// Reads.
        pub offsets: &'a Buf<u32>,
        /// Reads.
        pub group_first: &'a Buf<u32>,
        /// Writes.
        pub ranges: &'a Buf<[u32; 2]>,
        /// Writes.
        pub args: &'a Buf<[u32; 4]>,
        /// Writes.
        pub n_digits: &'a Buf<u32>,
        /// ReadWrites.
        pub frame_status: &'a Buf<super::Status>,
    }
    impl Kernel for Args<'_> {
        type Push = Push;
        const INFO: &'static KernelInfo = INFO;
        fn slices(&self) -> Vec<Slice> {
            vec![
                self.n_active.slice(),
                self.offsets.slice(),
                self.group_first.slice(),
                self.ranges.slice(),
                self.args.slice(),
                self.n_digits.slice(),
                self.frame_status.slice(),
            ]
        }
    }
    /// What the device needs to know.
    pub const INFO: &KernelInfo = &KernelInfo {
        name: "prepare_active",
        push_bytes: size_of::<Push>() as u32,
        spirv: include_bytes!("../../shaders-glsl/spv/prepare_active.spv"),
        local: 64,
        subgroups: false,
        floats: 0x0,
        bindings: &[
            BindingInfo { name: "n_active", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "offsets", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "group_first", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "ranges", kind: BindingKind::Storage, access: Access::Write },
            BindingInfo { name: "args", kind: BindingKind::Storage, access: Access::Write },
            BindingInfo { name: "n_digits", kind: BindingKind::Storage, access: Access::Write },
            BindingInfo { name: "frame_status", kind: BindingKind::Storage, access: Access::ReadWrite },
        ],
    };
}

/// projects the active Gaussians of a group, evaluates their colour and counts the tiles they touch.
pub mod project_static_sh0 {
    use super::super::kernel::*;
    /// `Push` of the shaders.
    #[repr(C)]
    #[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
    pub struct Push {
        /// `group` of the shader.
        pub group: u32,
        /// `first` of the shader.
        pub first: u32,
    }
    const _: () = {
        assert!(size_of::<Push>() == 8);
        assert!(std::mem::offset_of!(Push, group) == 0);
        assert!(std::mem::offset_of!(Push, first) == 4);
    };
    /// The kernel's buffers.
    pub struct Args<'a> {
        /// Reads.
        pub view: &'a Buf<super::ViewParams>,
        /// Reads.
        pub ranges: &'a Buf<[u32; 2]>,
        /// Reads.
        pub active_id: &'a Buf<u32>,
        /// Reads.
        pub geometry: &'a Buf<[f32; 4]>,
        /// Reads.
        pub sh0: &'a Buf<[f32; 4]>,
        /// Writes.
        pub splats: &'a Buf<[f32; 4]>,
        /// Writes.
        pub depth_keys: &'a Buf<u32>,
        /// Writes.
        pub identity: &'a Buf<u32>,
        /// Writes.
        pub tile_counts: &'a Buf<u32>,
        /// ReadWrites.
        pub frame_status: &'a Buf<super::Status>,
        /// Reads.
        pub motion: &'a Buf<[f32; 4]>,
        /// Reads.
        pub sh1: &'a Buf<[f32; 4]>,
        /// Reads.
        pub sh2: &'a Buf<[f32; 4]>,
        /// Reads.
        pub sh3: &'a Buf<[f32; 4]>,
    }
    impl Kernel for Args<'_> {
        type Push = Push;
        const INFO: &'static KernelInfo = INFO;
        fn slices(&self) -> Vec<Slice> {
            vec![
                self.view.slice(),
                self.ranges.slice(),
                self.active_id.slice(),
                self.geometry.slice(),
                self.sh0.slice(),
                self.splats.slice(),
                self.depth_keys.slice(),
                self.identity.slice(),
                self.tile_counts.slice(),
                self.frame_status.slice(),
                self.motion.slice(),
                self.sh1.slice(),
                self.sh2.slice(),
                self.sh3.slice(),
            ]
        }
    }
    /// What the device needs to know.
    pub const INFO: &KernelInfo = &KernelInfo {
        name: "project_static_sh0",
        push_bytes: size_of::<Push>() as u32,
        spirv: include_bytes!("../../shaders-glsl/spv/project_static_sh0.spv"),
        local: 64,
        subgroups: true,
        floats: 0x3c38,
        bindings: &[
            BindingInfo { name: "view", kind: BindingKind::Uniform, access: Access::Read },
            BindingInfo { name: "ranges", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "active_id", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "geometry", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "sh0", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "splats", kind: BindingKind::Storage, access: Access::Write },
            BindingInfo { name: "depth_keys", kind: BindingKind::Storage, access: Access::Write },
            BindingInfo { name: "identity", kind: BindingKind::Storage, access: Access::Write },
            BindingInfo { name: "tile_counts", kind: BindingKind::Storage, access: Access::Write },
            BindingInfo { name: "frame_status", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "motion", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "sh1", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "sh2", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "sh3", kind: BindingKind::Storage, access: Access::Read },
        ],
    };
}

/// projects the active Gaussians of a group, evaluates their colour and counts the tiles they touch.
pub mod project_static_sh1 {
    use super::super::kernel::*;
    /// What the device needs to know. A variant of [`super::project_static_sh0`].
    pub const INFO: &KernelInfo = &KernelInfo {
        name: "project_static_sh1",
        push_bytes: size_of::<super::project_static_sh0::Push>() as u32,
        spirv: include_bytes!("../../shaders-glsl/spv/project_static_sh1.spv"),
        local: 64,
        subgroups: true,
        floats: 0x3c38,
        bindings: &[
            BindingInfo { name: "view", kind: BindingKind::Uniform, access: Access::Read },
            BindingInfo { name: "ranges", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "active_id", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "geometry", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "sh0", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "splats", kind: BindingKind::Storage, access: Access::Write },
            BindingInfo { name: "depth_keys", kind: BindingKind::Storage, access: Access::Write },
            BindingInfo { name: "identity", kind: BindingKind::Storage, access: Access::Write },
            BindingInfo { name: "tile_counts", kind: BindingKind::Storage, access: Access::Write },
            BindingInfo { name: "frame_status", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "motion", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "sh1", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "sh2", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "sh3", kind: BindingKind::Storage, access: Access::Read },
        ],
    };
}

/// projects the active Gaussians of a group, evaluates their colour and counts the tiles they touch.
pub mod project_static_sh2 {
    use super::super::kernel::*;
    /// What the device needs to know. A variant of [`super::project_static_sh0`].
    pub const INFO: &KernelInfo = &KernelInfo {
        name: "project_static_sh2",
        push_bytes: size_of::<super::project_static_sh0::Push>() as u32,
        spirv: include_bytes!("../../shaders-glsl/spv/project_static_sh2.spv"),
        local: 64,
        subgroups: true,
        floats: 0x3c38,
        bindings: &[
            BindingInfo { name: "view", kind: BindingKind::Uniform, access: Access::Read },
            BindingInfo { name: "ranges", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "active_id", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "geometry", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "sh0", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "splats", kind: BindingKind::Storage, access: Access::Write },
            BindingInfo { name: "depth_keys", kind: BindingKind::Storage, access: Access::Write },
            BindingInfo { name: "identity", kind: BindingKind::Storage, access: Access::Write },
            BindingInfo { name: "tile_counts", kind: BindingKind::Storage, access: Access::Write },
            BindingInfo { name: "frame_status", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "motion", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "sh1", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "sh2", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "sh3", kind: BindingKind::Storage, access: Access::Read },
        ],
    };
}

/// projects the active Gaussians of a group, evaluates their colour and counts the tiles they touch.
pub mod project_static_sh3 {
    use super::super::kernel::*;
    /// What the device needs to know. A variant of [`super::project_static_sh0`].
    pub const INFO: &KernelInfo = &KernelInfo {
        name: "project_static_sh3",
        push_bytes: size_of::<super::project_static_sh0::Push>() as u32,
        spirv: include_bytes!("../../shaders-glsl/spv/project_static_sh3.spv"),
        local: 64,
        subgroups: true,
        floats: 0x3c38,
        bindings: &[
            BindingInfo { name: "view", kind: BindingKind::Uniform, access: Access::Read },
            BindingInfo { name: "ranges", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "active_id", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "geometry", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "sh0", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "splats", kind: BindingKind::Storage, access: Access::Write },
            BindingInfo { name: "depth_keys", kind: BindingKind::Storage, access: Access::Write },
            BindingInfo { name: "identity", kind: BindingKind::Storage, access: Access::Write },
            BindingInfo { name: "tile_counts", kind: BindingKind::Storage, access: Access::Write },
            BindingInfo { name: "frame_status", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "motion", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "sh1", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "sh2", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "sh3", kind: BindingKind::Storage, access: Access::Read },
        ],
    };
}

/// projects the active Gaussians of a group, evaluates their colour and counts the tiles they touch.
pub mod project_dynamic_sh0 {
    use super::super::kernel::*;
    /// What the device needs to know. A variant of [`super::project_static_sh0`].
    pub const INFO: &KernelInfo = &KernelInfo {
        name: "project_dynamic_sh0",
        push_bytes: size_of::<super::project_static_sh0::Push>() as u32,
        spirv: include_bytes!("../../shaders-glsl/spv/project_dynamic_sh0.spv"),
        local: 64,
        subgroups: true,
        floats: 0x3c38,
        bindings: &[
            BindingInfo { name: "view", kind: BindingKind::Uniform, access: Access::Read },
            BindingInfo { name: "ranges", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "active_id", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "geometry", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "sh0", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "splats", kind: BindingKind::Storage, access: Access::Write },
            BindingInfo { name: "depth_keys", kind: BindingKind::Storage, access: Access::Write },
            BindingInfo { name: "identity", kind: BindingKind::Storage, access: Access::Write },
            BindingInfo { name: "tile_counts", kind: BindingKind::Storage, access: Access::Write },
            BindingInfo { name: "frame_status", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "motion", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "sh1", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "sh2", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "sh3", kind: BindingKind::Storage, access: Access::Read },
        ],
    };
}

/// projects the active Gaussians of a group, evaluates their colour and counts the tiles they touch.
pub mod project_dynamic_sh1 {
    use super::super::kernel::*;
    /// What the device needs to know. A variant of [`super::project_static_sh0`].
    pub const INFO: &KernelInfo = &KernelInfo {
        name: "project_dynamic_sh1",
        push_bytes: size_of::<super::project_static_sh0::Push>() as u32,
        spirv: include_bytes!("../../shaders-glsl/spv/project_dynamic_sh1.spv"),
        local: 64,
        subgroups: true,
        floats: 0x3c38,
        bindings: &[
            BindingInfo { name: "view", kind: BindingKind::Uniform, access: Access::Read },
            BindingInfo { name: "ranges", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "active_id", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "geometry", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "sh0", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "splats", kind: BindingKind::Storage, access: Access::Write },
            BindingInfo { name: "depth_keys", kind: BindingKind::Storage, access: Access::Write },
            BindingInfo { name: "identity", kind: BindingKind::Storage, access: Access::Write },
            BindingInfo { name: "tile_counts", kind: BindingKind::Storage, access: Access::Write },
            BindingInfo { name: "frame_status", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "motion", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "sh1", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "sh2", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "sh3", kind: BindingKind::Storage, access: Access::Read },
        ],
    };
}

/// projects the active Gaussians of a group, evaluates their colour and counts the tiles they touch.
pub mod project_dynamic_sh2 {
    use super::super::kernel::*;
    /// What the device needs to know. A variant of [`super::project_static_sh0`].
    pub const INFO: &KernelInfo = &KernelInfo {
        name: "project_dynamic_sh2",
        push_bytes: size_of::<super::project_static_sh0::Push>() as u32,
        spirv: include_bytes!("../../shaders-glsl/spv/project_dynamic_sh2.spv"),
        local: 64,
        subgroups: true,
        floats: 0x3c38,
        bindings: &[
            BindingInfo { name: "view", kind: BindingKind::Uniform, access: Access::Read },
            BindingInfo { name: "ranges", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "active_id", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "geometry", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "sh0", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "splats", kind: BindingKind::Storage, access: Access::Write },
            BindingInfo { name: "depth_keys", kind: BindingKind::Storage, access: Access::Write },
            BindingInfo { name: "identity", kind: BindingKind::Storage, access: Access::Write },
            BindingInfo { name: "tile_counts", kind: BindingKind::Storage, access: Access::Write },
            BindingInfo { name: "frame_status", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "motion", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "sh1", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "sh2", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "sh3", kind: BindingKind::Storage, access: Access::Read },
        ],
    };
}

/// projects the active Gaussians of a group, evaluates their colour and counts the tiles they touch.
pub mod project_dynamic_sh3 {
    use super::super::kernel::*;
    /// What the device needs to know. A variant of [`super::project_static_sh0`].
    pub const INFO: &KernelInfo = &KernelInfo {
        name: "project_dynamic_sh3",
        push_bytes: size_of::<super::project_static_sh0::Push>() as u32,
        spirv: include_bytes!("../../shaders-glsl/spv/project_dynamic_sh3.spv"),
        local: 64,
        subgroups: true,
        floats: 0x3c38,
        bindings: &[
            BindingInfo { name: "view", kind: BindingKind::Uniform, access: Access::Read },
            BindingInfo { name: "ranges", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "active_id", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "geometry", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "sh0", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "splats", kind: BindingKind::Storage, access: Access::Write },
            BindingInfo { name: "depth_keys", kind: BindingKind::Storage, access: Access::Write },
            BindingInfo { name: "identity", kind: BindingKind::Storage, access: Access::Write },
            BindingInfo { name: "tile_counts", kind: BindingKind::Storage, access: Access::Write },
            BindingInfo { name: "frame_status", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "motion", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "sh1", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "sh2", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "sh3", kind: BindingKind::Storage, access: Access::Read },
        ],
    };
}

/// projects the active Gaussians of a group, evaluates their colour and counts the tiles they touch.
pub mod project_static_sh1_half {
    use super::super::kernel::*;
    /// `Push` of the shaders.
    #[repr(C)]
    #[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
    pub struct Push {
        /// `group` of the shader.
        pub group: u32,
        /// `first` of the shader.
        pub first: u32,
    }
    const _: () = {
        assert!(size_of::<Push>() == 8);
        assert!(std::mem::offset_of!(Push, group) == 0);
        assert!(std::mem::offset_of!(Push, first) == 4);
    };
    /// The kernel's buffers.
    pub struct Args<'a> {
        /// Reads.
        pub view: &'a Buf<super::ViewParams>,
        /// Reads.
        pub ranges: &'a Buf<[u32; 2]>,
        /// Reads.
        pub active_id: &'a Buf<u32>,
        /// Reads.
        pub geometry: &'a Buf<[f32; 4]>,
        /// Reads.
        pub sh0: &'a Buf<[f32; 4]>,
        /// Writes.
        pub splats: &'a Buf<[f32; 4]>,
        /// Writes.
        pub depth_keys: &'a Buf<u32>,
        /// Writes.
        pub identity: &'a Buf<u32>,
        /// Writes.
        pub tile_counts: &'a Buf<u32>,
        /// ReadWrites.
        pub frame_status: &'a Buf<super::Status>,
        /// Reads.
        pub motion: &'a Buf<[f32; 4]>,
        /// Reads.
        pub sh1: &'a Buf<[u32; 2]>,
        /// Reads.
        pub sh2: &'a Buf<[u32; 2]>,
        /// Reads.
        pub sh3: &'a Buf<[u32; 2]>,
    }
    impl Kernel for Args<'_> {
        type Push = Push;
        const INFO: &'static KernelInfo = INFO;
        fn slices(&self) -> Vec<Slice> {
            vec![
                self.view.slice(),
                self.ranges.slice(),
                self.active_id.slice(),
                self.geometry.slice(),
                self.sh0.slice(),
                self.splats.slice(),
                self.depth_keys.slice(),
                self.identity.slice(),
                self.tile_counts.slice(),
                self.frame_status.slice(),
                self.motion.slice(),
                self.sh1.slice(),
                self.sh2.slice(),
                self.sh3.slice(),
            ]
        }
    }
    /// What the device needs to know.
    pub const INFO: &KernelInfo = &KernelInfo {
        name: "project_static_sh1_half",
        push_bytes: size_of::<Push>() as u32,
        spirv: include_bytes!("../../shaders-glsl/spv/project_static_sh1_half.spv"),
        local: 64,
        subgroups: true,
        floats: 0x438,
        bindings: &[
            BindingInfo { name: "view", kind: BindingKind::Uniform, access: Access::Read },
            BindingInfo { name: "ranges", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "active_id", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "geometry", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "sh0", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "splats", kind: BindingKind::Storage, access: Access::Write },
            BindingInfo { name: "depth_keys", kind: BindingKind::Storage, access: Access::Write },
            BindingInfo { name: "identity", kind: BindingKind::Storage, access: Access::Write },
            BindingInfo { name: "tile_counts", kind: BindingKind::Storage, access: Access::Write },
            BindingInfo { name: "frame_status", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "motion", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "sh1", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "sh2", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "sh3", kind: BindingKind::Storage, access: Access::Read },
        ],
    };
}

/// projects the active Gaussians of a group, evaluates their colour and counts the tiles they touch.
pub mod project_static_sh2_half {
    use super::super::kernel::*;
    /// What the device needs to know. A variant of [`super::project_static_sh1_half`].
    pub const INFO: &KernelInfo = &KernelInfo {
        name: "project_static_sh2_half",
        push_bytes: size_of::<super::project_static_sh1_half::Push>() as u32,
        spirv: include_bytes!("../../shaders-glsl/spv/project_static_sh2_half.spv"),
        local: 64,
        subgroups: true,
        floats: 0x438,
        bindings: &[
            BindingInfo { name: "view", kind: BindingKind::Uniform, access: Access::Read },
            BindingInfo { name: "ranges", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "active_id", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "geometry", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "sh0", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "splats", kind: BindingKind::Storage, access: Access::Write },
            BindingInfo { name: "depth_keys", kind: BindingKind::Storage, access: Access::Write },
            BindingInfo { name: "identity", kind: BindingKind::Storage, access: Access::Write },
            BindingInfo { name: "tile_counts", kind: BindingKind::Storage, access: Access::Write },
            BindingInfo { name: "frame_status", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "motion", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "sh1", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "sh2", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "sh3", kind: BindingKind::Storage, access: Access::Read },
        ],
    };
}

/// projects the active Gaussians of a group, evaluates their colour and counts the tiles they touch.
pub mod project_static_sh3_half {
    use super::super::kernel::*;
    /// What the device needs to know. A variant of [`super::project_static_sh1_half`].
    pub const INFO: &KernelInfo = &KernelInfo {
        name: "project_static_sh3_half",
        push_bytes: size_of::<super::project_static_sh1_half::Push>() as u32,
        spirv: include_bytes!("../../shaders-glsl/spv/project_static_sh3_half.spv"),
        local: 64,
        subgroups: true,
        floats: 0x438,
        bindings: &[
            BindingInfo { name: "view", kind: BindingKind::Uniform, access: Access::Read },
            BindingInfo { name: "ranges", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "active_id", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "geometry", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "sh0", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "splats", kind: BindingKind::Storage, access: Access::Write },
            BindingInfo { name: "depth_keys", kind: BindingKind::Storage, access: Access::Write },
            BindingInfo { name: "identity", kind: BindingKind::Storage, access: Access::Write },
            BindingInfo { name: "tile_counts", kind: BindingKind::Storage, access: Access::Write },
            BindingInfo { name: "frame_status", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "motion", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "sh1", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "sh2", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "sh3", kind: BindingKind::Storage, access: Access::Read },
        ],
    };
}

/// projects the active Gaussians of a group, evaluates their colour and counts the tiles they touch.
pub mod project_dynamic_sh1_half {
    use super::super::kernel::*;
    /// What the device needs to know. A variant of [`super::project_static_sh1_half`].
    pub const INFO: &KernelInfo = &KernelInfo {
        name: "project_dynamic_sh1_half",
        push_bytes: size_of::<super::project_static_sh1_half::Push>() as u32,
        spirv: include_bytes!("../../shaders-glsl/spv/project_dynamic_sh1_half.spv"),
        local: 64,
        subgroups: true,
        floats: 0x438,
        bindings: &[
            BindingInfo { name: "view", kind: BindingKind::Uniform, access: Access::Read },
            BindingInfo { name: "ranges", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "active_id", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "geometry", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "sh0", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "splats", kind: BindingKind::Storage, access: Access::Write },
            BindingInfo { name: "depth_keys", kind: BindingKind::Storage, access: Access::Write },
            BindingInfo { name: "identity", kind: BindingKind::Storage, access: Access::Write },
            BindingInfo { name: "tile_counts", kind: BindingKind::Storage, access: Access::Write },
            BindingInfo { name: "frame_status", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "motion", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "sh1", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "sh2", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "sh3", kind: BindingKind::Storage, access: Access::Read },
        ],
    };
}

/// projects the active Gaussians of a group, evaluates their colour and counts the tiles they touch.
pub mod project_dynamic_sh2_half {
    use super::super::kernel::*;
    /// What the device needs to know. A variant of [`super::project_static_sh1_half`].
    pub const INFO: &KernelInfo = &KernelInfo {
        name: "project_dynamic_sh2_half",
        push_bytes: size_of::<super::project_static_sh1_half::Push>() as u32,
        spirv: include_bytes!("../../shaders-glsl/spv/project_dynamic_sh2_half.spv"),
        local: 64,
        subgroups: true,
        floats: 0x438,
        bindings: &[
            BindingInfo { name: "view", kind: BindingKind::Uniform, access: Access::Read },
            BindingInfo { name: "ranges", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "active_id", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "geometry", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "sh0", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "splats", kind: BindingKind::Storage, access: Access::Write },
            BindingInfo { name: "depth_keys", kind: BindingKind::Storage, access: Access::Write },
            BindingInfo { name: "identity", kind: BindingKind::Storage, access: Access::Write },
            BindingInfo { name: "tile_counts", kind: BindingKind::Storage, access: Access::Write },
            BindingInfo { name: "frame_status", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "motion", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "sh1", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "sh2", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "sh3", kind: BindingKind::Storage, access: Access::Read },
        ],
    };
}

/// projects the active Gaussians of a group, evaluates their colour and counts the tiles they touch.
pub mod project_dynamic_sh3_half {
    use super::super::kernel::*;
    /// What the device needs to know. A variant of [`super::project_static_sh1_half`].
    pub const INFO: &KernelInfo = &KernelInfo {
        name: "project_dynamic_sh3_half",
        push_bytes: size_of::<super::project_static_sh1_half::Push>() as u32,
        spirv: include_bytes!("../../shaders-glsl/spv/project_dynamic_sh3_half.spv"),
        local: 64,
        subgroups: true,
        floats: 0x438,
        bindings: &[
            BindingInfo { name: "view", kind: BindingKind::Uniform, access: Access::Read },
            BindingInfo { name: "ranges", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "active_id", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "geometry", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "sh0", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "splats", kind: BindingKind::Storage, access: Access::Write },
            BindingInfo { name: "depth_keys", kind: BindingKind::Storage, access: Access::Write },
            BindingInfo { name: "identity", kind: BindingKind::Storage, access: Access::Write },
            BindingInfo { name: "tile_counts", kind: BindingKind::Storage, access: Access::Write },
            BindingInfo { name: "frame_status", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "motion", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "sh1", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "sh2", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "sh3", kind: BindingKind::Storage, access: Access::Read },
        ],
    };
}

/// rounds a band of spherical harmonics to halves, for projection to read.
pub mod sh_half {
    use super::super::kernel::*;
    /// `Push` of the shaders.
    #[repr(C)]
    #[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
    pub struct Push {
        /// `n` of the shader.
        pub n: u32,
    }
    const _: () = {
        assert!(size_of::<Push>() == 4);
        assert!(std::mem::offset_of!(Push, n) == 0);
    };
    /// The kernel's buffers.
    pub struct Args<'a> {
        /// Reads.
        pub band: &'a Buf<[f32; 4]>,
        /// Writes.
        pub halves: &'a Buf<[u32; 2]>,
    }
    impl Kernel for Args<'_> {
        type Push = Push;
        const INFO: &'static KernelInfo = INFO;
        fn slices(&self) -> Vec<Slice> {
            vec![self.band.slice(), self.halves.slice()]
        }
    }
    /// What the device needs to know.
    pub const INFO: &KernelInfo = &KernelInfo {
        name: "sh_half",
        push_bytes: size_of::<Push>() as u32,
        spirv: include_bytes!("../../shaders-glsl/spv/sh_half.spv"),
        local: 64,
        subgroups: false,
        floats: 0x1,
        bindings: &[
            BindingInfo { name: "band", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "halves", kind: BindingKind::Storage, access: Access::Write },
        ],
    };
}

/// sums each block of 1,024 values, for the spine.
pub mod scan_reduce {
    use super::super::kernel::*;
    /// This kernel takes no push constants.
    pub type Push = ();
    /// The kernel's buffers.
    pub struct Args<'a> {
        /// Reads.
        pub count: &'a Buf<u32>,
        /// Reads.
        pub values: &'a Buf<u32>,
        /// Writes.
        pub partials: &'a Buf<u32>,
    }
    impl Kernel for Args<'_> {
        type Push = Push;
        const INFO: &'static KernelInfo = INFO;
        fn slices(&self) -> Vec<Slice> {
            vec![self.count.slice(), self.values.slice(), self.partials.slice()]
        }
    }
    /// What the device needs to know.
    pub const INFO: &KernelInfo = &KernelInfo {
        name: "scan_reduce",
        push_bytes: size_of::<Push>() as u32,
        spirv: include_bytes!("../../shaders-glsl/spv/scan_reduce.spv"),
        local: 128,
        subgroups: true,
        floats: 0x0,
        bindings: &[
            BindingInfo { name: "count", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "values", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "partials", kind: BindingKind::Storage, access: Access::Write },
        ],
    };
}

/// scans the block sums and gives the total, which saturates at 2^32 - 1.
pub mod scan_spine {
    use super::super::kernel::*;
    /// This kernel takes no push constants.
    pub type Push = ();
    /// The kernel's buffers.
    pub struct Args<'a> {
        /// Reads.
        pub count: &'a Buf<u32>,
        /// ReadWrites.
        pub partials: &'a Buf<u32>,
        /// Writes.
        pub total: &'a Buf<u32>,
    }
    impl Kernel for Args<'_> {
        type Push = Push;
        const INFO: &'static KernelInfo = INFO;
        fn slices(&self) -> Vec<Slice> {
            vec![self.count.slice(), self.partials.slice(), self.total.slice()]
        }
    }
    /// What the device needs to know.
    pub const INFO: &KernelInfo = &KernelInfo {
        name: "scan_spine",
        push_bytes: size_of::<Push>() as u32,
        spirv: include_bytes!("../../shaders-glsl/spv/scan_spine.spv"),
        local: 128,
        subgroups: true,
        floats: 0x0,
        bindings: &[
            BindingInfo { name: "count", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "partials", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "total", kind: BindingKind::Storage, access: Access::Write },
        ],
    };
}

/// replaces each value by the sum of all before it.
pub mod scan_downsweep {
    use super::super::kernel::*;
    /// This kernel takes no push constants.
    pub type Push = ();
    /// The kernel's buffers.
    pub struct Args<'a> {
        /// Reads.
        pub count: &'a Buf<u32>,
        /// Reads.
        pub partials: &'a Buf<u32>,
        /// ReadWrites.
        pub values: &'a Buf<u32>,
    }
    impl Kernel for Args<'_> {
        type Push = Push;
        const INFO: &'static KernelInfo = INFO;
        fn slices(&self) -> Vec<Slice> {
            vec![self.count.slice(), self.partials.slice(), self.values.slice()]
        }
    }
    /// What the device needs to know.
    pub const INFO: &KernelInfo = &KernelInfo {
        name: "scan_downsweep",
        push_bytes: size_of::<Push>() as u32,
        spirv: include_bytes!("../../shaders-glsl/spv/scan_downsweep.spv"),
        local: 128,
        subgroups: true,
        floats: 0x0,
        bindings: &[
            BindingInfo { name: "count", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "partials", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "values", kind: BindingKind::Storage, access: Access::ReadWrite },
        ],
    };
}

/// counts the 8-bit digits of each block of 2,048 keys, digit-major.
pub mod sort_count {
    use super::super::kernel::*;
    /// `Push` of the shaders.
    #[repr(C)]
    #[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
    pub struct Push {
        /// `shift` of the shader.
        pub shift: u32,
    }
    const _: () = {
        assert!(size_of::<Push>() == 4);
        assert!(std::mem::offset_of!(Push, shift) == 0);
    };
    /// The kernel's buffers.
    pub struct Args<'a> {
        /// Reads.
        pub count: &'a Buf<u32>,
        /// Reads.
        pub keys: &'a Buf<u32>,
        /// Writes.
        pub digits: &'a Buf<u32>,
    }
    impl Kernel for Args<'_> {
        type Push = Push;
        const INFO: &'static KernelInfo = INFO;
        fn slices(&self) -> Vec<Slice> {
            vec![self.count.slice(), self.keys.slice(), self.digits.slice()]
        }
    }
    /// What the device needs to know.
    pub const INFO: &KernelInfo = &KernelInfo {
        name: "sort_count",
        push_bytes: size_of::<Push>() as u32,
        spirv: include_bytes!("../../shaders-glsl/spv/sort_count.spv"),
        local: 64,
        subgroups: false,
        floats: 0x0,
        bindings: &[
            BindingInfo { name: "count", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "keys", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "digits", kind: BindingKind::Storage, access: Access::Write },
        ],
    };
}

/// moves each key and its value to its place by one 8-bit digit, stably.
pub mod sort_scatter {
    use super::super::kernel::*;
    /// `Push` of the shaders.
    #[repr(C)]
    #[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
    pub struct Push {
        /// `shift` of the shader.
        pub shift: u32,
    }
    const _: () = {
        assert!(size_of::<Push>() == 4);
        assert!(std::mem::offset_of!(Push, shift) == 0);
    };
    /// The kernel's buffers.
    pub struct Args<'a> {
        /// Reads.
        pub count: &'a Buf<u32>,
        /// Reads.
        pub digits: &'a Buf<u32>,
        /// Reads.
        pub keys_in: &'a Buf<u32>,
        /// Reads.
        pub values_in: &'a Buf<u32>,
        /// Writes.
        pub keys_out: &'a Buf<u32>,
        /// Writes.
        pub values_out: &'a Buf<u32>,
    }
    impl Kernel for Args<'_> {
        type Push = Push;
        const INFO: &'static KernelInfo = INFO;
        fn slices(&self) -> Vec<Slice> {
            vec![
                self.count.slice(),
                self.digits.slice(),
                self.keys_in.slice(),
                self.values_in.slice(),
                self.keys_out.slice(),
                self.values_out.slice(),
            ]
        }
    }
    /// What the device needs to know.
    pub const INFO: &KernelInfo = &KernelInfo {
        name: "sort_scatter",
        push_bytes: size_of::<Push>() as u32,
        spirv: include_bytes!("../../shaders-glsl/spv/sort_scatter.spv"),
        local: 64,
        subgroups: true,
        floats: 0x0,
        bindings: &[
            BindingInfo { name: "count", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "digits", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "keys_in", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "values_in", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "keys_out", kind: BindingKind::Storage, access: Access::Write },
            BindingInfo { name: "values_out", kind: BindingKind::Storage, access: Access::Write },
        ],
    };
}

/// moves each key and its value to its place by one 8-bit digit, stably.
pub mod sort_scatter_w32 {
    use super::super::kernel::*;
    /// What the device needs to know. A variant of [`super::sort_scatter`].
    pub const INFO: &KernelInfo = &KernelInfo {
        name: "sort_scatter_w32",
        push_bytes: size_of::<super::sort_scatter::Push>() as u32,
        spirv: include_bytes!("../../shaders-glsl/spv/sort_scatter_w32.spv"),
        local: 64,
        subgroups: true,
        floats: 0x0,
        bindings: &[
            BindingInfo { name: "count", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "digits", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "keys_in", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "values_in", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "keys_out", kind: BindingKind::Storage, access: Access::Write },
            BindingInfo { name: "values_out", kind: BindingKind::Storage, access: Access::Write },
        ],
    };
}

/// reads a table in the order of a list of indices.
pub mod gather {
    use super::super::kernel::*;
    /// This kernel takes no push constants.
    pub type Push = ();
    /// The kernel's buffers.
    pub struct Args<'a> {
        /// Reads.
        pub count: &'a Buf<u32>,
        /// Reads.
        pub index: &'a Buf<u32>,
        /// Reads.
        pub table: &'a Buf<u32>,
        /// Writes.
        pub gathered: &'a Buf<u32>,
    }
    impl Kernel for Args<'_> {
        type Push = Push;
        const INFO: &'static KernelInfo = INFO;
        fn slices(&self) -> Vec<Slice> {
            vec![self.count.slice(), self.index.slice(), self.table.slice(), self.gathered.slice()]
        }
    }
    /// What the device needs to know.
    pub const INFO: &KernelInfo = &KernelInfo {
        name: "gather",
        push_bytes: size_of::<Push>() as u32,
        spirv: include_bytes!("../../shaders-glsl/spv/gather.spv"),
        local: 64,
        subgroups: false,
        floats: 0x0,
        bindings: &[
            BindingInfo { name: "count", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "index", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "table", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "gathered", kind: BindingKind::Storage, access: Access::Write },
        ],
    };
}

/// turns the number of intersections into grids, and reports an overflow.
pub mod prepare_intersections {
    use super::super::kernel::*;
    /// `Push` of the shaders.
    #[repr(C)]
    #[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
    pub struct Push {
        /// `capacity` of the shader.
        pub capacity: u32,
    }
    const _: () = {
        assert!(size_of::<Push>() == 4);
        assert!(std::mem::offset_of!(Push, capacity) == 0);
    };
    /// The kernel's buffers.
    pub struct Args<'a> {
        /// ReadWrites.
        pub n_intersections: &'a Buf<u32>,
        /// ReadWrites.
        pub args: &'a Buf<[u32; 4]>,
        /// Writes.
        pub n_digits: &'a Buf<u32>,
        /// Writes.
        pub emit_args: &'a Buf<[u32; 4]>,
        /// ReadWrites.
        pub frame_status: &'a Buf<super::Status>,
    }
    impl Kernel for Args<'_> {
        type Push = Push;
        const INFO: &'static KernelInfo = INFO;
        fn slices(&self) -> Vec<Slice> {
            vec![
                self.n_intersections.slice(),
                self.args.slice(),
                self.n_digits.slice(),
                self.emit_args.slice(),
                self.frame_status.slice(),
            ]
        }
    }
    /// What the device needs to know.
    pub const INFO: &KernelInfo = &KernelInfo {
        name: "prepare_intersections",
        push_bytes: size_of::<Push>() as u32,
        spirv: include_bytes!("../../shaders-glsl/spv/prepare_intersections.spv"),
        local: 1,
        subgroups: false,
        floats: 0x0,
        bindings: &[
            BindingInfo { name: "n_intersections", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "args", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "n_digits", kind: BindingKind::Storage, access: Access::Write },
            BindingInfo { name: "emit_args", kind: BindingKind::Storage, access: Access::Write },
            BindingInfo { name: "frame_status", kind: BindingKind::Storage, access: Access::ReadWrite },
        ],
    };
}

/// writes one (tile, Gaussian) pair per tile that a Gaussian touches, in depth order.
pub mod emit {
    use super::super::kernel::*;
    /// This kernel takes no push constants.
    pub type Push = ();
    /// The kernel's buffers.
    pub struct Args<'a> {
        /// Reads.
        pub view: &'a Buf<super::ViewParams>,
        /// Reads.
        pub n_active: &'a Buf<u32>,
        /// Reads.
        pub order: &'a Buf<u32>,
        /// Reads.
        pub tile_counts: &'a Buf<u32>,
        /// Reads.
        pub offsets: &'a Buf<u32>,
        /// Reads.
        pub splats: &'a Buf<[f32; 4]>,
        /// Writes.
        pub tile_keys: &'a Buf<u32>,
        /// Writes.
        pub splat_ids: &'a Buf<u32>,
    }
    impl Kernel for Args<'_> {
        type Push = Push;
        const INFO: &'static KernelInfo = INFO;
        fn slices(&self) -> Vec<Slice> {
            vec![
                self.view.slice(),
                self.n_active.slice(),
                self.order.slice(),
                self.tile_counts.slice(),
                self.offsets.slice(),
                self.splats.slice(),
                self.tile_keys.slice(),
                self.splat_ids.slice(),
            ]
        }
    }
    /// What the device needs to know.
    pub const INFO: &KernelInfo = &KernelInfo {
        name: "emit",
        push_bytes: size_of::<Push>() as u32,
        spirv: include_bytes!("../../shaders-glsl/spv/emit.spv"),
        local: 64,
        subgroups: true,
        floats: 0x20,
        bindings: &[
            BindingInfo { name: "view", kind: BindingKind::Uniform, access: Access::Read },
            BindingInfo { name: "n_active", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "order", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "tile_counts", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "offsets", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "splats", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "tile_keys", kind: BindingKind::Storage, access: Access::Write },
            BindingInfo { name: "splat_ids", kind: BindingKind::Storage, access: Access::Write },
        ],
    };
}

/// writes one (tile, Gaussian) pair per tile that a Gaussian touches, in depth order.
pub mod emit_slots {
    use super::super::kernel::*;
    /// This kernel takes no push constants.
    pub type Push = ();
    /// The kernel's buffers.
    pub struct Args<'a> {
        /// Reads.
        pub view: &'a Buf<super::ViewParams>,
        /// Reads.
        pub n_active: &'a Buf<u32>,
        /// Reads.
        pub order: &'a Buf<u32>,
        /// Reads.
        pub tile_counts: &'a Buf<u32>,
        /// Reads.
        pub offsets: &'a Buf<u32>,
        /// Reads.
        pub splats: &'a Buf<[f32; 4]>,
        /// Writes.
        pub tile_keys: &'a Buf<u32>,
        /// Writes.
        pub splat_ids: &'a Buf<u32>,
        /// Writes.
        pub slots: &'a Buf<u32>,
        /// Writes.
        pub slot_first: &'a Buf<u32>,
    }
    impl Kernel for Args<'_> {
        type Push = Push;
        const INFO: &'static KernelInfo = INFO;
        fn slices(&self) -> Vec<Slice> {
            vec![
                self.view.slice(),
                self.n_active.slice(),
                self.order.slice(),
                self.tile_counts.slice(),
                self.offsets.slice(),
                self.splats.slice(),
                self.tile_keys.slice(),
                self.splat_ids.slice(),
                self.slots.slice(),
                self.slot_first.slice(),
            ]
        }
    }
    /// What the device needs to know.
    pub const INFO: &KernelInfo = &KernelInfo {
        name: "emit_slots",
        push_bytes: size_of::<Push>() as u32,
        spirv: include_bytes!("../../shaders-glsl/spv/emit_slots.spv"),
        local: 64,
        subgroups: true,
        floats: 0x20,
        bindings: &[
            BindingInfo { name: "view", kind: BindingKind::Uniform, access: Access::Read },
            BindingInfo { name: "n_active", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "order", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "tile_counts", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "offsets", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "splats", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "tile_keys", kind: BindingKind::Storage, access: Access::Write },
            BindingInfo { name: "splat_ids", kind: BindingKind::Storage, access: Access::Write },
            BindingInfo { name: "slots", kind: BindingKind::Storage, access: Access::Write },
            BindingInfo { name: "slot_first", kind: BindingKind::Storage, access: Access::Write },
        ],
    };
}

/// finds where each tile's list begins and ends among the sorted intersections.
pub mod tile_ranges {
    use super::super::kernel::*;
    /// `Push` of the shaders.
    #[repr(C)]
    #[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
    pub struct Push {
        /// `n_tiles` of the shader.
        pub n_tiles: u32,
    }
    const _: () = {
        assert!(size_of::<Push>() == 4);
        assert!(std::mem::offset_of!(Push, n_tiles) == 0);
    };
    /// The kernel's buffers.
    pub struct Args<'a> {
        /// Reads.
        pub n_intersections: &'a Buf<u32>,
        /// Reads.
        pub tile_keys: &'a Buf<u32>,
        /// Writes.
        pub tile_first: &'a Buf<u32>,
        /// Writes.
        pub tile_last: &'a Buf<u32>,
    }
    impl Kernel for Args<'_> {
        type Push = Push;
        const INFO: &'static KernelInfo = INFO;
        fn slices(&self) -> Vec<Slice> {
            vec![self.n_intersections.slice(), self.tile_keys.slice(), self.tile_first.slice(), self.tile_last.slice()]
        }
    }
    /// What the device needs to know.
    pub const INFO: &KernelInfo = &KernelInfo {
        name: "tile_ranges",
        push_bytes: size_of::<Push>() as u32,
        spirv: include_bytes!("../../shaders-glsl/spv/tile_ranges.spv"),
        local: 64,
        subgroups: false,
        floats: 0x0,
        bindings: &[
            BindingInfo { name: "n_intersections", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "tile_keys", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "tile_first", kind: BindingKind::Storage, access: Access::Write },
            BindingInfo { name: "tile_last", kind: BindingKind::Storage, access: Access::Write },
        ],
    };
}

/// counts the tiles by the logarithm of their list's length, and finds the longest list.
pub mod tile_buckets {
    use super::super::kernel::*;
    /// `Push` of the shaders.
    #[repr(C)]
    #[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
    pub struct Push {
        /// `n_tiles` of the shader.
        pub n_tiles: u32,
        /// `longest` of the shader.
        pub longest: u32,
    }
    const _: () = {
        assert!(size_of::<Push>() == 8);
        assert!(std::mem::offset_of!(Push, n_tiles) == 0);
        assert!(std::mem::offset_of!(Push, longest) == 4);
    };
    /// The kernel's buffers.
    pub struct Args<'a> {
        /// Reads.
        pub tile_first: &'a Buf<u32>,
        /// Reads.
        pub tile_last: &'a Buf<u32>,
        /// ReadWrites.
        pub buckets: &'a Buf<u32>,
        /// ReadWrites.
        pub frame_status: &'a Buf<super::Status>,
    }
    impl Kernel for Args<'_> {
        type Push = Push;
        const INFO: &'static KernelInfo = INFO;
        fn slices(&self) -> Vec<Slice> {
            vec![self.tile_first.slice(), self.tile_last.slice(), self.buckets.slice(), self.frame_status.slice()]
        }
    }
    /// What the device needs to know.
    pub const INFO: &KernelInfo = &KernelInfo {
        name: "tile_buckets",
        push_bytes: size_of::<Push>() as u32,
        spirv: include_bytes!("../../shaders-glsl/spv/tile_buckets.spv"),
        local: 64,
        subgroups: false,
        floats: 0x0,
        bindings: &[
            BindingInfo { name: "tile_first", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "tile_last", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "buckets", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "frame_status", kind: BindingKind::Storage, access: Access::ReadWrite },
        ],
    };
}

/// lists the tiles, heavy ones first, so that no device ends on its longest list.
pub mod tile_order {
    use super::super::kernel::*;
    /// `Push` of the shaders.
    #[repr(C)]
    #[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
    pub struct Push {
        /// `n_tiles` of the shader.
        pub n_tiles: u32,
    }
    const _: () = {
        assert!(size_of::<Push>() == 4);
        assert!(std::mem::offset_of!(Push, n_tiles) == 0);
    };
    /// The kernel's buffers.
    pub struct Args<'a> {
        /// Reads.
        pub tile_first: &'a Buf<u32>,
        /// Reads.
        pub tile_last: &'a Buf<u32>,
        /// Reads.
        pub buckets: &'a Buf<u32>,
        /// ReadWrites.
        pub cursors: &'a Buf<u32>,
        /// Writes.
        pub tile_order: &'a Buf<u32>,
    }
    impl Kernel for Args<'_> {
        type Push = Push;
        const INFO: &'static KernelInfo = INFO;
        fn slices(&self) -> Vec<Slice> {
            vec![
                self.tile_first.slice(),
                self.tile_last.slice(),
                self.buckets.slice(),
                self.cursors.slice(),
                self.tile_order.slice(),
            ]
        }
    }
    /// What the device needs to know.
    pub const INFO: &KernelInfo = &KernelInfo {
        name: "tile_order",
        push_bytes: size_of::<Push>() as u32,
        spirv: include_bytes!("../../shaders-glsl/spv/tile_order.spv"),
        local: 64,
        subgroups: false,
        floats: 0x0,
        bindings: &[
            BindingInfo { name: "tile_first", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "tile_last", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "buckets", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "cursors", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "tile_order", kind: BindingKind::Storage, access: Access::Write },
        ],
    };
}

/// blends each tile's Gaussians front to back into colour, alpha, depth, inverse depth and flow.
pub mod blend_fwd_p4 {
    use super::super::kernel::*;
    /// `Push` of the shaders.
    #[repr(C)]
    #[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
    pub struct Push {
        /// `n_blocks` of the shader.
        pub n_blocks: u32,
        /// `stride` of the shader.
        pub stride: u32,
        /// `round` of the shader.
        pub round: u32,
        /// `last_round` of the shader.
        pub last_round: u32,
    }
    const _: () = {
        assert!(size_of::<Push>() == 16);
        assert!(std::mem::offset_of!(Push, n_blocks) == 0);
        assert!(std::mem::offset_of!(Push, stride) == 4);
        assert!(std::mem::offset_of!(Push, round) == 8);
        assert!(std::mem::offset_of!(Push, last_round) == 12);
    };
    /// The kernel's buffers.
    pub struct Args<'a> {
        /// Reads.
        pub view: &'a Buf<super::ViewParams>,
        /// Reads.
        pub tile_order: &'a Buf<u32>,
        /// Reads.
        pub tile_first: &'a Buf<u32>,
        /// Reads.
        pub tile_last: &'a Buf<u32>,
        /// Reads.
        pub splat_ids: &'a Buf<u32>,
        /// Reads.
        pub splats: &'a Buf<[f32; 4]>,
        /// ReadWrites.
        pub image0: &'a Buf<[f32; 4]>,
        /// ReadWrites.
        pub image1: &'a Buf<[f32; 4]>,
    }
    impl Kernel for Args<'_> {
        type Push = Push;
        const INFO: &'static KernelInfo = INFO;
        fn slices(&self) -> Vec<Slice> {
            vec![
                self.view.slice(),
                self.tile_order.slice(),
                self.tile_first.slice(),
                self.tile_last.slice(),
                self.splat_ids.slice(),
                self.splats.slice(),
                self.image0.slice(),
                self.image1.slice(),
            ]
        }
    }
    /// What the device needs to know.
    pub const INFO: &KernelInfo = &KernelInfo {
        name: "blend_fwd_p4",
        push_bytes: size_of::<Push>() as u32,
        spirv: include_bytes!("../../shaders-glsl/spv/blend_fwd_p4.spv"),
        local: 64,
        subgroups: true,
        floats: 0xe0,
        bindings: &[
            BindingInfo { name: "view", kind: BindingKind::Uniform, access: Access::Read },
            BindingInfo { name: "tile_order", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "tile_first", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "tile_last", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "splat_ids", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "splats", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "image0", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "image1", kind: BindingKind::Storage, access: Access::ReadWrite },
        ],
    };
}

/// blends each tile's Gaussians front to back into colour, alpha, depth, inverse depth and flow.
pub mod blend_fwd_p8 {
    use super::super::kernel::*;
    /// What the device needs to know. A variant of [`super::blend_fwd_p4`].
    pub const INFO: &KernelInfo = &KernelInfo {
        name: "blend_fwd_p8",
        push_bytes: size_of::<super::blend_fwd_p4::Push>() as u32,
        spirv: include_bytes!("../../shaders-glsl/spv/blend_fwd_p8.spv"),
        local: 64,
        subgroups: true,
        floats: 0xe0,
        bindings: &[
            BindingInfo { name: "view", kind: BindingKind::Uniform, access: Access::Read },
            BindingInfo { name: "tile_order", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "tile_first", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "tile_last", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "splat_ids", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "splats", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "image0", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "image1", kind: BindingKind::Storage, access: Access::ReadWrite },
        ],
    };
}

/// blends each tile's Gaussians front to back into colour, alpha, depth, inverse depth and flow.
pub mod blend_fwd_color_p4 {
    use super::super::kernel::*;
    /// What the device needs to know. A variant of [`super::blend_fwd_p4`].
    pub const INFO: &KernelInfo = &KernelInfo {
        name: "blend_fwd_color_p4",
        push_bytes: size_of::<super::blend_fwd_p4::Push>() as u32,
        spirv: include_bytes!("../../shaders-glsl/spv/blend_fwd_color_p4.spv"),
        local: 64,
        subgroups: true,
        floats: 0xe0,
        bindings: &[
            BindingInfo { name: "view", kind: BindingKind::Uniform, access: Access::Read },
            BindingInfo { name: "tile_order", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "tile_first", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "tile_last", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "splat_ids", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "splats", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "image0", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "image1", kind: BindingKind::Storage, access: Access::ReadWrite },
        ],
    };
}

/// blends each tile's Gaussians front to back into colour, alpha, depth, inverse depth and flow.
pub mod blend_fwd_color_p8 {
    use super::super::kernel::*;
    /// What the device needs to know. A variant of [`super::blend_fwd_p4`].
    pub const INFO: &KernelInfo = &KernelInfo {
        name: "blend_fwd_color_p8",
        push_bytes: size_of::<super::blend_fwd_p4::Push>() as u32,
        spirv: include_bytes!("../../shaders-glsl/spv/blend_fwd_color_p8.spv"),
        local: 64,
        subgroups: true,
        floats: 0xe0,
        bindings: &[
            BindingInfo { name: "view", kind: BindingKind::Uniform, access: Access::Read },
            BindingInfo { name: "tile_order", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "tile_first", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "tile_last", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "splat_ids", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "splats", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "image0", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "image1", kind: BindingKind::Storage, access: Access::ReadWrite },
        ],
    };
}

/// blends each tile's Gaussians front to back into colour, alpha, depth, inverse depth and flow.
pub mod blend_fwd_train_p4 {
    use super::super::kernel::*;
    /// `Push` of the shaders.
    #[repr(C)]
    #[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
    pub struct Push {
        /// `n_blocks` of the shader.
        pub n_blocks: u32,
        /// `stride` of the shader.
        pub stride: u32,
        /// `round` of the shader.
        pub round: u32,
        /// `last_round` of the shader.
        pub last_round: u32,
    }
    const _: () = {
        assert!(size_of::<Push>() == 16);
        assert!(std::mem::offset_of!(Push, n_blocks) == 0);
        assert!(std::mem::offset_of!(Push, stride) == 4);
        assert!(std::mem::offset_of!(Push, round) == 8);
        assert!(std::mem::offset_of!(Push, last_round) == 12);
    };
    /// The kernel's buffers.
    pub struct Args<'a> {
        /// Reads.
        pub view: &'a Buf<super::ViewParams>,
        /// Reads.
        pub tile_order: &'a Buf<u32>,
        /// Reads.
        pub tile_first: &'a Buf<u32>,
        /// Reads.
        pub tile_last: &'a Buf<u32>,
        /// Reads.
        pub splat_ids: &'a Buf<u32>,
        /// Reads.
        pub splats: &'a Buf<[f32; 4]>,
        /// ReadWrites.
        pub image0: &'a Buf<[f32; 4]>,
        /// ReadWrites.
        pub image1: &'a Buf<[f32; 4]>,
        /// ReadWrites.
        pub tail: &'a Buf<[u32; 2]>,
    }
    impl Kernel for Args<'_> {
        type Push = Push;
        const INFO: &'static KernelInfo = INFO;
        fn slices(&self) -> Vec<Slice> {
            vec![
                self.view.slice(),
                self.tile_order.slice(),
                self.tile_first.slice(),
                self.tile_last.slice(),
                self.splat_ids.slice(),
                self.splats.slice(),
                self.image0.slice(),
                self.image1.slice(),
                self.tail.slice(),
            ]
        }
    }
    /// What the device needs to know.
    pub const INFO: &KernelInfo = &KernelInfo {
        name: "blend_fwd_train_p4",
        push_bytes: size_of::<Push>() as u32,
        spirv: include_bytes!("../../shaders-glsl/spv/blend_fwd_train_p4.spv"),
        local: 64,
        subgroups: true,
        floats: 0xe0,
        bindings: &[
            BindingInfo { name: "view", kind: BindingKind::Uniform, access: Access::Read },
            BindingInfo { name: "tile_order", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "tile_first", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "tile_last", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "splat_ids", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "splats", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "image0", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "image1", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "tail", kind: BindingKind::Storage, access: Access::ReadWrite },
        ],
    };
}

/// blends each tile's Gaussians front to back into colour, alpha, depth, inverse depth and flow.
pub mod blend_fwd_train_p8 {
    use super::super::kernel::*;
    /// What the device needs to know. A variant of [`super::blend_fwd_train_p4`].
    pub const INFO: &KernelInfo = &KernelInfo {
        name: "blend_fwd_train_p8",
        push_bytes: size_of::<super::blend_fwd_train_p4::Push>() as u32,
        spirv: include_bytes!("../../shaders-glsl/spv/blend_fwd_train_p8.spv"),
        local: 64,
        subgroups: true,
        floats: 0xe0,
        bindings: &[
            BindingInfo { name: "view", kind: BindingKind::Uniform, access: Access::Read },
            BindingInfo { name: "tile_order", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "tile_first", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "tile_last", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "splat_ids", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "splats", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "image0", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "image1", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "tail", kind: BindingKind::Storage, access: Access::ReadWrite },
        ],
    };
}

/// blends each tile's Gaussians front to back into colour, alpha, depth, inverse depth and flow.
pub mod blend_fwd_train_color_p4 {
    use super::super::kernel::*;
    /// What the device needs to know. A variant of [`super::blend_fwd_train_p4`].
    pub const INFO: &KernelInfo = &KernelInfo {
        name: "blend_fwd_train_color_p4",
        push_bytes: size_of::<super::blend_fwd_train_p4::Push>() as u32,
        spirv: include_bytes!("../../shaders-glsl/spv/blend_fwd_train_color_p4.spv"),
        local: 64,
        subgroups: true,
        floats: 0xe0,
        bindings: &[
            BindingInfo { name: "view", kind: BindingKind::Uniform, access: Access::Read },
            BindingInfo { name: "tile_order", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "tile_first", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "tile_last", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "splat_ids", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "splats", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "image0", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "image1", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "tail", kind: BindingKind::Storage, access: Access::ReadWrite },
        ],
    };
}

/// blends each tile's Gaussians front to back into colour, alpha, depth, inverse depth and flow.
pub mod blend_fwd_train_color_p8 {
    use super::super::kernel::*;
    /// What the device needs to know. A variant of [`super::blend_fwd_train_p4`].
    pub const INFO: &KernelInfo = &KernelInfo {
        name: "blend_fwd_train_color_p8",
        push_bytes: size_of::<super::blend_fwd_train_p4::Push>() as u32,
        spirv: include_bytes!("../../shaders-glsl/spv/blend_fwd_train_color_p8.spv"),
        local: 64,
        subgroups: true,
        floats: 0xe0,
        bindings: &[
            BindingInfo { name: "view", kind: BindingKind::Uniform, access: Access::Read },
            BindingInfo { name: "tile_order", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "tile_first", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "tile_last", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "splat_ids", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "splats", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "image0", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "image1", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "tail", kind: BindingKind::Storage, access: Access::ReadWrite },
        ],
    };
}

/// carries the cotangents of a picture back to the splats, in one of four modes of accumulation.
pub mod blend_bwd_p4 {
    use super::super::kernel::*;
    /// `Push` of the shaders.
    #[repr(C)]
    #[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
    pub struct Push {
        /// `n_work` of the shader.
        pub n_work: u32,
        /// `stride` of the shader.
        pub stride: u32,
        /// `block` of the shader.
        pub block: u32,
        /// `segment` of the shader.
        pub segment: u32,
        /// `first_round` of the shader.
        pub first_round: u32,
        /// `scale` of the shader.
        pub scale: f32,
    }
    const _: () = {
        assert!(size_of::<Push>() == 24);
        assert!(std::mem::offset_of!(Push, n_work) == 0);
        assert!(std::mem::offset_of!(Push, stride) == 4);
        assert!(std::mem::offset_of!(Push, block) == 8);
        assert!(std::mem::offset_of!(Push, segment) == 12);
        assert!(std::mem::offset_of!(Push, first_round) == 16);
        assert!(std::mem::offset_of!(Push, scale) == 20);
    };
    /// The kernel's buffers.
    pub struct Args<'a> {
        /// Reads.
        pub view: &'a Buf<super::ViewParams>,
        /// Reads.
        pub tile_order: &'a Buf<u32>,
        /// Reads.
        pub tile_first: &'a Buf<u32>,
        /// Reads.
        pub splat_ids: &'a Buf<u32>,
        /// Reads.
        pub slots: &'a Buf<u32>,
        /// Reads.
        pub splats: &'a Buf<[f32; 4]>,
        /// Reads.
        pub tail: &'a Buf<[u32; 2]>,
        /// Reads.
        pub d_image0: &'a Buf<[f32; 4]>,
        /// ReadWrites.
        pub carry: &'a Buf<[f32; 2]>,
        /// ReadWrites.
        pub d_slots: &'a Buf<[f32; 2]>,
        /// Reads.
        pub d_image1: &'a Buf<[f32; 4]>,
    }
    impl Kernel for Args<'_> {
        type Push = Push;
        const INFO: &'static KernelInfo = INFO;
        fn slices(&self) -> Vec<Slice> {
            vec![
                self.view.slice(),
                self.tile_order.slice(),
                self.tile_first.slice(),
                self.splat_ids.slice(),
                self.slots.slice(),
                self.splats.slice(),
                self.tail.slice(),
                self.d_image0.slice(),
                self.carry.slice(),
                self.d_slots.slice(),
                self.d_image1.slice(),
            ]
        }
    }
    /// What the device needs to know.
    pub const INFO: &KernelInfo = &KernelInfo {
        name: "blend_bwd_p4",
        push_bytes: size_of::<Push>() as u32,
        spirv: include_bytes!("../../shaders-glsl/spv/blend_bwd_p4.spv"),
        local: 64,
        subgroups: true,
        floats: 0x7a0,
        bindings: &[
            BindingInfo { name: "view", kind: BindingKind::Uniform, access: Access::Read },
            BindingInfo { name: "tile_order", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "tile_first", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "splat_ids", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "slots", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "splats", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "tail", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "d_image0", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "carry", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "d_slots", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "d_image1", kind: BindingKind::Storage, access: Access::Read },
        ],
    };
}

/// carries the cotangents of a picture back to the splats, in one of four modes of accumulation.
pub mod blend_bwd_p8 {
    use super::super::kernel::*;
    /// What the device needs to know. A variant of [`super::blend_bwd_p4`].
    pub const INFO: &KernelInfo = &KernelInfo {
        name: "blend_bwd_p8",
        push_bytes: size_of::<super::blend_bwd_p4::Push>() as u32,
        spirv: include_bytes!("../../shaders-glsl/spv/blend_bwd_p8.spv"),
        local: 64,
        subgroups: true,
        floats: 0x7a0,
        bindings: &[
            BindingInfo { name: "view", kind: BindingKind::Uniform, access: Access::Read },
            BindingInfo { name: "tile_order", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "tile_first", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "splat_ids", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "slots", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "splats", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "tail", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "d_image0", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "carry", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "d_slots", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "d_image1", kind: BindingKind::Storage, access: Access::Read },
        ],
    };
}

/// carries the cotangents of a picture back to the splats, in one of four modes of accumulation.
pub mod blend_bwd_color_p4 {
    use super::super::kernel::*;
    /// What the device needs to know. A variant of [`super::blend_bwd_p4`].
    pub const INFO: &KernelInfo = &KernelInfo {
        name: "blend_bwd_color_p4",
        push_bytes: size_of::<super::blend_bwd_p4::Push>() as u32,
        spirv: include_bytes!("../../shaders-glsl/spv/blend_bwd_color_p4.spv"),
        local: 64,
        subgroups: true,
        floats: 0x7a0,
        bindings: &[
            BindingInfo { name: "view", kind: BindingKind::Uniform, access: Access::Read },
            BindingInfo { name: "tile_order", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "tile_first", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "splat_ids", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "slots", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "splats", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "tail", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "d_image0", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "carry", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "d_slots", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "d_image1", kind: BindingKind::Storage, access: Access::Read },
        ],
    };
}

/// carries the cotangents of a picture back to the splats, in one of four modes of accumulation.
pub mod blend_bwd_color_p8 {
    use super::super::kernel::*;
    /// What the device needs to know. A variant of [`super::blend_bwd_p4`].
    pub const INFO: &KernelInfo = &KernelInfo {
        name: "blend_bwd_color_p8",
        push_bytes: size_of::<super::blend_bwd_p4::Push>() as u32,
        spirv: include_bytes!("../../shaders-glsl/spv/blend_bwd_color_p8.spv"),
        local: 64,
        subgroups: true,
        floats: 0x7a0,
        bindings: &[
            BindingInfo { name: "view", kind: BindingKind::Uniform, access: Access::Read },
            BindingInfo { name: "tile_order", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "tile_first", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "splat_ids", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "slots", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "splats", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "tail", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "d_image0", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "carry", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "d_slots", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "d_image1", kind: BindingKind::Storage, access: Access::Read },
        ],
    };
}

/// carries the cotangents of a picture back to the splats, in one of four modes of accumulation.
pub mod blend_bwd_float_p4 {
    use super::super::kernel::*;
    /// `Push` of the shaders.
    #[repr(C)]
    #[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
    pub struct Push {
        /// `n_work` of the shader.
        pub n_work: u32,
        /// `stride` of the shader.
        pub stride: u32,
        /// `block` of the shader.
        pub block: u32,
        /// `segment` of the shader.
        pub segment: u32,
        /// `first_round` of the shader.
        pub first_round: u32,
        /// `scale` of the shader.
        pub scale: f32,
    }
    const _: () = {
        assert!(size_of::<Push>() == 24);
        assert!(std::mem::offset_of!(Push, n_work) == 0);
        assert!(std::mem::offset_of!(Push, stride) == 4);
        assert!(std::mem::offset_of!(Push, block) == 8);
        assert!(std::mem::offset_of!(Push, segment) == 12);
        assert!(std::mem::offset_of!(Push, first_round) == 16);
        assert!(std::mem::offset_of!(Push, scale) == 20);
    };
    /// The kernel's buffers.
    pub struct Args<'a> {
        /// Reads.
        pub view: &'a Buf<super::ViewParams>,
        /// Reads.
        pub tile_order: &'a Buf<u32>,
        /// Reads.
        pub tile_first: &'a Buf<u32>,
        /// Reads.
        pub splat_ids: &'a Buf<u32>,
        /// Reads.
        pub slots: &'a Buf<u32>,
        /// Reads.
        pub splats: &'a Buf<[f32; 4]>,
        /// Reads.
        pub tail: &'a Buf<[u32; 2]>,
        /// Reads.
        pub d_image0: &'a Buf<[f32; 4]>,
        /// ReadWrites.
        pub carry: &'a Buf<[f32; 2]>,
        /// ReadWrites.
        pub d_slots: &'a Buf<f32>,
        /// Reads.
        pub d_image1: &'a Buf<[f32; 4]>,
    }
    impl Kernel for Args<'_> {
        type Push = Push;
        const INFO: &'static KernelInfo = INFO;
        fn slices(&self) -> Vec<Slice> {
            vec![
                self.view.slice(),
                self.tile_order.slice(),
                self.tile_first.slice(),
                self.splat_ids.slice(),
                self.slots.slice(),
                self.splats.slice(),
                self.tail.slice(),
                self.d_image0.slice(),
                self.carry.slice(),
                self.d_slots.slice(),
                self.d_image1.slice(),
            ]
        }
    }
    /// What the device needs to know.
    pub const INFO: &KernelInfo = &KernelInfo {
        name: "blend_bwd_float_p4",
        push_bytes: size_of::<Push>() as u32,
        spirv: include_bytes!("../../shaders-glsl/spv/blend_bwd_float_p4.spv"),
        local: 64,
        subgroups: true,
        floats: 0x7a0,
        bindings: &[
            BindingInfo { name: "view", kind: BindingKind::Uniform, access: Access::Read },
            BindingInfo { name: "tile_order", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "tile_first", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "splat_ids", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "slots", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "splats", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "tail", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "d_image0", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "carry", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "d_slots", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "d_image1", kind: BindingKind::Storage, access: Access::Read },
        ],
    };
}

/// carries the cotangents of a picture back to the splats, in one of four modes of accumulation.
pub mod blend_bwd_float_p8 {
    use super::super::kernel::*;
    /// What the device needs to know. A variant of [`super::blend_bwd_float_p4`].
    pub const INFO: &KernelInfo = &KernelInfo {
        name: "blend_bwd_float_p8",
        push_bytes: size_of::<super::blend_bwd_float_p4::Push>() as u32,
        spirv: include_bytes!("../../shaders-glsl/spv/blend_bwd_float_p8.spv"),
        local: 64,
        subgroups: true,
        floats: 0x7a0,
        bindings: &[
            BindingInfo { name: "view", kind: BindingKind::Uniform, access: Access::Read },
            BindingInfo { name: "tile_order", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "tile_first", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "splat_ids", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "slots", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "splats", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "tail", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "d_image0", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "carry", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "d_slots", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "d_image1", kind: BindingKind::Storage, access: Access::Read },
        ],
    };
}

/// carries the cotangents of a picture back to the splats, in one of four modes of accumulation.
pub mod blend_bwd_float_color_p4 {
    use super::super::kernel::*;
    /// What the device needs to know. A variant of [`super::blend_bwd_float_p4`].
    pub const INFO: &KernelInfo = &KernelInfo {
        name: "blend_bwd_float_color_p4",
        push_bytes: size_of::<super::blend_bwd_float_p4::Push>() as u32,
        spirv: include_bytes!("../../shaders-glsl/spv/blend_bwd_float_color_p4.spv"),
        local: 64,
        subgroups: true,
        floats: 0x7a0,
        bindings: &[
            BindingInfo { name: "view", kind: BindingKind::Uniform, access: Access::Read },
            BindingInfo { name: "tile_order", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "tile_first", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "splat_ids", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "slots", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "splats", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "tail", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "d_image0", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "carry", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "d_slots", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "d_image1", kind: BindingKind::Storage, access: Access::Read },
        ],
    };
}

/// carries the cotangents of a picture back to the splats, in one of four modes of accumulation.
pub mod blend_bwd_float_color_p8 {
    use super::super::kernel::*;
    /// What the device needs to know. A variant of [`super::blend_bwd_float_p4`].
    pub const INFO: &KernelInfo = &KernelInfo {
        name: "blend_bwd_float_color_p8",
        push_bytes: size_of::<super::blend_bwd_float_p4::Push>() as u32,
        spirv: include_bytes!("../../shaders-glsl/spv/blend_bwd_float_color_p8.spv"),
        local: 64,
        subgroups: true,
        floats: 0x7a0,
        bindings: &[
            BindingInfo { name: "view", kind: BindingKind::Uniform, access: Access::Read },
            BindingInfo { name: "tile_order", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "tile_first", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "splat_ids", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "slots", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "splats", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "tail", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "d_image0", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "carry", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "d_slots", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "d_image1", kind: BindingKind::Storage, access: Access::Read },
        ],
    };
}

/// carries the cotangents of a picture back to the splats, in one of four modes of accumulation.
pub mod blend_bwd_fixed_p4 {
    use super::super::kernel::*;
    /// `Push` of the shaders.
    #[repr(C)]
    #[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
    pub struct Push {
        /// `n_work` of the shader.
        pub n_work: u32,
        /// `stride` of the shader.
        pub stride: u32,
        /// `block` of the shader.
        pub block: u32,
        /// `segment` of the shader.
        pub segment: u32,
        /// `first_round` of the shader.
        pub first_round: u32,
        /// `scale` of the shader.
        pub scale: f32,
    }
    const _: () = {
        assert!(size_of::<Push>() == 24);
        assert!(std::mem::offset_of!(Push, n_work) == 0);
        assert!(std::mem::offset_of!(Push, stride) == 4);
        assert!(std::mem::offset_of!(Push, block) == 8);
        assert!(std::mem::offset_of!(Push, segment) == 12);
        assert!(std::mem::offset_of!(Push, first_round) == 16);
        assert!(std::mem::offset_of!(Push, scale) == 20);
    };
    /// The kernel's buffers.
    pub struct Args<'a> {
        /// Reads.
        pub view: &'a Buf<super::ViewParams>,
        /// Reads.
        pub tile_order: &'a Buf<u32>,
        /// Reads.
        pub tile_first: &'a Buf<u32>,
        /// Reads.
        pub splat_ids: &'a Buf<u32>,
        /// Reads.
        pub slots: &'a Buf<u32>,
        /// Reads.
        pub splats: &'a Buf<[f32; 4]>,
        /// Reads.
        pub tail: &'a Buf<[u32; 2]>,
        /// Reads.
        pub d_image0: &'a Buf<[f32; 4]>,
        /// ReadWrites.
        pub carry: &'a Buf<[f32; 2]>,
        /// ReadWrites.
        pub d_slots: &'a Buf<u32>,
        /// Reads.
        pub d_image1: &'a Buf<[f32; 4]>,
    }
    impl Kernel for Args<'_> {
        type Push = Push;
        const INFO: &'static KernelInfo = INFO;
        fn slices(&self) -> Vec<Slice> {
            vec![
                self.view.slice(),
                self.tile_order.slice(),
                self.tile_first.slice(),
                self.splat_ids.slice(),
                self.slots.slice(),
                self.splats.slice(),
                self.tail.slice(),
                self.d_image0.slice(),
                self.carry.slice(),
                self.d_slots.slice(),
                self.d_image1.slice(),
            ]
        }
    }
    /// What the device needs to know.
    pub const INFO: &KernelInfo = &KernelInfo {
        name: "blend_bwd_fixed_p4",
        push_bytes: size_of::<Push>() as u32,
        spirv: include_bytes!("../../shaders-glsl/spv/blend_bwd_fixed_p4.spv"),
        local: 64,
        subgroups: true,
        floats: 0x5a0,
        bindings: &[
            BindingInfo { name: "view", kind: BindingKind::Uniform, access: Access::Read },
            BindingInfo { name: "tile_order", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "tile_first", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "splat_ids", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "slots", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "splats", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "tail", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "d_image0", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "carry", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "d_slots", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "d_image1", kind: BindingKind::Storage, access: Access::Read },
        ],
    };
}

/// carries the cotangents of a picture back to the splats, in one of four modes of accumulation.
pub mod blend_bwd_fixed_p8 {
    use super::super::kernel::*;
    /// What the device needs to know. A variant of [`super::blend_bwd_fixed_p4`].
    pub const INFO: &KernelInfo = &KernelInfo {
        name: "blend_bwd_fixed_p8",
        push_bytes: size_of::<super::blend_bwd_fixed_p4::Push>() as u32,
        spirv: include_bytes!("../../shaders-glsl/spv/blend_bwd_fixed_p8.spv"),
        local: 64,
        subgroups: true,
        floats: 0x5a0,
        bindings: &[
            BindingInfo { name: "view", kind: BindingKind::Uniform, access: Access::Read },
            BindingInfo { name: "tile_order", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "tile_first", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "splat_ids", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "slots", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "splats", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "tail", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "d_image0", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "carry", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "d_slots", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "d_image1", kind: BindingKind::Storage, access: Access::Read },
        ],
    };
}

/// carries the cotangents of a picture back to the splats, in one of four modes of accumulation.
pub mod blend_bwd_fixed_color_p4 {
    use super::super::kernel::*;
    /// What the device needs to know. A variant of [`super::blend_bwd_fixed_p4`].
    pub const INFO: &KernelInfo = &KernelInfo {
        name: "blend_bwd_fixed_color_p4",
        push_bytes: size_of::<super::blend_bwd_fixed_p4::Push>() as u32,
        spirv: include_bytes!("../../shaders-glsl/spv/blend_bwd_fixed_color_p4.spv"),
        local: 64,
        subgroups: true,
        floats: 0x5a0,
        bindings: &[
            BindingInfo { name: "view", kind: BindingKind::Uniform, access: Access::Read },
            BindingInfo { name: "tile_order", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "tile_first", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "splat_ids", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "slots", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "splats", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "tail", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "d_image0", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "carry", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "d_slots", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "d_image1", kind: BindingKind::Storage, access: Access::Read },
        ],
    };
}

/// carries the cotangents of a picture back to the splats, in one of four modes of accumulation.
pub mod blend_bwd_fixed_color_p8 {
    use super::super::kernel::*;
    /// What the device needs to know. A variant of [`super::blend_bwd_fixed_p4`].
    pub const INFO: &KernelInfo = &KernelInfo {
        name: "blend_bwd_fixed_color_p8",
        push_bytes: size_of::<super::blend_bwd_fixed_p4::Push>() as u32,
        spirv: include_bytes!("../../shaders-glsl/spv/blend_bwd_fixed_color_p8.spv"),
        local: 64,
        subgroups: true,
        floats: 0x5a0,
        bindings: &[
            BindingInfo { name: "view", kind: BindingKind::Uniform, access: Access::Read },
            BindingInfo { name: "tile_order", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "tile_first", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "splat_ids", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "slots", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "splats", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "tail", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "d_image0", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "carry", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "d_slots", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "d_image1", kind: BindingKind::Storage, access: Access::Read },
        ],
    };
}

/// carries the cotangents of a picture back to the splats, in one of four modes of accumulation.
pub mod blend_bwd_swap_p4 {
    use super::super::kernel::*;
    /// What the device needs to know. A variant of [`super::blend_bwd_fixed_p4`].
    pub const INFO: &KernelInfo = &KernelInfo {
        name: "blend_bwd_swap_p4",
        push_bytes: size_of::<super::blend_bwd_fixed_p4::Push>() as u32,
        spirv: include_bytes!("../../shaders-glsl/spv/blend_bwd_swap_p4.spv"),
        local: 64,
        subgroups: true,
        floats: 0x5a0,
        bindings: &[
            BindingInfo { name: "view", kind: BindingKind::Uniform, access: Access::Read },
            BindingInfo { name: "tile_order", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "tile_first", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "splat_ids", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "slots", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "splats", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "tail", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "d_image0", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "carry", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "d_slots", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "d_image1", kind: BindingKind::Storage, access: Access::Read },
        ],
    };
}

/// carries the cotangents of a picture back to the splats, in one of four modes of accumulation.
pub mod blend_bwd_swap_p8 {
    use super::super::kernel::*;
    /// What the device needs to know. A variant of [`super::blend_bwd_fixed_p4`].
    pub const INFO: &KernelInfo = &KernelInfo {
        name: "blend_bwd_swap_p8",
        push_bytes: size_of::<super::blend_bwd_fixed_p4::Push>() as u32,
        spirv: include_bytes!("../../shaders-glsl/spv/blend_bwd_swap_p8.spv"),
        local: 64,
        subgroups: true,
        floats: 0x5a0,
        bindings: &[
            BindingInfo { name: "view", kind: BindingKind::Uniform, access: Access::Read },
            BindingInfo { name: "tile_order", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "tile_first", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "splat_ids", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "slots", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "splats", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "tail", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "d_image0", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "carry", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "d_slots", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "d_image1", kind: BindingKind::Storage, access: Access::Read },
        ],
    };
}

/// carries the cotangents of a picture back to the splats, in one of four modes of accumulation.
pub mod blend_bwd_swap_color_p4 {
    use super::super::kernel::*;
    /// What the device needs to know. A variant of [`super::blend_bwd_fixed_p4`].
    pub const INFO: &KernelInfo = &KernelInfo {
        name: "blend_bwd_swap_color_p4",
        push_bytes: size_of::<super::blend_bwd_fixed_p4::Push>() as u32,
        spirv: include_bytes!("../../shaders-glsl/spv/blend_bwd_swap_color_p4.spv"),
        local: 64,
        subgroups: true,
        floats: 0x5a0,
        bindings: &[
            BindingInfo { name: "view", kind: BindingKind::Uniform, access: Access::Read },
            BindingInfo { name: "tile_order", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "tile_first", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "splat_ids", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "slots", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "splats", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "tail", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "d_image0", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "carry", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "d_slots", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "d_image1", kind: BindingKind::Storage, access: Access::Read },
        ],
    };
}

/// carries the cotangents of a picture back to the splats, in one of four modes of accumulation.
pub mod blend_bwd_swap_color_p8 {
    use super::super::kernel::*;
    /// What the device needs to know. A variant of [`super::blend_bwd_fixed_p4`].
    pub const INFO: &KernelInfo = &KernelInfo {
        name: "blend_bwd_swap_color_p8",
        push_bytes: size_of::<super::blend_bwd_fixed_p4::Push>() as u32,
        spirv: include_bytes!("../../shaders-glsl/spv/blend_bwd_swap_color_p8.spv"),
        local: 64,
        subgroups: true,
        floats: 0x5a0,
        bindings: &[
            BindingInfo { name: "view", kind: BindingKind::Uniform, access: Access::Read },
            BindingInfo { name: "tile_order", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "tile_first", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "splat_ids", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "slots", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "splats", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "tail", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "d_image0", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "carry", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "d_slots", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "d_image1", kind: BindingKind::Storage, access: Access::Read },
        ],
    };
}

/// turns sums in fixed point into floats.
pub mod fixed_sums {
    use super::super::kernel::*;
    /// `Push` of the shaders.
    #[repr(C)]
    #[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
    pub struct Push {
        /// `inverse_scale` of the shader.
        pub inverse_scale: f32,
    }
    const _: () = {
        assert!(size_of::<Push>() == 4);
        assert!(std::mem::offset_of!(Push, inverse_scale) == 0);
    };
    /// The kernel's buffers.
    pub struct Args<'a> {
        /// Reads.
        pub count: &'a Buf<u32>,
        /// Reads.
        pub words: &'a Buf<u32>,
        /// Writes.
        pub d_slots: &'a Buf<[f32; 2]>,
    }
    impl Kernel for Args<'_> {
        type Push = Push;
        const INFO: &'static KernelInfo = INFO;
        fn slices(&self) -> Vec<Slice> {
            vec![self.count.slice(), self.words.slice(), self.d_slots.slice()]
        }
    }
    /// What the device needs to know.
    pub const INFO: &KernelInfo = &KernelInfo {
        name: "fixed_sums",
        push_bytes: size_of::<Push>() as u32,
        spirv: include_bytes!("../../shaders-glsl/spv/fixed_sums.spv"),
        local: 64,
        subgroups: false,
        floats: 0x4,
        bindings: &[
            BindingInfo { name: "count", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "words", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "d_slots", kind: BindingKind::Storage, access: Access::Write },
        ],
    };
}

/// carries each active Gaussian's sums back to its parameters; with ADAM it moves them there and then.
pub mod project_bwd_static_sh0 {
    use super::super::kernel::*;
    /// `Push` of the shaders.
    #[repr(C)]
    #[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
    pub struct Push {
        /// `group` of the shader.
        pub group: u32,
        /// `first` of the shader.
        pub first: u32,
        /// `is_summed` of the shader.
        pub is_summed: u32,
        /// `wants_camera` of the shader.
        pub wants_camera: u32,
    }
    const _: () = {
        assert!(size_of::<Push>() == 16);
        assert!(std::mem::offset_of!(Push, group) == 0);
        assert!(std::mem::offset_of!(Push, first) == 4);
        assert!(std::mem::offset_of!(Push, is_summed) == 8);
        assert!(std::mem::offset_of!(Push, wants_camera) == 12);
    };
    /// The kernel's buffers.
    pub struct Args<'a> {
        /// Reads.
        pub view: &'a Buf<super::ViewParams>,
        /// Reads.
        pub ranges: &'a Buf<[u32; 2]>,
        /// Reads.
        pub active_id: &'a Buf<u32>,
        /// Reads.
        pub geometry: &'a Buf<[f32; 4]>,
        /// Reads.
        pub splats: &'a Buf<[f32; 4]>,
        /// Reads.
        pub tile_counts: &'a Buf<u32>,
        /// Reads.
        pub slot_first: &'a Buf<u32>,
        /// Reads.
        pub d_slots: &'a Buf<[f32; 2]>,
        /// ReadWrites.
        pub n_bad: &'a Buf<u32>,
        /// Reads.
        pub frame_status: &'a Buf<super::Status>,
        /// Writes.
        pub d_camera: &'a Buf<[f32; 4]>,
        /// Reads.
        pub motion: &'a Buf<[f32; 4]>,
        /// Reads.
        pub sh1: &'a Buf<[f32; 4]>,
        /// Reads.
        pub sh2: &'a Buf<[f32; 4]>,
        /// Reads.
        pub sh3: &'a Buf<[f32; 4]>,
        /// Writes.
        pub d_geometry: &'a Buf<[f32; 4]>,
        /// Writes.
        pub d_sh0: &'a Buf<[f32; 4]>,
        /// Writes.
        pub d_motion: &'a Buf<[f32; 4]>,
        /// Writes.
        pub d_sh1: &'a Buf<[f32; 4]>,
        /// Writes.
        pub d_sh2: &'a Buf<[f32; 4]>,
        /// Writes.
        pub d_sh3: &'a Buf<[f32; 4]>,
    }
    impl Kernel for Args<'_> {
        type Push = Push;
        const INFO: &'static KernelInfo = INFO;
        fn slices(&self) -> Vec<Slice> {
            vec![
                self.view.slice(),
                self.ranges.slice(),
                self.active_id.slice(),
                self.geometry.slice(),
                self.splats.slice(),
                self.tile_counts.slice(),
                self.slot_first.slice(),
                self.d_slots.slice(),
                self.n_bad.slice(),
                self.frame_status.slice(),
                self.d_camera.slice(),
                self.motion.slice(),
                self.sh1.slice(),
                self.sh2.slice(),
                self.sh3.slice(),
                self.d_geometry.slice(),
                self.d_sh0.slice(),
                self.d_motion.slice(),
                self.d_sh1.slice(),
                self.d_sh2.slice(),
                self.d_sh3.slice(),
            ]
        }
    }
    /// What the device needs to know.
    pub const INFO: &KernelInfo = &KernelInfo {
        name: "project_bwd_static_sh0",
        push_bytes: size_of::<Push>() as u32,
        spirv: include_bytes!("../../shaders-glsl/spv/project_bwd_static_sh0.spv"),
        local: 64,
        subgroups: true,
        floats: 0x1ffc98,
        bindings: &[
            BindingInfo { name: "view", kind: BindingKind::Uniform, access: Access::Read },
            BindingInfo { name: "ranges", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "active_id", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "geometry", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "splats", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "tile_counts", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "slot_first", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "d_slots", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "n_bad", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "frame_status", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "d_camera", kind: BindingKind::Storage, access: Access::Write },
            BindingInfo { name: "motion", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "sh1", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "sh2", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "sh3", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "d_geometry", kind: BindingKind::Storage, access: Access::Write },
            BindingInfo { name: "d_sh0", kind: BindingKind::Storage, access: Access::Write },
            BindingInfo { name: "d_motion", kind: BindingKind::Storage, access: Access::Write },
            BindingInfo { name: "d_sh1", kind: BindingKind::Storage, access: Access::Write },
            BindingInfo { name: "d_sh2", kind: BindingKind::Storage, access: Access::Write },
            BindingInfo { name: "d_sh3", kind: BindingKind::Storage, access: Access::Write },
        ],
    };
}

/// carries each active Gaussian's sums back to its parameters; with ADAM it moves them there and then.
pub mod project_bwd_static_sh1 {
    use super::super::kernel::*;
    /// What the device needs to know. A variant of [`super::project_bwd_static_sh0`].
    pub const INFO: &KernelInfo = &KernelInfo {
        name: "project_bwd_static_sh1",
        push_bytes: size_of::<super::project_bwd_static_sh0::Push>() as u32,
        spirv: include_bytes!("../../shaders-glsl/spv/project_bwd_static_sh1.spv"),
        local: 64,
        subgroups: true,
        floats: 0x1ffc98,
        bindings: &[
            BindingInfo { name: "view", kind: BindingKind::Uniform, access: Access::Read },
            BindingInfo { name: "ranges", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "active_id", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "geometry", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "splats", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "tile_counts", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "slot_first", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "d_slots", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "n_bad", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "frame_status", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "d_camera", kind: BindingKind::Storage, access: Access::Write },
            BindingInfo { name: "motion", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "sh1", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "sh2", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "sh3", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "d_geometry", kind: BindingKind::Storage, access: Access::Write },
            BindingInfo { name: "d_sh0", kind: BindingKind::Storage, access: Access::Write },
            BindingInfo { name: "d_motion", kind: BindingKind::Storage, access: Access::Write },
            BindingInfo { name: "d_sh1", kind: BindingKind::Storage, access: Access::Write },
            BindingInfo { name: "d_sh2", kind: BindingKind::Storage, access: Access::Write },
            BindingInfo { name: "d_sh3", kind: BindingKind::Storage, access: Access::Write },
        ],
    };
}

/// carries each active Gaussian's sums back to its parameters; with ADAM it moves them there and then.
pub mod project_bwd_static_sh2 {
    use super::super::kernel::*;
    /// What the device needs to know. A variant of [`super::project_bwd_static_sh0`].
    pub const INFO: &KernelInfo = &KernelInfo {
        name: "project_bwd_static_sh2",
        push_bytes: size_of::<super::project_bwd_static_sh0::Push>() as u32,
        spirv: include_bytes!("../../shaders-glsl/spv/project_bwd_static_sh2.spv"),
        local: 64,
        subgroups: true,
        floats: 0x1ffc98,
        bindings: &[
            BindingInfo { name: "view", kind: BindingKind::Uniform, access: Access::Read },
            BindingInfo { name: "ranges", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "active_id", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "geometry", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "splats", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "tile_counts", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "slot_first", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "d_slots", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "n_bad", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "frame_status", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "d_camera", kind: BindingKind::Storage, access: Access::Write },
            BindingInfo { name: "motion", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "sh1", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "sh2", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "sh3", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "d_geometry", kind: BindingKind::Storage, access: Access::Write },
            BindingInfo { name: "d_sh0", kind: BindingKind::Storage, access: Access::Write },
            BindingInfo { name: "d_motion", kind: BindingKind::Storage, access: Access::Write },
            BindingInfo { name: "d_sh1", kind: BindingKind::Storage, access: Access::Write },
            BindingInfo { name: "d_sh2", kind: BindingKind::Storage, access: Access::Write },
            BindingInfo { name: "d_sh3", kind: BindingKind::Storage, access: Access::Write },
        ],
    };
}

/// carries each active Gaussian's sums back to its parameters; with ADAM it moves them there and then.
pub mod project_bwd_static_sh3 {
    use super::super::kernel::*;
    /// What the device needs to know. A variant of [`super::project_bwd_static_sh0`].
    pub const INFO: &KernelInfo = &KernelInfo {
        name: "project_bwd_static_sh3",
        push_bytes: size_of::<super::project_bwd_static_sh0::Push>() as u32,
        spirv: include_bytes!("../../shaders-glsl/spv/project_bwd_static_sh3.spv"),
        local: 64,
        subgroups: true,
        floats: 0x1ffc98,
        bindings: &[
            BindingInfo { name: "view", kind: BindingKind::Uniform, access: Access::Read },
            BindingInfo { name: "ranges", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "active_id", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "geometry", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "splats", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "tile_counts", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "slot_first", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "d_slots", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "n_bad", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "frame_status", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "d_camera", kind: BindingKind::Storage, access: Access::Write },
            BindingInfo { name: "motion", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "sh1", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "sh2", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "sh3", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "d_geometry", kind: BindingKind::Storage, access: Access::Write },
            BindingInfo { name: "d_sh0", kind: BindingKind::Storage, access: Access::Write },
            BindingInfo { name: "d_motion", kind: BindingKind::Storage, access: Access::Write },
            BindingInfo { name: "d_sh1", kind: BindingKind::Storage, access: Access::Write },
            BindingInfo { name: "d_sh2", kind: BindingKind::Storage, access: Access::Write },
            BindingInfo { name: "d_sh3", kind: BindingKind::Storage, access: Access::Write },
        ],
    };
}

/// carries each active Gaussian's sums back to its parameters; with ADAM it moves them there and then.
pub mod project_bwd_dynamic_sh0 {
    use super::super::kernel::*;
    /// What the device needs to know. A variant of [`super::project_bwd_static_sh0`].
    pub const INFO: &KernelInfo = &KernelInfo {
        name: "project_bwd_dynamic_sh0",
        push_bytes: size_of::<super::project_bwd_static_sh0::Push>() as u32,
        spirv: include_bytes!("../../shaders-glsl/spv/project_bwd_dynamic_sh0.spv"),
        local: 64,
        subgroups: true,
        floats: 0x1ffc98,
        bindings: &[
            BindingInfo { name: "view", kind: BindingKind::Uniform, access: Access::Read },
            BindingInfo { name: "ranges", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "active_id", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "geometry", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "splats", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "tile_counts", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "slot_first", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "d_slots", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "n_bad", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "frame_status", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "d_camera", kind: BindingKind::Storage, access: Access::Write },
            BindingInfo { name: "motion", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "sh1", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "sh2", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "sh3", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "d_geometry", kind: BindingKind::Storage, access: Access::Write },
            BindingInfo { name: "d_sh0", kind: BindingKind::Storage, access: Access::Write },
            BindingInfo { name: "d_motion", kind: BindingKind::Storage, access: Access::Write },
            BindingInfo { name: "d_sh1", kind: BindingKind::Storage, access: Access::Write },
            BindingInfo { name: "d_sh2", kind: BindingKind::Storage, access: Access::Write },
            BindingInfo { name: "d_sh3", kind: BindingKind::Storage, access: Access::Write },
        ],
    };
}

/// carries each active Gaussian's sums back to its parameters; with ADAM it moves them there and then.
pub mod project_bwd_dynamic_sh1 {
    use super::super::kernel::*;
    /// What the device needs to know. A variant of [`super::project_bwd_static_sh0`].
    pub const INFO: &KernelInfo = &KernelInfo {
        name: "project_bwd_dynamic_sh1",
        push_bytes: size_of::<super::project_bwd_static_sh0::Push>() as u32,
        spirv: include_bytes!("../../shaders-glsl/spv/project_bwd_dynamic_sh1.spv"),
        local: 64,
        subgroups: true,
        floats: 0x1ffc98,
        bindings: &[
            BindingInfo { name: "view", kind: BindingKind::Uniform, access: Access::Read },
            BindingInfo { name: "ranges", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "active_id", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "geometry", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "splats", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "tile_counts", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "slot_first", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "d_slots", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "n_bad", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "frame_status", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "d_camera", kind: BindingKind::Storage, access: Access::Write },
            BindingInfo { name: "motion", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "sh1", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "sh2", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "sh3", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "d_geometry", kind: BindingKind::Storage, access: Access::Write },
            BindingInfo { name: "d_sh0", kind: BindingKind::Storage, access: Access::Write },
            BindingInfo { name: "d_motion", kind: BindingKind::Storage, access: Access::Write },
            BindingInfo { name: "d_sh1", kind: BindingKind::Storage, access: Access::Write },
            BindingInfo { name: "d_sh2", kind: BindingKind::Storage, access: Access::Write },
            BindingInfo { name: "d_sh3", kind: BindingKind::Storage, access: Access::Write },
        ],
    };
}

/// carries each active Gaussian's sums back to its parameters; with ADAM it moves them there and then.
pub mod project_bwd_dynamic_sh2 {
    use super::super::kernel::*;
    /// What the device needs to know. A variant of [`super::project_bwd_static_sh0`].
    pub const INFO: &KernelInfo = &KernelInfo {
        name: "project_bwd_dynamic_sh2",
        push_bytes: size_of::<super::project_bwd_static_sh0::Push>() as u32,
        spirv: include_bytes!("../../shaders-glsl/spv/project_bwd_dynamic_sh2.spv"),
        local: 64,
        subgroups: true,
        floats: 0x1ffc98,
        bindings: &[
            BindingInfo { name: "view", kind: BindingKind::Uniform, access: Access::Read },
            BindingInfo { name: "ranges", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "active_id", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "geometry", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "splats", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "tile_counts", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "slot_first", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "d_slots", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "n_bad", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "frame_status", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "d_camera", kind: BindingKind::Storage, access: Access::Write },
            BindingInfo { name: "motion", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "sh1", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "sh2", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "sh3", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "d_geometry", kind: BindingKind::Storage, access: Access::Write },
            BindingInfo { name: "d_sh0", kind: BindingKind::Storage, access: Access::Write },
            BindingInfo { name: "d_motion", kind: BindingKind::Storage, access: Access::Write },
            BindingInfo { name: "d_sh1", kind: BindingKind::Storage, access: Access::Write },
            BindingInfo { name: "d_sh2", kind: BindingKind::Storage, access: Access::Write },
            BindingInfo { name: "d_sh3", kind: BindingKind::Storage, access: Access::Write },
        ],
    };
}

/// carries each active Gaussian's sums back to its parameters; with ADAM it moves them there and then.
pub mod project_bwd_dynamic_sh3 {
    use super::super::kernel::*;
    /// What the device needs to know. A variant of [`super::project_bwd_static_sh0`].
    pub const INFO: &KernelInfo = &KernelInfo {
        name: "project_bwd_dynamic_sh3",
        push_bytes: size_of::<super::project_bwd_static_sh0::Push>() as u32,
        spirv: include_bytes!("../../shaders-glsl/spv/project_bwd_dynamic_sh3.spv"),
        local: 64,
        subgroups: true,
        floats: 0x1ffc98,
        bindings: &[
            BindingInfo { name: "view", kind: BindingKind::Uniform, access: Access::Read },
            BindingInfo { name: "ranges", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "active_id", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "geometry", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "splats", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "tile_counts", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "slot_first", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "d_slots", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "n_bad", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "frame_status", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "d_camera", kind: BindingKind::Storage, access: Access::Write },
            BindingInfo { name: "motion", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "sh1", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "sh2", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "sh3", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "d_geometry", kind: BindingKind::Storage, access: Access::Write },
            BindingInfo { name: "d_sh0", kind: BindingKind::Storage, access: Access::Write },
            BindingInfo { name: "d_motion", kind: BindingKind::Storage, access: Access::Write },
            BindingInfo { name: "d_sh1", kind: BindingKind::Storage, access: Access::Write },
            BindingInfo { name: "d_sh2", kind: BindingKind::Storage, access: Access::Write },
            BindingInfo { name: "d_sh3", kind: BindingKind::Storage, access: Access::Write },
        ],
    };
}

/// carries each active Gaussian's sums back to its parameters; with ADAM it moves them there and then.
pub mod project_bwd_adam_static_sh0 {
    use super::super::kernel::*;
    /// `Push` of the shaders.
    #[repr(C)]
    #[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
    pub struct Push {
        /// `group` of the shader.
        pub group: u32,
        /// `first` of the shader.
        pub first: u32,
        /// `is_summed` of the shader.
        pub is_summed: u32,
        /// `wants_camera` of the shader.
        pub wants_camera: u32,
    }
    const _: () = {
        assert!(size_of::<Push>() == 16);
        assert!(std::mem::offset_of!(Push, group) == 0);
        assert!(std::mem::offset_of!(Push, first) == 4);
        assert!(std::mem::offset_of!(Push, is_summed) == 8);
        assert!(std::mem::offset_of!(Push, wants_camera) == 12);
    };
    /// The kernel's buffers.
    pub struct Args<'a> {
        /// Reads.
        pub view: &'a Buf<super::ViewParams>,
        /// Reads.
        pub ranges: &'a Buf<[u32; 2]>,
        /// Reads.
        pub active_id: &'a Buf<u32>,
        /// ReadWrites.
        pub geometry: &'a Buf<[f32; 4]>,
        /// Reads.
        pub splats: &'a Buf<[f32; 4]>,
        /// Reads.
        pub tile_counts: &'a Buf<u32>,
        /// Reads.
        pub slot_first: &'a Buf<u32>,
        /// Reads.
        pub d_slots: &'a Buf<[f32; 2]>,
        /// ReadWrites.
        pub n_bad: &'a Buf<u32>,
        /// Reads.
        pub frame_status: &'a Buf<super::Status>,
        /// Writes.
        pub d_camera: &'a Buf<[f32; 4]>,
        /// ReadWrites.
        pub sh0: &'a Buf<[f32; 4]>,
        /// ReadWrites.
        pub motion: &'a Buf<[f32; 4]>,
        /// ReadWrites.
        pub sh1: &'a Buf<[f32; 4]>,
        /// ReadWrites.
        pub sh2: &'a Buf<[f32; 4]>,
        /// ReadWrites.
        pub sh3: &'a Buf<[f32; 4]>,
        /// ReadWrites.
        pub moments_geometry: &'a Buf<[f32; 4]>,
        /// ReadWrites.
        pub moments_sh0: &'a Buf<[f32; 4]>,
        /// ReadWrites.
        pub moments_motion: &'a Buf<[f32; 4]>,
        /// ReadWrites.
        pub moments_sh1: &'a Buf<[f32; 4]>,
        /// ReadWrites.
        pub moments_sh2: &'a Buf<[f32; 4]>,
        /// ReadWrites.
        pub moments_sh3: &'a Buf<[f32; 4]>,
        /// ReadWrites.
        pub state: &'a Buf<[f32; 4]>,
        /// Reads.
        pub adam: &'a Buf<super::AdamParams>,
    }
    impl Kernel for Args<'_> {
        type Push = Push;
        const INFO: &'static KernelInfo = INFO;
        fn slices(&self) -> Vec<Slice> {
            vec![
                self.view.slice(),
                self.ranges.slice(),
                self.active_id.slice(),
                self.geometry.slice(),
                self.splats.slice(),
                self.tile_counts.slice(),
                self.slot_first.slice(),
                self.d_slots.slice(),
                self.n_bad.slice(),
                self.frame_status.slice(),
                self.d_camera.slice(),
                self.sh0.slice(),
                self.motion.slice(),
                self.sh1.slice(),
                self.sh2.slice(),
                self.sh3.slice(),
                self.moments_geometry.slice(),
                self.moments_sh0.slice(),
                self.moments_motion.slice(),
                self.moments_sh1.slice(),
                self.moments_sh2.slice(),
                self.moments_sh3.slice(),
                self.state.slice(),
                self.adam.slice(),
            ]
        }
    }
    /// What the device needs to know.
    pub const INFO: &KernelInfo = &KernelInfo {
        name: "project_bwd_adam_static_sh0",
        push_bytes: size_of::<Push>() as u32,
        spirv: include_bytes!("../../shaders-glsl/spv/project_bwd_adam_static_sh0.spv"),
        local: 64,
        subgroups: true,
        floats: 0x7ffc98,
        bindings: &[
            BindingInfo { name: "view", kind: BindingKind::Uniform, access: Access::Read },
            BindingInfo { name: "ranges", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "active_id", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "geometry", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "splats", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "tile_counts", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "slot_first", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "d_slots", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "n_bad", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "frame_status", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "d_camera", kind: BindingKind::Storage, access: Access::Write },
            BindingInfo { name: "sh0", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "motion", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "sh1", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "sh2", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "sh3", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "moments_geometry", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "moments_sh0", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "moments_motion", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "moments_sh1", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "moments_sh2", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "moments_sh3", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "state", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "adam", kind: BindingKind::Uniform, access: Access::Read },
        ],
    };
}

/// carries each active Gaussian's sums back to its parameters; with ADAM it moves them there and then.
pub mod project_bwd_adam_static_sh1 {
    use super::super::kernel::*;
    /// What the device needs to know. A variant of [`super::project_bwd_adam_static_sh0`].
    pub const INFO: &KernelInfo = &KernelInfo {
        name: "project_bwd_adam_static_sh1",
        push_bytes: size_of::<super::project_bwd_adam_static_sh0::Push>() as u32,
        spirv: include_bytes!("../../shaders-glsl/spv/project_bwd_adam_static_sh1.spv"),
        local: 64,
        subgroups: true,
        floats: 0x7ffc98,
        bindings: &[
            BindingInfo { name: "view", kind: BindingKind::Uniform, access: Access::Read },
            BindingInfo { name: "ranges", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "active_id", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "geometry", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "splats", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "tile_counts", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "slot_first", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "d_slots", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "n_bad", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "frame_status", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "d_camera", kind: BindingKind::Storage, access: Access::Write },
            BindingInfo { name: "sh0", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "motion", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "sh1", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "sh2", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "sh3", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "moments_geometry", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "moments_sh0", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "moments_motion", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "moments_sh1", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "moments_sh2", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "moments_sh3", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "state", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "adam", kind: BindingKind::Uniform, access: Access::Read },
        ],
    };
}

/// carries each active Gaussian's sums back to its parameters; with ADAM it moves them there and then.
pub mod project_bwd_adam_static_sh2 {
    use super::super::kernel::*;
    /// What the device needs to know. A variant of [`super::project_bwd_adam_static_sh0`].
    pub const INFO: &KernelInfo = &KernelInfo {
        name: "project_bwd_adam_static_sh2",
        push_bytes: size_of::<super::project_bwd_adam_static_sh0::Push>() as u32,
        spirv: include_bytes!("../../shaders-glsl/spv/project_bwd_adam_static_sh2.spv"),
        local: 64,
        subgroups: true,
        floats: 0x7ffc98,
        bindings: &[
            BindingInfo { name: "view", kind: BindingKind::Uniform, access: Access::Read },
            BindingInfo { name: "ranges", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "active_id", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "geometry", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "splats", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "tile_counts", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "slot_first", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "d_slots", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "n_bad", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "frame_status", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "d_camera", kind: BindingKind::Storage, access: Access::Write },
            BindingInfo { name: "sh0", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "motion", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "sh1", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "sh2", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "sh3", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "moments_geometry", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "moments_sh0", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "moments_motion", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "moments_sh1", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "moments_sh2", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "moments_sh3", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "state", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "adam", kind: BindingKind::Uniform, access: Access::Read },
        ],
    };
}

/// carries each active Gaussian's sums back to its parameters; with ADAM it moves them there and then.
pub mod project_bwd_adam_static_sh3 {
    use super::super::kernel::*;
    /// What the device needs to know. A variant of [`super::project_bwd_adam_static_sh0`].
    pub const INFO: &KernelInfo = &KernelInfo {
        name: "project_bwd_adam_static_sh3",
        push_bytes: size_of::<super::project_bwd_adam_static_sh0::Push>() as u32,
        spirv: include_bytes!("../../shaders-glsl/spv/project_bwd_adam_static_sh3.spv"),
        local: 64,
        subgroups: true,
        floats: 0x7ffc98,
        bindings: &[
            BindingInfo { name: "view", kind: BindingKind::Uniform, access: Access::Read },
            BindingInfo { name: "ranges", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "active_id", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "geometry", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "splats", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "tile_counts", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "slot_first", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "d_slots", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "n_bad", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "frame_status", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "d_camera", kind: BindingKind::Storage, access: Access::Write },
            BindingInfo { name: "sh0", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "motion", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "sh1", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "sh2", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "sh3", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "moments_geometry", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "moments_sh0", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "moments_motion", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "moments_sh1", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "moments_sh2", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "moments_sh3", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "state", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "adam", kind: BindingKind::Uniform, access: Access::Read },
        ],
    };
}

/// carries each active Gaussian's sums back to its parameters; with ADAM it moves them there and then.
pub mod project_bwd_adam_dynamic_sh0 {
    use super::super::kernel::*;
    /// What the device needs to know. A variant of [`super::project_bwd_adam_static_sh0`].
    pub const INFO: &KernelInfo = &KernelInfo {
        name: "project_bwd_adam_dynamic_sh0",
        push_bytes: size_of::<super::project_bwd_adam_static_sh0::Push>() as u32,
        spirv: include_bytes!("../../shaders-glsl/spv/project_bwd_adam_dynamic_sh0.spv"),
        local: 64,
        subgroups: true,
        floats: 0x7ffc98,
        bindings: &[
            BindingInfo { name: "view", kind: BindingKind::Uniform, access: Access::Read },
            BindingInfo { name: "ranges", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "active_id", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "geometry", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "splats", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "tile_counts", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "slot_first", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "d_slots", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "n_bad", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "frame_status", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "d_camera", kind: BindingKind::Storage, access: Access::Write },
            BindingInfo { name: "sh0", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "motion", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "sh1", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "sh2", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "sh3", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "moments_geometry", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "moments_sh0", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "moments_motion", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "moments_sh1", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "moments_sh2", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "moments_sh3", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "state", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "adam", kind: BindingKind::Uniform, access: Access::Read },
        ],
    };
}

/// carries each active Gaussian's sums back to its parameters; with ADAM it moves them there and then.
pub mod project_bwd_adam_dynamic_sh1 {
    use super::super::kernel::*;
    /// What the device needs to know. A variant of [`super::project_bwd_adam_static_sh0`].
    pub const INFO: &KernelInfo = &KernelInfo {
        name: "project_bwd_adam_dynamic_sh1",
        push_bytes: size_of::<super::project_bwd_adam_static_sh0::Push>() as u32,
        spirv: include_bytes!("../../shaders-glsl/spv/project_bwd_adam_dynamic_sh1.spv"),
        local: 64,
        subgroups: true,
        floats: 0x7ffc98,
        bindings: &[
            BindingInfo { name: "view", kind: BindingKind::Uniform, access: Access::Read },
            BindingInfo { name: "ranges", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "active_id", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "geometry", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "splats", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "tile_counts", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "slot_first", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "d_slots", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "n_bad", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "frame_status", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "d_camera", kind: BindingKind::Storage, access: Access::Write },
            BindingInfo { name: "sh0", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "motion", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "sh1", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "sh2", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "sh3", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "moments_geometry", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "moments_sh0", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "moments_motion", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "moments_sh1", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "moments_sh2", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "moments_sh3", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "state", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "adam", kind: BindingKind::Uniform, access: Access::Read },
        ],
    };
}

/// carries each active Gaussian's sums back to its parameters; with ADAM it moves them there and then.
pub mod project_bwd_adam_dynamic_sh2 {
    use super::super::kernel::*;
    /// What the device needs to know. A variant of [`super::project_bwd_adam_static_sh0`].
    pub const INFO: &KernelInfo = &KernelInfo {
        name: "project_bwd_adam_dynamic_sh2",
        push_bytes: size_of::<super::project_bwd_adam_static_sh0::Push>() as u32,
        spirv: include_bytes!("../../shaders-glsl/spv/project_bwd_adam_dynamic_sh2.spv"),
        local: 64,
        subgroups: true,
        floats: 0x7ffc98,
        bindings: &[
            BindingInfo { name: "view", kind: BindingKind::Uniform, access: Access::Read },
            BindingInfo { name: "ranges", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "active_id", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "geometry", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "splats", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "tile_counts", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "slot_first", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "d_slots", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "n_bad", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "frame_status", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "d_camera", kind: BindingKind::Storage, access: Access::Write },
            BindingInfo { name: "sh0", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "motion", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "sh1", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "sh2", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "sh3", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "moments_geometry", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "moments_sh0", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "moments_motion", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "moments_sh1", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "moments_sh2", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "moments_sh3", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "state", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "adam", kind: BindingKind::Uniform, access: Access::Read },
        ],
    };
}

/// carries each active Gaussian's sums back to its parameters; with ADAM it moves them there and then.
pub mod project_bwd_adam_dynamic_sh3 {
    use super::super::kernel::*;
    /// What the device needs to know. A variant of [`super::project_bwd_adam_static_sh0`].
    pub const INFO: &KernelInfo = &KernelInfo {
        name: "project_bwd_adam_dynamic_sh3",
        push_bytes: size_of::<super::project_bwd_adam_static_sh0::Push>() as u32,
        spirv: include_bytes!("../../shaders-glsl/spv/project_bwd_adam_dynamic_sh3.spv"),
        local: 64,
        subgroups: true,
        floats: 0x7ffc98,
        bindings: &[
            BindingInfo { name: "view", kind: BindingKind::Uniform, access: Access::Read },
            BindingInfo { name: "ranges", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "active_id", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "geometry", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "splats", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "tile_counts", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "slot_first", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "d_slots", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "n_bad", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "frame_status", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "d_camera", kind: BindingKind::Storage, access: Access::Write },
            BindingInfo { name: "sh0", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "motion", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "sh1", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "sh2", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "sh3", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "moments_geometry", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "moments_sh0", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "moments_motion", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "moments_sh1", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "moments_sh2", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "moments_sh3", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "state", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "adam", kind: BindingKind::Uniform, access: Access::Read },
        ],
    };
}

/// adds up what a picture says of each Gaussian: how much would change without one of its parts, or with a new one.
pub mod fisher_static_sh0 {
    use super::super::kernel::*;
    /// `Push` of the shaders.
    #[repr(C)]
    #[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
    pub struct Push {
        /// `n` of the shader.
        pub n: u32,
        /// `time` of the shader.
        pub time: f32,
        /// `middle` of the shader.
        pub middle: f32,
        /// `squares` of the shader.
        pub squares: f32,
        /// `n_cameras` of the shader.
        pub n_cameras: u32,
    }
    const _: () = {
        assert!(size_of::<Push>() == 20);
        assert!(std::mem::offset_of!(Push, n) == 0);
        assert!(std::mem::offset_of!(Push, time) == 4);
        assert!(std::mem::offset_of!(Push, middle) == 8);
        assert!(std::mem::offset_of!(Push, squares) == 12);
        assert!(std::mem::offset_of!(Push, n_cameras) == 16);
    };
    /// The kernel's buffers.
    pub struct Args<'a> {
        /// Reads.
        pub geometry: &'a Buf<[f32; 4]>,
        /// Reads.
        pub d_geometry: &'a Buf<[f32; 4]>,
        /// Reads.
        pub d_sh0: &'a Buf<[f32; 4]>,
        /// ReadWrites.
        pub sums: &'a Buf<[f32; 4]>,
        /// Reads.
        pub motion: &'a Buf<[f32; 4]>,
        /// Reads.
        pub sh1: &'a Buf<[f32; 4]>,
        /// Reads.
        pub sh2: &'a Buf<[f32; 4]>,
        /// Reads.
        pub sh3: &'a Buf<[f32; 4]>,
        /// Reads.
        pub d_sh1: &'a Buf<[f32; 4]>,
        /// Reads.
        pub d_sh2: &'a Buf<[f32; 4]>,
        /// Reads.
        pub d_sh3: &'a Buf<[f32; 4]>,
        /// Reads.
        pub cameras: &'a Buf<[f32; 4]>,
    }
    impl Kernel for Args<'_> {
        type Push = Push;
        const INFO: &'static KernelInfo = INFO;
        fn slices(&self) -> Vec<Slice> {
            vec![
                self.geometry.slice(),
                self.d_geometry.slice(),
                self.d_sh0.slice(),
                self.sums.slice(),
                self.motion.slice(),
                self.sh1.slice(),
                self.sh2.slice(),
                self.sh3.slice(),
                self.d_sh1.slice(),
                self.d_sh2.slice(),
                self.d_sh3.slice(),
                self.cameras.slice(),
            ]
        }
    }
    /// What the device needs to know.
    pub const INFO: &KernelInfo = &KernelInfo {
        name: "fisher_static_sh0",
        push_bytes: size_of::<Push>() as u32,
        spirv: include_bytes!("../../shaders-glsl/spv/fisher_static_sh0.spv"),
        local: 64,
        subgroups: true,
        floats: 0xfff,
        bindings: &[
            BindingInfo { name: "geometry", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "d_geometry", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "d_sh0", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "sums", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "motion", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "sh1", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "sh2", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "sh3", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "d_sh1", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "d_sh2", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "d_sh3", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "cameras", kind: BindingKind::Storage, access: Access::Read },
        ],
    };
}

/// adds up what a picture says of each Gaussian: how much would change without one of its parts, or with a new one.
pub mod fisher_static_sh1 {
    use super::super::kernel::*;
    /// What the device needs to know. A variant of [`super::fisher_static_sh0`].
    pub const INFO: &KernelInfo = &KernelInfo {
        name: "fisher_static_sh1",
        push_bytes: size_of::<super::fisher_static_sh0::Push>() as u32,
        spirv: include_bytes!("../../shaders-glsl/spv/fisher_static_sh1.spv"),
        local: 64,
        subgroups: true,
        floats: 0xfff,
        bindings: &[
            BindingInfo { name: "geometry", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "d_geometry", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "d_sh0", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "sums", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "motion", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "sh1", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "sh2", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "sh3", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "d_sh1", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "d_sh2", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "d_sh3", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "cameras", kind: BindingKind::Storage, access: Access::Read },
        ],
    };
}

/// adds up what a picture says of each Gaussian: how much would change without one of its parts, or with a new one.
pub mod fisher_static_sh2 {
    use super::super::kernel::*;
    /// What the device needs to know. A variant of [`super::fisher_static_sh0`].
    pub const INFO: &KernelInfo = &KernelInfo {
        name: "fisher_static_sh2",
        push_bytes: size_of::<super::fisher_static_sh0::Push>() as u32,
        spirv: include_bytes!("../../shaders-glsl/spv/fisher_static_sh2.spv"),
        local: 64,
        subgroups: true,
        floats: 0xfff,
        bindings: &[
            BindingInfo { name: "geometry", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "d_geometry", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "d_sh0", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "sums", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "motion", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "sh1", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "sh2", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "sh3", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "d_sh1", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "d_sh2", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "d_sh3", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "cameras", kind: BindingKind::Storage, access: Access::Read },
        ],
    };
}

/// adds up what a picture says of each Gaussian: how much would change without one of its parts, or with a new one.
pub mod fisher_static_sh3 {
    use super::super::kernel::*;
    /// What the device needs to know. A variant of [`super::fisher_static_sh0`].
    pub const INFO: &KernelInfo = &KernelInfo {
        name: "fisher_static_sh3",
        push_bytes: size_of::<super::fisher_static_sh0::Push>() as u32,
        spirv: include_bytes!("../../shaders-glsl/spv/fisher_static_sh3.spv"),
        local: 64,
        subgroups: true,
        floats: 0xfff,
        bindings: &[
            BindingInfo { name: "geometry", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "d_geometry", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "d_sh0", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "sums", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "motion", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "sh1", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "sh2", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "sh3", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "d_sh1", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "d_sh2", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "d_sh3", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "cameras", kind: BindingKind::Storage, access: Access::Read },
        ],
    };
}

/// adds up what a picture says of each Gaussian: how much would change without one of its parts, or with a new one.
pub mod fisher_dynamic_sh0 {
    use super::super::kernel::*;
    /// What the device needs to know. A variant of [`super::fisher_static_sh0`].
    pub const INFO: &KernelInfo = &KernelInfo {
        name: "fisher_dynamic_sh0",
        push_bytes: size_of::<super::fisher_static_sh0::Push>() as u32,
        spirv: include_bytes!("../../shaders-glsl/spv/fisher_dynamic_sh0.spv"),
        local: 64,
        subgroups: true,
        floats: 0xfff,
        bindings: &[
            BindingInfo { name: "geometry", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "d_geometry", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "d_sh0", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "sums", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "motion", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "sh1", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "sh2", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "sh3", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "d_sh1", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "d_sh2", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "d_sh3", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "cameras", kind: BindingKind::Storage, access: Access::Read },
        ],
    };
}

/// adds up what a picture says of each Gaussian: how much would change without one of its parts, or with a new one.
pub mod fisher_dynamic_sh1 {
    use super::super::kernel::*;
    /// What the device needs to know. A variant of [`super::fisher_static_sh0`].
    pub const INFO: &KernelInfo = &KernelInfo {
        name: "fisher_dynamic_sh1",
        push_bytes: size_of::<super::fisher_static_sh0::Push>() as u32,
        spirv: include_bytes!("../../shaders-glsl/spv/fisher_dynamic_sh1.spv"),
        local: 64,
        subgroups: true,
        floats: 0xfff,
        bindings: &[
            BindingInfo { name: "geometry", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "d_geometry", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "d_sh0", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "sums", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "motion", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "sh1", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "sh2", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "sh3", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "d_sh1", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "d_sh2", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "d_sh3", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "cameras", kind: BindingKind::Storage, access: Access::Read },
        ],
    };
}

/// adds up what a picture says of each Gaussian: how much would change without one of its parts, or with a new one.
pub mod fisher_dynamic_sh2 {
    use super::super::kernel::*;
    /// What the device needs to know. A variant of [`super::fisher_static_sh0`].
    pub const INFO: &KernelInfo = &KernelInfo {
        name: "fisher_dynamic_sh2",
        push_bytes: size_of::<super::fisher_static_sh0::Push>() as u32,
        spirv: include_bytes!("../../shaders-glsl/spv/fisher_dynamic_sh2.spv"),
        local: 64,
        subgroups: true,
        floats: 0xfff,
        bindings: &[
            BindingInfo { name: "geometry", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "d_geometry", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "d_sh0", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "sums", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "motion", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "sh1", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "sh2", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "sh3", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "d_sh1", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "d_sh2", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "d_sh3", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "cameras", kind: BindingKind::Storage, access: Access::Read },
        ],
    };
}

/// adds up what a picture says of each Gaussian: how much would change without one of its parts, or with a new one.
pub mod fisher_dynamic_sh3 {
    use super::super::kernel::*;
    /// What the device needs to know. A variant of [`super::fisher_static_sh0`].
    pub const INFO: &KernelInfo = &KernelInfo {
        name: "fisher_dynamic_sh3",
        push_bytes: size_of::<super::fisher_static_sh0::Push>() as u32,
        spirv: include_bytes!("../../shaders-glsl/spv/fisher_dynamic_sh3.spv"),
        local: 64,
        subgroups: true,
        floats: 0xfff,
        bindings: &[
            BindingInfo { name: "geometry", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "d_geometry", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "d_sh0", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "sums", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "motion", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "sh1", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "sh2", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "sh3", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "d_sh1", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "d_sh2", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "d_sh3", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "cameras", kind: BindingKind::Storage, access: Access::Read },
        ],
    };
}

/// adds the active Gaussians' gradients of the camera.
pub mod camera_sum {
    use super::super::kernel::*;
    /// This kernel takes no push constants.
    pub type Push = ();
    /// The kernel's buffers.
    pub struct Args<'a> {
        /// Reads.
        pub count: &'a Buf<u32>,
        /// Reads.
        pub d_camera: &'a Buf<[f32; 4]>,
        /// Writes.
        pub partials: &'a Buf<[f32; 4]>,
    }
    impl Kernel for Args<'_> {
        type Push = Push;
        const INFO: &'static KernelInfo = INFO;
        fn slices(&self) -> Vec<Slice> {
            vec![self.count.slice(), self.d_camera.slice(), self.partials.slice()]
        }
    }
    /// What the device needs to know.
    pub const INFO: &KernelInfo = &KernelInfo {
        name: "camera_sum",
        push_bytes: size_of::<Push>() as u32,
        spirv: include_bytes!("../../shaders-glsl/spv/camera_sum.spv"),
        local: 64,
        subgroups: false,
        floats: 0x6,
        bindings: &[
            BindingInfo { name: "count", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "d_camera", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "partials", kind: BindingKind::Storage, access: Access::Write },
        ],
    };
}

/// adds the workgroups' gradients of camera and background.
pub mod camera_total {
    use super::super::kernel::*;
    /// This kernel takes no push constants.
    pub type Push = ();
    /// The kernel's buffers.
    pub struct Args<'a> {
        /// Reads.
        pub partials: &'a Buf<[f32; 4]>,
        /// Writes.
        pub total: &'a Buf<[f32; 4]>,
    }
    impl Kernel for Args<'_> {
        type Push = Push;
        const INFO: &'static KernelInfo = INFO;
        fn slices(&self) -> Vec<Slice> {
            vec![self.partials.slice(), self.total.slice()]
        }
    }
    /// What the device needs to know.
    pub const INFO: &KernelInfo = &KernelInfo {
        name: "camera_total",
        push_bytes: size_of::<Push>() as u32,
        spirv: include_bytes!("../../shaders-glsl/spv/camera_total.spv"),
        local: 64,
        subgroups: false,
        floats: 0x3,
        bindings: &[
            BindingInfo { name: "partials", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "total", kind: BindingKind::Storage, access: Access::Write },
        ],
    };
}

/// adds the pixels' gradients of the background.
pub mod background_sum {
    use super::super::kernel::*;
    /// `Push` of the shaders.
    #[repr(C)]
    #[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
    pub struct Push {
        /// `n` of the shader.
        pub n: u32,
    }
    const _: () = {
        assert!(size_of::<Push>() == 4);
        assert!(std::mem::offset_of!(Push, n) == 0);
    };
    /// The kernel's buffers.
    pub struct Args<'a> {
        /// Reads.
        pub tail: &'a Buf<[u32; 2]>,
        /// Reads.
        pub d_image0: &'a Buf<[f32; 4]>,
        /// Writes.
        pub partials: &'a Buf<[f32; 4]>,
    }
    impl Kernel for Args<'_> {
        type Push = Push;
        const INFO: &'static KernelInfo = INFO;
        fn slices(&self) -> Vec<Slice> {
            vec![self.tail.slice(), self.d_image0.slice(), self.partials.slice()]
        }
    }
    /// What the device needs to know.
    pub const INFO: &KernelInfo = &KernelInfo {
        name: "background_sum",
        push_bytes: size_of::<Push>() as u32,
        spirv: include_bytes!("../../shaders-glsl/spv/background_sum.spv"),
        local: 64,
        subgroups: false,
        floats: 0x6,
        bindings: &[
            BindingInfo { name: "tail", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "d_image0", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "partials", kind: BindingKind::Storage, access: Access::Write },
        ],
    };
}

/// filters the moments of picture and truth along the rows.
pub mod ssim_rows {
    use super::super::kernel::*;
    /// `Push` of the shaders.
    #[repr(C)]
    #[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
    pub struct Push {
        /// `width` of the shader.
        pub width: u32,
        /// `height` of the shader.
        pub height: u32,
    }
    const _: () = {
        assert!(size_of::<Push>() == 8);
        assert!(std::mem::offset_of!(Push, width) == 0);
        assert!(std::mem::offset_of!(Push, height) == 4);
    };
    /// The kernel's buffers.
    pub struct Args<'a> {
        /// Reads.
        pub image: &'a Buf<[f32; 4]>,
        /// Reads.
        pub truth: &'a Buf<u32>,
        /// Writes.
        pub moments: &'a Buf<[f32; 4]>,
    }
    impl Kernel for Args<'_> {
        type Push = Push;
        const INFO: &'static KernelInfo = INFO;
        fn slices(&self) -> Vec<Slice> {
            vec![self.image.slice(), self.truth.slice(), self.moments.slice()]
        }
    }
    /// What the device needs to know.
    pub const INFO: &KernelInfo = &KernelInfo {
        name: "ssim_rows",
        push_bytes: size_of::<Push>() as u32,
        spirv: include_bytes!("../../shaders-glsl/spv/ssim_rows.spv"),
        local: 64,
        subgroups: false,
        floats: 0x5,
        bindings: &[
            BindingInfo { name: "image", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "truth", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "moments", kind: BindingKind::Storage, access: Access::Write },
        ],
    };
}

/// filters the moments of picture and truth along the rows.
pub mod ssim_rows_s2 {
    use super::super::kernel::*;
    /// What the device needs to know. A variant of [`super::ssim_rows`].
    pub const INFO: &KernelInfo = &KernelInfo {
        name: "ssim_rows_s2",
        push_bytes: size_of::<super::ssim_rows::Push>() as u32,
        spirv: include_bytes!("../../shaders-glsl/spv/ssim_rows_s2.spv"),
        local: 64,
        subgroups: false,
        floats: 0x5,
        bindings: &[
            BindingInfo { name: "image", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "truth", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "moments", kind: BindingKind::Storage, access: Access::Write },
        ],
    };
}

/// filters the moments along the columns, forms SSIM and its derivatives, and sums 1 - SSIM and the absolute error.
pub mod ssim_columns {
    use super::super::kernel::*;
    /// `Push` of the shaders.
    #[repr(C)]
    #[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
    pub struct Push {
        /// `width` of the shader.
        pub width: u32,
        /// `height` of the shader.
        pub height: u32,
    }
    const _: () = {
        assert!(size_of::<Push>() == 8);
        assert!(std::mem::offset_of!(Push, width) == 0);
        assert!(std::mem::offset_of!(Push, height) == 4);
    };
    /// The kernel's buffers.
    pub struct Args<'a> {
        /// Reads.
        pub moments: &'a Buf<[f32; 4]>,
        /// Reads.
        pub image: &'a Buf<[f32; 4]>,
        /// Reads.
        pub truth: &'a Buf<u32>,
        /// Writes.
        pub partials: &'a Buf<[f32; 4]>,
        /// Writes.
        pub sums: &'a Buf<[f32; 4]>,
    }
    impl Kernel for Args<'_> {
        type Push = Push;
        const INFO: &'static KernelInfo = INFO;
        fn slices(&self) -> Vec<Slice> {
            vec![self.moments.slice(), self.image.slice(), self.truth.slice(), self.partials.slice(), self.sums.slice()]
        }
    }
    /// What the device needs to know.
    pub const INFO: &KernelInfo = &KernelInfo {
        name: "ssim_columns",
        push_bytes: size_of::<Push>() as u32,
        spirv: include_bytes!("../../shaders-glsl/spv/ssim_columns.spv"),
        local: 64,
        subgroups: false,
        floats: 0x1b,
        bindings: &[
            BindingInfo { name: "moments", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "image", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "truth", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "partials", kind: BindingKind::Storage, access: Access::Write },
            BindingInfo { name: "sums", kind: BindingKind::Storage, access: Access::Write },
        ],
    };
}

/// filters the moments along the columns, forms SSIM and its derivatives, and sums 1 - SSIM and the absolute error.
pub mod ssim_columns_s2 {
    use super::super::kernel::*;
    /// What the device needs to know. A variant of [`super::ssim_columns`].
    pub const INFO: &KernelInfo = &KernelInfo {
        name: "ssim_columns_s2",
        push_bytes: size_of::<super::ssim_columns::Push>() as u32,
        spirv: include_bytes!("../../shaders-glsl/spv/ssim_columns_s2.spv"),
        local: 64,
        subgroups: false,
        floats: 0x1b,
        bindings: &[
            BindingInfo { name: "moments", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "image", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "truth", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "partials", kind: BindingKind::Storage, access: Access::Write },
            BindingInfo { name: "sums", kind: BindingKind::Storage, access: Access::Write },
        ],
    };
}

/// filters the derivatives of SSIM along the rows.
pub mod ssim_bwd_rows {
    use super::super::kernel::*;
    /// `Push` of the shaders.
    #[repr(C)]
    #[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
    pub struct Push {
        /// `width` of the shader.
        pub width: u32,
        /// `height` of the shader.
        pub height: u32,
    }
    const _: () = {
        assert!(size_of::<Push>() == 8);
        assert!(std::mem::offset_of!(Push, width) == 0);
        assert!(std::mem::offset_of!(Push, height) == 4);
    };
    /// The kernel's buffers.
    pub struct Args<'a> {
        /// Reads.
        pub partials: &'a Buf<[f32; 4]>,
        /// Writes.
        pub filtered: &'a Buf<[f32; 4]>,
    }
    impl Kernel for Args<'_> {
        type Push = Push;
        const INFO: &'static KernelInfo = INFO;
        fn slices(&self) -> Vec<Slice> {
            vec![self.partials.slice(), self.filtered.slice()]
        }
    }
    /// What the device needs to know.
    pub const INFO: &KernelInfo = &KernelInfo {
        name: "ssim_bwd_rows",
        push_bytes: size_of::<Push>() as u32,
        spirv: include_bytes!("../../shaders-glsl/spv/ssim_bwd_rows.spv"),
        local: 64,
        subgroups: false,
        floats: 0x3,
        bindings: &[
            BindingInfo { name: "partials", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "filtered", kind: BindingKind::Storage, access: Access::Write },
        ],
    };
}

/// filters the derivatives of SSIM along the rows.
pub mod ssim_bwd_rows_s2 {
    use super::super::kernel::*;
    /// What the device needs to know. A variant of [`super::ssim_bwd_rows`].
    pub const INFO: &KernelInfo = &KernelInfo {
        name: "ssim_bwd_rows_s2",
        push_bytes: size_of::<super::ssim_bwd_rows::Push>() as u32,
        spirv: include_bytes!("../../shaders-glsl/spv/ssim_bwd_rows_s2.spv"),
        local: 64,
        subgroups: false,
        floats: 0x3,
        bindings: &[
            BindingInfo { name: "partials", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "filtered", kind: BindingKind::Storage, access: Access::Write },
        ],
    };
}

/// filters the derivatives of SSIM along the columns and forms the cotangent of the colour.
pub mod ssim_bwd_columns {
    use super::super::kernel::*;
    /// `Push` of the shaders.
    #[repr(C)]
    #[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
    pub struct Push {
        /// `width` of the shader.
        pub width: u32,
        /// `height` of the shader.
        pub height: u32,
        /// `l1_weight` of the shader.
        pub l1_weight: f32,
        /// `ssim_weight` of the shader.
        pub ssim_weight: f32,
    }
    const _: () = {
        assert!(size_of::<Push>() == 16);
        assert!(std::mem::offset_of!(Push, width) == 0);
        assert!(std::mem::offset_of!(Push, height) == 4);
        assert!(std::mem::offset_of!(Push, l1_weight) == 8);
        assert!(std::mem::offset_of!(Push, ssim_weight) == 12);
    };
    /// The kernel's buffers.
    pub struct Args<'a> {
        /// Reads.
        pub filtered: &'a Buf<[f32; 4]>,
        /// Reads.
        pub image: &'a Buf<[f32; 4]>,
        /// Reads.
        pub truth: &'a Buf<u32>,
        /// Writes.
        pub d_image: &'a Buf<[f32; 4]>,
    }
    impl Kernel for Args<'_> {
        type Push = Push;
        const INFO: &'static KernelInfo = INFO;
        fn slices(&self) -> Vec<Slice> {
            vec![self.filtered.slice(), self.image.slice(), self.truth.slice(), self.d_image.slice()]
        }
    }
    /// What the device needs to know.
    pub const INFO: &KernelInfo = &KernelInfo {
        name: "ssim_bwd_columns",
        push_bytes: size_of::<Push>() as u32,
        spirv: include_bytes!("../../shaders-glsl/spv/ssim_bwd_columns.spv"),
        local: 64,
        subgroups: false,
        floats: 0xb,
        bindings: &[
            BindingInfo { name: "filtered", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "image", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "truth", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "d_image", kind: BindingKind::Storage, access: Access::Write },
        ],
    };
}

/// filters the derivatives of SSIM along the columns and forms the cotangent of the colour.
pub mod ssim_bwd_columns_s2 {
    use super::super::kernel::*;
    /// What the device needs to know. A variant of [`super::ssim_bwd_columns`].
    pub const INFO: &KernelInfo = &KernelInfo {
        name: "ssim_bwd_columns_s2",
        push_bytes: size_of::<super::ssim_bwd_columns::Push>() as u32,
        spirv: include_bytes!("../../shaders-glsl/spv/ssim_bwd_columns_s2.spv"),
        local: 64,
        subgroups: false,
        floats: 0xb,
        bindings: &[
            BindingInfo { name: "filtered", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "image", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "truth", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "d_image", kind: BindingKind::Storage, access: Access::Write },
        ],
    };
}

/// the absolute error alone, in the steps without SSIM: its cotangent and sums.
pub mod l1 {
    use super::super::kernel::*;
    /// `Push` of the shaders.
    #[repr(C)]
    #[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
    pub struct Push {
        /// `n` of the shader.
        pub n: u32,
        /// `l1_weight` of the shader.
        pub l1_weight: f32,
    }
    const _: () = {
        assert!(size_of::<Push>() == 8);
        assert!(std::mem::offset_of!(Push, n) == 0);
        assert!(std::mem::offset_of!(Push, l1_weight) == 4);
    };
    /// The kernel's buffers.
    pub struct Args<'a> {
        /// Reads.
        pub image: &'a Buf<[f32; 4]>,
        /// Reads.
        pub truth: &'a Buf<u32>,
        /// Writes.
        pub d_image: &'a Buf<[f32; 4]>,
        /// Writes.
        pub sums: &'a Buf<[f32; 4]>,
    }
    impl Kernel for Args<'_> {
        type Push = Push;
        const INFO: &'static KernelInfo = INFO;
        fn slices(&self) -> Vec<Slice> {
            vec![self.image.slice(), self.truth.slice(), self.d_image.slice(), self.sums.slice()]
        }
    }
    /// What the device needs to know.
    pub const INFO: &KernelInfo = &KernelInfo {
        name: "l1",
        push_bytes: size_of::<Push>() as u32,
        spirv: include_bytes!("../../shaders-glsl/spv/l1.spv"),
        local: 64,
        subgroups: false,
        floats: 0xd,
        bindings: &[
            BindingInfo { name: "image", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "truth", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "d_image", kind: BindingKind::Storage, access: Access::Write },
            BindingInfo { name: "sums", kind: BindingKind::Storage, access: Access::Write },
        ],
    };
}

/// adds the workgroups' sums of 1 - SSIM, absolute and squared error.
pub mod loss_sum {
    use super::super::kernel::*;
    /// `Push` of the shaders.
    #[repr(C)]
    #[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
    pub struct Push {
        /// `n` of the shader.
        pub n: u32,
    }
    const _: () = {
        assert!(size_of::<Push>() == 4);
        assert!(std::mem::offset_of!(Push, n) == 0);
    };
    /// The kernel's buffers.
    pub struct Args<'a> {
        /// Reads.
        pub sums: &'a Buf<[f32; 4]>,
        /// Writes.
        pub loss: &'a Buf<[f32; 4]>,
    }
    impl Kernel for Args<'_> {
        type Push = Push;
        const INFO: &'static KernelInfo = INFO;
        fn slices(&self) -> Vec<Slice> {
            vec![self.sums.slice(), self.loss.slice()]
        }
    }
    /// What the device needs to know.
    pub const INFO: &KernelInfo = &KernelInfo {
        name: "loss_sum",
        push_bytes: size_of::<Push>() as u32,
        spirv: include_bytes!("../../shaders-glsl/spv/loss_sum.spv"),
        local: 64,
        subgroups: false,
        floats: 0x3,
        bindings: &[
            BindingInfo { name: "sums", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "loss", kind: BindingKind::Storage, access: Access::Write },
        ],
    };
}

/// compares depth and flow with their priors: cotangents and sums.
pub mod prior_loss {
    use super::super::kernel::*;
    /// `Push` of the shaders.
    #[repr(C)]
    #[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
    pub struct Push {
        /// `n` of the shader.
        pub n: u32,
        /// `is_metric` of the shader.
        pub is_metric: u32,
        /// `depth_weight` of the shader.
        pub depth_weight: f32,
        /// `flow_weight` of the shader.
        pub flow_weight: f32,
    }
    const _: () = {
        assert!(size_of::<Push>() == 16);
        assert!(std::mem::offset_of!(Push, n) == 0);
        assert!(std::mem::offset_of!(Push, is_metric) == 4);
        assert!(std::mem::offset_of!(Push, depth_weight) == 8);
        assert!(std::mem::offset_of!(Push, flow_weight) == 12);
    };
    /// The kernel's buffers.
    pub struct Args<'a> {
        /// Reads.
        pub image1: &'a Buf<[f32; 4]>,
        /// Reads.
        pub truth: &'a Buf<u32>,
        /// Reads.
        pub priors: &'a Buf<[u32; 2]>,
        /// Writes.
        pub d_image1: &'a Buf<[f32; 4]>,
        /// Writes.
        pub sums: &'a Buf<[f32; 4]>,
    }
    impl Kernel for Args<'_> {
        type Push = Push;
        const INFO: &'static KernelInfo = INFO;
        fn slices(&self) -> Vec<Slice> {
            vec![self.image1.slice(), self.truth.slice(), self.priors.slice(), self.d_image1.slice(), self.sums.slice()]
        }
    }
    /// What the device needs to know.
    pub const INFO: &KernelInfo = &KernelInfo {
        name: "prior_loss",
        push_bytes: size_of::<Push>() as u32,
        spirv: include_bytes!("../../shaders-glsl/spv/prior_loss.spv"),
        local: 64,
        subgroups: false,
        floats: 0x19,
        bindings: &[
            BindingInfo { name: "image1", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "truth", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "priors", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "d_image1", kind: BindingKind::Storage, access: Access::Write },
            BindingInfo { name: "sums", kind: BindingKind::Storage, access: Access::Write },
        ],
    };
}

/// adds the camera's time offset, which only the device knows, to the view's time.
pub mod clock_apply {
    use super::super::kernel::*;
    /// `Push` of the shaders.
    #[repr(C)]
    #[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
    pub struct Push {
        /// `camera` of the shader.
        pub camera: u32,
    }
    const _: () = {
        assert!(size_of::<Push>() == 4);
        assert!(std::mem::offset_of!(Push, camera) == 0);
    };
    /// The kernel's buffers.
    pub struct Args<'a> {
        /// Reads.
        pub clocks: &'a Buf<[f32; 4]>,
        /// ReadWrites.
        pub view: &'a Buf<super::ViewParams>,
    }
    impl Kernel for Args<'_> {
        type Push = Push;
        const INFO: &'static KernelInfo = INFO;
        fn slices(&self) -> Vec<Slice> {
            vec![self.clocks.slice(), self.view.slice()]
        }
    }
    /// What the device needs to know.
    pub const INFO: &KernelInfo = &KernelInfo {
        name: "clock_apply",
        push_bytes: size_of::<Push>() as u32,
        spirv: include_bytes!("../../shaders-glsl/spv/clock_apply.spv"),
        local: 1,
        subgroups: false,
        floats: 0x1,
        bindings: &[
            BindingInfo { name: "clocks", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "view", kind: BindingKind::Storage, access: Access::ReadWrite },
        ],
    };
}

/// moves the cameras' time offsets: Adam on the image's gradient and the L2 term, bound, gauge.
pub mod clock_step {
    use super::super::kernel::*;
    /// `Push` of the shaders.
    #[repr(C)]
    #[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
    pub struct Push {
        /// `camera` of the shader.
        pub camera: u32,
        /// `n_cameras` of the shader.
        pub n_cameras: u32,
        /// `dt` of the shader.
        pub dt: f32,
        /// `rate` of the shader.
        pub rate: f32,
        /// `inverse_c2` of the shader.
        pub inverse_c2: f32,
        /// `regulariser` of the shader.
        pub regulariser: f32,
        /// `bound` of the shader.
        pub bound: f32,
    }
    const _: () = {
        assert!(size_of::<Push>() == 28);
        assert!(std::mem::offset_of!(Push, camera) == 0);
        assert!(std::mem::offset_of!(Push, n_cameras) == 4);
        assert!(std::mem::offset_of!(Push, dt) == 8);
        assert!(std::mem::offset_of!(Push, rate) == 12);
        assert!(std::mem::offset_of!(Push, inverse_c2) == 16);
        assert!(std::mem::offset_of!(Push, regulariser) == 20);
        assert!(std::mem::offset_of!(Push, bound) == 24);
    };
    /// The kernel's buffers.
    pub struct Args<'a> {
        /// Reads.
        pub total: &'a Buf<[f32; 4]>,
        /// Reads.
        pub free: &'a Buf<u32>,
        /// Reads.
        pub frame_status: &'a Buf<super::Status>,
        /// ReadWrites.
        pub clocks: &'a Buf<[f32; 4]>,
    }
    impl Kernel for Args<'_> {
        type Push = Push;
        const INFO: &'static KernelInfo = INFO;
        fn slices(&self) -> Vec<Slice> {
            vec![self.total.slice(), self.free.slice(), self.frame_status.slice(), self.clocks.slice()]
        }
    }
    /// What the device needs to know.
    pub const INFO: &KernelInfo = &KernelInfo {
        name: "clock_step",
        push_bytes: size_of::<Push>() as u32,
        spirv: include_bytes!("../../shaders-glsl/spv/clock_step.spv"),
        local: 64,
        subgroups: false,
        floats: 0x9,
        bindings: &[
            BindingInfo { name: "total", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "free", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "frame_status", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "clocks", kind: BindingKind::Storage, access: Access::ReadWrite },
        ],
    };
}

/// cuts the crop out of picture and truth and scales both as LPIPS's trunk wants them.
pub mod lpips_input {
    use super::super::kernel::*;
    /// `Push` of the shaders.
    #[repr(C)]
    #[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
    pub struct Push {
        /// `width` of the shader.
        pub width: u32,
        /// `first_x` of the shader.
        pub first_x: u32,
        /// `first_y` of the shader.
        pub first_y: u32,
        /// `crop_width` of the shader.
        pub crop_width: u32,
        /// `crop_height` of the shader.
        pub crop_height: u32,
    }
    const _: () = {
        assert!(size_of::<Push>() == 20);
        assert!(std::mem::offset_of!(Push, width) == 0);
        assert!(std::mem::offset_of!(Push, first_x) == 4);
        assert!(std::mem::offset_of!(Push, first_y) == 8);
        assert!(std::mem::offset_of!(Push, crop_width) == 12);
        assert!(std::mem::offset_of!(Push, crop_height) == 16);
    };
    /// The kernel's buffers.
    pub struct Args<'a> {
        /// Reads.
        pub image: &'a Buf<[f32; 4]>,
        /// Reads.
        pub truth: &'a Buf<u32>,
        /// Writes.
        pub features: &'a Buf<[f32; 4]>,
        /// Writes.
        pub truth_features: &'a Buf<[f32; 4]>,
    }
    impl Kernel for Args<'_> {
        type Push = Push;
        const INFO: &'static KernelInfo = INFO;
        fn slices(&self) -> Vec<Slice> {
            vec![self.image.slice(), self.truth.slice(), self.features.slice(), self.truth_features.slice()]
        }
    }
    /// What the device needs to know.
    pub const INFO: &KernelInfo = &KernelInfo {
        name: "lpips_input",
        push_bytes: size_of::<Push>() as u32,
        spirv: include_bytes!("../../shaders-glsl/spv/lpips_input.spv"),
        local: 64,
        subgroups: false,
        floats: 0xd,
        bindings: &[
            BindingInfo { name: "image", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "truth", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "features", kind: BindingKind::Storage, access: Access::Write },
            BindingInfo { name: "truth_features", kind: BindingKind::Storage, access: Access::Write },
        ],
    };
}

/// convolves feature maps: forward with bias and ReLU, or a cotangent back to the maps it came from.
pub mod lpips_conv {
    use super::super::kernel::*;
    /// `Push` of the shaders.
    #[repr(C)]
    #[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
    pub struct Push {
        /// `in_width` of the shader.
        pub in_width: u32,
        /// `in_height` of the shader.
        pub in_height: u32,
        /// `in_planes` of the shader.
        pub in_planes: u32,
        /// `in_first` of the shader.
        pub in_first: u32,
        /// `out_width` of the shader.
        pub out_width: u32,
        /// `out_height` of the shader.
        pub out_height: u32,
        /// `out_channels` of the shader.
        pub out_channels: u32,
        /// `out_stride` of the shader.
        pub out_stride: u32,
        /// `out_first` of the shader.
        pub out_first: u32,
        /// `columns` of the shader.
        pub columns: u32,
        /// `run` of the shader.
        pub run: u32,
        /// `steps` of the shader.
        pub steps: u32,
        /// `stride` of the shader.
        pub stride: u32,
        /// `pad` of the shader.
        pub pad: u32,
        /// `add` of the shader.
        pub add: u32,
        /// `mask` of the shader.
        pub mask: u32,
    }
    const _: () = {
        assert!(size_of::<Push>() == 64);
        assert!(std::mem::offset_of!(Push, in_width) == 0);
        assert!(std::mem::offset_of!(Push, in_height) == 4);
        assert!(std::mem::offset_of!(Push, in_planes) == 8);
        assert!(std::mem::offset_of!(Push, in_first) == 12);
        assert!(std::mem::offset_of!(Push, out_width) == 16);
        assert!(std::mem::offset_of!(Push, out_height) == 20);
        assert!(std::mem::offset_of!(Push, out_channels) == 24);
        assert!(std::mem::offset_of!(Push, out_stride) == 28);
        assert!(std::mem::offset_of!(Push, out_first) == 32);
        assert!(std::mem::offset_of!(Push, columns) == 36);
        assert!(std::mem::offset_of!(Push, run) == 40);
        assert!(std::mem::offset_of!(Push, steps) == 44);
        assert!(std::mem::offset_of!(Push, stride) == 48);
        assert!(std::mem::offset_of!(Push, pad) == 52);
        assert!(std::mem::offset_of!(Push, add) == 56);
        assert!(std::mem::offset_of!(Push, mask) == 60);
    };
    /// The kernel's buffers.
    pub struct Args<'a> {
        /// Reads.
        pub features: &'a Buf<[f32; 4]>,
        /// Reads.
        pub weights: &'a Buf<[f32; 4]>,
        /// Reads.
        pub bias: &'a Buf<f32>,
        /// Writes.
        pub maps: &'a Buf<f32>,
    }
    impl Kernel for Args<'_> {
        type Push = Push;
        const INFO: &'static KernelInfo = INFO;
        fn slices(&self) -> Vec<Slice> {
            vec![self.features.slice(), self.weights.slice(), self.bias.slice(), self.maps.slice()]
        }
    }
    /// What the device needs to know.
    pub const INFO: &KernelInfo = &KernelInfo {
        name: "lpips_conv",
        push_bytes: size_of::<Push>() as u32,
        spirv: include_bytes!("../../shaders-glsl/spv/lpips_conv.spv"),
        local: 64,
        subgroups: true,
        floats: 0xf,
        bindings: &[
            BindingInfo { name: "features", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "weights", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "bias", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "maps", kind: BindingKind::Storage, access: Access::Write },
        ],
    };
}

/// takes the greatest of each 3 x 3 window, two pixels apart, and keeps which it was.
pub mod lpips_pool {
    use super::super::kernel::*;
    /// `Push` of the shaders.
    #[repr(C)]
    #[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
    pub struct Push {
        /// `width` of the shader.
        pub width: u32,
        /// `height` of the shader.
        pub height: u32,
        /// `planes` of the shader.
        pub planes: u32,
        /// `out_width` of the shader.
        pub out_width: u32,
        /// `out_height` of the shader.
        pub out_height: u32,
    }
    const _: () = {
        assert!(size_of::<Push>() == 20);
        assert!(std::mem::offset_of!(Push, width) == 0);
        assert!(std::mem::offset_of!(Push, height) == 4);
        assert!(std::mem::offset_of!(Push, planes) == 8);
        assert!(std::mem::offset_of!(Push, out_width) == 12);
        assert!(std::mem::offset_of!(Push, out_height) == 16);
    };
    /// The kernel's buffers.
    pub struct Args<'a> {
        /// Reads.
        pub features: &'a Buf<[f32; 4]>,
        /// Writes.
        pub pooled: &'a Buf<[f32; 4]>,
        /// Writes.
        pub choices: &'a Buf<u32>,
    }
    impl Kernel for Args<'_> {
        type Push = Push;
        const INFO: &'static KernelInfo = INFO;
        fn slices(&self) -> Vec<Slice> {
            vec![self.features.slice(), self.pooled.slice(), self.choices.slice()]
        }
    }
    /// What the device needs to know.
    pub const INFO: &KernelInfo = &KernelInfo {
        name: "lpips_pool",
        push_bytes: size_of::<Push>() as u32,
        spirv: include_bytes!("../../shaders-glsl/spv/lpips_pool.spv"),
        local: 64,
        subgroups: false,
        floats: 0x3,
        bindings: &[
            BindingInfo { name: "features", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "pooled", kind: BindingKind::Storage, access: Access::Write },
            BindingInfo { name: "choices", kind: BindingKind::Storage, access: Access::Write },
        ],
    };
}

/// compares the features of picture and truth at one depth of LPIPS's trunk, and forms the cotangent.
pub mod lpips_tap {
    use super::super::kernel::*;
    /// `Push` of the shaders.
    #[repr(C)]
    #[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
    pub struct Push {
        /// `pixels` of the shader.
        pub pixels: u32,
        /// `planes` of the shader.
        pub planes: u32,
        /// `first_sum` of the shader.
        pub first_sum: u32,
        /// `per_pixel` of the shader.
        pub per_pixel: f32,
    }
    const _: () = {
        assert!(size_of::<Push>() == 16);
        assert!(std::mem::offset_of!(Push, pixels) == 0);
        assert!(std::mem::offset_of!(Push, planes) == 4);
        assert!(std::mem::offset_of!(Push, first_sum) == 8);
        assert!(std::mem::offset_of!(Push, per_pixel) == 12);
    };
    /// The kernel's buffers.
    pub struct Args<'a> {
        /// Reads.
        pub features: &'a Buf<[f32; 4]>,
        /// Reads.
        pub truth_features: &'a Buf<[f32; 4]>,
        /// Reads.
        pub linear: &'a Buf<[f32; 4]>,
        /// Writes.
        pub sums: &'a Buf<f32>,
    }
    impl Kernel for Args<'_> {
        type Push = Push;
        const INFO: &'static KernelInfo = INFO;
        fn slices(&self) -> Vec<Slice> {
            vec![self.features.slice(), self.truth_features.slice(), self.linear.slice(), self.sums.slice()]
        }
    }
    /// What the device needs to know.
    pub const INFO: &KernelInfo = &KernelInfo {
        name: "lpips_tap",
        push_bytes: size_of::<Push>() as u32,
        spirv: include_bytes!("../../shaders-glsl/spv/lpips_tap.spv"),
        local: 64,
        subgroups: true,
        floats: 0xf,
        bindings: &[
            BindingInfo { name: "features", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "truth_features", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "linear", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "sums", kind: BindingKind::Storage, access: Access::Write },
        ],
    };
}

/// compares the features of picture and truth at one depth of LPIPS's trunk, and forms the cotangent.
pub mod lpips_tap_bwd {
    use super::super::kernel::*;
    /// `Push` of the shaders.
    #[repr(C)]
    #[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
    pub struct Push {
        /// `pixels` of the shader.
        pub pixels: u32,
        /// `planes` of the shader.
        pub planes: u32,
        /// `first_sum` of the shader.
        pub first_sum: u32,
        /// `per_pixel` of the shader.
        pub per_pixel: f32,
    }
    const _: () = {
        assert!(size_of::<Push>() == 16);
        assert!(std::mem::offset_of!(Push, pixels) == 0);
        assert!(std::mem::offset_of!(Push, planes) == 4);
        assert!(std::mem::offset_of!(Push, first_sum) == 8);
        assert!(std::mem::offset_of!(Push, per_pixel) == 12);
    };
    /// The kernel's buffers.
    pub struct Args<'a> {
        /// Reads.
        pub features: &'a Buf<[f32; 4]>,
        /// Reads.
        pub truth_features: &'a Buf<[f32; 4]>,
        /// Reads.
        pub linear: &'a Buf<[f32; 4]>,
        /// Writes.
        pub sums: &'a Buf<f32>,
        /// Writes.
        pub d_features: &'a Buf<[f32; 4]>,
    }
    impl Kernel for Args<'_> {
        type Push = Push;
        const INFO: &'static KernelInfo = INFO;
        fn slices(&self) -> Vec<Slice> {
            vec![
                self.features.slice(),
                self.truth_features.slice(),
                self.linear.slice(),
                self.sums.slice(),
                self.d_features.slice(),
            ]
        }
    }
    /// What the device needs to know.
    pub const INFO: &KernelInfo = &KernelInfo {
        name: "lpips_tap_bwd",
        push_bytes: size_of::<Push>() as u32,
        spirv: include_bytes!("../../shaders-glsl/spv/lpips_tap_bwd.spv"),
        local: 64,
        subgroups: true,
        floats: 0x1f,
        bindings: &[
            BindingInfo { name: "features", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "truth_features", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "linear", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "sums", kind: BindingKind::Storage, access: Access::Write },
            BindingInfo { name: "d_features", kind: BindingKind::Storage, access: Access::Write },
        ],
    };
}

/// adds the workgroups' shares of LPIPS.
pub mod lpips_sum {
    use super::super::kernel::*;
    /// `Push` of the shaders.
    #[repr(C)]
    #[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
    pub struct Push {
        /// `n` of the shader.
        pub n: u32,
    }
    const _: () = {
        assert!(size_of::<Push>() == 4);
        assert!(std::mem::offset_of!(Push, n) == 0);
    };
    /// The kernel's buffers.
    pub struct Args<'a> {
        /// Reads.
        pub sums: &'a Buf<f32>,
        /// Writes.
        pub value: &'a Buf<f32>,
    }
    impl Kernel for Args<'_> {
        type Push = Push;
        const INFO: &'static KernelInfo = INFO;
        fn slices(&self) -> Vec<Slice> {
            vec![self.sums.slice(), self.value.slice()]
        }
    }
    /// What the device needs to know.
    pub const INFO: &KernelInfo = &KernelInfo {
        name: "lpips_sum",
        push_bytes: size_of::<Push>() as u32,
        spirv: include_bytes!("../../shaders-glsl/spv/lpips_sum.spv"),
        local: 64,
        subgroups: false,
        floats: 0x3,
        bindings: &[
            BindingInfo { name: "sums", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "value", kind: BindingKind::Storage, access: Access::Write },
        ],
    };
}

/// convolves feature maps: forward with bias and ReLU, or a cotangent back to the maps it came from.
pub mod lpips_conv_bwd {
    use super::super::kernel::*;
    /// `Push` of the shaders.
    #[repr(C)]
    #[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
    pub struct Push {
        /// `in_width` of the shader.
        pub in_width: u32,
        /// `in_height` of the shader.
        pub in_height: u32,
        /// `in_planes` of the shader.
        pub in_planes: u32,
        /// `in_first` of the shader.
        pub in_first: u32,
        /// `out_width` of the shader.
        pub out_width: u32,
        /// `out_height` of the shader.
        pub out_height: u32,
        /// `out_channels` of the shader.
        pub out_channels: u32,
        /// `out_stride` of the shader.
        pub out_stride: u32,
        /// `out_first` of the shader.
        pub out_first: u32,
        /// `columns` of the shader.
        pub columns: u32,
        /// `run` of the shader.
        pub run: u32,
        /// `steps` of the shader.
        pub steps: u32,
        /// `stride` of the shader.
        pub stride: u32,
        /// `pad` of the shader.
        pub pad: u32,
        /// `add` of the shader.
        pub add: u32,
        /// `mask` of the shader.
        pub mask: u32,
    }
    const _: () = {
        assert!(size_of::<Push>() == 64);
        assert!(std::mem::offset_of!(Push, in_width) == 0);
        assert!(std::mem::offset_of!(Push, in_height) == 4);
        assert!(std::mem::offset_of!(Push, in_planes) == 8);
        assert!(std::mem::offset_of!(Push, in_first) == 12);
        assert!(std::mem::offset_of!(Push, out_width) == 16);
        assert!(std::mem::offset_of!(Push, out_height) == 20);
        assert!(std::mem::offset_of!(Push, out_channels) == 24);
        assert!(std::mem::offset_of!(Push, out_stride) == 28);
        assert!(std::mem::offset_of!(Push, out_first) == 32);
        assert!(std::mem::offset_of!(Push, columns) == 36);
        assert!(std::mem::offset_of!(Push, run) == 40);
        assert!(std::mem::offset_of!(Push, steps) == 44);
        assert!(std::mem::offset_of!(Push, stride) == 48);
        assert!(std::mem::offset_of!(Push, pad) == 52);
        assert!(std::mem::offset_of!(Push, add) == 56);
        assert!(std::mem::offset_of!(Push, mask) == 60);
    };
    /// The kernel's buffers.
    pub struct Args<'a> {
        /// Reads.
        pub features: &'a Buf<[f32; 4]>,
        /// Reads.
        pub weights: &'a Buf<[f32; 4]>,
        /// Reads.
        pub forward: &'a Buf<f32>,
        /// ReadWrites.
        pub maps: &'a Buf<f32>,
    }
    impl Kernel for Args<'_> {
        type Push = Push;
        const INFO: &'static KernelInfo = INFO;
        fn slices(&self) -> Vec<Slice> {
            vec![self.features.slice(), self.weights.slice(), self.forward.slice(), self.maps.slice()]
        }
    }
    /// What the device needs to know.
    pub const INFO: &KernelInfo = &KernelInfo {
        name: "lpips_conv_bwd",
        push_bytes: size_of::<Push>() as u32,
        spirv: include_bytes!("../../shaders-glsl/spv/lpips_conv_bwd.spv"),
        local: 64,
        subgroups: true,
        floats: 0xf,
        bindings: &[
            BindingInfo { name: "features", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "weights", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "forward", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "maps", kind: BindingKind::Storage, access: Access::ReadWrite },
        ],
    };
}

/// carries the cotangent of a pool back to the greatest value of each window.
pub mod lpips_pool_bwd {
    use super::super::kernel::*;
    /// `Push` of the shaders.
    #[repr(C)]
    #[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
    pub struct Push {
        /// `width` of the shader.
        pub width: u32,
        /// `height` of the shader.
        pub height: u32,
        /// `planes` of the shader.
        pub planes: u32,
        /// `out_width` of the shader.
        pub out_width: u32,
        /// `out_height` of the shader.
        pub out_height: u32,
    }
    const _: () = {
        assert!(size_of::<Push>() == 20);
        assert!(std::mem::offset_of!(Push, width) == 0);
        assert!(std::mem::offset_of!(Push, height) == 4);
        assert!(std::mem::offset_of!(Push, planes) == 8);
        assert!(std::mem::offset_of!(Push, out_width) == 12);
        assert!(std::mem::offset_of!(Push, out_height) == 16);
    };
    /// The kernel's buffers.
    pub struct Args<'a> {
        /// Reads.
        pub features: &'a Buf<[f32; 4]>,
        /// Reads.
        pub choices: &'a Buf<u32>,
        /// Reads.
        pub d_pooled: &'a Buf<[f32; 4]>,
        /// ReadWrites.
        pub d_features: &'a Buf<[f32; 4]>,
    }
    impl Kernel for Args<'_> {
        type Push = Push;
        const INFO: &'static KernelInfo = INFO;
        fn slices(&self) -> Vec<Slice> {
            vec![self.features.slice(), self.choices.slice(), self.d_pooled.slice(), self.d_features.slice()]
        }
    }
    /// What the device needs to know.
    pub const INFO: &KernelInfo = &KernelInfo {
        name: "lpips_pool_bwd",
        push_bytes: size_of::<Push>() as u32,
        spirv: include_bytes!("../../shaders-glsl/spv/lpips_pool_bwd.spv"),
        local: 64,
        subgroups: false,
        floats: 0xd,
        bindings: &[
            BindingInfo { name: "features", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "choices", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "d_pooled", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "d_features", kind: BindingKind::Storage, access: Access::ReadWrite },
        ],
    };
}

/// adds the cotangent of LPIPS's input to that of the picture.
pub mod lpips_input_bwd {
    use super::super::kernel::*;
    /// `Push` of the shaders.
    #[repr(C)]
    #[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
    pub struct Push {
        /// `width` of the shader.
        pub width: u32,
        /// `first_x` of the shader.
        pub first_x: u32,
        /// `first_y` of the shader.
        pub first_y: u32,
        /// `crop_width` of the shader.
        pub crop_width: u32,
        /// `crop_height` of the shader.
        pub crop_height: u32,
        /// `blocks_x` of the shader.
        pub blocks_x: u32,
        /// `stride` of the shader.
        pub stride: u32,
        /// `pad` of the shader.
        pub pad: u32,
        /// `weight` of the shader.
        pub weight: f32,
    }
    const _: () = {
        assert!(size_of::<Push>() == 36);
        assert!(std::mem::offset_of!(Push, width) == 0);
        assert!(std::mem::offset_of!(Push, first_x) == 4);
        assert!(std::mem::offset_of!(Push, first_y) == 8);
        assert!(std::mem::offset_of!(Push, crop_width) == 12);
        assert!(std::mem::offset_of!(Push, crop_height) == 16);
        assert!(std::mem::offset_of!(Push, blocks_x) == 20);
        assert!(std::mem::offset_of!(Push, stride) == 24);
        assert!(std::mem::offset_of!(Push, pad) == 28);
        assert!(std::mem::offset_of!(Push, weight) == 32);
    };
    /// The kernel's buffers.
    pub struct Args<'a> {
        /// Reads.
        pub d_blocks: &'a Buf<f32>,
        /// Reads.
        pub truth: &'a Buf<u32>,
        /// ReadWrites.
        pub d_image: &'a Buf<[f32; 4]>,
    }
    impl Kernel for Args<'_> {
        type Push = Push;
        const INFO: &'static KernelInfo = INFO;
        fn slices(&self) -> Vec<Slice> {
            vec![self.d_blocks.slice(), self.truth.slice(), self.d_image.slice()]
        }
    }
    /// What the device needs to know.
    pub const INFO: &KernelInfo = &KernelInfo {
        name: "lpips_input_bwd",
        push_bytes: size_of::<Push>() as u32,
        spirv: include_bytes!("../../shaders-glsl/spv/lpips_input_bwd.spv"),
        local: 64,
        subgroups: false,
        floats: 0x5,
        bindings: &[
            BindingInfo { name: "d_blocks", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "truth", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "d_image", kind: BindingKind::Storage, access: Access::ReadWrite },
        ],
    };
}

/// maps each pixel's colour by the affine map that the camera's bilateral grid has at its place and luma; with
pub mod bilateral_slice {
    use super::super::kernel::*;
    /// `Push` of the shaders.
    #[repr(C)]
    #[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
    pub struct Push {
        /// `width` of the shader.
        pub width: u32,
        /// `height` of the shader.
        pub height: u32,
        /// `rows` of the shader.
        pub rows: u32,
        /// `parts` of the shader.
        pub parts: u32,
    }
    const _: () = {
        assert!(size_of::<Push>() == 16);
        assert!(std::mem::offset_of!(Push, width) == 0);
        assert!(std::mem::offset_of!(Push, height) == 4);
        assert!(std::mem::offset_of!(Push, rows) == 8);
        assert!(std::mem::offset_of!(Push, parts) == 12);
    };
    /// The kernel's buffers.
    pub struct Args<'a> {
        /// Reads.
        pub camera_grid: &'a Buf<[f32; 4]>,
        /// Reads.
        pub image: &'a Buf<[f32; 4]>,
        /// Writes.
        pub graded: &'a Buf<[f32; 4]>,
    }
    impl Kernel for Args<'_> {
        type Push = Push;
        const INFO: &'static KernelInfo = INFO;
        fn slices(&self) -> Vec<Slice> {
            vec![self.camera_grid.slice(), self.image.slice(), self.graded.slice()]
        }
    }
    /// What the device needs to know.
    pub const INFO: &KernelInfo = &KernelInfo {
        name: "bilateral_slice",
        push_bytes: size_of::<Push>() as u32,
        spirv: include_bytes!("../../shaders-glsl/spv/bilateral_slice.spv"),
        local: 64,
        subgroups: true,
        floats: 0x7,
        bindings: &[
            BindingInfo { name: "camera_grid", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "image", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "graded", kind: BindingKind::Storage, access: Access::Write },
        ],
    };
}

/// maps each pixel's colour by the affine map that the camera's bilateral grid has at its place and luma; with
pub mod bilateral_slice_bwd {
    use super::super::kernel::*;
    /// `Push` of the shaders.
    #[repr(C)]
    #[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
    pub struct Push {
        /// `width` of the shader.
        pub width: u32,
        /// `height` of the shader.
        pub height: u32,
        /// `rows` of the shader.
        pub rows: u32,
        /// `parts` of the shader.
        pub parts: u32,
    }
    const _: () = {
        assert!(size_of::<Push>() == 16);
        assert!(std::mem::offset_of!(Push, width) == 0);
        assert!(std::mem::offset_of!(Push, height) == 4);
        assert!(std::mem::offset_of!(Push, rows) == 8);
        assert!(std::mem::offset_of!(Push, parts) == 12);
    };
    /// The kernel's buffers.
    pub struct Args<'a> {
        /// Reads.
        pub camera_grid: &'a Buf<[f32; 4]>,
        /// Reads.
        pub image: &'a Buf<[f32; 4]>,
        /// Reads.
        pub d_graded: &'a Buf<[f32; 4]>,
        /// Writes.
        pub d_image: &'a Buf<[f32; 4]>,
    }
    impl Kernel for Args<'_> {
        type Push = Push;
        const INFO: &'static KernelInfo = INFO;
        fn slices(&self) -> Vec<Slice> {
            vec![self.camera_grid.slice(), self.image.slice(), self.d_graded.slice(), self.d_image.slice()]
        }
    }
    /// What the device needs to know.
    pub const INFO: &KernelInfo = &KernelInfo {
        name: "bilateral_slice_bwd",
        push_bytes: size_of::<Push>() as u32,
        spirv: include_bytes!("../../shaders-glsl/spv/bilateral_slice_bwd.spv"),
        local: 64,
        subgroups: true,
        floats: 0xf,
        bindings: &[
            BindingInfo { name: "camera_grid", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "image", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "d_graded", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "d_image", kind: BindingKind::Storage, access: Access::Write },
        ],
    };
}

/// sums the cotangents of a part's pixels into the four columns of cells at its corners.
pub mod bilateral_bwd {
    use super::super::kernel::*;
    /// `Push` of the shaders.
    #[repr(C)]
    #[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
    pub struct Push {
        /// `width` of the shader.
        pub width: u32,
        /// `height` of the shader.
        pub height: u32,
        /// `rows` of the shader.
        pub rows: u32,
        /// `parts` of the shader.
        pub parts: u32,
    }
    const _: () = {
        assert!(size_of::<Push>() == 16);
        assert!(std::mem::offset_of!(Push, width) == 0);
        assert!(std::mem::offset_of!(Push, height) == 4);
        assert!(std::mem::offset_of!(Push, rows) == 8);
        assert!(std::mem::offset_of!(Push, parts) == 12);
    };
    /// The kernel's buffers.
    pub struct Args<'a> {
        /// Reads.
        pub image: &'a Buf<[f32; 4]>,
        /// Reads.
        pub d_graded: &'a Buf<[f32; 4]>,
        /// Writes.
        pub partials: &'a Buf<[f32; 4]>,
    }
    impl Kernel for Args<'_> {
        type Push = Push;
        const INFO: &'static KernelInfo = INFO;
        fn slices(&self) -> Vec<Slice> {
            vec![self.image.slice(), self.d_graded.slice(), self.partials.slice()]
        }
    }
    /// What the device needs to know.
    pub const INFO: &KernelInfo = &KernelInfo {
        name: "bilateral_bwd",
        push_bytes: size_of::<Push>() as u32,
        spirv: include_bytes!("../../shaders-glsl/spv/bilateral_bwd.spv"),
        local: 64,
        subgroups: true,
        floats: 0x7,
        bindings: &[
            BindingInfo { name: "image", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "d_graded", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "partials", kind: BindingKind::Storage, access: Access::Write },
        ],
    };
}

/// adds the parts' sums around each cell: the gradient of the camera's grid.
pub mod bilateral_sum {
    use super::super::kernel::*;
    /// `Push` of the shaders.
    #[repr(C)]
    #[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
    pub struct Push {
        /// `parts` of the shader.
        pub parts: u32,
    }
    const _: () = {
        assert!(size_of::<Push>() == 4);
        assert!(std::mem::offset_of!(Push, parts) == 0);
    };
    /// The kernel's buffers.
    pub struct Args<'a> {
        /// Reads.
        pub partials: &'a Buf<[f32; 4]>,
        /// Writes.
        pub d_grid: &'a Buf<[f32; 4]>,
    }
    impl Kernel for Args<'_> {
        type Push = Push;
        const INFO: &'static KernelInfo = INFO;
        fn slices(&self) -> Vec<Slice> {
            vec![self.partials.slice(), self.d_grid.slice()]
        }
    }
    /// What the device needs to know.
    pub const INFO: &KernelInfo = &KernelInfo {
        name: "bilateral_sum",
        push_bytes: size_of::<Push>() as u32,
        spirv: include_bytes!("../../shaders-glsl/spv/bilateral_sum.spv"),
        local: 64,
        subgroups: true,
        floats: 0x3,
        bindings: &[
            BindingInfo { name: "partials", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "d_grid", kind: BindingKind::Storage, access: Access::Write },
        ],
    };
}

/// one step of Adam on one camera's grid, along its gradient and that of the total variation.
pub mod bilateral_adam {
    use super::super::kernel::*;
    /// `Push` of the shaders.
    #[repr(C)]
    #[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
    pub struct Push {
        /// `rate` of the shader.
        pub rate: f32,
        /// `beta1` of the shader.
        pub beta1: f32,
        /// `beta2` of the shader.
        pub beta2: f32,
        /// `inverse_c2` of the shader.
        pub inverse_c2: f32,
        /// `eps` of the shader.
        pub eps: f32,
        /// `tv_weight` of the shader.
        pub tv_weight: f32,
    }
    const _: () = {
        assert!(size_of::<Push>() == 24);
        assert!(std::mem::offset_of!(Push, rate) == 0);
        assert!(std::mem::offset_of!(Push, beta1) == 4);
        assert!(std::mem::offset_of!(Push, beta2) == 8);
        assert!(std::mem::offset_of!(Push, inverse_c2) == 12);
        assert!(std::mem::offset_of!(Push, eps) == 16);
        assert!(std::mem::offset_of!(Push, tv_weight) == 20);
    };
    /// The kernel's buffers.
    pub struct Args<'a> {
        /// Reads.
        pub frame_status: &'a Buf<super::Status>,
        /// Reads.
        pub camera_grid: &'a Buf<[f32; 4]>,
        /// Reads.
        pub d_grid: &'a Buf<[f32; 4]>,
        /// ReadWrites.
        pub first: &'a Buf<[f32; 4]>,
        /// ReadWrites.
        pub second: &'a Buf<[f32; 4]>,
        /// Writes.
        pub stepped: &'a Buf<[f32; 4]>,
        /// Writes.
        pub sums: &'a Buf<[f32; 4]>,
    }
    impl Kernel for Args<'_> {
        type Push = Push;
        const INFO: &'static KernelInfo = INFO;
        fn slices(&self) -> Vec<Slice> {
            vec![
                self.frame_status.slice(),
                self.camera_grid.slice(),
                self.d_grid.slice(),
                self.first.slice(),
                self.second.slice(),
                self.stepped.slice(),
                self.sums.slice(),
            ]
        }
    }
    /// What the device needs to know.
    pub const INFO: &KernelInfo = &KernelInfo {
        name: "bilateral_adam",
        push_bytes: size_of::<Push>() as u32,
        spirv: include_bytes!("../../shaders-glsl/spv/bilateral_adam.spv"),
        local: 64,
        subgroups: false,
        floats: 0x7e,
        bindings: &[
            BindingInfo { name: "frame_status", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "camera_grid", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "d_grid", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "first", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "second", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "stepped", kind: BindingKind::Storage, access: Access::Write },
            BindingInfo { name: "sums", kind: BindingKind::Storage, access: Access::Write },
        ],
    };
}

/// takes the mean deviation from the identity over the cameras off every camera's grid.
pub mod bilateral_gauge {
    use super::super::kernel::*;
    /// `Push` of the shaders.
    #[repr(C)]
    #[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
    pub struct Push {
        /// `n_cameras` of the shader.
        pub n_cameras: u32,
    }
    const _: () = {
        assert!(size_of::<Push>() == 4);
        assert!(std::mem::offset_of!(Push, n_cameras) == 0);
    };
    /// The kernel's buffers.
    pub struct Args<'a> {
        /// Reads.
        pub frame_status: &'a Buf<super::Status>,
        /// ReadWrites.
        pub grids: &'a Buf<[f32; 4]>,
    }
    impl Kernel for Args<'_> {
        type Push = Push;
        const INFO: &'static KernelInfo = INFO;
        fn slices(&self) -> Vec<Slice> {
            vec![self.frame_status.slice(), self.grids.slice()]
        }
    }
    /// What the device needs to know.
    pub const INFO: &KernelInfo = &KernelInfo {
        name: "bilateral_gauge",
        push_bytes: size_of::<Push>() as u32,
        spirv: include_bytes!("../../shaders-glsl/spv/bilateral_gauge.spv"),
        local: 64,
        subgroups: true,
        floats: 0x2,
        bindings: &[
            BindingInfo { name: "frame_status", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "grids", kind: BindingKind::Storage, access: Access::ReadWrite },
        ],
    };
}

/// one step of dense Adam on one buffer of the Gaussians that the frame did not see.
pub mod adam_idle {
    use super::super::kernel::*;
    /// `Push` of the shaders.
    #[repr(C)]
    #[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
    pub struct Push {
        /// `group` of the shader.
        pub group: u32,
        /// `n` of the shader.
        pub n: u32,
        /// `first` of the shader.
        pub first: u32,
        /// `kind` of the shader.
        pub kind: u32,
        /// `planes` of the shader.
        pub planes: u32,
    }
    const _: () = {
        assert!(size_of::<Push>() == 20);
        assert!(std::mem::offset_of!(Push, group) == 0);
        assert!(std::mem::offset_of!(Push, n) == 4);
        assert!(std::mem::offset_of!(Push, first) == 8);
        assert!(std::mem::offset_of!(Push, kind) == 12);
        assert!(std::mem::offset_of!(Push, planes) == 16);
    };
    /// The kernel's buffers.
    pub struct Args<'a> {
        /// Reads.
        pub frame_status: &'a Buf<super::Status>,
        /// Reads.
        pub adam: &'a Buf<super::AdamParams>,
        /// Reads.
        pub ranges: &'a Buf<[u32; 2]>,
        /// Reads.
        pub idle_id: &'a Buf<u32>,
        /// ReadWrites.
        pub parameter: &'a Buf<[f32; 4]>,
        /// ReadWrites.
        pub moments: &'a Buf<[f32; 4]>,
        /// ReadWrites.
        pub state: &'a Buf<[f32; 4]>,
    }
    impl Kernel for Args<'_> {
        type Push = Push;
        const INFO: &'static KernelInfo = INFO;
        fn slices(&self) -> Vec<Slice> {
            vec![
                self.frame_status.slice(),
                self.adam.slice(),
                self.ranges.slice(),
                self.idle_id.slice(),
                self.parameter.slice(),
                self.moments.slice(),
                self.state.slice(),
            ]
        }
    }
    /// What the device needs to know.
    pub const INFO: &KernelInfo = &KernelInfo {
        name: "adam_idle",
        push_bytes: size_of::<Push>() as u32,
        spirv: include_bytes!("../../shaders-glsl/spv/adam_idle.spv"),
        local: 64,
        subgroups: true,
        floats: 0x70,
        bindings: &[
            BindingInfo { name: "frame_status", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "adam", kind: BindingKind::Uniform, access: Access::Read },
            BindingInfo { name: "ranges", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "idle_id", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "parameter", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "moments", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "state", kind: BindingKind::Storage, access: Access::ReadWrite },
        ],
    };
}

/// gives one buffer of the Gaussians in view the steps of dense Adam that they missed while they were not.
pub mod adam_catch_up {
    use super::super::kernel::*;
    /// `Push` of the shaders.
    #[repr(C)]
    #[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
    pub struct Push {
        /// `group` of the shader.
        pub group: u32,
        /// `first` of the shader.
        pub first: u32,
        /// `n` of the shader.
        pub n: u32,
        /// `all` of the shader.
        pub all: u32,
        /// `kind` of the shader.
        pub kind: u32,
        /// `planes` of the shader.
        pub planes: u32,
        /// `until` of the shader.
        pub until: u32,
        /// `is_last` of the shader.
        pub is_last: u32,
        /// `log2_beta1` of the shader.
        pub log2_beta1: f32,
        /// `log2_beta2` of the shader.
        pub log2_beta2: f32,
    }
    const _: () = {
        assert!(size_of::<Push>() == 40);
        assert!(std::mem::offset_of!(Push, group) == 0);
        assert!(std::mem::offset_of!(Push, first) == 4);
        assert!(std::mem::offset_of!(Push, n) == 8);
        assert!(std::mem::offset_of!(Push, all) == 12);
        assert!(std::mem::offset_of!(Push, kind) == 16);
        assert!(std::mem::offset_of!(Push, planes) == 20);
        assert!(std::mem::offset_of!(Push, until) == 24);
        assert!(std::mem::offset_of!(Push, is_last) == 28);
        assert!(std::mem::offset_of!(Push, log2_beta1) == 32);
        assert!(std::mem::offset_of!(Push, log2_beta2) == 36);
    };
    /// The kernel's buffers.
    pub struct Args<'a> {
        /// Reads.
        pub frame_status: &'a Buf<super::Status>,
        /// Reads.
        pub adam: &'a Buf<super::AdamParams>,
        /// Reads.
        pub ranges: &'a Buf<[u32; 2]>,
        /// Reads.
        pub active_id: &'a Buf<u32>,
        /// Reads.
        pub sums: &'a Buf<[f32; 4]>,
        /// ReadWrites.
        pub parameter: &'a Buf<[f32; 4]>,
        /// ReadWrites.
        pub moments: &'a Buf<[f32; 4]>,
        /// ReadWrites.
        pub state: &'a Buf<[f32; 4]>,
    }
    impl Kernel for Args<'_> {
        type Push = Push;
        const INFO: &'static KernelInfo = INFO;
        fn slices(&self) -> Vec<Slice> {
            vec![
                self.frame_status.slice(),
                self.adam.slice(),
                self.ranges.slice(),
                self.active_id.slice(),
                self.sums.slice(),
                self.parameter.slice(),
                self.moments.slice(),
                self.state.slice(),
            ]
        }
    }
    /// What the device needs to know.
    pub const INFO: &KernelInfo = &KernelInfo {
        name: "adam_catch_up",
        push_bytes: size_of::<Push>() as u32,
        spirv: include_bytes!("../../shaders-glsl/spv/adam_catch_up.spv"),
        local: 64,
        subgroups: true,
        floats: 0xf0,
        bindings: &[
            BindingInfo { name: "frame_status", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "adam", kind: BindingKind::Uniform, access: Access::Read },
            BindingInfo { name: "ranges", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "active_id", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "sums", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "parameter", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "moments", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "state", kind: BindingKind::Storage, access: Access::ReadWrite },
        ],
    };
}

/// decides for each Gaussian of a group whether it is kept, how hard it is pulled and where it is stored.
pub mod density_classify_static {
    use super::super::kernel::*;
    /// `Push` of the shaders.
    #[repr(C)]
    #[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
    pub struct Push {
        /// `center` of the shader.
        pub center: [f32; 4],
        /// `n` of the shader.
        pub n: u32,
        /// `first` of the shader.
        pub first: u32,
        /// `n_frames` of the shader.
        pub n_frames: u32,
        /// `weight` of the shader.
        pub weight: u32,
        /// `prune_opacity` of the shader.
        pub prune_opacity: f32,
        /// `largest` of the shader.
        pub largest: f32,
        /// `split_above` of the shader.
        pub split_above: f32,
        /// `gradient` of the shader.
        pub gradient: f32,
        /// `bucket` of the shader.
        pub bucket: u32,
    }
    const _: () = {
        assert!(size_of::<Push>() == 52);
        assert!(std::mem::offset_of!(Push, center) == 0);
        assert!(std::mem::offset_of!(Push, n) == 16);
        assert!(std::mem::offset_of!(Push, first) == 20);
        assert!(std::mem::offset_of!(Push, n_frames) == 24);
        assert!(std::mem::offset_of!(Push, weight) == 28);
        assert!(std::mem::offset_of!(Push, prune_opacity) == 32);
        assert!(std::mem::offset_of!(Push, largest) == 36);
        assert!(std::mem::offset_of!(Push, split_above) == 40);
        assert!(std::mem::offset_of!(Push, gradient) == 44);
        assert!(std::mem::offset_of!(Push, bucket) == 48);
    };
    /// The kernel's buffers.
    pub struct Args<'a> {
        /// Reads.
        pub geometry: &'a Buf<[f32; 4]>,
        /// Reads.
        pub state: &'a Buf<[f32; 4]>,
        /// Writes.
        pub flags: &'a Buf<u32>,
        /// Writes.
        pub scores: &'a Buf<u32>,
        /// Writes.
        pub identity: &'a Buf<u32>,
        /// Writes.
        pub entries: &'a Buf<u32>,
        /// Writes.
        pub codes: &'a Buf<u32>,
        /// ReadWrites.
        pub counters: &'a Buf<u32>,
    }
    impl Kernel for Args<'_> {
        type Push = Push;
        const INFO: &'static KernelInfo = INFO;
        fn slices(&self) -> Vec<Slice> {
            vec![
                self.geometry.slice(),
                self.state.slice(),
                self.flags.slice(),
                self.scores.slice(),
                self.identity.slice(),
                self.entries.slice(),
                self.codes.slice(),
                self.counters.slice(),
            ]
        }
    }
    /// What the device needs to know.
    pub const INFO: &KernelInfo = &KernelInfo {
        name: "density_classify_static",
        push_bytes: size_of::<Push>() as u32,
        spirv: include_bytes!("../../shaders-glsl/spv/density_classify_static.spv"),
        local: 128,
        subgroups: true,
        floats: 0x3,
        bindings: &[
            BindingInfo { name: "geometry", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "state", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "flags", kind: BindingKind::Storage, access: Access::Write },
            BindingInfo { name: "scores", kind: BindingKind::Storage, access: Access::Write },
            BindingInfo { name: "identity", kind: BindingKind::Storage, access: Access::Write },
            BindingInfo { name: "entries", kind: BindingKind::Storage, access: Access::Write },
            BindingInfo { name: "codes", kind: BindingKind::Storage, access: Access::Write },
            BindingInfo { name: "counters", kind: BindingKind::Storage, access: Access::ReadWrite },
        ],
    };
}

/// decides for each Gaussian of a group whether it is kept, how hard it is pulled and where it is stored.
pub mod density_classify_dynamic {
    use super::super::kernel::*;
    /// `Push` of the shaders.
    #[repr(C)]
    #[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
    pub struct Push {
        /// `center` of the shader.
        pub center: [f32; 4],
        /// `n` of the shader.
        pub n: u32,
        /// `first` of the shader.
        pub first: u32,
        /// `n_frames` of the shader.
        pub n_frames: u32,
        /// `weight` of the shader.
        pub weight: u32,
        /// `prune_opacity` of the shader.
        pub prune_opacity: f32,
        /// `largest` of the shader.
        pub largest: f32,
        /// `split_above` of the shader.
        pub split_above: f32,
        /// `gradient` of the shader.
        pub gradient: f32,
        /// `bucket` of the shader.
        pub bucket: u32,
    }
    const _: () = {
        assert!(size_of::<Push>() == 52);
        assert!(std::mem::offset_of!(Push, center) == 0);
        assert!(std::mem::offset_of!(Push, n) == 16);
        assert!(std::mem::offset_of!(Push, first) == 20);
        assert!(std::mem::offset_of!(Push, n_frames) == 24);
        assert!(std::mem::offset_of!(Push, weight) == 28);
        assert!(std::mem::offset_of!(Push, prune_opacity) == 32);
        assert!(std::mem::offset_of!(Push, largest) == 36);
        assert!(std::mem::offset_of!(Push, split_above) == 40);
        assert!(std::mem::offset_of!(Push, gradient) == 44);
        assert!(std::mem::offset_of!(Push, bucket) == 48);
    };
    /// The kernel's buffers.
    pub struct Args<'a> {
        /// Reads.
        pub geometry: &'a Buf<[f32; 4]>,
        /// Reads.
        pub state: &'a Buf<[f32; 4]>,
        /// Writes.
        pub flags: &'a Buf<u32>,
        /// Writes.
        pub scores: &'a Buf<u32>,
        /// Writes.
        pub identity: &'a Buf<u32>,
        /// Writes.
        pub entries: &'a Buf<u32>,
        /// Writes.
        pub codes: &'a Buf<u32>,
        /// ReadWrites.
        pub counters: &'a Buf<u32>,
        /// Reads.
        pub motion: &'a Buf<[f32; 4]>,
    }
    impl Kernel for Args<'_> {
        type Push = Push;
        const INFO: &'static KernelInfo = INFO;
        fn slices(&self) -> Vec<Slice> {
            vec![
                self.geometry.slice(),
                self.state.slice(),
                self.flags.slice(),
                self.scores.slice(),
                self.identity.slice(),
                self.entries.slice(),
                self.codes.slice(),
                self.counters.slice(),
                self.motion.slice(),
            ]
        }
    }
    /// What the device needs to know.
    pub const INFO: &KernelInfo = &KernelInfo {
        name: "density_classify_dynamic",
        push_bytes: size_of::<Push>() as u32,
        spirv: include_bytes!("../../shaders-glsl/spv/density_classify_dynamic.spv"),
        local: 128,
        subgroups: true,
        floats: 0x103,
        bindings: &[
            BindingInfo { name: "geometry", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "state", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "flags", kind: BindingKind::Storage, access: Access::Write },
            BindingInfo { name: "scores", kind: BindingKind::Storage, access: Access::Write },
            BindingInfo { name: "identity", kind: BindingKind::Storage, access: Access::Write },
            BindingInfo { name: "entries", kind: BindingKind::Storage, access: Access::Write },
            BindingInfo { name: "codes", kind: BindingKind::Storage, access: Access::Write },
            BindingInfo { name: "counters", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "motion", kind: BindingKind::Storage, access: Access::Read },
        ],
    };
}

/// lets the Gaussians that are pulled hardest grow, as many as the budget allows.
pub mod density_choose {
    use super::super::kernel::*;
    /// `Push` of the shaders.
    #[repr(C)]
    #[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
    pub struct Push {
        /// `n` of the shader.
        pub n: u32,
        /// `max_gaussians` of the shader.
        pub max_gaussians: u32,
        /// `growth` of the shader.
        pub growth: f32,
    }
    const _: () = {
        assert!(size_of::<Push>() == 12);
        assert!(std::mem::offset_of!(Push, n) == 0);
        assert!(std::mem::offset_of!(Push, max_gaussians) == 4);
        assert!(std::mem::offset_of!(Push, growth) == 8);
    };
    /// The kernel's buffers.
    pub struct Args<'a> {
        /// Reads.
        pub keys: &'a Buf<u32>,
        /// Reads.
        pub order: &'a Buf<u32>,
        /// Reads.
        pub counters: &'a Buf<u32>,
        /// ReadWrites.
        pub flags: &'a Buf<u32>,
        /// Writes.
        pub entries: &'a Buf<u32>,
    }
    impl Kernel for Args<'_> {
        type Push = Push;
        const INFO: &'static KernelInfo = INFO;
        fn slices(&self) -> Vec<Slice> {
            vec![self.keys.slice(), self.order.slice(), self.counters.slice(), self.flags.slice(), self.entries.slice()]
        }
    }
    /// What the device needs to know.
    pub const INFO: &KernelInfo = &KernelInfo {
        name: "density_choose",
        push_bytes: size_of::<Push>() as u32,
        spirv: include_bytes!("../../shaders-glsl/spv/density_choose.spv"),
        local: 64,
        subgroups: false,
        floats: 0x0,
        bindings: &[
            BindingInfo { name: "keys", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "order", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "counters", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "flags", kind: BindingKind::Storage, access: Access::ReadWrite },
            BindingInfo { name: "entries", kind: BindingKind::Storage, access: Access::Write },
        ],
    };
}

/// lists where each new Gaussian comes from: who is kept, the copy of a clone, the halves of a split.
pub mod density_list {
    use super::super::kernel::*;
    /// `Push` of the shaders.
    #[repr(C)]
    #[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
    pub struct Push {
        /// `n` of the shader.
        pub n: u32,
    }
    const _: () = {
        assert!(size_of::<Push>() == 4);
        assert!(std::mem::offset_of!(Push, n) == 0);
    };
    /// The kernel's buffers.
    pub struct Args<'a> {
        /// Reads.
        pub flags: &'a Buf<u32>,
        /// Reads.
        pub offsets: &'a Buf<u32>,
        /// Reads.
        pub codes: &'a Buf<u32>,
        /// Writes.
        pub sources: &'a Buf<u32>,
        /// Writes.
        pub source_codes: &'a Buf<u32>,
        /// ReadWrites.
        pub counters: &'a Buf<u32>,
    }
    impl Kernel for Args<'_> {
        type Push = Push;
        const INFO: &'static KernelInfo = INFO;
        fn slices(&self) -> Vec<Slice> {
            vec![
                self.flags.slice(),
                self.offsets.slice(),
                self.codes.slice(),
                self.sources.slice(),
                self.source_codes.slice(),
                self.counters.slice(),
            ]
        }
    }
    /// What the device needs to know.
    pub const INFO: &KernelInfo = &KernelInfo {
        name: "density_list",
        push_bytes: size_of::<Push>() as u32,
        spirv: include_bytes!("../../shaders-glsl/spv/density_list.spv"),
        local: 128,
        subgroups: true,
        floats: 0x0,
        bindings: &[
            BindingInfo { name: "flags", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "offsets", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "codes", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "sources", kind: BindingKind::Storage, access: Access::Write },
            BindingInfo { name: "source_codes", kind: BindingKind::Storage, access: Access::Write },
            BindingInfo { name: "counters", kind: BindingKind::Storage, access: Access::ReadWrite },
        ],
    };
}

/// draws for every dead and every new Gaussian a living one whose place it takes, with odds like its opacity.
pub mod density_sample {
    use super::super::kernel::*;
    /// `Push` of the shaders.
    #[repr(C)]
    #[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
    pub struct Push {
        /// `n` of the shader.
        pub n: u32,
        /// `n_new` of the shader.
        pub n_new: u32,
        /// `key` of the shader.
        pub key: u32,
    }
    const _: () = {
        assert!(size_of::<Push>() == 12);
        assert!(std::mem::offset_of!(Push, n) == 0);
        assert!(std::mem::offset_of!(Push, n_new) == 4);
        assert!(std::mem::offset_of!(Push, key) == 8);
    };
    /// The kernel's buffers.
    pub struct Args<'a> {
        /// Reads.
        pub flags: &'a Buf<u32>,
        /// Reads.
        pub before: &'a Buf<u32>,
        /// Reads.
        pub total: &'a Buf<u32>,
        /// Writes.
        pub targets: &'a Buf<u32>,
        /// ReadWrites.
        pub copies: &'a Buf<u32>,
    }
    impl Kernel for Args<'_> {
        type Push = Push;
        const INFO: &'static KernelInfo = INFO;
        fn slices(&self) -> Vec<Slice> {
            vec![self.flags.slice(), self.before.slice(), self.total.slice(), self.targets.slice(), self.copies.slice()]
        }
    }
    /// What the device needs to know.
    pub const INFO: &KernelInfo = &KernelInfo {
        name: "density_sample",
        push_bytes: size_of::<Push>() as u32,
        spirv: include_bytes!("../../shaders-glsl/spv/density_sample.spv"),
        local: 64,
        subgroups: true,
        floats: 0x0,
        bindings: &[
            BindingInfo { name: "flags", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "before", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "total", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "targets", kind: BindingKind::Storage, access: Access::Write },
            BindingInfo { name: "copies", kind: BindingKind::Storage, access: Access::ReadWrite },
        ],
    };
}

/// lists where each new Gaussian comes from when the dead are relocated: the living stay, the dead and the new
pub mod density_relocate {
    use super::super::kernel::*;
    /// `Push` of the shaders.
    #[repr(C)]
    #[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
    pub struct Push {
        /// `n` of the shader.
        pub n: u32,
        /// `n_new` of the shader.
        pub n_new: u32,
        /// `n_old` of the shader.
        pub n_old: u32,
    }
    const _: () = {
        assert!(size_of::<Push>() == 12);
        assert!(std::mem::offset_of!(Push, n) == 0);
        assert!(std::mem::offset_of!(Push, n_new) == 4);
        assert!(std::mem::offset_of!(Push, n_old) == 8);
    };
    /// The kernel's buffers.
    pub struct Args<'a> {
        /// Reads.
        pub flags: &'a Buf<u32>,
        /// Reads.
        pub offsets: &'a Buf<u32>,
        /// Reads.
        pub codes: &'a Buf<u32>,
        /// Reads.
        pub targets: &'a Buf<u32>,
        /// Reads.
        pub copies: &'a Buf<u32>,
        /// Writes.
        pub sources: &'a Buf<u32>,
        /// Writes.
        pub source_codes: &'a Buf<u32>,
        /// ReadWrites.
        pub counters: &'a Buf<u32>,
    }
    impl Kernel for Args<'_> {
        type Push = Push;
        const INFO: &'static KernelInfo = INFO;
        fn slices(&self) -> Vec<Slice> {
            vec![
                self.flags.slice(),
                self.offsets.slice(),
                self.codes.slice(),
                self.targets.slice(),
                self.copies.slice(),
                self.sources.slice(),
                self.source_codes.slice(),
                self.counters.slice(),
            ]
        }
    }
    /// What the device needs to know.
    pub const INFO: &KernelInfo = &KernelInfo {
        name: "density_relocate",
        push_bytes: size_of::<Push>() as u32,
        spirv: include_bytes!("../../shaders-glsl/spv/density_relocate.spv"),
        local: 128,
        subgroups: false,
        floats: 0x0,
        bindings: &[
            BindingInfo { name: "flags", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "offsets", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "codes", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "targets", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "copies", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "sources", kind: BindingKind::Storage, access: Access::Write },
            BindingInfo { name: "source_codes", kind: BindingKind::Storage, access: Access::Write },
            BindingInfo { name: "counters", kind: BindingKind::Storage, access: Access::ReadWrite },
        ],
    };
}

/// carries numbers of an old group of Gaussians to a new one, in the order of the list of sources.
pub mod density_gather {
    use super::super::kernel::*;
    /// `Push` of the shaders.
    #[repr(C)]
    #[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
    pub struct Push {
        /// `as_it_was` of the shader.
        pub as_it_was: [f32; 4],
        /// `child` of the shader.
        pub child: [f32; 4],
        /// `size` of the shader.
        pub size: u32,
        /// `planes` of the shader.
        pub planes: u32,
        /// `n` of the shader.
        pub n: u32,
        /// `start` of the shader.
        pub start: u32,
        /// `old_first` of the shader.
        pub old_first: u32,
        /// `old_n` of the shader.
        pub old_n: u32,
    }
    const _: () = {
        assert!(size_of::<Push>() == 56);
        assert!(std::mem::offset_of!(Push, as_it_was) == 0);
        assert!(std::mem::offset_of!(Push, child) == 16);
        assert!(std::mem::offset_of!(Push, size) == 32);
        assert!(std::mem::offset_of!(Push, planes) == 36);
        assert!(std::mem::offset_of!(Push, n) == 40);
        assert!(std::mem::offset_of!(Push, start) == 44);
        assert!(std::mem::offset_of!(Push, old_first) == 48);
        assert!(std::mem::offset_of!(Push, old_n) == 52);
    };
    /// The kernel's buffers.
    pub struct Args<'a> {
        /// Reads.
        pub sources: &'a Buf<u32>,
        /// Reads.
        pub old: &'a Buf<[f32; 4]>,
        /// Writes.
        pub gathered: &'a Buf<[f32; 4]>,
    }
    impl Kernel for Args<'_> {
        type Push = Push;
        const INFO: &'static KernelInfo = INFO;
        fn slices(&self) -> Vec<Slice> {
            vec![self.sources.slice(), self.old.slice(), self.gathered.slice()]
        }
    }
    /// What the device needs to know.
    pub const INFO: &KernelInfo = &KernelInfo {
        name: "density_gather",
        push_bytes: size_of::<Push>() as u32,
        spirv: include_bytes!("../../shaders-glsl/spv/density_gather.spv"),
        local: 64,
        subgroups: false,
        floats: 0x6,
        bindings: &[
            BindingInfo { name: "sources", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "old", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "gathered", kind: BindingKind::Storage, access: Access::Write },
        ],
    };
}

/// writes the geometry of a new group of Gaussians: those that stay, clones, halves of splits, and copies that
pub mod density_children {
    use super::super::kernel::*;
    /// `Push` of the shaders.
    #[repr(C)]
    #[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
    pub struct Push {
        /// `n` of the shader.
        pub n: u32,
        /// `start` of the shader.
        pub start: u32,
        /// `old_first` of the shader.
        pub old_first: u32,
        /// `old_n` of the shader.
        pub old_n: u32,
        /// `key` of the shader.
        pub key: u32,
        /// `ceiling` of the shader.
        pub ceiling: f32,
    }
    const _: () = {
        assert!(size_of::<Push>() == 24);
        assert!(std::mem::offset_of!(Push, n) == 0);
        assert!(std::mem::offset_of!(Push, start) == 4);
        assert!(std::mem::offset_of!(Push, old_first) == 8);
        assert!(std::mem::offset_of!(Push, old_n) == 12);
        assert!(std::mem::offset_of!(Push, key) == 16);
        assert!(std::mem::offset_of!(Push, ceiling) == 20);
    };
    /// The kernel's buffers.
    pub struct Args<'a> {
        /// Reads.
        pub sources: &'a Buf<u32>,
        /// Reads.
        pub copies: &'a Buf<u32>,
        /// Reads.
        pub old: &'a Buf<[f32; 4]>,
        /// Writes.
        pub geometry: &'a Buf<[f32; 4]>,
    }
    impl Kernel for Args<'_> {
        type Push = Push;
        const INFO: &'static KernelInfo = INFO;
        fn slices(&self) -> Vec<Slice> {
            vec![self.sources.slice(), self.copies.slice(), self.old.slice(), self.geometry.slice()]
        }
    }
    /// What the device needs to know.
    pub const INFO: &KernelInfo = &KernelInfo {
        name: "density_children",
        push_bytes: size_of::<Push>() as u32,
        spirv: include_bytes!("../../shaders-glsl/spv/density_children.spv"),
        local: 64,
        subgroups: false,
        floats: 0xc,
        bindings: &[
            BindingInfo { name: "sources", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "copies", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "old", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "geometry", kind: BindingKind::Storage, access: Access::Write },
        ],
    };
}

/// lets faint Gaussians wander: adds noise of their own shape to their positions after each step.
pub mod mcmc_noise {
    use super::super::kernel::*;
    /// `Push` of the shaders.
    #[repr(C)]
    #[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
    pub struct Push {
        /// `n` of the shader.
        pub n: u32,
        /// `first` of the shader.
        pub first: u32,
        /// `key` of the shader.
        pub key: u32,
        /// `rate` of the shader.
        pub rate: f32,
    }
    const _: () = {
        assert!(size_of::<Push>() == 16);
        assert!(std::mem::offset_of!(Push, n) == 0);
        assert!(std::mem::offset_of!(Push, first) == 4);
        assert!(std::mem::offset_of!(Push, key) == 8);
        assert!(std::mem::offset_of!(Push, rate) == 12);
    };
    /// The kernel's buffers.
    pub struct Args<'a> {
        /// Reads.
        pub frame_status: &'a Buf<super::Status>,
        /// ReadWrites.
        pub geometry: &'a Buf<[f32; 4]>,
    }
    impl Kernel for Args<'_> {
        type Push = Push;
        const INFO: &'static KernelInfo = INFO;
        fn slices(&self) -> Vec<Slice> {
            vec![self.frame_status.slice(), self.geometry.slice()]
        }
    }
    /// What the device needs to know.
    pub const INFO: &KernelInfo = &KernelInfo {
        name: "mcmc_noise",
        push_bytes: size_of::<Push>() as u32,
        spirv: include_bytes!("../../shaders-glsl/spv/mcmc_noise.spv"),
        local: 64,
        subgroups: false,
        floats: 0x2,
        bindings: &[
            BindingInfo { name: "frame_status", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "geometry", kind: BindingKind::Storage, access: Access::ReadWrite },
        ],
    };
}

/// measures the bandwidth of streaming copies.
pub mod probe_copy {
    use super::super::kernel::*;
    /// `Push` of the shaders.
    #[repr(C)]
    #[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
    pub struct Push {
        /// `n` of the shader.
        pub n: u32,
    }
    const _: () = {
        assert!(size_of::<Push>() == 4);
        assert!(std::mem::offset_of!(Push, n) == 0);
    };
    /// The kernel's buffers.
    pub struct Args<'a> {
        /// Reads.
        pub source: &'a Buf<[f32; 4]>,
        /// Writes.
        pub target: &'a Buf<[f32; 4]>,
    }
    impl Kernel for Args<'_> {
        type Push = Push;
        const INFO: &'static KernelInfo = INFO;
        fn slices(&self) -> Vec<Slice> {
            vec![self.source.slice(), self.target.slice()]
        }
    }
    /// What the device needs to know.
    pub const INFO: &KernelInfo = &KernelInfo {
        name: "probe_copy",
        push_bytes: size_of::<Push>() as u32,
        spirv: include_bytes!("../../shaders-glsl/spv/probe_copy.spv"),
        local: 64,
        subgroups: false,
        floats: 0x3,
        bindings: &[
            BindingInfo { name: "source", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "target", kind: BindingKind::Storage, access: Access::Write },
        ],
    };
}

/// measures the rate of fused multiply-adds.
pub mod probe_fma {
    use super::super::kernel::*;
    /// `Push` of the shaders.
    #[repr(C)]
    #[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
    pub struct Push {
        /// `rounds` of the shader.
        pub rounds: u32,
    }
    const _: () = {
        assert!(size_of::<Push>() == 4);
        assert!(std::mem::offset_of!(Push, rounds) == 0);
    };
    /// The kernel's buffers.
    pub struct Args<'a> {
        /// Reads.
        pub factors: &'a Buf<[f32; 4]>,
        /// Writes.
        pub sums: &'a Buf<f32>,
    }
    impl Kernel for Args<'_> {
        type Push = Push;
        const INFO: &'static KernelInfo = INFO;
        fn slices(&self) -> Vec<Slice> {
            vec![self.factors.slice(), self.sums.slice()]
        }
    }
    /// What the device needs to know.
    pub const INFO: &KernelInfo = &KernelInfo {
        name: "probe_fma",
        push_bytes: size_of::<Push>() as u32,
        spirv: include_bytes!("../../shaders-glsl/spv/probe_fma.spv"),
        local: 64,
        subgroups: true,
        floats: 0x3,
        bindings: &[
            BindingInfo { name: "factors", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "sums", kind: BindingKind::Storage, access: Access::Write },
        ],
    };
}

/// measures the rate of exp2.
pub mod probe_exp2 {
    use super::super::kernel::*;
    /// `Push` of the shaders.
    #[repr(C)]
    #[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
    pub struct Push {
        /// `rounds` of the shader.
        pub rounds: u32,
    }
    const _: () = {
        assert!(size_of::<Push>() == 4);
        assert!(std::mem::offset_of!(Push, rounds) == 0);
    };
    /// The kernel's buffers.
    pub struct Args<'a> {
        /// Reads.
        pub starts: &'a Buf<[f32; 4]>,
        /// Writes.
        pub means: &'a Buf<f32>,
    }
    impl Kernel for Args<'_> {
        type Push = Push;
        const INFO: &'static KernelInfo = INFO;
        fn slices(&self) -> Vec<Slice> {
            vec![self.starts.slice(), self.means.slice()]
        }
    }
    /// What the device needs to know.
    pub const INFO: &KernelInfo = &KernelInfo {
        name: "probe_exp2",
        push_bytes: size_of::<Push>() as u32,
        spirv: include_bytes!("../../shaders-glsl/spv/probe_exp2.spv"),
        local: 64,
        subgroups: true,
        floats: 0x3,
        bindings: &[
            BindingInfo { name: "starts", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "means", kind: BindingKind::Storage, access: Access::Write },
        ],
    };
}

/// measures the rate of shuffles within a subgroup.
pub mod probe_shuffle {
    use super::super::kernel::*;
    /// `Push` of the shaders.
    #[repr(C)]
    #[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
    pub struct Push {
        /// `rounds` of the shader.
        pub rounds: u32,
    }
    const _: () = {
        assert!(size_of::<Push>() == 4);
        assert!(std::mem::offset_of!(Push, rounds) == 0);
    };
    /// The kernel's buffers.
    pub struct Args<'a> {
        /// Reads.
        pub starts: &'a Buf<[u32; 4]>,
        /// Writes.
        pub turned: &'a Buf<[u32; 4]>,
    }
    impl Kernel for Args<'_> {
        type Push = Push;
        const INFO: &'static KernelInfo = INFO;
        fn slices(&self) -> Vec<Slice> {
            vec![self.starts.slice(), self.turned.slice()]
        }
    }
    /// What the device needs to know.
    pub const INFO: &KernelInfo = &KernelInfo {
        name: "probe_shuffle",
        push_bytes: size_of::<Push>() as u32,
        spirv: include_bytes!("../../shaders-glsl/spv/probe_shuffle.spv"),
        local: 64,
        subgroups: true,
        floats: 0x0,
        bindings: &[
            BindingInfo { name: "starts", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "turned", kind: BindingKind::Storage, access: Access::Write },
        ],
    };
}

/// measures the rate at which scattered rows of 64 bytes come in, each lane its own, as splats do.
pub mod probe_gather {
    use super::super::kernel::*;
    /// `Push` of the shaders.
    #[repr(C)]
    #[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
    pub struct Push {
        /// `n` of the shader.
        pub n: u32,
        /// `mask` of the shader.
        pub mask: u32,
    }
    const _: () = {
        assert!(size_of::<Push>() == 8);
        assert!(std::mem::offset_of!(Push, n) == 0);
        assert!(std::mem::offset_of!(Push, mask) == 4);
    };
    /// The kernel's buffers.
    pub struct Args<'a> {
        /// Reads.
        pub rows: &'a Buf<[f32; 4]>,
        /// Writes.
        pub sums: &'a Buf<[f32; 4]>,
    }
    impl Kernel for Args<'_> {
        type Push = Push;
        const INFO: &'static KernelInfo = INFO;
        fn slices(&self) -> Vec<Slice> {
            vec![self.rows.slice(), self.sums.slice()]
        }
    }
    /// What the device needs to know.
    pub const INFO: &KernelInfo = &KernelInfo {
        name: "probe_gather",
        push_bytes: size_of::<Push>() as u32,
        spirv: include_bytes!("../../shaders-glsl/spv/probe_gather.spv"),
        local: 64,
        subgroups: false,
        floats: 0x3,
        bindings: &[
            BindingInfo { name: "rows", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "sums", kind: BindingKind::Storage, access: Access::Write },
        ],
    };
}

/// measures the rate of atomic additions to scattered rows of 64 bytes, 16 neighbours to a row.
pub mod probe_atomic {
    use super::super::kernel::*;
    /// `Push` of the shaders.
    #[repr(C)]
    #[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
    pub struct Push {
        /// `n` of the shader.
        pub n: u32,
        /// `mask` of the shader.
        pub mask: u32,
    }
    const _: () = {
        assert!(size_of::<Push>() == 8);
        assert!(std::mem::offset_of!(Push, n) == 0);
        assert!(std::mem::offset_of!(Push, mask) == 4);
    };
    /// The kernel's buffers.
    pub struct Args<'a> {
        /// Reads.
        pub term: &'a Buf<u32>,
        /// ReadWrites.
        pub words: &'a Buf<u32>,
    }
    impl Kernel for Args<'_> {
        type Push = Push;
        const INFO: &'static KernelInfo = INFO;
        fn slices(&self) -> Vec<Slice> {
            vec![self.term.slice(), self.words.slice()]
        }
    }
    /// What the device needs to know.
    pub const INFO: &KernelInfo = &KernelInfo {
        name: "probe_atomic",
        push_bytes: size_of::<Push>() as u32,
        spirv: include_bytes!("../../shaders-glsl/spv/probe_atomic.spv"),
        local: 64,
        subgroups: false,
        floats: 0x0,
        bindings: &[
            BindingInfo { name: "term", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "words", kind: BindingKind::Storage, access: Access::ReadWrite },
        ],
    };
}

/// measures the rate of atomic additions to scattered rows of 64 bytes, 16 neighbours to a row.
pub mod probe_atomic_float {
    use super::super::kernel::*;
    /// `Push` of the shaders.
    #[repr(C)]
    #[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
    pub struct Push {
        /// `n` of the shader.
        pub n: u32,
        /// `mask` of the shader.
        pub mask: u32,
    }
    const _: () = {
        assert!(size_of::<Push>() == 8);
        assert!(std::mem::offset_of!(Push, n) == 0);
        assert!(std::mem::offset_of!(Push, mask) == 4);
    };
    /// The kernel's buffers.
    pub struct Args<'a> {
        /// Reads.
        pub term: &'a Buf<f32>,
        /// ReadWrites.
        pub words: &'a Buf<f32>,
    }
    impl Kernel for Args<'_> {
        type Push = Push;
        const INFO: &'static KernelInfo = INFO;
        fn slices(&self) -> Vec<Slice> {
            vec![self.term.slice(), self.words.slice()]
        }
    }
    /// What the device needs to know.
    pub const INFO: &KernelInfo = &KernelInfo {
        name: "probe_atomic_float",
        push_bytes: size_of::<Push>() as u32,
        spirv: include_bytes!("../../shaders-glsl/spv/probe_atomic_float.spv"),
        local: 64,
        subgroups: false,
        floats: 0x3,
        bindings: &[
            BindingInfo { name: "term", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "words", kind: BindingKind::Storage, access: Access::ReadWrite },
        ],
    };
}

/// measures what a dispatch costs that does next to nothing and waits for the one before.
pub mod probe_dispatch {
    use super::super::kernel::*;
    /// This kernel takes no push constants.
    pub type Push = ();
    /// The kernel's buffers.
    pub struct Args<'a> {
        /// Reads.
        pub steps: &'a Buf<u32>,
        /// ReadWrites.
        pub count: &'a Buf<u32>,
    }
    impl Kernel for Args<'_> {
        type Push = Push;
        const INFO: &'static KernelInfo = INFO;
        fn slices(&self) -> Vec<Slice> {
            vec![self.steps.slice(), self.count.slice()]
        }
    }
    /// What the device needs to know.
    pub const INFO: &KernelInfo = &KernelInfo {
        name: "probe_dispatch",
        push_bytes: size_of::<Push>() as u32,
        spirv: include_bytes!("../../shaders-glsl/spv/probe_dispatch.spv"),
        local: 64,
        subgroups: false,
        floats: 0x0,
        bindings: &[
            BindingInfo { name: "steps", kind: BindingKind::Storage, access: Access::Read },
            BindingInfo { name: "count", kind: BindingKind::Storage, access: Access::ReadWrite },
        ],
    };
}

/// Every kernel, in the order of the table.
pub const ALL: &[&super::KernelInfo] = &[
    bound_static::INFO,
    bound_dynamic::INFO,
    cull_static::INFO,
    cull_dynamic::INFO,
    compact::INFO,
    prepare_active::INFO,
    project_static_sh0::INFO,
    project_static_sh1::INFO,
    project_static_sh2::INFO,
    project_static_sh3::INFO,
    project_dynamic_sh0::INFO,
    project_dynamic_sh1::INFO,
    project_dynamic_sh2::INFO,
    project_dynamic_sh3::INFO,
    project_static_sh1_half::INFO,
    project_static_sh2_half::INFO,
    project_static_sh3_half::INFO,
    project_dynamic_sh1_half::INFO,
    project_dynamic_sh2_half::INFO,
    project_dynamic_sh3_half::INFO,
    sh_half::INFO,
    scan_reduce::INFO,
    scan_spine::INFO,
    scan_downsweep::INFO,
    sort_count::INFO,
    sort_scatter::INFO,
    sort_scatter_w32::INFO,
    gather::INFO,
    prepare_intersections::INFO,
    emit::INFO,
    emit_slots::INFO,
    tile_ranges::INFO,
    tile_buckets::INFO,
    tile_order::INFO,
    blend_fwd_p4::INFO,
    blend_fwd_p8::INFO,
    blend_fwd_color_p4::INFO,
    blend_fwd_color_p8::INFO,
    blend_fwd_train_p4::INFO,
    blend_fwd_train_p8::INFO,
    blend_fwd_train_color_p4::INFO,
    blend_fwd_train_color_p8::INFO,
    blend_bwd_p4::INFO,
    blend_bwd_p8::INFO,
    blend_bwd_color_p4::INFO,
    blend_bwd_color_p8::INFO,
    blend_bwd_float_p4::INFO,
    blend_bwd_float_p8::INFO,
    blend_bwd_float_color_p4::INFO,
    blend_bwd_float_color_p8::INFO,
    blend_bwd_fixed_p4::INFO,
    blend_bwd_fixed_p8::INFO,
    blend_bwd_fixed_color_p4::INFO,
    blend_bwd_fixed_color_p8::INFO,
    blend_bwd_swap_p4::INFO,
    blend_bwd_swap_p8::INFO,
    blend_bwd_swap_color_p4::INFO,
    blend_bwd_swap_color_p8::INFO,
    fixed_sums::INFO,
    project_bwd_static_sh0::INFO,
    project_bwd_static_sh1::INFO,
    project_bwd_static_sh2::INFO,
    project_bwd_static_sh3::INFO,
    project_bwd_dynamic_sh0::INFO,
    project_bwd_dynamic_sh1::INFO,
    project_bwd_dynamic_sh2::INFO,
    project_bwd_dynamic_sh3::INFO,
    project_bwd_adam_static_sh0::INFO,
    project_bwd_adam_static_sh1::INFO,
    project_bwd_adam_static_sh2::INFO,
    project_bwd_adam_static_sh3::INFO,
    project_bwd_adam_dynamic_sh0::INFO,
    project_bwd_adam_dynamic_sh1::INFO,
    project_bwd_adam_dynamic_sh2::INFO,
    project_bwd_adam_dynamic_sh3::INFO,
    fisher_static_sh0::INFO,
    fisher_static_sh1::INFO,
    fisher_static_sh2::INFO,
    fisher_static_sh3::INFO,
    fisher_dynamic_sh0::INFO,
    fisher_dynamic_sh1::INFO,
    fisher_dynamic_sh2::INFO,
    fisher_dynamic_sh3::INFO,
    camera_sum::INFO,
    camera_total::INFO,
    background_sum::INFO,
    ssim_rows::INFO,
    ssim_rows_s2::INFO,
    ssim_columns::INFO,
    ssim_columns_s2::INFO,
    ssim_bwd_rows::INFO,
    ssim_bwd_rows_s2::INFO,
    ssim_bwd_columns::INFO,
    ssim_bwd_columns_s2::INFO,
    l1::INFO,
    loss_sum::INFO,
    prior_loss::INFO,
    clock_apply::INFO,
    clock_step::INFO,
    lpips_input::INFO,
    lpips_conv::INFO,
    lpips_pool::INFO,
    lpips_tap::INFO,
    lpips_tap_bwd::INFO,
    lpips_sum::INFO,
    lpips_conv_bwd::INFO,
    lpips_pool_bwd::INFO,
    lpips_input_bwd::INFO,
    bilateral_slice::INFO,
    bilateral_slice_bwd::INFO,
    bilateral_bwd::INFO,
    bilateral_sum::INFO,
    bilateral_adam::INFO,
    bilateral_gauge::INFO,
    adam_idle::INFO,
    adam_catch_up::INFO,
    density_classify_static::INFO,
    density_classify_dynamic::INFO,
    density_choose::INFO,
    density_list::INFO,
    density_sample::INFO,
    density_relocate::INFO,
    density_gather::INFO,
    density_children::INFO,
    mcmc_noise::INFO,
    probe_copy::INFO,
    probe_fma::INFO,
    probe_exp2::INFO,
    probe_shuffle::INFO,
    probe_gather::INFO,
    probe_atomic::INFO,
    probe_atomic_float::INFO,
    probe_dispatch::INFO,
];
