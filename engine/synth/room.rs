//! The furniture of the room and what moves in it. World: x right, y down, z away from the inward rig, metres.

use super::math::{self, Stream};
use super::options::{Options, Rig};
use super::shape::Shape;
use super::texture::Texture;
use super::world::{Body, Jitter, Motion, World};
use glam::DVec3;

/// Half sides of the room, which is centred on the origin: around an inward rig, and around one that looks outward.
const HALF: DVec3 = DVec3::new(3.2, FLOOR, 3.0);
const WIDE_HALF: DVec3 = DVec3::new(4.4, FLOOR, 4.9);
const FLOOR: f64 = 1.4;
pub(super) const HEAD: f64 = 0.17;

pub(super) fn room(options: &Options) -> World {
    let Options { seed, rig, frames, still_frames: still, .. } = *options;
    let half = if rig == Rig::Inward { HALF } else { WIDE_HALF };
    let mut builder = Builder { bodies: Vec::new(), jitter: Jitter(math::random(seed, Stream::World, 0, 0)), half };
    builder.shell();
    builder.furniture();
    builder.small_things();
    builder.moving_things();
    let head = builder.speaker();
    World { bodies: builder.bodies, frames, still, head }
}

struct Builder {
    bodies: Vec<Body>,
    jitter: Jitter,
    half: DVec3,
}

impl Builder {
    fn add(&mut self, name: &'static str, shape: Shape, texture: Texture, motion: Motion) -> &mut Body {
        let dynamic = false;
        let (textures, texture_seed, life) = ([texture; 6], self.jitter.0.bits(), (f64::NEG_INFINITY, f64::INFINITY));
        self.bodies.push(Body { name, shape, textures, texture_seed, gloss: 0.0, motion, dynamic, life });
        let last = self.bodies.len() - 1;
        &mut self.bodies[last]
    }

    fn block(&mut self, name: &'static str, half: [f64; 3], texture: Texture, at: DVec3) -> &mut Body {
        self.add(name, Shape::Block(DVec3::from_array(half)), texture, Motion::rest(at))
    }

    /// Two walls carry patterns, one clouds, one and the ceiling nothing at all.
    fn shell(&mut self) {
        let jitter = &mut self.jitter;
        let plain = Texture::Plain(jitter.tint(0.62, 0.72, 0.68));
        let clouds = Texture::Clouds(jitter.tint(0.85, 0.7, 0.5), jitter.tint(0.6, 0.42, 0.35), 0.55);
        let ceiling = Texture::Plain(DVec3::splat(0.88));
        let floor = Texture::Planks(jitter.tint(0.66, 0.46, 0.3), jitter.tint(0.45, 0.29, 0.18), 0.24);
        let bricks = Texture::Bricks(jitter.tint(0.68, 0.36, 0.28), DVec3::splat(0.75), 0.42);
        let paper = Texture::Wallpaper(jitter.tint(0.86, 0.82, 0.68), jitter.tint(0.35, 0.45, 0.6), 0.4);
        let shell = self.add("room", Shape::Room(self.half), plain, Motion::rest(DVec3::ZERO));
        shell.textures = [plain, clouds, ceiling, floor, bricks, paper];
    }

    fn furniture(&mut self) {
        let shift = self.jitter.step(0.08);
        let wood = Texture::Planks(self.jitter.tint(0.72, 0.52, 0.3), self.jitter.tint(0.55, 0.36, 0.2), 0.16);
        let table = DVec3::new(-0.1, FLOOR - 0.72, 0.9) + shift;
        self.block("table top", [0.72, 0.035, 0.45], wood, table);
        let leg_color = Texture::Plain(DVec3::new(0.3, 0.2, 0.13));
        for (x, z) in [(-0.64, -0.37), (0.64, -0.37), (-0.64, 0.37), (0.64, 0.37)] {
            let height = 0.72 - 0.035;
            let at = DVec3::new(table.x + x, FLOOR - height / 2.0, table.z + z);
            self.block("table leg", [0.04, height / 2.0, 0.04], leg_color, at);
        }
        let vase = Texture::Octants(self.jitter.tint(0.2, 0.45, 0.7), self.jitter.tint(0.9, 0.9, 0.85));
        let at = table + DVec3::new(-0.45, -0.035 - 0.17, 0.05);
        self.add("vase", Shape::Capsule { half: 0.09, radius: 0.08 }, vase, Motion::rest(at)).gloss = 0.35;

        let shift = self.jitter.step(0.06);
        let cloth = Texture::Clouds(self.jitter.tint(0.25, 0.42, 0.4), self.jitter.tint(0.5, 0.65, 0.55), 0.18);
        // What stands at the far wall stands there in every room.
        let wall = DVec3::Z * (self.half.z - HALF.z);
        let shift = shift + wall;
        let parts: [(&str, [f64; 3], [f64; 3]); 4] = [
            ("sofa seat", [0.85, 0.2, 0.42], [-1.75, FLOOR - 0.2, 2.35]),
            ("sofa back", [0.85, 0.42, 0.12], [-1.75, FLOOR - 0.42, 2.8]),
            ("sofa arm", [0.11, 0.3, 0.42], [-2.71, FLOOR - 0.3, 2.35]),
            ("sofa arm", [0.11, 0.3, 0.42], [-0.79, FLOOR - 0.3, 2.35]),
        ];
        for (name, half, at) in parts {
            self.block(name, half, cloth, DVec3::from_array(at) + shift);
        }
        let cushion = Texture::Checker(self.jitter.tint(0.9, 0.6, 0.2), self.jitter.tint(0.75, 0.2, 0.2), 0.11);
        let at = DVec3::new(-2.2, FLOOR - 0.4 - 0.17, 2.45) + shift;
        self.block("cushion", [0.2, 0.17, 0.09], cushion, at).motion.angle = 0.35;

        let side = Texture::Plain(DVec3::new(0.4, 0.27, 0.17));
        let turn = self.jitter.0.uniform(-0.1, 0.1);
        let shelf = self.block("shelf", [0.6, 0.85, 0.2], side, DVec3::new(2.2, FLOOR - 0.85, 2.75) + wall);
        shelf.textures[4] = Texture::Books(0.07);
        shelf.motion.angle = turn;
    }

