//! A camera at one frame in f64 on the host.

use crate::scene::{Intrinsics, Pose, View};
use glam::{DVec2, DVec3};

#[derive(Clone, Copy, Debug)]
pub(crate) struct Pinhole {
    intrinsics: Intrinsics,
    pose: Pose,
}

impl Pinhole {
    pub fn new(view: &View) -> Self {
        Pinhole { intrinsics: view.intrinsics, pose: view.pose }
    }

    /// Place in the image, pixels, and depth; `None` behind the camera.
    pub fn project(&self, world: DVec3) -> Option<(DVec2, f64)> {
        let at = self.pose.to_camera(world);
        (at.z > 1e-9).then(|| (self.intrinsics.project(at), at.z))
    }

    /// The place in the image and its derivative by the world position, for x and y; `None` behind the camera.
    pub fn linearised(&self, world: DVec3) -> Option<(DVec2, [DVec3; 2])> {
        let (place, z) = self.project(world)?;
        let focal = self.intrinsics.focal();
        let rotation = self.pose.rotation;
        let slope = (place - self.intrinsics.principal()) / (z * focal);
        // Row k of J R (SPEC 3).
        let by = |k: usize| (rotation.row(k) / z - rotation.row(2) * slope[k]) * focal[k];
        Some((place, [by(0), by(1)]))
    }

    /// True if the ball of a radius around a point reaches into the image, by its outline's size in the middle.
    pub fn holds(&self, world: DVec3, radius: f64) -> bool {
        self.project(world).is_some_and(|(at, depth)| {
            let reach = self.intrinsics.focal() * radius / depth;
            at.cmpge(-reach).all() && at.cmplt(self.intrinsics.size() + reach).all()
        })
    }

    /// Index of the pixel at a place of the image, row by row.
    pub fn pixel(&self, place: DVec2) -> Option<usize> {
        self.intrinsics.holds(place).then(|| place.y as usize * self.intrinsics.width as usize + place.x as usize)
    }
}
