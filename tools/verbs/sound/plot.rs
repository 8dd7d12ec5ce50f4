//! Curves over time as an SVG.

use ivv::report::{Axis, Chart, Mark, Panel, Row, Series};

/// Width and height of a panel.
const SIZE: [f64; 2] = [720.0, 190.0];

/// Dots over one time axis: of each panel what it shows and in which unit, and (seconds, value).
pub fn plot(curves: &[(&str, Vec<[f64; 2]>)]) -> String {
    let times = || curves.iter().flat_map(|(_, points)| points).map(|point| point[0]);
    let [from, to] = ivv::report::statistics::range(times());
    let row = |(title, points): &(&str, Vec<[f64; 2]>)| {
        let both_signs = points.iter().flat_map(|point| [point[1], -point[1]]);
        let marks = points.iter().map(|at| Mark { at: *at, radius: 1.5, ..Mark::default() }).collect();
        let panel = Panel {
            title: (*title).to_owned(),
            margin: [60.0, 24.0, 20.0, 36.0],
            x: if from < to { Axis::between("seconds", from, to) } else { Axis::around("seconds", times(), 1.0) },
            y: Axis::around("", both_signs, 1e-3),
            series: vec![Series { colour: Some(0), is_joined: false, marks }],
            notes: Vec::new(),
            list: Vec::new(),
        };
        Row { heading: String::new(), panels: vec![panel] }
    };
    Chart { panel: SIZE, legend: Vec::new(), rows: curves.iter().map(row).collect() }.svg()
}
