//! A sweep as Markdown and as a picture.

use super::exponent::Exponent;
use super::roofline::si;
use super::sweep::{Course, Grows, Point, Sweep};
use crate::report::{Axis, Chart, Mark, Panel, Row, Series, Table};
use std::fmt::Write;

/// Width and height of a plot, and room left of its axes, above, right and below.
const SIZE: [f64; 2] = [460.0, 320.0];
const MARGIN: [f64; 4] = [64.0, 36.0, 24.0, 48.0];

impl Grows {
    fn told(self) -> &'static str {
        match self {
            Grows::Frames => "The length of the clip; at each time as many Gaussians live",
            Grows::Cameras => "Cameras, each with its clock and its grid",
            Grows::Pixels => "Pixels of a picture of the same Gaussians",
            Grows::Gaussians => "Gaussians, all of them alive, that cover the picture equally often",
        }
    }
}

impl Course {
    fn table(&self) -> Table {
        let first = self.points.first();
        let times = |ms: f64, first: Option<f64>| format!("{:.2}", ms / first.unwrap_or(ms));
        let row = |point: &Point| {
            vec![
                format!("{}", point.size),
                format!("{}", point.gaussians),
                format!("{:.0}", point.active),
                format!("{:.0}", point.intersections),
                format!("{:.2}", point.step_ms),
                times(point.step_ms, first.map(|first| first.step_ms)),
                format!("{:.2}", point.frame_ms),
                times(point.frame_ms, first.map(|first| first.frame_ms)),
            ]
        };
        let heads = [
            self.grows.name(),
            "in the scene",
            "active",
            "pairs",
            "step, ms",
            "over the first",
            "frame, ms",
            "over the first",
        ];
        Table::new(&heads, self.points.iter().map(row)).with_text(0)
    }

    fn exponents(&self) -> String {
        let told = |exponent: &Option<Exponent>| exponent.map_or("unknown".to_owned(), |it| it.to_string());
        format!("step {}, frame {}", told(&self.step), told(&self.frame))
    }

    fn panel(&self) -> Panel {
        let series = |colour: usize, ms: fn(&Point) -> f64| {
            let mark = |point: &Point| Mark {
                at: [point.size, ms(point)],
                radius: 4.0,
                title: format!("{} {}: {:.2} ms", point.size, self.grows.name(), ms(point)),
                ..Mark::default()
            };
            Series { colour: Some(colour), is_joined: true, marks: self.points.iter().map(mark).collect() }
        };
        let times = self.points.iter().flat_map(|point| [point.step_ms, point.frame_ms]);
        Panel {
            title: format!("ms; {}", self.exponents()),
            margin: MARGIN,
            x: Axis::decades(self.grows.name(), self.points.iter().map(|point| point.size), si),
            y: Axis::decades("", times, |ms| ms.to_string()),
            series: vec![series(0, |point| point.step_ms), series(1, |point| point.frame_ms)],
            notes: Vec::new(),
            list: Vec::new(),
        }
    }
}

impl Sweep {
    pub fn markdown(&self) -> String {
        let Sweep { device, shaders, options, seconds, .. } = self;
        let adam = format!("{:?}", options.adam).to_lowercase();
        let mut text = format!(
            "{}, {}, subgroups of {}; kernels {shaders}; Adam `{adam}`; {seconds:.0} s.\n\n{MEANING}\n",
            device.name, device.driver, device.subgroup_size
        );
        for course in &self.courses {
            let _ = write!(text, "\n## {}\n\n", course.grows.told());
            let _ = write!(text, "Exponents: {}.\n\n{}", course.exponents(), course.table().markdown());
        }
        if !self.left_out.is_empty() {
            let _ = write!(text, "\n## Left out\n\n");
            self.left_out.iter().for_each(|what| text += &format!("- {what}\n"));
        }
        text
    }

    pub fn terminal(&self) -> String {
        let course = |course: &Course| {
            format!("{}\n{}exponents: {}\n", course.grows.told(), course.table().plain(), course.exponents())
        };
        let left_out = self.left_out.iter().map(|what| format!("left out: {what}\n"));
        self.courses.iter().map(course).chain(left_out).collect()
    }

    pub fn svg(&self) -> String {
        let drawn: Vec<Panel> =
            self.courses.iter().filter(|course| !course.points.is_empty()).map(Course::panel).collect();
        let row = |panels: &[Panel]| Row { heading: String::new(), panels: panels.to_vec() };
        Chart {
            panel: SIZE,
            legend: vec!["step".to_owned(), "frame".to_owned()],
            rows: drawn.chunks(2).map(row).collect(),
        }
        .svg()
    }
}

const MEANING: &str = "Each table has one thing grow and all else stay. An exponent is the slope of the line through the logarithms \
    of size and time, by least squares, with its standard error: 0 where the time stays, 1 where it grows in proportion. Steps are \
    those of `ivv train` with degree 3, clocks and grids, without priors and density control; frames stay on the device.";
