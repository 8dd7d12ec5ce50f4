//! The bodies of the room, how they move, and where rays meet them at a time.

use super::math::{rotation, sin_cos};
use super::shape::{Shape, Touch};
use super::texture::Texture;
use crate::random::Random;
use glam::{DMat3, DVec3};
use std::f64::consts::TAU;

const LAMP: DVec3 = DVec3::new(0.2, -1.2, -0.6);
/// Light that reaches every surface, and the most that the lamp adds.
const AMBIENT: f64 = 0.5;
const DIRECT: f64 = 0.68;
/// Starting points of shadow rays are lifted off their surface by this much, scene units.
const LIFT: f64 = 1e-6;

/// A rigid motion over the clip; u goes from 0 at frame 0 to 1 at frame F.
#[derive(Clone, Copy, Debug)]
pub(super) struct Motion {
    pub at: DVec3,
    pub velocity: DVec3,
    /// Added sin(2 pi u) times.
    pub sway: DVec3,
    pub axis: DVec3,
    /// Radians at u = 0.
    pub angle: f64,
    pub spin: f64,
}

impl Motion {
    pub fn rest(at: DVec3) -> Self {
        Motion { at, velocity: DVec3::ZERO, sway: DVec3::ZERO, axis: DVec3::Y, angle: 0.0, spin: 0.0 }
    }

    /// (body to world rotation, position) at u.
    pub fn pose(&self, u: f64) -> (DMat3, DVec3) {
        let (swing, _) = sin_cos(TAU * u);
        (rotation(self.axis, self.angle + self.spin * u), self.at + self.velocity * u + self.sway * swing)
    }
}

#[derive(Clone, Debug)]
pub(super) struct Body {
    pub name: &'static str,
    pub shape: Shape,
    /// By face of a box; other shapes wear the first.
    pub textures: [Texture; 6],
    pub texture_seed: u64,
    pub gloss: f64,
    pub motion: Motion,
    pub dynamic: bool,
    /// It exists for `from <= u < to`.
    pub life: (f64, f64),
}

pub(super) struct World {
    pub bodies: Vec<Body>,
    pub frames: u32,
    /// Frames at the beginning in which nothing moves.
    pub still: u32,
    /// Index of the body whose mouth is the sound source.
    pub head: usize,
}

impl World {
    pub fn clip_time(&self, frame: f64) -> f64 {
        frame / f64::from(self.frames)
    }

    /// The time to which movements have come at a frame's time: 0 as long as everything stands still.
    pub fn moving_time(&self, frame: f64) -> f64 {
        // Without such frames a clock that runs ahead shows what was before the clip.
        let moving = frame - f64::from(self.still);
        self.clip_time(if self.still > 0 { moving.max(0.0) } else { moving })
    }

    /// The world at a time in frames. A body has a pose at any time, also outside its life.
    pub fn at(&self, frame: f64) -> Snapshot<'_> {
        let (u, moving) = (self.clip_time(frame), self.moving_time(frame));
        let place = |body| {
            let body: &Body = body;
            let (to_world, position) = body.motion.pose(moving);
            let alive = (body.life.0..body.life.1).contains(&u);
            Placed { body, to_world, to_body: to_world.transpose(), position, bound: body.shape.bound(), alive }
        };
        Snapshot { placed: self.bodies.iter().map(place).collect() }
    }
}

pub(super) struct Placed<'a> {
    pub body: &'a Body,
    pub to_world: DMat3,
    to_body: DMat3,
    pub position: DVec3,
    bound: f64,
    alive: bool,
}

impl Placed<'_> {
    pub fn world(&self, local: DVec3) -> DVec3 {
        self.to_world * local + self.position
    }

    fn touch(&self, origin: DVec3, direction: DVec3) -> Option<Touch> {
        if !self.alive {
            return None;
        }
        let from = origin - self.position;
        // Most rays miss the bounding sphere.
        let along = from.dot(direction);
        let length = direction.length_squared();
        if (from.length_squared() - self.bound * self.bound) * length > along * along {
            return None;
        }
        self.body.shape.touch(self.to_body * from, self.to_body * direction)
    }
}

