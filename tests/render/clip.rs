//! Clips of which only a window is on the device, pictures that follow one another without a wait.

use crate::common::one::with;
use crate::common::prelude::*;
use crate::common::random::{self, view};
use ivv::internals::settings::{Culls, Knobs};
use ivv::internals::stage::Destination;

/// `n` dynamic Gaussians before [`view`] with lives of about `tau` all over the clip, behind 500 static ones.
pub fn clip(n: usize, tau: f64) -> Splats {
    let mut random = Random::new(n as u64);
    let mut splats = Splats { n_static: 500, ..Splats::new(0) };
    for i in 0..splats.n_static + n {
        splats.position.push(random.vector(-1.5, 1.5));
        splats.rotation.push(random.vector(-1.0, 1.0));
        splats.scale.push(random.vector(-5.0, -3.5));
        splats.opacity.push(random.uniform(-3.0, 3.0) as f32);
        splats.sh.push(random.vector(-0.5, 1.5));
        splats.source_row.push(i as u32);
        if i >= splats.n_static {
            splats.motion.push(Motion {
                velocity: random.vector(-0.5, 0.5),
                t_center: random.uniform(0.0, 1.0) as f32,
                t_scale: (tau * random.uniform(0.5, 1.5)).ln() as f32,
            });
        }
    }
    splats
}

pub fn at(time: f64) -> View {
    View { time, time_offset: 0.0, ..view() }
}

fn whole_and_clip(splats: &Splats, constants: Constants) -> [Renderer; 2] {
    let whole = Renderer::new(gpu().clone(), splats, constants).unwrap();
    [whole, Renderer::of_clip(gpu().clone(), Arc::new(splats.clone()), constants).unwrap()]
}

#[test]
fn windows_of_a_clip_show_every_bit_of_the_whole_scene() {
    let _device = gpu();
    let mut splats = clip(20_000, 0.02);
    let mut random = Random::new(3);
    random::poison(&mut splats, &mut random, 1e-4);
    let [mut whole, mut windows] = whole_and_clip(&splats, Constants::default());
    // Over borders of windows, back and forth, before and after the clip.
    let times = [0.0, 0.031, 0.0625, 0.06251, 0.0624999, 0.5, 0.499_999_99, 1.0, 0.25, -0.3, -0.01, 1.04, 7.0];
    for time in times {
        let offset = View { time: time - 0.01, time_offset: 0.2, ..view() };
        for view in [at(time), offset] {
            let (expected, all) = whole.render(&view, Outputs::All).unwrap();
            let (found, report) = windows.render(&view, Outputs::All).unwrap();
            assert_same_frame(format_args!("at {time}"), &found, &expected);
            assert_eq!((report.active, report.visible), (all.active, all.visible), "at {time}");
            assert!(report.gaussians < all.gaussians / 3, "{} of {}", report.gaussians, all.gaussians);
        }
    }
    // What is asked of the scene as a whole is of all Gaussians, and pictures stay what they are.
    let (cotangents, _) = whole.render(&at(0.5), Outputs::All).unwrap();
    let [expected, found] = [&mut whole, &mut windows].map(|renderer| renderer.vjp(&at(0.5), &cotangents).unwrap());
    assert_eq!(found.0.params.opacity.len(), splats.len());
    assert_same("gradient of opacity", &found.0.params.opacity, &expected.0.params.opacity);
    let [expected, found] = [whole, windows].map(|mut renderer| renderer.render(&at(0.7), Outputs::Color).unwrap().0);
    assert_same_frame("after a gradient", &found, &expected);
}

