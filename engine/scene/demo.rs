//! The scene that the project ships: the corner of a room with still, moving and fading things.
//!
//! Its files must be the same bytes on every machine. IEEE 754 fixes +, -, *, / and sqrt, but not sin, cos, exp and ln: angles advance by
//! rotation with literal constants, and logarithms are summed here.

use super::{Intrinsics, Motion, Pose, Splats, View, dc_of_color, rotation_of_rows};
use crate::random::Random;
use glam::DVec3;

type Vec3 = [f64; 3];

/// Degree-1 spherical harmonics constant, sqrt(3 / (4 pi)).
const SH_C1: f64 = 0.488_602_511_902_919_9;
/// Tangential standard deviation of a surface Gaussian over the spacing of its neighbours: closes the surface.
const STD_PER_SPACING: f64 = 0.6;
/// Standard deviation along the normal over the tangential one: flat, yet not degenerate.
const FLATNESS: f64 = 0.15;
const FLOOR_Y: f64 = 1.0;
const LIGHT: DVec3 = DVec3::new(0.48, -0.8, -0.36);
const N_VIEWS: u32 = 8;
/// Centre and radius of the still sphere, centre and half side of the box.
const SPHERE: (Vec3, f64) = ([-0.75, FLOOR_Y - 0.5, 0.55], 0.5);
const BOX: (Vec3, f64) = ([0.85, FLOOR_Y - 0.38, 0.75], 0.38);

/// A dynamic scene of about 5,300 Gaussians of degree 1 and eight views of it (320 x 240, on an arc, at eight times). Floor, walls, a
/// sphere and a box are static; a ball crosses the floor; a ring fades in and out at half time. The room is 4 units wide, x right, y down, z
/// away from the cameras.
pub fn demo() -> (Splats, Vec<View>) {
    let mut scene = Builder { splats: Splats::new(1), noise: Random::new(0x69_76_76), motion: None };
    scene.floor();
    scene.walls();
    scene.sphere(SPHERE.0, SPHERE.1, 700, |_, unit| {
        let band = (unit[1] * 4.0 + 8.0).floor() as i64 % 2 == 0;
        if band { [0.85, 0.25, 0.2] } else { [0.95, 0.82, 0.6] }
    });
    scene.cube();
    scene.splats.n_static = scene.splats.position.len();
    // The ball passes between the cameras and the still things and never leaves the floor.
    let ball_tau = 4.0;
    scene.motion = Some(Motion { velocity: [2.6, 0.0, -0.5], t_center: 0.5, t_scale: ln(ball_tau) as f32 });
    scene.sphere([0.0, FLOOR_Y - 0.26, -0.55], 0.26, 360, |_, unit| {
        if (unit[0] > 0.0) == (unit[2] > 0.0) { [0.15, 0.45, 0.95] } else { [0.95, 0.95, 0.98] }
    });
    let ring_tau = 0.22;
    scene.motion = Some(Motion { velocity: [0.0; 3], t_center: 0.5, t_scale: ln(ring_tau) as f32 });
    scene.ring([0.1, -0.15, 0.9], 0.42, 0.1);
    scene.splats.source_row = (0..scene.splats.position.len() as u32).collect();
    (scene.splats, views())
}

struct Builder {
    splats: Splats,
    noise: Random,
    /// Of the next Gaussians; `None` of static ones.
    motion: Option<Motion>,
}

impl Builder {
    /// One Gaussian of a surface: `color` is its albedo before shading.
    fn surface(&mut self, at: Vec3, normal: Vec3, spacing: f64, color: Vec3) {
        let std = STD_PER_SPACING * spacing;
        let shade = 0.62 + 0.38 * DVec3::from(normal).dot(LIGHT).max(0.0);
        let grain = 1.0 + 0.04 * self.noise.uniform(-1.0, 1.0);
        // A surface is a little brighter when it is looked at along its normal: dir . normal is -1 there.
        let sheen = -0.07 / SH_C1;
        let [nx, ny, nz] = normal;
        let splats = &mut self.splats;
        splats.position.push(at.map(|v| v as f32));
        splats.rotation.push(z_axis_to(normal).map(|v| v as f32));
        splats.scale.push([ln(std), ln(std), ln(std * FLATNESS)].map(|v| v as f32));
        splats.opacity.push((3.2 + 0.6 * self.noise.uniform(-1.0, 1.0)) as f32);
        splats.sh.push(color.map(|c| dc_of_color(c * shade * grain)));
        // 3DGS's degree-1 basis is C1 (-y, z, -x), so sheen * C1 * (dir . normal) takes these signs.
        splats.sh.extend([-ny, nz, -nx].map(|n| [(sheen * n) as f32; 3]));
        splats.motion.extend(self.motion);
    }