pub(super) struct Hit {
    /// Along the ray, in lengths of its direction.
    pub t: f64,
    pub body: usize,
    pub at: DVec3,
    pub normal: DVec3,
    /// The same point in the body's frame.
    pub local: DVec3,
    face: usize,
}

pub(super) struct Snapshot<'a> {
    pub placed: Vec<Placed<'a>>,
}

impl Snapshot<'_> {
    pub fn hit(&self, origin: DVec3, direction: DVec3) -> Option<Hit> {
        let touches = self.placed.iter().enumerate();
        let touches = touches.filter_map(|(i, placed)| Some((i, placed.touch(origin, direction)?)));
        let (body, touch) = touches.min_by(|a, b| a.1.t.total_cmp(&b.1.t))?;
        let placed = &self.placed[body];
        let at = origin + touch.t * direction;
        let local = placed.to_body * (at - placed.position);
        Some(Hit { t: touch.t, body, at, normal: placed.to_world * touch.normal, local, face: touch.face })
    }

    /// True if nothing stands between two points, the ends themselves aside.
    pub fn sees(&self, from: DVec3, to: DVec3) -> bool {
        self.hit(from, to - from).is_none_or(|hit| hit.t > 1.0 - LIFT)
    }

    pub fn texture(&self, hit: &Hit) -> Texture {
        self.placed[hit.body].body.textures[hit.face]
    }

    /// The colour of a hit seen along `direction`, in [0, 1]. Only bodies at rest cast and receive shadows.
    pub fn color(&self, hit: &Hit, direction: DVec3) -> DVec3 {
        let body = self.placed[hit.body].body;
        let albedo = self.texture(hit).albedo(hit.local, hit.face, body.texture_seed);
        let way = LAMP - hit.at;
        let distance = way.length_squared();
        let light = way / distance.sqrt();
        let facing = hit.normal.dot(light).max(0.0);
        let lit = facing > 0.0 && (body.dynamic || self.lit(hit.at + hit.normal * LIFT, way));
        let direct = if lit { DIRECT * facing / (1.0 + 0.04 * distance) } else { 0.0 };
        let mirrored = direction - hit.normal * (2.0 * direction.dot(hit.normal));
        let shine = (mirrored.dot(light) / direction.length()).max(0.0);
        let highlight = if lit { body.gloss * squared(squared(squared(shine))) } else { 0.0 };
        (albedo * (AMBIENT + direct) + DVec3::splat(highlight)).clamp(DVec3::ZERO, DVec3::ONE)
    }

    fn lit(&self, from: DVec3, way: DVec3) -> bool {
        let blockers = self.placed.iter().filter(|placed| !placed.body.dynamic);
        let mut blockers = blockers.filter(|placed| !matches!(placed.body.shape, Shape::Room(_)));
        !blockers.any(|placed| placed.touch(from, way).is_some_and(|touch| touch.t < 1.0))
    }
}

fn squared(x: f64) -> f64 {
    x * x
}

pub(super) struct Jitter(pub Random);

impl Jitter {
    pub fn tint(&mut self, r: f64, g: f64, b: f64) -> DVec3 {
        let shift = DVec3::from_array(std::array::from_fn(|_| self.0.uniform(-0.07, 0.07)));
        (DVec3::new(r, g, b) + shift).clamp(DVec3::splat(0.04), DVec3::splat(0.98))
    }

    /// A horizontal step of at most `most` in x and in z.
    pub fn step(&mut self, most: f64) -> DVec3 {
        DVec3::new(self.0.uniform(-most, most), 0.0, self.0.uniform(-most, most))
    }

    pub fn factor(&mut self) -> f64 {
        self.0.uniform(0.88, 1.12)
    }
}
