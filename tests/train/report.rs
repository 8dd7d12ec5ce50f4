//! The report: well formed, complete, and in need of nothing but itself.

use super::scores_of;
use crate::common::prelude::*;
use ivv::internals::study::{Example, Report};
use ivv::internals::train::{CaptureSummary, Evaluation, Kind, Log, SceneScores, SceneSize, ViewScores};
use serde_json::json;

/// The tags of an HTML or SVG text balance, attributes are quoted, and every character reference is whole.
pub fn assert_well_formed(html: &str) {
    const VOID: [&str; 3] = ["!DOCTYPE", "meta", "img"];
    let mut open: Vec<&str> = Vec::new();
    // The style sheet is no markup.
    let (before, rest) = html.split_once("<style>").unwrap();
    let (style, after) = rest.split_once("</style>").unwrap();
    assert!(!style.contains('<') && style.matches('{').count() == style.matches('}').count());
    for part in [before, after].iter().flat_map(|text| text.split('<').skip(1)) {
        let (tag, text) = part.split_once('>').unwrap_or_else(|| panic!("a tag is not closed: {part:.80}"));
        assert!(!text.contains('>') && tag.matches('"').count() % 2 == 0, "{tag:.80}");
        for reference in text.split('&').skip(1) {
            assert!(["amp;", "lt;", "gt;", "quot;"].iter().any(|r| reference.starts_with(r)), "&{reference:.20}");
        }
        let name = tag.split([' ', '\n']).next().unwrap();
        match name.strip_prefix('/') {
            Some(name) => assert_eq!(open.pop(), Some(name)),
            None if tag.ends_with('/') || VOID.contains(&name) => {}
            None => open.push(name),
        }
    }
    assert_eq!(open, Vec::<&str>::new());
}

pub fn assert_self_contained(html: &str) {
    for forbidden in ["http:", "https:", "//cdn", "<script", "<link", "<iframe", "@import", "url(", "srcset", "href"] {
        assert!(!html.contains(forbidden), "{forbidden}");
    }
    assert!(html.split("src=\"").skip(1).all(|src| src.starts_with("data:image/png;base64,")));
}

pub fn plot<'a>(html: &'a str, id: &str) -> &'a str {
    let begin = html.find(&format!("<svg id=\"{id}\"")).unwrap_or_else(|| panic!("no plot {id}"));
    &html[begin..begin + html[begin..].find("</svg>").unwrap()]
}

fn run() -> Run {
    let held = CaptureSummary {
        cameras: 3,
        frames: 2,
        fps: 30.0,
        training_images: 4,
        test_images: 2,
        masks: 0,
        largest_image: [700, 4],
        points: 9,
    };
    let test_cameras = vec!["cam<1>".to_owned()];
    Run {
        viewpoints: Vec::new(),
        calibration: Default::default(),
        capture: "/captures/a & b".into(),
        capture_settings: Default::default(),
        test_cameras,
        world: Default::default(),
        constants: Constants::default(),
        held,
        fingerprints: None,
    }
}

fn scores() -> SceneScores {
    let scores = scores_of(20.0);
    let view = |frame| ViewScores {
        view: format!("cam<1>_{frame:05}"),
        camera: "cam<1>".to_owned(),
        frame,
        scores,
        render_ms: 2.0,
    };
    let evaluation = Evaluation::new(40, vec![view(0), view(1)]).unwrap();
    SceneScores::new(
        Path::new("scene.ply"),
        SceneSize::of(&ivv::internals::scene::demo().0),
        "a \"device\"",
        0.01,
        evaluation,
    )
}

fn html(name: &str, totals: &Value, log: &Log, scores: Option<&SceneScores>, examples: &[Example]) -> String {
    let file = std::env::temp_dir().join(format!("ivv-report-{name}-{}.html", std::process::id()));
    let (run, config) = (run(), Config { max_gaussians: 123_457, ..exact() });
    let report = Report { name: "a <run>", run: &run, config: &config, totals, log, scores, examples };
    report.write(&file).unwrap();
    let html = std::fs::read_to_string(&file).unwrap();
    std::fs::remove_file(&file).unwrap();
    assert_well_formed(&html);
    assert_self_contained(&html);
    html
}