#[test]
fn pictures_and_gradients_do_not_tell_in_which_blocks_gaussians_die() {
    let gpu = gpu();
    let mut splats = clip(3_000, 0.01);
    splats.motion[7].t_scale = f32::INFINITY;
    splats.motion[9].t_center = f32::NAN;
    splats.motion[11].t_scale = 60.0;
    // By time, so that most blocks are dead at any, and mixed, so that none is.
    let mut order: Vec<usize> = (500..splats.len()).collect();
    order.sort_by(|a, b| splats.motion[a - 500].t_center.total_cmp(&splats.motion[b - 500].t_center));
    let order: Vec<usize> = (0..500).chain(order).collect();
    let sorted = splats.in_order(&order);
    let [mut by_time, mut mixed] =
        [&sorted, &splats].map(|splats| Renderer::new(gpu.clone(), splats, Constants::default()).unwrap());
    for time in [0.0, 0.3, 0.31, 0.999, -0.5, 9.0] {
        let view = at(time);
        let (found, report) = by_time.render(&view, Outputs::All).unwrap();
        let (expected, other) = mixed.render(&view, Outputs::All).unwrap();
        assert_same_frame(format_args!("at {time}"), &found, &expected);
        assert_eq!(report.active, other.active, "at {time}");
        let [found, expected] =
            [&mut by_time, &mut mixed].map(|renderer| renderer.vjp(&view, &expected).unwrap().0.params);
        let expected = Splats { source_row: (0..splats.len() as u32).collect(), ..expected };
        assert_same_splats(format_args!("gradient at {time}"), &found, &expected.in_order(&order));
        if gpu.caps().timestamp_ns > 0.0 {
            let live = |renderer: &mut Renderer| renderer.profile(&view, Outputs::Color).unwrap().counters.live;
            let (few, all) = (live(&mut by_time), live(&mut mixed));
            assert!(few < 1_500.0 && (time != 0.3 || all > 3_400.0), "{few} and {all} live at {time}");
        }
    }
}

/// Gaussians are projected at all times.
fn unculled() -> Knobs {
    Knobs { culls: Culls { time_cull: false, ..Culls::default() }, ..Knobs::default() }
}

#[test]
fn windows_follow_what_is_left_out_of_time_and_are_none_where_they_do_not_pay() {
    let _device = gpu();
    let splats = clip(20_000, 0.02);
    for temporal_cut in [0.0, 0.3] {
        let knobs = Knobs { temporal_cut, ..Knobs::default() };
        let [mut whole, mut windows] = whole_and_clip(&splats, knobs.on(Constants::default()));
        let [expected, found] = [&mut whole, &mut windows].map(|r| r.render(&at(0.3), Outputs::Color).unwrap());
        assert_same_frame(format_args!("a cut of {temporal_cut}"), &found.0, &expected.0);
        assert!(found.1.gaussians < expected.1.gaussians / 3);
    }
    let always = unculled().on(Constants::default());
    for (splats, constants) in
        [(splats, always), (clip(2_000, 0.02), Constants::default()), (clip(20_000, 2.0), Constants::default())]
    {
        let [_, mut windows] = whole_and_clip(&splats, constants);
        let (_, report) = windows.render(&at(0.5), Outputs::Color).unwrap();
        assert_eq!(report.gaussians, splats.len() as u64);
    }
}

#[test]
fn the_work_of_a_frame_does_not_grow_with_the_length_of_the_clip() {
    let _device = gpu();
    // Four times the frames at equal live Gaussians: as many more, which live for a quarter of the clip's time.
    let work = |n: usize, tau: f64| {
        let mut renderer = Renderer::of_clip(gpu().clone(), Arc::new(clip(n, tau)), Constants::default()).unwrap();
        let reports = (0..8).map(|k| renderer.draw(&at(0.31 + 0.05 * f64::from(k)), Outputs::Color).unwrap());
        reports.fold([0, 0, 0], |[a, b, c], r| [a + r.gaussians, b + r.active, c + r.intersections])
    };
    let (short, long) = (work(20_000, 0.04), work(80_000, 0.01));
    println!("on the device, active, intersections: {short:?}, {long:?} in a clip four times as long");
    for (short, long) in short.into_iter().zip(long) {
        assert!((long as f64 / short as f64 - 1.0).abs() < 0.1, "{short}, {long}");
    }
}

