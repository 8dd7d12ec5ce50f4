//! The forward stages one by one, with everything they leave on the device read back.

use super::device::{Watched, gpu};
use ivv::Constants;
use ivv::internals::gpu::generated::{Status, ViewParams};
use ivv::internals::gpu::{Buf, Recording};
use ivv::internals::scene::{Splats, View};
use ivv::internals::stage::{
    Blend, Cull, Outputs, Projected, Purpose, SceneBuffers, Strip, Tiles, ViewBuffers, Zeros, view_params,
};

const INTERSECTIONS: u32 = 1 << 20;

/// A scene, a view and the stages' buffers on the device.
pub struct Fixture {
    pub scene: SceneBuffers,
    pub cull: Cull,
    pub projected: Projected,
    view: Buf<ViewParams>,
    status: Buf<Status>,
    /// Last, so that the buffers are freed before another test gets the device.
    pub gpu: Watched,
}

pub struct Active {
    pub status: Status,
    pub ids: Vec<u32>,
    pub ranges: Vec<[u32; 2]>,
    /// Four vec4 each, see `include/splat.glsl`.
    pub splats: Vec<[[f32; 4]; 4]>,
    pub depth_keys: Vec<u32>,
    pub tile_counts: Vec<u32>,
}

pub struct Lists {
    pub status: Status,
    pub entries: Vec<u32>,
    pub ranges: Vec<[u32; 2]>,
    pub order: Vec<u32>,
}

impl Fixture {
    pub fn new(splats: &Splats, view: &View) -> Fixture {
        let gpu = gpu();
        let scene = SceneBuffers::upload(&gpu, splats, &Constants::default(), Purpose::Picture).unwrap();
        let capacity = splats.len().max(1) as u32;
        Fixture::with(gpu, scene, view, capacity)
    }

    /// Room for `capacity` active Gaussians.
    pub fn with(gpu: Watched, scene: SceneBuffers, view: &View, capacity: u32) -> Fixture {
        let params = view_params(view, &Constants::default(), scene.origin, Strip::whole(view));
        Fixture {
            cull: Cull::new(&gpu, &scene, capacity, false).unwrap(),
            projected: Projected::new(&gpu, capacity).unwrap(),
            view: gpu.upload("view", &[params]).unwrap(),
            status: gpu.upload("status", &[Status::default()]).unwrap(),
            scene,
            gpu,
        }
    }

    /// Culls alone; gives the status and the first `n_active` ids.
    pub fn cull(&self) -> (Status, Vec<u32>) {
        let mut rec = Recording::new();
        rec.fill(self.status.slice(), 0);
        self.cull.record(&mut rec, &self.scene, &self.view, &self.status);
        self.gpu.run(&rec).unwrap();
        let status = self.gpu.read(&self.status).unwrap()[0];
        let used = self.gpu.read(&self.cull.n_active).unwrap()[0];
        let mut ids = self.gpu.read(&self.cull.active_id).unwrap();
        ids.truncate(used as usize);
        (status, ids)
    }

    pub fn project(&self) -> Active {
        let mut rec = Recording::new();
        rec.fill(self.status.slice(), 0);
        self.cull.record(&mut rec, &self.scene, &self.view, &self.status);
        self.projected.record(&mut rec, &self.scene, &self.cull, &self.view, &self.status);
        self.gpu.run(&rec).unwrap();
        self.active()
    }

    fn active(&self) -> Active {
        let (gpu, p) = (&self.gpu, &self.projected);
        let n = gpu.read(&self.cull.n_active).unwrap()[0] as usize;
        let words = |buffer: &Buf<u32>| {
            let mut items = gpu.read(buffer).unwrap();
            items.truncate(n);
            items
        };
        let planes = gpu.read(&p.splats).unwrap();
        Active {
            status: gpu.read(&self.status).unwrap()[0],
            ids: words(&self.cull.active_id),
            ranges: gpu.read(&self.cull.ranges).unwrap(),
            splats: planes.as_chunks::<4>().0[..n].to_vec(),
            depth_keys: words(&p.depth_keys),
            tile_counts: words(&p.tile_counts),
        }
    }

