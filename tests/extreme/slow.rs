//! The slow lane: pictures of the sizes that real rigs have (N18). `IVV_TEST_SLOW=1` runs it.

use crate::common::device::{gpu, is_slow_lane};
use crate::common::frames::{Tolerance, compare, render};
use crate::common::one::{One, at_pixel, camera, round, scene_of};
use crate::common::random::Random;
use ivv::Constants;
use ivv::scene::View;
use ivv::twin::render_f64;

#[test]
fn slow_n18_pictures_of_sixteen_and_twenty_three_megapixels_are_those_of_float64() {
    if !is_slow_lane() {
        return;
    }
    for (width, height) in [(5312, 2988), (5568, 4176)] {
        let view = View { fx: 3000.0, fy: 3000.0, ..camera(width, height) };
        let mut random = Random::new(u64::from(width));
        let all: Vec<One> = (0..60)
            .map(|_| {
                let [x, y] = [width, height].map(|side| random.uniform(0.0, f64::from(side)));
                let z = random.uniform(2.0, 6.0);
                let deviation = random.uniform(0.5, 150.0) * z / 3000.0;
                round(at_pixel(&view, x, y, z), deviation, random.uniform(0.1, 0.95), [0.3, 0.6, 0.1])
            })
            .collect();
        let splats = scene_of(&all);
        let (frame, report) = render(&splats, &view);
        assert_eq!(report.tiles, u64::from(width.div_ceil(16) * height.div_ceil(16)));
        let image_bytes = 16 * u64::from(width) * u64::from(height);
        let in_one = image_bytes <= gpu().caps().max_binding_bytes;
        assert!(in_one || report.strips > 1, "{report:?}");
        let truth = render_f64(&splats, &view, &Constants::default());
        // A pixel position of 5,000 is known to 2.4e-4 in f32.
        let tolerance = Tolerance { away: 5e-4, ..Tolerance::default() };
        compare(&frame, &truth, &tolerance).unwrap_or_else(|fault| panic!("{width} x {height}: {fault}"));
    }
}
