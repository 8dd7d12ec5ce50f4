//! How times grow, on tiny sizes.

use crate::common::prelude::*;
use ivv::internals::profile::{Grows, Sweep, SweepOptions};

#[test]
fn a_sweep_has_one_thing_grow_at_a_time_and_says_what_it_left_out() {
    let gpu = gpu();
    // So much time that nothing is left out for want of it, however slow the machine is just now.
    let options =
        SweepOptions { gaussians: 200, most_gaussians: 13_000, size: [64, 48], seconds: 1e5, adam: AdamMode::Lazy };
    let mut n_begun = 0;
    let sweep = Sweep::measure(&gpu, &options, &mut || n_begun += 1).unwrap();
    assert_eq!(sweep.courses.iter().map(|course| course.points.len()).sum::<usize>(), n_begun);
    for course in &sweep.courses {
        let [first, .., last] = course.points.as_slice() else {
            panic!("{:?} has fewer than two points", course.grows)
        };
        assert!(course.points.is_sorted_by(|a, b| a.size < b.size));
        assert!(course.points.iter().all(|point| point.step_ms > 0.0 && point.frame_ms > 0.0), "{course:?}");
        assert!(course.step.is_some() && course.frame.is_some());
        let near = |a: f64, b: f64| (0.7..1.4).contains(&(a / b));
        match course.grows {
            Grows::Gaussians => assert!(last.active > 2.5 * first.active && last.gaussians > first.gaussians),
            Grows::Frames => assert!(last.gaussians > 3 * first.gaussians && near(last.active, first.active)),
            Grows::Cameras | Grows::Pixels => {
                assert!(last.gaussians == first.gaussians && near(last.active, first.active))
            }
        }
    }
    // 768 frames with 200 Gaussians each time are 34,134.
    assert!(sweep.left_out.iter().any(|what| what.starts_with("768 frames: 34134")), "{:?}", sweep.left_out);
    let (told, picture) = (sweep.markdown(), sweep.svg());
    assert!(
        told.contains("## Left out") && told.contains("Adam `lazy`") && told.matches("Exponents: step ").count() == 4
    );
    assert_eq!(picture.matches("<g transform").count(), 4);
}

#[test]
fn the_command_writes_a_table_numbers_and_a_picture() {
    let folder = Folder::new("sweep");
    works(&["profile", "--sweep", "3000", "--seconds", "0.5", "-o", text(&folder.0)]);
    let read = |file: &str| std::fs::read_to_string(folder.file(file)).unwrap();
    let sweep: serde_json::Value = serde_json::from_str(&read("sweep.json")).unwrap();
    assert_eq!(sweep["courses"].as_array().unwrap().len(), 4);
    assert!(read("sweep.md").contains("## Left out") && read("sweep.svg").starts_with("<svg"));
    // A sweep takes no subject.
    fails(&["profile", "--sweep", "capture"], 2);
}
