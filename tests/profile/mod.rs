//! Profiles: limits, traces, and dispatches that are dumped and run again.

mod command;
mod compare;
mod estimate;
mod sweep;

use crate::adversary::rounds_otherwise;
pub use crate::common::folder::Folder;
use crate::common::prelude::*;
use crate::common::random;
use ivv::Error;
use ivv::internals::gpu::table::{Cost, Count};
use ivv::internals::gpu::{Dispatch, PassTime, kernel_named};
use ivv::internals::profile::{
    Bound, Difference, FrameTimes, Moment, Peaks, Replay, read_dispatch, trace, write_dispatch,
};

#[test]
fn of_the_last_frames_it_knows_the_rate_the_quantiles_and_the_slowest_passes() {
    let pass = |label: &str, ms: f64| PassTime { label: label.to_owned(), begin_ns: 0.0, ns: 1e6 * ms };
    let report = |times: Vec<PassTime>| FrameReport { times, ..FrameReport::default() };
    let mut lately = FrameTimes::default();
    assert!(lately.rate() == 0.0 && lately.quantile(0.5).is_nan() && lately.slowest(3).is_empty());
    // Twice in the frame, so it counts twice, from the first frame on.
    lately.add(9.0, None, report(vec![pass("blend", 2.0), pass("sort", 3.0), pass("blend", 2.0)]));
    let near = |found: &[(&str, f64)], expected: &[(&str, f64)]| {
        let is_near = |(a, b): (&(&str, f64), &(&str, f64))| a.0 == b.0 && (a.1 - b.1).abs() < 1e-9;
        assert!(found.len() == expected.len() && found.iter().zip(expected).all(is_near), "{found:?}");
    };
    near(&lately.slowest(3), &[("blend", 4.0), ("sort", 3.0)]);
    // Of the newest frame a tenth.
    lately.add(1.0, Some(20.0), report(vec![pass("blend", 3.0), pass("blend", 3.0), pass("cull", 1.0)]));
    near(&lately.slowest(2), &[("blend", 4.2), ("sort", 2.7)]);
    near(&lately.slowest(9), &[("blend", 4.2), ("sort", 2.7), ("cull", 1.0)]);
    assert_eq!((lately.rate(), lately.quantile(0.5), lately.quantile(1.0)), (50.0, 5.0, 9.0));
    // What comes no more is forgotten, and so are old frames.
    for _ in 0..2 * FrameTimes::FRAMES {
        lately.add(2.0, Some(40.0), report(vec![pass("cull", 1.0)]));
    }
    near(&lately.slowest(9), &[("cull", 1.0)]);
    assert_eq!((lately.ms.len(), lately.rate(), lately.quantile(1.0)), (FrameTimes::FRAMES, 25.0, 2.0));
}

#[test]
fn a_limit_is_the_slowest_resource_and_the_dispatches() {
    let peaks = Peaks { bytes: 1e9, flops: 4e9, exp2: 1e9, dispatch_ns: 100.0, ..Peaks::default() };
    let cost = |bytes, flops, exp2| Cost { bytes, flops, exp2, ..Cost::default() };
    assert_eq!(peaks.limit(&cost(1000.0, 1000.0, 10.0), 2.0), (1200.0, Bound::Bytes));
    assert_eq!(peaks.limit(&cost(1000.0, 8000.0, 10.0), 1.0), (2100.0, Bound::Flops));
    assert_eq!(peaks.limit(&cost(1000.0, 8000.0, 3000.0), 0.0), (3000.0, Bound::Exp2));
    assert_eq!(peaks.limit(&cost(50.0, 0.0, 0.0), 1.0), (150.0, Bound::Dispatch));
    // What was not measured binds nothing.
    assert_eq!(peaks.limit(&Cost { atomics: 1e9, ..Cost::default() }, 1.0), (100.0, Bound::Dispatch));
}

#[test]
fn every_kernel_of_a_frame_or_a_step_has_a_model_of_its_cost() {
    let is_outside = |file: &str| file.starts_with("probe/") || file.starts_with("density/density_");
    for row in KERNELS.iter().filter(|row| !is_outside(row.file)) {
        let terms = row.family.cost.unwrap_or_else(|| panic!("{}: the table has no model of its cost", row.name))(row);
        let mut sum = Cost::default();
        terms.iter().for_each(|term| sum.add(&term.cost, 1.0));
        assert!(row.count == Count::Dispatches || sum.bytes + sum.flops > 0.0, "{}: costs nothing", row.name);
    }
}