    fn eye(&self) -> ViewBuffers<'_> {
        ViewBuffers { view: &self.view, status: &self.status, projected: &self.projected }
    }

    pub fn bin(&self, view: &View) -> (Active, Lists) {
        let (tiles_x, tiles_y) = Strip::whole(view).tiles(view);
        let n_tiles = tiles_x * tiles_y;
        let active = self.project();
        let room = [active.ids.len().max(1) as u32, INTERSECTIONS, n_tiles];
        let mut zeros = Zeros::new(&self.gpu, &[Tiles::n_zeros(room)]).unwrap();
        let tiles = Tiles::new(&self.gpu, room, false, &mut zeros).unwrap();
        let mut rec = Recording::new();
        zeros.record(&mut rec, 0);
        let order = tiles.record_order(&mut rec, &self.cull, &self.projected);
        let lists = tiles.record(&mut rec, &self.cull, self.eye(), &order, n_tiles, u32::MAX);
        self.gpu.run(&rec).unwrap();
        let status: Status = self.gpu.read(&self.status).unwrap()[0];
        let mut entries = self.gpu.read(&lists.splat_ids).unwrap();
        entries.truncate(status.n_intersections as usize);
        let (first, last) = (self.gpu.read(&tiles.tile_first).unwrap(), self.gpu.read(&tiles.tile_last).unwrap());
        let ranges = first.into_iter().zip(last).map(|(first, last)| [first, last]).collect();
        (active, Lists { status, entries, ranges, order: self.gpu.read(&tiles.tile_order).unwrap() })
    }

    /// The two images of `strip`, a row of pixels after the other, as the blend leaves them.
    pub fn blend(&self, view: &View, strip: Strip) -> (Vec<[f32; 4]>, Vec<[f32; 4]>) {
        let (tiles_x, tiles_y) = strip.tiles(view);
        let (n_tiles, n_pixels) = (tiles_x * tiles_y, (view.intrinsics.width * strip.n_rows) as usize);
        let params = view_params(view, &Constants::default(), self.scene.origin, strip);
        self.gpu.write(&self.view, &[params]).unwrap();
        let room = [self.scene.n.max(1), INTERSECTIONS, n_tiles];
        let mut zeros = Zeros::new(&self.gpu, &[Tiles::n_zeros(room), Blend::n_zeros(&self.gpu)]).unwrap();
        let tiles = Tiles::new(&self.gpu, room, false, &mut zeros).unwrap();
        let (outputs, purpose) = (Outputs::All, Purpose::Picture);
        let blend = Blend::new(&self.gpu, n_pixels, INTERSECTIONS, outputs, purpose, &mut zeros).unwrap();
        let mut rec = Recording::new();
        zeros.record(&mut rec, 0);
        rec.fill(self.status.slice(), 0);
        self.cull.record(&mut rec, &self.scene, &self.view, &self.status);
        self.projected.record(&mut rec, &self.scene, &self.cull, &self.view, &self.status);
        let order = tiles.record_order(&mut rec, &self.cull, &self.projected);
        let lists = tiles.record(&mut rec, &self.cull, self.eye(), &order, n_tiles, u32::MAX);
        blend.record(&mut rec, &tiles, &lists, self.eye(), n_tiles, 1);
        self.gpu.run(&rec).unwrap();
        assert_eq!(self.gpu.read(&self.status).unwrap()[0].failed, 0);
        let image1 = blend.image1.as_ref().unwrap();
        (self.gpu.read(&blend.image0).unwrap(), self.gpu.read(image1).unwrap())
    }

    /// The index in the host's arrays of each Gaussian of flat index `flat`.
    pub fn index_of(&self, flat: u32) -> usize {
        let mut before = 0;
        for group in &self.scene.groups {
            if flat >= group.first && flat < group.first + group.n {
                return (before + flat - group.first) as usize;
            }
            before += group.n;
        }
        panic!("flat index {flat} belongs to no Gaussian");
    }
}