    fn floor(&mut self) {
        let (n, spacing) = (48, 4.0 / 48.0);
        for (row, column) in (0..n).flat_map(|row| (0..n).map(move |column| (row, column))) {
            let at = |i: i32| (f64::from(i) + 0.5) * spacing - 2.0;
            let (x, z) = (at(column), at(row));
            let white = (row / 6 + column / 6) % 2 == 0;
            let albedo = if white { [0.88, 0.86, 0.8] } else { [0.32, 0.36, 0.42] };
            let shadow = contact(x, z, SPHERE) * contact(x, z, BOX);
            self.surface([x, FLOOR_Y, z], [0.0, -1.0, 0.0], spacing, albedo.map(|c| c * shadow));
        }
    }

    fn walls(&mut self) {
        let (columns, rows, spacing) = (30, 19, 4.0 / 30.0);
        for (row, column) in (0..rows).flat_map(|row| (0..columns).map(move |column| (row, column))) {
            let along = (f64::from(column) + 0.5) * spacing - 2.0;
            let y = FLOOR_Y - (f64::from(row) + 0.5) * spacing;
            let dado = row < 5;
            let stripe = column % 6 < 3;
            let back = match (dado, stripe) {
                (true, _) => [0.42, 0.55, 0.5],
                (_, true) => [0.9, 0.84, 0.7],
                _ => [0.83, 0.74, 0.58],
            };
            self.surface([along, y, 2.0], [0.0, 0.0, -1.0], spacing, back);
            let brick = (column + if row % 4 < 2 { 0 } else { 2 }) % 4 == 0 || row % 2 == 0;
            let left = if brick { [0.72, 0.45, 0.36] } else { [0.62, 0.36, 0.28] };
            self.surface([-2.0, y, along], [1.0, 0.0, 0.0], spacing, left);
        }
    }

    /// `n` points of a spiral over a sphere, each with the same area; `albedo` gets the point and its unit vector.
    fn sphere(&mut self, center: Vec3, radius: f64, n: u32, albedo: impl Fn(Vec3, Vec3) -> Vec3) {
        // cos and sin of the golden angle, pi (3 - sqrt 5).
        const STEP: [f64; 2] = [-0.737_368_878_078_320_1, 0.675_490_294_261_523_9];
        // 4 pi r^2 / n is the area of a point, its root their spacing.
        let spacing = radius * (4.0 * std::f64::consts::PI / f64::from(n)).sqrt();
        let mut turn = [1.0, 0.0];
        for i in 0..n {
            let y = 1.0 - 2.0 * (f64::from(i) + 0.5) / f64::from(n);
            let r = (1.0 - y * y).sqrt();
            let unit = [r * turn[0], y, r * turn[1]];
            let at = std::array::from_fn(|k| center[k] + radius * unit[k]);
            self.surface(at, unit, spacing, albedo(at, unit));
            turn = advance(turn, STEP);
        }
    }

    fn cube(&mut self) {
        let (center, half) = BOX;
        let n = 9;
        let spacing = 2.0 * half / f64::from(n);
        for (axis, sign) in [(0, -1.0), (0, 1.0), (1, -1.0), (2, -1.0), (2, 1.0)] {
            for (i, j) in (0..n).flat_map(|i| (0..n).map(move |j| (i, j))) {
                let across = |k: i32| (f64::from(k) + 0.5) * spacing - half;
                let mut at = center;
                at[axis] += sign * half;
                at[(axis + 1) % 3] += across(i);
                at[(axis + 2) % 3] += across(j);
                let mut normal = [0.0; 3];
                normal[axis] = sign;
                let edge = i == 0 || j == 0 || i == n - 1 || j == n - 1;
                let cross = i == n / 2 || j == n / 2;
                let albedo = if edge || cross { [0.95, 0.75, 0.25] } else { [0.2, 0.6, 0.45] };
                self.surface(at, normal, spacing, albedo);
            }
        }
    }

