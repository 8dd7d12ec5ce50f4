//! Photographs teach what rests, and a run on top of another, which leaves that alone, does without them.

use crate::capture::photos::clip;
use crate::common::prelude::*;
use crate::common::program::json;

#[test]
fn a_photograph_shows_and_teaches_what_rests_alone() {
    let clip = clip("train-photos");
    let (capture, base, part) = (text(&clip.0), clip.0.join("base"), clip.0.join("part"));
    let short = ["--sh-degree", "1", "--set", "init_points=200", "--eval-every", "0", "--steps", "30"];
    let told = tells(&[&["train", capture, "-o", text(&base)][..], &short].concat());
    assert!(told.contains("of the static ones from photographs"), "{told}");
    assert_eq!(json(&base.join("run.json"))["held"]["training_images"], 15);
    // Photographs have no clock.
    let clocks = json(&base.join("offsets.json"));
    let named = |name: &str| clocks.to_string().contains(name);
    assert!(named("cam00") && !named("photo"), "{clocks}");
    let scene = read_ply(&base.join("scene.ply")).unwrap();
    assert!(scene.n_static > 50 && scene.motion.len() > 20, "{} {}", scene.n_static, scene.motion.len());
    let opened = Capture::open(&clip.0).unwrap();
    // A colour map each, but the gauge is of those that film.
    let setup = Setup::new(&opened, &exact());
    assert_eq!((setup.n_filming, setup.first_photo, setup.most_grids), (3, 4, 6));
    assert!(setup.has_grid[4..].iter().all(|has| *has));
    let (photo, frame) = (opened.view(4, 0).unwrap(), opened.view(0, 1).unwrap());
    // The others are as good as not there.
    let part_of = |is_static: bool| {
        let mut part = scene.clone();
        (0..part.len()).filter(|i| (*i < scene.n_static) != is_static).for_each(|i| part.opacity[i] = -30.0);
        part
    };
    let covered = |splats: &Splats, view| render(splats, view).0.alpha.iter().sum::<f32>();
    assert_eq!(covered(&part_of(false), &photo), 0.0);
    assert!(covered(&part_of(false), &frame) > 1.0 && covered(&part_of(true), &photo) > 1.0);
    // On top of that: the cameras are the same, their photographs are not asked for.
    let of_part = ["train", capture, "-o", text(&part), "--frames", "1:3", "--base", text(&base)];
    works(&[&of_part[..], &short[2..]].concat());
    let told = json(&part.join("run.json"));
    assert_eq!(told["held"]["training_images"], 6);
    // It goes on, and is scored and rendered as any other.
    works(&["train", "--resume", "-o", text(&part), "--steps", "40", "--eval-every", "0"]);
    works(&["render", text(&part), "-o", text(&clip.0.join("views")), "--frames", "0:1"]);
    // Nor are photographs among the views of the base, which would be of no time of the clip.
    works(&["render", text(&base), "-o", text(&clip.0.join("all"))]);
    // Nor among those that a file of the clip has to start from.
    let file = clip.0.join("clip.4dgs");
    works(&["export", text(&base), "-o", text(&file), "--clamp-colors"]);
    let views = ivv::internals::formats::FourDgs::open(&file).unwrap().views().unwrap();
    assert!(views.len() > 1 && views.iter().all(|view| !view.name.contains("photo")), "{views:?}");
    works(&["render", text(&file), "-o", text(&clip.0.join("of-file"))]);
    assert!(
        !std::fs::read_dir(clip.0.join("all")).unwrap().any(|file| file
            .unwrap()
            .file_name()
            .to_str()
            .unwrap()
            .contains("photo"))
    );
}
