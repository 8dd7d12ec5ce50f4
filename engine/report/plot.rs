//! Plots as SVG. Axes, ticks, marks and legends are drawn here, all in one way; what differs from plot to plot is data.

use super::axis::Axis;
use super::page::escape;
use std::fmt::Write;

const STYLE: &str = include_str!("plot.css");
/// In plot.css.
const COLOURS: usize = 8;
/// Heights of a legend's line and of a heading.
const LINE: f64 = 18.0;
const HEADING: f64 = 24.0;

#[derive(Clone, Debug, Default)]
pub struct Chart {
    /// Width and height.
    pub panel: [f64; 2],
    /// By colour; may be empty.
    pub legend: Vec<String>,
    pub rows: Vec<Row>,
}

#[derive(Clone, Debug)]
pub struct Row {
    /// May be empty.
    pub heading: String,
    pub panels: Vec<Panel>,
}

#[derive(Clone, Debug)]
pub struct Panel {
    pub title: String,
    /// Left, top, right, bottom.
    pub margin: [f64; 4],
    pub x: Axis,
    pub y: Axis,
    /// The last on top.
    pub series: Vec<Series>,
    pub notes: Vec<Note>,
    /// Lines of text right of the axes.
    pub list: Vec<String>,
}

#[derive(Clone, Debug)]
pub struct Series {
    /// None is grey.
    pub colour: Option<usize>,
    pub is_joined: bool,
    pub marks: Vec<Mark>,
}

#[derive(Clone, Debug, Default)]
pub struct Mark {
    pub at: [f64; 2],
    /// Ends of a vertical line.
    pub range: Option<[f64; 2]>,
    /// 0 for no circle.
    pub radius: f64,
    /// Tooltip; may be empty.
    pub title: String,
}

