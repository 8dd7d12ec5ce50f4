//! What lies behind a scene: a background that varies while it is trained, and a backdrop where no training camera looks.

use super::{Tiny, as_it_is, train};
use crate::common::prelude::*;
use crate::common::program::json;
use image::{DynamicImage, Rgb, RgbImage};
use ivv::internals::synth::{Options, Rig};
use ivv::internals::train::{Kind, Log, Priors};

fn change(tiny: &Tiny, to: impl Fn(RgbImage) -> DynamicImage) {
    for shot in tiny.capture.cameras.iter().flat_map(|camera| &camera.shots) {
        let image = image::open(&shot.image).unwrap().to_rgb8();
        to(image).save(&shot.image).unwrap();
    }
}

fn varies(tiny: &Tiny, config: &Config) -> bool {
    Setup::new(&Capture::open(&tiny.folder).unwrap(), config).varies_background
}

#[test]
fn a_background_that_images_show_does_not_vary() {
    let tiny = Tiny::new("shown");
    let config = exact();
    assert!(varies(&tiny, &config));
    assert!(!varies(&tiny, &Config { vary_background: false, ..config.clone() }));
    // A tenth of each image is cut out.
    let cut_out = |mut image: RgbImage| {
        let width = image.width();
        image.enumerate_pixels_mut().filter(|(x, ..)| 10 * x < width).for_each(|(.., pixel)| *pixel = Rgb([77; 3]));
        DynamicImage::from(image)
    };
    change(&tiny, cut_out);
    assert!(varies(&tiny, &config), "the background is black");
    assert!(!varies(&tiny, &Config { background: [0.3; 3], ..config.clone() }));
    let with_alpha = |alpha: u8| {
        move |image: RgbImage| {
            let mut image = DynamicImage::from(image).to_rgba8();
            image.get_pixel_mut(3, 4).0[3] = alpha;
            DynamicImage::from(image)
        }
    };
    change(&tiny, with_alpha(255));
    assert!(varies(&tiny, &config), "an alpha channel, which nothing shows through");
    change(&tiny, with_alpha(254));
    assert!(!varies(&tiny, &config), "the background shows through");
}

#[test]
fn images_that_it_shows_through_are_seen_over_the_background_of_the_run() {
    let tiny = Tiny::new("white");
    change(&tiny, |image| {
        let mut image = DynamicImage::from(image).to_rgba8();
        image.pixels_mut().for_each(|pixel| pixel.0[3] = 0);
        image.into()
    });
    let (capture, run) = (tiny.folder.to_str().unwrap(), tiny.folder.join("run"));
    let output = run.to_str().unwrap();
    let random = ["--set", "init=random", "--set", "init_points=20"];
    works(&[&["train", capture, "-o", output, "--steps", "2", "--set", "background=[1,1,1]"][..], &random].concat());
    // Images and a scene of which little shows are white alike.
    let opened = Run::read(&run).unwrap().open_capture(None).unwrap();
    assert!(opened.picture(0, 1).unwrap().pixels.iter().all(|pixel| *pixel == u32::MAX));
    let score = json(&run.join("eval.json"))["psnr"].as_f64().unwrap();
    assert!(score > 12.0, "{score} dB");
    works(&["train", "--resume", "-o", output, "--steps", "3"]);
}

#[test]
fn a_clip_that_fades_in_from_black_does_not_show_the_background() {
    let tiny = Tiny::new("fades");
    for shot in tiny.capture.cameras.iter().filter_map(|camera| camera.shots.first()) {
        let image = image::open(&shot.image).unwrap();
        RgbImage::new(image.width(), image.height()).save(&shot.image).unwrap();
    }
    assert!(varies(&tiny, &exact()));
}

#[test]
fn a_background_does_not_vary_where_cameras_look_outward() {
    let tiny = outward("around");
    assert!(!varies(&tiny, &exact()));
}

fn outward(name: &str) -> Tiny {
    Tiny::of(name, &Options { frames: 2, rig: Rig::Outward, ..Preset::Tiny.options(7) })
}

/// Views of the training cameras, or of those for testing, at the first frame.
fn views(capture: &Capture, are_test: bool) -> Vec<View> {
    let cameras = (0..capture.cameras.len()).filter(|camera| capture.cameras[*camera].is_test == are_test);
    cameras.map(|camera| capture.view(camera, 0).unwrap()).collect()
}

/// Mean share of the background in the pictures of `views`.
fn background_in(splats: &Splats, views: &[View]) -> f64 {
    let gpu = gpu();
    let mut renderer = Renderer::new(gpu.clone(), splats, Constants::default()).unwrap();
    let mut color = |view: &View, background: [f32; 3]| {
        let view = View { background, ..view.clone() };
        renderer.render(&view, Outputs::Color).unwrap().0.color
    };
    let mut share = |view: &View| {
        let (white, black) = (color(view, [1.0; 3]), color(view, [0.0; 3]));
        let sum: f64 = white.iter().zip(&black).map(|(w, b)| f64::from(w[0] - b[0])).sum();
        sum / white.len() as f64
    };
    views.iter().map(&mut share).sum::<f64>() / views.len() as f64
}