#[test]
fn pictures_that_follow_one_another_are_those_that_are_waited_for() {
    let _device = gpu();
    let splats = clip(20_000, 0.02);
    let mut views: Vec<View> = (0..12).map(|k| at(0.4 + 0.02 * f64::from(k))).collect();
    views[4] = with(views[4].clone(), |of| (of.width, of.height) = (41, 30));
    views[7] = with(views[7].clone(), |of| (of.fx, of.fy) = (500.0, 500.0));
    let alone: Vec<(Frame, FrameReport)> = {
        let mut renderer = Renderer::new(gpu().clone(), &splats, Constants::default()).unwrap();
        views.iter().map(|view| renderer.render(view, Outputs::All).unwrap()).collect()
    };
    let [whole, windows] = whole_and_clip(&splats, Constants::default());
    for mut renderer in [whole, windows] {
        // There is no room: each of the first ones is rendered again while the next one is on its way.
        renderer.limit_intersections(1);
        let mut n = 0;
        let stream = renderer.stream(views.clone(), Outputs::All, Destination::Host, |view, frame, report| {
            assert_eq!((view.time, report.intersections), (views[n].time, alone[n].1.intersections));
            assert_same_frame(format_args!("picture {n}"), &frame, &alone[n].0);
            n += 1;
            ivv::Result::Ok(true)
        });
        stream.unwrap();
        assert_eq!(n, views.len());
        let mut n = 0;
        let stream = renderer.stream(views.clone(), Outputs::Color, Destination::Device, |_, frame, _| {
            assert!(frame.color.is_empty());
            n += 1;
            ivv::Result::Ok(n < 3)
        });
        stream.unwrap();
        assert_eq!(n, 3, "whoever has enough ends it");
    }
}

#[test]
fn gaussians_are_there_from_when_up_to_when_their_span_says() {
    let _device = gpu();
    let (all, few) = ([0.25, 0.2499, 0.26, 0.5, 0.9, -0.5, 0.25], [0.5, 0.25, 0.9]);
    // Of 300 nothing but the spans asks for windows.
    for (n, times) in [(300, &all[..]), (20_000, &few)] {
        let mut splats = clip(n, 0.3);
        let mut random = Random::new(9);
        // Some borders are times of pictures.
        let borders = [f32::NEG_INFINITY, 0.25, 0.26, 0.5, 0.75, f32::INFINITY];
        let border = |random: &mut Random| random.uniform(0.0, 5.999) as usize;
        splats.span = (0..n)
            .map(|_| [0, 0].map(|_| border(&mut random)))
            .map(|[a, b]| [borders[a.min(b)], borders[a.max(b)]])
            .collect();
        splats.check().unwrap();
        for knobs in [Knobs::default(), unculled()] {
            let constants = Constants { knobs, ..Constants::default() };
            let mut spans = Renderer::new(gpu().clone(), &splats, constants).unwrap();
            for &time in times {
                let there: Vec<usize> = (0..splats.len()).filter(|&i| splats.is_there(i, time)).collect();
                let alone = Splats { span: Vec::new(), ..splats.in_order(&there) };
                assert!(there.len() < splats.len());
                let (expected, all) =
                    Renderer::new(gpu().clone(), &alone, constants).unwrap().render(&at(time), Outputs::All).unwrap();
                let (found, report) = spans.render(&at(time), Outputs::All).unwrap();
                assert_same_frame(format_args!("{n} at {time}"), &found, &expected);
                assert_eq!(report.visible, all.visible);
            }
        }
        let mut renderer = Renderer::of_clip(gpu().clone(), Arc::new(splats), Constants::default()).unwrap();
        let (cotangents, _) = renderer.render(&at(0.5), Outputs::All).unwrap();
        let refused = renderer.vjp(&at(0.5), &cotangents).map(|_| ()).unwrap_err().to_string();
        assert!(refused.contains("appear or disappear at once"), "{refused}");
    }
}
