//! Frames that need more room than there is (N26).

use crate::common::device::gpu;
use crate::common::frames::{bits, render};
use crate::common::random::{scene, view};
use ivv::Constants;
use ivv::stage::{Outputs, Renderer};

#[test]
fn a_frame_that_overflows_is_replayed_and_shows_the_same_bits() {
    let gpu = gpu();
    let splats = scene(51, 300, 1);
    let (expected, roomy) = render(&splats, &view());
    let n = roomy.intersections as u32;
    assert!(n > 500 && roomy.replays == 0, "{roomy:?}");
    for (capacity, replays) in [(0, 1), (1, 1), (n - 1, 1), (n, 0), (n + 1, 0)] {
        let mut renderer = Renderer::new(gpu.clone(), &splats, Constants::default()).unwrap();
        renderer.limit_intersections(capacity);
        let (frame, report) = renderer.render(&view(), Outputs::All).unwrap();
        assert_eq!((report.replays, report.intersections), (replays, u64::from(n)), "room for {capacity} of {n}");
        assert!(bits(&frame) == bits(&expected), "room for {capacity} of {n}: other bits");
        let (frame, report) = renderer.render(&view(), Outputs::All).unwrap();
        assert_eq!(report.replays, 0, "the second frame has the room");
        assert!(bits(&frame) == bits(&expected));
    }
}