#[derive(Clone, Debug)]
pub struct Note {
    pub at: [f64; 2],
    /// Right and down, in units of the picture.
    pub shift: [f64; 2],
    pub anchor: Anchor,
    pub look: Look,
    pub text: String,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Anchor {
    Start,
    Middle,
    End,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Look {
    Plain,
    /// In a circle.
    Number,
}

impl Chart {
    pub fn of(panel: Panel, size: [f64; 2]) -> Self {
        Chart { panel: size, legend: Vec::new(), rows: vec![Row { heading: String::new(), panels: vec![panel] }] }
    }

    /// A file.
    pub fn svg(&self) -> String {
        let ([w, h], body) = self.draw();
        format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {w} {h}\" width=\"{w}\" height=\"{h}\">\n\
             <style>\n{STYLE}</style>\n{body}</svg>\n"
        )
    }

    /// A part of a page.
    pub fn inline(&self, id: &str, label: &str) -> String {
        let (size, body) = self.draw();
        inline(id, label, size, &body)
    }

    fn draw(&self) -> ([f64; 2], String) {
        let [width, height] = self.panel;
        let columns = self.rows.iter().map(|row| row.panels.len()).max().unwrap_or(0).max(1);
        let mut svg = String::new();
        let mut top = if self.legend.is_empty() { 0.0 } else { 8.0 + LINE * self.legend.len() as f64 };
        for (index, name) in self.legend.iter().enumerate() {
            let (y, class) = (6.0 + LINE * index as f64, colour(Some(index)));
            let _ = writeln!(svg, "<rect class=\"key {class}\" x=\"10\" y=\"{y}\" width=\"12\" height=\"12\"/>");
            svg += &text([28.0, y + 10.0], Anchor::Start, "", name);
        }
        for row in &self.rows {
            if !row.heading.is_empty() {
                svg += &text([10.0, top + 16.0], Anchor::Start, "heading", &row.heading);
                top += HEADING;
            }
            for (column, panel) in row.panels.iter().enumerate() {
                let x = width * column as f64;
                let _ = write!(svg, "<g transform=\"translate({x} {top})\">\n{}</g>\n", panel.draw(self.panel));
            }
            top += height;
        }
        ([width * columns as f64, top], svg)
    }
}

impl Panel {
    fn draw(&self, size: [f64; 2]) -> String {
        let [left, top] = [self.margin[0], self.margin[1]];
        let (right, bottom) = (size[0] - self.margin[2], size[1] - self.margin[3]);
        let x = |value: f64| left + self.x.part(value) * (right - left);
        let y = |value: f64| bottom - self.y.part(value) * (bottom - top);
        let mut svg = String::new();
        if !self.title.is_empty() {
            svg += &text([left, top - 8.0], Anchor::Start, "title", &self.title);
        }
        let mut line = |class: &str, [x1, x2]: [f64; 2], [y1, y2]: [f64; 2]| {
            let _ =
                writeln!(svg, "<line class=\"{class}\" x1=\"{x1:.1}\" x2=\"{x2:.1}\" y1=\"{y1:.1}\" y2=\"{y2:.1}\"/>");
        };
        for at in self.y.ticks().map(|(part, _)| bottom - part * (bottom - top)) {
            line("grid", [left, right], [at, at]);
        }
        for at in self.x.ticks().map(|(part, _)| left + part * (right - left)) {
            line("grid", [at, at], [top, bottom]);
        }
        line("axis", [left, right], [bottom, bottom]);
        for (part, name) in self.y.ticks() {
            svg += &text([left - 6.0, bottom - part * (bottom - top) + 4.0], Anchor::End, "", name);
        }
        for (part, name) in self.x.ticks() {
            svg += &text([left + part * (right - left), bottom + 15.0], Anchor::Middle, "", name);
        }
        if !self.x.label.is_empty() {
            svg += &text([right, bottom + 30.0], Anchor::End, "", &self.x.label);
        }
        for series in &self.series {
            let class = colour(series.colour);
            if series.is_joined {
                let at: Vec<String> =
                    series.marks.iter().map(|mark| format!("{:.1},{:.1}", x(mark.at[0]), y(mark.at[1]))).collect();
                let _ = writeln!(svg, "<polyline class=\"line {class}\" points=\"{}\"/>", at.join(" "));
            }
            // Loose dots may overlap.
            let class = if series.is_joined { class } else { class + " loose" };
            svg.extend(series.marks.iter().map(|mark| mark.draw(&class, &x, &y)));
        }
        for Note { at, shift, anchor, look, text: words } in &self.notes {
            let class = match look {
                Look::Plain => "",
                Look::Number => "number",
            };
            svg += &text([x(at[0]) + shift[0], y(at[1]) + shift[1]], *anchor, class, words);
        }
        for (index, words) in self.list.iter().enumerate() {
            svg += &text([right + 30.0, top + LINE * index as f64], Anchor::Start, "", words);
        }
        svg
    }
}

impl Mark {
    fn draw(&self, class: &str, x: &impl Fn(f64) -> f64, y: &impl Fn(f64) -> f64) -> String {
        let (cx, cy) = (x(self.at[0]), y(self.at[1]));
        let mut svg = String::new();
        if let Some(ends) = self.range {
            let [y1, y2] = ends.map(y);
            let _ = writeln!(
                svg,
                "<line class=\"range {class}\" x1=\"{cx:.1}\" x2=\"{cx:.1}\" y1=\"{y1:.1}\" y2=\"{y2:.1}\"/>"
            );
        }
        if self.radius > 0.0 {
            let title = match self.title.as_str() {
                "" => String::new(),
                title => format!("<title>{}</title>", escape(title)),
            };
            let r = self.radius;
            let _ = writeln!(
                svg,
                "<circle class=\"mark {class}\" cx=\"{cx:.1}\" cy=\"{cy:.1}\" r=\"{r:.1}\">{title}</circle>"
            );
        }
        svg
    }
}

fn colour(index: Option<usize>) -> String {
    index.map_or("grey".to_owned(), |index| format!("s{}", index % COLOURS))
}

pub(super) fn text([x, y]: [f64; 2], anchor: Anchor, class: &str, words: &str) -> String {
    let class = if class.is_empty() { String::new() } else { format!(" class=\"{class}\"") };
    let anchor = match anchor {
        Anchor::Start => "",
        Anchor::Middle => " text-anchor=\"middle\"",
        Anchor::End => " text-anchor=\"end\"",
    };
    format!("<text{class} x=\"{x:.1}\" y=\"{y:.1}\"{anchor}>{}</text>\n", escape(words))
}

pub(super) fn inline(id: &str, label: &str, [w, h]: [f64; 2], body: &str) -> String {
    let label = escape(label);
    format!("<svg id=\"{id}\" viewBox=\"0 0 {w} {h}\" role=\"img\" aria-label=\"{label}\">\n{body}</svg>\n")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn marks_lines_and_words_are_where_the_axes_put_them() {
        let mark = |x: f64, y: f64| Mark { at: [x, y], radius: 3.0, title: "<m>".to_owned(), ..Mark::default() };
        let marks = vec![mark(0.0, 0.0), Mark { range: Some([0.0, 2.0]), ..mark(5.0, 1.0) }];
        let panel = Panel {
            title: "a & b".to_owned(),
            margin: [20.0, 30.0, 0.0, 10.0],
            x: Axis::between("x", 0.0, 10.0),
            y: Axis::between("", 0.0, 2.0),
            series: vec![
                Series { colour: Some(9), is_joined: true, marks },
                Series { colour: None, is_joined: false, marks: vec![Mark::default()] },
            ],
            notes: vec![Note {
                at: [5.0, 1.0],
                shift: [1.0, -2.0],
                anchor: Anchor::Middle,
                look: Look::Number,
                text: "here".to_owned(),
            }],
            list: vec!["aside".to_owned()],
        };
        let svg = Chart { legend: vec!["first".to_owned()], ..Chart::of(panel, [120.0, 140.0]) }.svg();
        for part in [
            "viewBox=\"0 0 120 166\"",
            "<g transform=\"translate(0 26)\">",
            ">a &amp; b</text>",
            "points=\"20.0,130.0 70.0,80.0\"",
            "<line class=\"range s1\" x1=\"70.0\" x2=\"70.0\" y1=\"130.0\" y2=\"30.0\"/>",
            "cx=\"70.0\" cy=\"80.0\" r=\"3.0\"><title>&lt;m&gt;</title>",
            "<text class=\"number\" x=\"71.0\" y=\"78.0\" text-anchor=\"middle\">here</text>",
            ">first</text>",
            ">aside</text>",
        ] {
            assert!(svg.contains(part), "{part}:\n{svg}");
        }
        assert_eq!((svg.matches("<circle").count(), svg.matches("<polyline").count()), (2, 1));
    }

    #[test]
    fn a_page_has_a_picture_without_a_style_of_its_own() {
        let inline = Chart::default().inline("a", "\"b\"");
        assert!(inline.starts_with("<svg id=\"a\"") && inline.contains("aria-label=\"&quot;b&quot;\""), "{inline}");
        assert!(!inline.contains("<style>") && !inline.contains("http"));
    }
}