#[test]
fn pairs_counted_on_the_host_are_those_of_the_reference() {
    let gpu = gpu();
    let (splats, view) = (random::scene(9, 300, 0), random::view());
    let mut renderer = Renderer::new(gpu.clone(), &splats, Constants::default()).unwrap();
    let report = renderer.profile(&view, Outputs::Color).unwrap();
    if report.passes.is_empty() {
        crate::common::notes::skip("the device has no timestamps");
        return;
    }
    let reference = ivv::internals::reference::render_f64(&splats, &view, &Constants::default());
    let added: u64 = reference.n_contributing.iter().map(|n| u64::from(*n)).sum();
    let counters = &report.counters;
    assert!(added > 1000, "{added}");
    let off = (counters.added - added as f64).abs();
    assert!(off <= 1e-3 * added as f64, "{} counted, {added} in the reference", counters.added);
    assert!(counters.evaluated >= counters.added && counters.evaluated <= 256.0 * counters.intersections);
    assert_eq!(counters.pixels, f64::from(view.intrinsics.width * view.intrinsics.height));
    let blend = report.passes.iter().find(|pass| pass.label.starts_with("blend/blend_fwd")).unwrap();
    assert_eq!((blend.units, blend.dispatches), (counters.intersections, 1));
    assert_eq!(blend.cost.exp2, counters.evaluated);
}

#[test]
fn a_trace_has_the_host_above_the_device_and_ends_with_it() {
    let pass = |label: &str, begin_ns: f64, ns: f64| PassTime { label: label.to_owned(), begin_ns, ns };
    let moment = Moment {
        name: "submit and wait".to_owned(),
        begin: 1.0,
        seconds: 0.5,
        passes: vec![pass("cull/fill", 0.0, 1e6), pass("blend/blend_fwd_p8", 2e6, 3e6)],
    };
    let text = serde_json::to_string(&trace("some device", &[moment])).unwrap();
    let value: serde_json::Value = serde_json::from_str(&text).unwrap();
    let events = value["traceEvents"].as_array().unwrap();
    let names: Vec<&str> =
        events.iter().filter(|e| e["ph"] == "M").map(|e| e["args"]["name"].as_str().unwrap()).collect();
    assert_eq!(names, ["host", "some device"]);
    let spans: Vec<_> = events
        .iter()
        .filter(|event| event["ph"] == "X")
        .map(|e| {
            (
                e["name"].as_str().unwrap(),
                e["pid"].as_u64().unwrap(),
                e["ts"].as_f64().unwrap(),
                e["dur"].as_f64().unwrap(),
            )
        })
        .collect();
    assert_eq!(spans.len(), 3);
    assert_eq!(spans[0], ("submit and wait", 0, 1e6, 5e5));
    assert_eq!((spans[1].0, spans[1].1, spans[2].0, spans[2].1), ("fill", 1, "blend_fwd_p8", 1));
    // The last pass ends with the waiting; the others keep their distance to it.
    assert!((spans[2].2 + spans[2].3 - 1.5e6).abs() < 1e-3 && (spans[2].2 - spans[1].2 - 2000.0).abs() < 1e-3);
}

#[test]
fn the_pass_that_ends_last_ends_with_the_host_though_another_was_recorded_behind_it() {
    let pass = |label: &str, begin_ns: f64, ns: f64| PassTime { label: label.to_owned(), begin_ns, ns };
    let passes = vec![pass("sort/long", 0.0, 9e5), pass("fill/short", 1e5, 1e5)];
    let value = trace("some device", &[Moment { name: "wait".to_owned(), begin: 0.0, seconds: 1e-3, passes }]);
    let spans = value["traceEvents"].as_array().unwrap().iter().filter(|event| event["ph"] == "X");
    let ends: Vec<f64> = spans.map(|span| span["ts"].as_f64().unwrap() + span["dur"].as_f64().unwrap()).collect();
    // Of the host, of the long pass and of the short one, microseconds.
    let expected = [1000.0, 1000.0, 300.0];
    assert!(ends.iter().zip(expected).all(|(end, expected)| (end - expected).abs() < 1e-6), "{ends:?}");
    assert_eq!(ends.len(), 3);
}

pub fn dumped() -> Dispatch {
    let gpu = gpu();
    let mut renderer = Renderer::new(gpu.clone(), &random::scene(11, 200, 0), Constants::default()).unwrap();
    let pixels =
        if gpu.caps().kind == ivv::internals::vk::DeviceKind::Cpu && gpu.caps().subgroup_size <= 32 { 8 } else { 4 };
    let kernel = format!("blend_fwd_p{pixels}");
    assert!(renderer.dump(&random::view(), Outputs::All, "blend_bwd_p8").unwrap().is_none(), "a picture has no such");
    let mut dispatch = renderer.dump(&random::view(), Outputs::All, &kernel).unwrap().expect("the blend ran");
    // The picture was there already, from the frame that the lists grew in.
    for image in dispatch.bindings.iter_mut().filter(|bound| bound.name.starts_with("image")) {
        image.before.fill(0);
    }
    dispatch
}