#[test]
fn a_report_shows_everything_it_is_given() {
    let mut log = Log::open(Path::new("nowhere"), 0);
    for step in 1..=1000 {
        log.push(Kind::Step, &json!({ "step": step, "loss": 1.0 / f64::from(step), "gaussians": 7 })).unwrap();
    }
    for step in [100, 400, 700, 1000] {
        log.push(Kind::Evaluation, &json!({ "step": step, "psnr": 0.01 * f64::from(step), "views": [1, 2] })).unwrap();
    }
    let pass = |label: &str, ms: f64| json!({ "label": label, "dispatches": 1.0, "units": 1.0, "ms": ms });
    let totals = json!({
        "seconds_stepping": 3700.0, "seconds_per_step": 3.7, "steps": 1000, "peak_bytes": 1 << 20,
        "profile": { "steps": [100, 500], "passes": [
            pass("cull/a", 2.0), pass("blend/b", 3.0), pass("cull/c", 6.0),
        ] },
        "bytes_by_buffer": { "sh & more": 2 << 20 },
    });
    // 700 pixels wide, so that it is halved; one pixel is hidden by the mask.
    let mut truth = Picture::new(700, 4, vec![0xff80_8080; 2800]);
    truth.pixels[5] = 0;
    let render = Frame { width: 700, height: 4, color: vec![[0.5, f32::NAN, 2.0]; 2800], ..Frame::default() };
    let (scores, one) = (scores(), scores_of(20.0));
    let example = Example { view: "cam<1>_00001".to_owned(), why: "worst", scores: one, truth, render };
    let html = html("full", &totals, &log, Some(&scores), std::slice::from_ref(&example));

    assert_eq!(plot(&html, "plot-psnr").matches("<circle").count(), 4, "a mark per evaluation");
    let curve = plot(&html, "plot-loss").split("points=\"").nth(1).unwrap().split('"').next().unwrap();
    let n_points = curve.split(' ').count();
    assert!((100..=240).contains(&n_points), "{n_points} points of 1000");
    let sections = plot(&html, "plot-sections");
    assert_eq!(sections.matches("<rect").count(), 2, "passes of one section are one bar");
    assert!(sections.contains("8.00 ms, 73 %"), "{sections}");
    for told in [
        "cam&lt;1&gt;_00000",
        "cam&lt;1&gt;_00001",
        "the worst",
        "1 h 1 min",
        "/captures/a &amp; b",
        "<tr class=\"changed\"><td>max_gaussians</td><td>123457</td><td>500000</td></tr>",
        "sh &amp; more",
        "not rounded to 8 bits",
    ] {
        assert!(html.contains(told), "{told}");
    }
    assert_eq!(html.matches("data:image/png;base64,").count(), 3, "image, rendering, error");
    let png = |nth: usize| html.split("base64,").nth(nth).unwrap().split('"').next().unwrap();
    for (nth, pixel) in [(1, [128, 128, 128]), (2, [128, 0, 255])] {
        let decoded = image::load_from_memory(&unbase64(png(nth))).unwrap().into_rgb8();
        assert_eq!((decoded.dimensions(), decoded.get_pixel(300, 1).0), ((350, 2), pixel));
    }
}

#[test]
fn a_run_of_which_little_is_known_has_a_report_too() {
    let html = html("empty", &Value::Null, &Log::open(Path::new("nowhere"), 0), None, &[]);
    assert!(html.contains("No data.") && html.contains("nothing was scored") && !html.contains("<polyline"));
    let mut log = Log::open(Path::new("nowhere"), 0);
    log.push(Kind::Step, &json!({ "step": 1, "loss": f64::NAN, "l1": 0.25, "gaussians": 1e7 })).unwrap();
    log.push(Kind::Evaluation, &json!({ "step": 1, "psnr": 30.0 })).unwrap();
    let html = self::html("one", &json!({}), &log, Some(&scores()), &[]);
    assert!(!html.contains("NaN") && plot(&html, "plot-gaussians").contains("10M"));
    assert_eq!(plot(&html, "plot-psnr").matches("<circle").count(), 1);
}

fn unbase64(text: &str) -> Vec<u8> {
    let value = |c: u8| match c {
        b'A'..=b'Z' => c - b'A',
        b'a'..=b'z' => c - b'a' + 26,
        b'0'..=b'9' => c - b'0' + 52,
        b'+' => 62,
        _ => 63,
    };
    let mut bytes = Vec::new();
    for four in text.trim_end_matches('=').as_bytes().chunks(4) {
        let word = four.iter().fold(0u32, |word, c| word << 6 | u32::from(value(*c))) << (6 * (4 - four.len()));
        bytes.extend(&word.to_be_bytes()[1..four.len()]);
    }
    bytes
}
