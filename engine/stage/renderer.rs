//! The renderer: a scene on the device, with what its frames are made in.

use super::window::Windows;
use super::{Capacity, Outputs, Purpose, SceneBuffers, Sums, Workspace, constants_on};
use crate::error::Result;
use crate::gpu::{Gpu, Slice};
use crate::scene::{Parts, Splats, View};
use crate::settings::Constants;
use std::sync::Arc;

/// Renders views of one scene.
pub struct Renderer {
    pub(super) gpu: Arc<Gpu>,
    pub(super) scene: SceneBuffers,
    pub(super) constants: Constants,
    pub(super) work: Option<Workspace>,
    pub(super) capacity: Capacity,
    /// Slices of the host's memory that are free again.
    pub(super) spare: Vec<Slice>,
    /// None where the whole scene is on the device.
    pub(super) windows: Option<Windows>,
}

impl Renderer {
    /// Uploads `splats`.
    ///
    /// # Errors
    /// [`Error::OutOfMemory`](crate::Error::OutOfMemory) naming the buffer that does not fit.
    pub fn new(gpu: Arc<Gpu>, splats: &Splats, constants: Constants) -> Result<Self> {
        if !splats.span.is_empty() {
            return Self::of_clip(gpu, Arc::new(splats.clone()), constants);
        }
        let constants = constants_on(gpu.caps().kind, constants.knobs, constants);
        Self::of_whole(gpu, splats, constants)
    }

    /// As [`Renderer::new`], for a clip that may be longer than what the device holds. Where most dynamic Gaussians live for a small
    /// part of the clip, only those that live near a view's time are uploaded, anew whenever that leaves their window: views in order
    /// of time are the fastest. Pictures are the same to the bit.
    ///
    /// # Errors
    /// As [`Renderer::new`].
    pub fn of_clip(gpu: Arc<Gpu>, splats: Arc<Splats>, constants: Constants) -> Result<Self> {
        let constants = constants_on(gpu.caps().kind, constants.knobs, constants);
        match Windows::of(&gpu, &splats, &constants)? {
            Some((windows, scene)) => Ok(Self::of_scene(gpu, scene, constants, Some(windows))),
            None => Self::of_whole(gpu, &splats, constants),
        }
    }

    /// As [`Renderer::of_clip`], for a clip that may be longer than what the host's memory holds too: its Gaussians are read as views
    /// need them. What takes a scene as a whole, as gradients do, is refused.
    #[doc(hidden)]
    pub fn of_parts(gpu: Arc<Gpu>, clip: Box<dyn Parts>, constants: Constants) -> Result<Self> {
        let constants = constants_on(gpu.caps().kind, constants.knobs, constants);
        let (windows, scene) = Windows::of_parts(&gpu, clip, &constants)?;
        Ok(Self::of_scene(gpu, scene, constants, Some(windows)))
    }

    fn of_whole(gpu: Arc<Gpu>, splats: &Splats, constants: Constants) -> Result<Self> {
        let scene = SceneBuffers::upload(&gpu, splats, &constants, Purpose::Picture)?;
        Ok(Self::of_scene(gpu, scene, constants, None))
    }

    fn of_scene(gpu: Arc<Gpu>, scene: SceneBuffers, constants: Constants, windows: Option<Windows>) -> Self {
        let mut capacity = Capacity {
            active: 1,
            intersections: 1,
            tiles: 1,
            pixels: 1,
            outputs: Outputs::Color,
            purpose: Purpose::Picture,
            // For cotangents of any size.
            sums: Sums::Slots,
            camera: false,
            idle: false,
            is_batched: false,
            depth_bits: constants.knobs.depth_bits,
        };
        capacity.active = capacity.active_of(scene.n, gpu.caps());
        capacity.intersections = capacity.active.saturating_mul(2).max(1 << 16);
        Renderer { gpu, scene, constants, work: None, capacity, spare: Vec::new(), windows }
    }

    /// The device.
    pub fn gpu(&self) -> &Arc<Gpu> {
        &self.gpu
    }

    /// Starts with room for so few intersections; the first frame that needs more grows it.
    #[doc(hidden)]
    pub fn limit_intersections(&mut self, n: u32) {
        self.capacity.intersections = n.max(1);
        self.work = None;
    }

    /// Adds gradients up in another way from now on.
    #[doc(hidden)]
    pub fn accumulate(&mut self, sums: Sums) -> Result<()> {
        sums.check(self.gpu.caps())?;
        self.capacity.sums = sums;
        Ok(())
    }

    pub(super) fn load_window(&mut self, view: &View) -> Result<()> {
        let Some(windows) = &mut self.windows else { return Ok(()) };
        if !windows.is_due(view) {
            return Ok(());
        }
        // What pictures on their way still use goes with them.
        self.work = None;
        windows.load(&self.gpu, &self.constants, &mut self.scene, view)
    }

    /// Puts all Gaussians on the device.
    pub(super) fn load_whole(&mut self) -> Result<()> {
        if let Some(windows) = &mut self.windows {
            self.scene = windows.load_whole(&self.gpu, &self.constants)?;
            (self.work, self.windows) = (None, None);
        }
        Ok(())
    }
}