#[test]
fn a_dumped_dispatch_gives_the_same_bits_again_and_a_variant_those_that_it_writes() {
    let Some(gpu) = timed() else { return };
    let folder = Folder::new("replay");
    let file = folder.file("blend.dispatch");
    let dispatch = dumped();
    let image = dispatch.bindings.iter().find(|bound| bound.name == "image0").unwrap();
    let after = image.after.as_ref().unwrap();
    assert!(image.before != *after && after.iter().any(|byte| *byte != 0), "the picture is not empty");
    write_dispatch(&file, &dispatch, &gpu).unwrap();
    let (read, kernel) = read_dispatch(&file).unwrap();
    assert_eq!((&read, kernel.name), (&dispatch, dispatch.kernel.as_str()));
    let variant = kernel_named(&kernel.name.replace("fwd", "fwd_color")).unwrap();
    // The variant writes no depth and no flow, so these stay as the dump has them before.
    let mut flat = read.clone();
    let extra = flat.bindings.iter_mut().find(|bound| bound.name == "image1").unwrap();
    extra.before = extra.after.clone().unwrap();
    let otherwise = rounds_otherwise("a variant has the bits of the dumped kernel");
    for (kernel, dispatch) in [(kernel, &read), (variant, &flat)].into_iter().take(if otherwise { 1 } else { 2 }) {
        let lines = Replay::new(&gpu, dispatch).unwrap().run(&[kernel], 3).unwrap();
        assert_eq!(lines[0].from_dumped, Difference::default(), "{}", kernel.name);
        assert!(lines[0].median_ns > 0.0 && lines[0].mad_ns >= 0.0 && lines[0].ratio.median == 1.0);
    }
    let lines = Replay::new(&gpu, &read).unwrap().run(&[variant], 1).unwrap();
    assert!(lines[0].from_dumped.words > 100, "the variant wrote depth and flow");
    let stranger = kernel_named("compact").unwrap();
    assert!(Replay::new(&gpu, &read).unwrap().run(&[stranger], 1).is_err());
    // Another picture is told from the dumped one.
    let mut other = read.clone();
    let image = other.bindings.iter_mut().find(|bound| bound.name == "image0").unwrap();
    image.after.as_mut().unwrap()[..4].copy_from_slice(&9f32.to_le_bytes());
    let lines = Replay::new(&gpu, &other).unwrap().run(&[kernel], 1).unwrap();
    let Difference { words, max_abs, max_rel } = lines[0].from_dumped;
    assert!(words == 1 && max_abs > 7.0 && max_abs <= 9.0 && max_rel > 0.7, "{:?}", lines[0].from_dumped);
}

#[test]
fn a_damaged_dump_is_refused_with_what_is_wrong() {
    let folder = Folder::new("damage");
    let file = folder.file("blend.dispatch");
    write_dispatch(&file, &dumped(), &gpu()).unwrap();
    let good = std::fs::read(&file).unwrap();
    assert!(read_dispatch(&file).is_ok());
    let fault = |bytes: &[u8]| {
        std::fs::write(&file, bytes).unwrap();
        match read_dispatch(&file) {
            Err(Error::Data { reason, remedy, .. }) => {
                assert!(remedy.contains("--dump"), "{remedy}");
                reason
            }
            Err(other) => panic!("{other}"),
            Ok(_) => panic!("was read"),
        }
    };
    fault(&[]);
    fault(&good[..good.len() - 1]);
    fault(&good[..20]);
    let mut flipped = good.clone();
    *flipped.last_mut().unwrap() ^= 1;
    assert!(fault(&flipped).contains("other bytes"));
    // The header's text, edited in place.
    let edited = |from: &str, to: &str| {
        assert_eq!(from.len(), to.len());
        let mut bytes = good.clone();
        let at = bytes.windows(from.len()).position(|window| window == from.as_bytes()).expect(from);
        bytes[at..at + to.len()].copy_from_slice(to.as_bytes());
        bytes
    };
    assert!(fault(&edited("blend_fwd_p", "blend_fwx_p")).contains("there is not"));
    assert!(fault(&edited("tile_order", "tile_ordex")).contains("bindings"));
    assert!(read_dispatch(Path::new("/nowhere/at.dispatch")).is_err());
}
