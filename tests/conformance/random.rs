//! Seeded random numbers and scenes.

use glam::DVec3;

use ivv::internals::scene::capture::Picture;
use ivv::internals::scene::{FlowModel, Intrinsics, Motion, Pose, Splats, View};

pub use ivv::internals::random::Random;

/// A camera at (0, 0, -4) that looks along z, 80 x 56 pixels.
pub fn view() -> View {
    View {
        name: "random".into(),
        intrinsics: Intrinsics { width: 80, height: 56, fx: 70.0, fy: 75.0, cx: 38.5, cy: 29.25 },
        pose: Pose { translation: DVec3::new(0.0, 0.0, 4.0), ..Pose::default() },
        time: 0.4,
        time_offset: 0.3,
        flow_dt: 0.05,
        background: [0.1, 0.3, 0.6],
        flow_model: FlowModel::Velocity,
        next_pose: None,
    }
}

/// [`view`] in 40 x 28 pixels.
pub fn small_view() -> View {
    let intrinsics = Intrinsics { width: 40, height: 28, fx: 35.0, fy: 37.5, cx: 19.25, cy: 14.5 };
    View { intrinsics, ..view() }
}

pub fn noise(seed: u64, view: &View) -> Picture {
    let mut random = Random::new(seed);
    let pixels =
        (0..view.intrinsics.width * view.intrinsics.height).map(|_| random.bits() as u32 | 0xff00_0000).collect();
    Picture::new(view.intrinsics.width, view.intrinsics.height, pixels)
}

/// Values that poison an unguarded kernel: not finite, zeros, denormal, near overflow.
const POISON: [f32; 8] = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 0.0, -0.0, 1e-45, 1e38, f32::MIN / 2.0];

/// Poisons each number of `splats` with probability `rate`; says how many.
pub fn poison(splats: &mut Splats, random: &mut Random, rate: f64) -> usize {
    let mut n = 0;
    let motion = splats.motion.iter_mut().flat_map(|m| {
        let Motion { velocity: [x, y, z], t_center, t_scale } = m;
        [x, y, z, t_center, t_scale]
    });
    let all = splats.position.as_flattened_mut().iter_mut().chain(splats.rotation.as_flattened_mut());
    let all = all.chain(splats.scale.as_flattened_mut()).chain(&mut splats.opacity);
    for slot in all.chain(splats.sh.as_flattened_mut()).chain(motion) {
        if random.uniform(0.0, 1.0) < rate {
            *slot = POISON[random.bits() as usize % POISON.len()];
            n += 1;
        }
    }
    n
}

/// `n` Gaussians of moderate size in front of [`view`], the first half static.
pub fn scene(seed: u64, n: usize, sh_degree: u32) -> Splats {
    let mut random = Random::new(seed);
    let n_static = n / 2;
    let mut splats = Splats { n_static, sh_degree, ..Splats::default() };
    for i in 0..n {
        splats.position.push(random.vector(-1.5, 1.5));
        splats.rotation.push(random.vector(-1.0, 1.0));
        splats.scale.push(random.vector(-4.0, -1.2));
        splats.opacity.push(random.uniform(-2.0, 3.0) as f32);
        for _ in 0..splats.n_coefficients() {
            splats.sh.push(random.vector(-0.5, 0.8));
        }
        if i >= n_static {
            splats.motion.push(Motion {
                velocity: random.vector(-1.0, 1.0),
                t_center: random.uniform(0.0, 1.0) as f32,
                t_scale: random.uniform(-2.0, 1.0) as f32,
            });
        }
        splats.source_row.push(i as u32);
    }
    splats
}

/// Gaussians everywhere around [`view`]'s camera, of all sizes, brightnesses and times, needles among them; most are
/// culled. The first half is static.
pub fn wild_scene(seed: u64, n: usize) -> Splats {
    let mut random = Random::new(seed);
    let mut splats = scene(seed, n, 0);
    for i in 0..n {
        let spread = random.pick(&[1.0, 3.0, 10.0, 1000.0]);
        splats.position[i] = random.vector(-spread, spread);
        splats.scale[i] = [random.pick(&[-15.0, -4.0, -2.0, 0.0, 3.0, 20.0]) as f32; 3];
        splats.scale[i][(random.bits() % 3) as usize] += random.uniform(-4.0, 4.0) as f32;
        splats.opacity[i] = random.pick(&[-5.541_263_6, -5.5, -3.0, 0.0, 3.0, 20.0]) as f32;
    }
    for motion in &mut splats.motion {
        motion.t_center = random.uniform(-0.5, 1.5) as f32;
        motion.t_scale = random.pick(&[-18.0, -3.0, -1.0, 0.0, 9.0, f64::INFINITY]) as f32;
    }
    splats
}