#[test]
fn a_scene_before_backgrounds_that_vary_lets_less_of_them_through() {
    let tiny = Tiny::new("through");
    // A black wall is a hole before a black background.
    change(&tiny, |mut image| {
        image.pixels_mut().for_each(|pixel| pixel.0 = pixel.0.map(|level| level / 8 + 3));
        image.into()
    });
    let world = tiny.capture.normalisation();
    let capture = Capture::open(&tiny.folder).unwrap().transformed(&world);
    let through = |vary_background: bool| {
        let config = Config { vary_background, backdrop: 0, ..exact() };
        let first = initialise(&capture, &config, &mut |_, _| {}).unwrap().splats;
        background_in(&train(&capture, &config, &first, 120).0, &views(&capture, false))
    };
    let (varied, same) = (through(true), through(false));
    println!("{varied:.4} of the background with many, {same:.4} with one");
    assert!(varied < 0.5 * same);
}

#[test]
fn a_backdrop_fills_what_no_training_camera_sees_leaves_the_rest_as_it_is_and_is_left_out_where_it_is_too_much() {
    let tiny = outward("backdrop");
    let capture = tiny.capture.clone().transformed(&tiny.capture.normalisation());
    let first = initialise(&capture, &exact(), &mut |_, _| {}).unwrap().splats;
    let _device = gpu();
    let session = |backdrop: u32, max_gaussians: usize| {
        let config = Config { backdrop, max_gaussians, steps: 60, ..exact() };
        let options = SessionOptions { first: Some(first.clone()), priors: Some(Priors::default()), ..as_it_is() };
        Session::begin(gpu().clone(), &capture, config, options).unwrap()
    };
    let told = |session: &mut Session| {
        let of = |event: Event| if let Event::Backdrop { n, is_added } = event { Some((n, is_added)) } else { None };
        session.take_events().into_iter().filter_map(of).collect::<Vec<_>>()
    };
    let [(scene, with, told_with), (_, without, told_without)] = [1000, 0].map(|backdrop| {
        let mut session = session(backdrop, 500_000);
        while session.step().unwrap() {}
        (session.scene().unwrap(), session.finish().unwrap(), told(&mut session))
    });
    let n = with.len() - without.len();
    assert!(n > 100 && with.n_static == without.n_static + n, "{n} were added");
    assert_eq!((told_with, told_without), (vec![(n, true)], vec![]));
    assert_eq!((&with.position[n..], &with.motion), (&without.position[..], &without.motion));
    let [seen, unseen] = [false, true].map(|are_test| {
        let views = views(&capture, are_test);
        [&with, &without].map(|splats| background_in(splats, &views))
    });
    println!("background: {seen:.4?} where cameras look, {unseen:.4?} beside");
    assert!(unseen[0] < 0.2 * unseen[1] && seen[1] - seen[0] < 0.05);

    let (mut enough, mut less) = (session(1000, with.len()), session(1000, with.len() - 1));
    assert_eq!((enough.finish_with(scene.clone()).unwrap(), told(&mut enough)), (with, vec![(n, true)]));
    assert_eq!((less.finish_with(scene.clone()).unwrap(), told(&mut less)), (scene, vec![(n, false)]));
}

#[test]
fn the_curve_of_a_run_is_of_scenes_without_a_backdrop() {
    let tiny = outward("curve");
    let run = tiny.folder.join("run");
    let (capture, output) = (tiny.folder.to_str().unwrap(), run.to_str().unwrap());
    works(&["train", capture, "-o", output, "--steps", "40", "--eval-every", "20"]);
    let backdrop = json(&run.join("train.json"))["backdrop"].as_u64().unwrap();
    let score = json(&run.join("eval.json"))["psnr"].as_f64().unwrap();
    let log = Log::open(&run, 40);
    let curve: Vec<f64> = log.lines(Kind::Evaluation).map(|line| line["psnr"].as_f64().unwrap()).collect();
    println!("{curve:.2?} dB, and {score:.2} dB with {backdrop} Gaussians behind");
    assert!(backdrop > 100 && curve.len() == 2 && curve.iter().all(|psnr| *psnr < score - 2.0));
    assert!(
        String::from_utf8(std::fs::read(run.join("report.html")).unwrap()).unwrap().contains("without the backdrop")
    );
    // Nothing falls when the run goes on.
    let told = tells(&["train", "--resume", "-o", output, "--steps", "60", "--eval-every", "20"]);
    assert!(!told.contains("fell"), "{told}");
}