    fn ring(&mut self, center: Vec3, radius: f64, tube: f64) {
        // cos and sin of 2 pi / 36 and 2 pi / 10.
        const AROUND: [f64; 2] = [0.984_807_753_012_208, 0.173_648_177_666_930_36];
        const ACROSS: [f64; 2] = [0.809_016_994_374_947_5, 0.587_785_252_292_473_1];
        let spacing = 2.0 * std::f64::consts::PI * radius / 36.0;
        let mut around = [1.0, 0.0];
        for i in 0..36 {
            let mut across = [1.0, 0.0];
            for _ in 0..10 {
                let unit = [around[0] * across[0], around[1] * across[0], across[1]];
                let reach = radius + tube * across[0];
                let at = [center[0] + around[0] * reach, center[1] + around[1] * reach, center[2] + tube * across[1]];
                let albedo = if i % 6 < 3 { [0.98, 0.55, 0.85] } else { [0.6, 0.3, 0.9] };
                self.surface(at, unit, spacing, albedo);
                across = advance(across, ACROSS);
            }
            around = advance(around, AROUND);
        }
    }
}

/// Eight cameras on an arc of 70 degrees around the room, each at its own time.
fn views() -> Vec<View> {
    // cos and sin of 10 degrees, and of the first camera's 20 degrees to the left of the middle.
    const STEP: [f64; 2] = [0.984_807_753_012_208, 0.173_648_177_666_930_36];
    let mut turn = [0.939_692_620_785_908_4, -0.342_020_143_325_668_7];
    let mut views = Vec::new();
    let target = [0.0, 0.35, 0.4];
    for index in 0..N_VIEWS {
        let center = [target[0] + 4.3 * turn[1] + 0.5, target[1] - 1.35, target[2] - 4.3 * turn[0]];
        views.push(View {
            name: format!("view{index:02}"),
            intrinsics: Intrinsics { width: 320, height: 240, fx: 300.0, fy: 300.0, cx: 160.0, cy: 120.0 },
            pose: pose(center.into(), target.into()),
            time: f64::from(index) / f64::from(N_VIEWS),
            flow_dt: 1.0 / 30.0,
            background: [0.55, 0.74, 0.95],
            ..View::default()
        });
        turn = advance(turn, STEP);
    }
    views
}

/// A camera at `center` that looks at `target` and has the world's y (down) below.
fn pose(center: DVec3, target: DVec3) -> Pose {
    // glam multiplies by the inverse of the length, which would change the last bits of the files that ship.
    let unit = |v: DVec3| v / v.length();
    let forward = unit(target - center);
    let right = unit(DVec3::Y.cross(forward));
    Pose::at(center, rotation_of_rows([right, forward.cross(right), forward]))
}

/// Brightness of the floor near a thing: 0.45 below it to 1 away from it.
fn contact(x: f64, z: f64, (center, radius): (Vec3, f64)) -> f64 {
    // The shadow leans away from the light.
    let (dx, dz) = (x - center[0] + 0.3 * radius, z - center[2] - 0.25 * radius);
    let distance = (dx * dx + dz * dz).sqrt() / radius;
    let t = ((distance - 0.6) / 0.9).clamp(0.0, 1.0);
    0.45 + 0.55 * t * t * (3.0 - 2.0 * t)
}

/// The rotation (w, x, y, z) that takes the z axis to `normal` on the shortest way.
fn z_axis_to([x, y, z]: Vec3) -> [f64; 4] {
    if z < -0.999_999 {
        return [0.0, 1.0, 0.0, 0.0];
    }
    let w = ((1.0 + z) / 2.0).sqrt();
    [w, -y / (2.0 * w), x / (2.0 * w), 0.0]
}

/// The angle of `turn` (cos, sin) plus that of `step`, brought back to unit length.
fn advance(turn: [f64; 2], step: [f64; 2]) -> [f64; 2] {
    let [c, s] = [turn[0] * step[0] - turn[1] * step[1], turn[0] * step[1] + turn[1] * step[0]];
    let length = (c * c + s * s).sqrt();
    [c / length, s / length]
}

/// The natural logarithm of a positive number: halved or doubled into [0.7, 1.4], then 2 atanh((m - 1) / (m + 1)).
fn ln(x: f64) -> f64 {
    let (mut m, mut exponent) = (x, 0.0);
    while m > 1.4 {
        m *= 0.5;
        exponent += 1.0;
    }
    while m < 0.7 {
        m *= 2.0;
        exponent -= 1.0;
    }
    let u = (m - 1.0) / (m + 1.0);
    let mut term = u;
    let mut sum = 0.0;
    // |u| < 0.18: twelve terms leave less than 1e-18.
    for k in 0..12 {
        sum += term / f64::from(2 * k + 1);
        term *= u * u;
    }
    exponent * std::f64::consts::LN_2 + 2.0 * sum
}