    fn small_things(&mut self) {
        let shift = self.jitter.step(0.08);
        let rug = Texture::Checker(self.jitter.tint(0.7, 0.25, 0.25), self.jitter.tint(0.88, 0.8, 0.65), 0.3);
        self.block("rug", [1.35, 0.006, 0.75], rug, DVec3::new(-0.2, FLOOR - 0.006, -0.45) + shift);
        let art = Texture::Clouds(self.jitter.tint(0.15, 0.3, 0.7), self.jitter.tint(0.95, 0.8, 0.3), 0.22);
        self.block("picture", [0.02, 0.38, 0.55], art, DVec3::new(-self.half.x + 0.02, -0.35, 0.7));
        let art = Texture::Checker(self.jitter.tint(0.15, 0.15, 0.2), self.jitter.tint(0.9, 0.35, 0.25), 0.16);
        self.block("picture", [0.5, 0.36, 0.02], art, DVec3::new(0.3, -0.45, self.half.z - 0.02));
        let pouf = Texture::Octants(self.jitter.tint(0.85, 0.55, 0.25), self.jitter.tint(0.35, 0.25, 0.45));
        let at = DVec3::new(-1.35, FLOOR - 0.3, 0.75) + shift;
        let pouf = self.add("pouf", Shape::Sphere(0.3), pouf, Motion::rest(at));
        pouf.motion.angle = 0.5;
    }

    /// One body for each way to move: rolling, turning, fast, appearing and disappearing.
    fn moving_things(&mut self) {
        let radius = 0.23;
        let speed = 3.0 * self.jitter.factor();
        let ball = Texture::Octants(self.jitter.tint(0.12, 0.35, 0.9), self.jitter.tint(0.95, 0.95, 0.95));
        let mut motion = Motion::rest(DVec3::new(-1.55, FLOOR - 0.012 - radius, -0.5));
        motion.velocity = DVec3::new(speed, 0.0, 0.35);
        // It rolls: the spin that leaves its lowest point at rest, about the axis across its way.
        motion.axis = motion.velocity.cross(DVec3::Y).normalize();
        motion.spin = -motion.velocity.length() / radius;
        self.moving("ball", Shape::Sphere(radius), ball, motion).gloss = 0.25;

        let side = 0.19;
        let crate_ =
            Texture::Checker(self.jitter.tint(0.2, 0.65, 0.35), self.jitter.tint(0.95, 0.85, 0.3), 2.0 * side / 3.0);
        let mut motion = Motion::rest(DVec3::new(0.05, FLOOR - 0.755 - side, 0.85));
        motion.spin = 2.4 * self.jitter.factor();
        self.moving("turning crate", Shape::Block(DVec3::splat(side)), crate_, motion);

        let dart = Texture::Octants(self.jitter.tint(0.95, 0.3, 0.1), self.jitter.tint(0.98, 0.9, 0.2));
        let mut motion = Motion::rest(DVec3::new(-5.2, -0.95, 0.3));
        motion.velocity = DVec3::new(9.2, 0.5, 0.4);
        motion.spin = 5.0 * self.jitter.factor();
        self.moving("fast ball", Shape::Sphere(0.12), dart, motion).life = (0.3, 0.8);

        let balloon = Texture::Checker(self.jitter.tint(0.85, 0.25, 0.65), self.jitter.tint(0.98, 0.75, 0.9), 0.14);
        let mut motion = Motion::rest(DVec3::new(-0.95, -0.1, 1.2));
        motion.velocity = DVec3::new(0.0, -0.45, 0.0);
        motion.sway = DVec3::new(0.15, 0.0, 0.0);
        motion.spin = self.jitter.factor();
        let shape = Shape::Capsule { half: 0.1, radius: 0.17 };
        self.moving("balloon", shape, balloon, motion).life = (0.25, 0.7);
    }

    /// A figure that walks to and fro, turns its head and talks. Returns the index of the head.
    fn speaker(&mut self) -> usize {
        let mut motion = Motion::rest(DVec3::new(1.35, FLOOR - 0.66, 0.7));
        motion.sway = DVec3::new(0.22 * self.jitter.factor(), 0.0, 0.12);
        motion.angle = 0.25;
        motion.spin = -0.5;
        let coat = Texture::Wallpaper(self.jitter.tint(0.35, 0.3, 0.6), self.jitter.tint(0.9, 0.8, 0.4), 0.13);
        self.moving("speaker's body", Shape::Capsule { half: 0.44, radius: 0.22 }, coat, motion);
        motion.at.y -= 0.66 + HEAD * 0.9;
        motion.spin *= 2.0 * self.jitter.factor();
        let face = Texture::Head(self.jitter.tint(0.85, 0.65, 0.5), self.jitter.tint(0.25, 0.16, 0.1), HEAD);
        self.moving("speaker's head", Shape::Sphere(HEAD), face, motion);
        self.bodies.len() - 1
    }

    fn moving(&mut self, name: &'static str, shape: Shape, texture: Texture, motion: Motion) -> &mut Body {
        let body = self.add(name, shape, texture, motion);
        body.dynamic = true;
        body
    }
}
