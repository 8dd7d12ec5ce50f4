//! Ablations as tables and as pictures.

use super::ablation::{Base, Measure, Study, StudyResult};
use crate::report::statistics::Estimate;
use crate::report::{Anchor, Axis, Chart, Look, Mark, Note, Panel, Series, Table};
use crate::words::count;
use std::fmt::Write;

/// Width of the picture, height of one of its rows, and room left of the axes, above, right and below.
const WIDTH: f64 = 640.0;
const ROW: f64 = 30.0;
const MARGIN: [f64; 4] = [170.0, 30.0, 80.0, 24.0];

impl StudyResult<'_> {
    /// A table in Markdown, the paper's figures in brackets.
    pub fn markdown(&self) -> String {
        let Study { title, measures, arms, .. } = self.study;
        let n_seeds = self.arms.iter().flat_map(|arm| &arm.values).map(Vec::len).max().unwrap_or(0);
        let of = if self.base == Base::Paper { ", the paper's weights and rates" } else { "" };
        let decimals = measures.last().map_or(2, |measure| measure.decimals().max(2));
        let rows = arms.iter().zip(&self.arms).enumerate().map(|(index, (arm, result))| {
            let mut row = vec![arm.name.to_owned()];
            row.extend(measures.iter().enumerate().map(|(k, measure)| {
                let own = result.values.get(k).and_then(|values| Estimate::new(values));
                let own = own.map_or("-".to_owned(), |own| format!("{:.*}", measure.decimals(), own.mean));
                let paper = arm.paper.get(k).filter(|paper| !paper.is_empty());
                own + &paper.map_or(String::new(), |paper| format!(" ({paper})"))
            }));
            let difference = self.difference(index).filter(|_| index > 0);
            row.push(difference.map_or(String::new(), |difference| difference.signed(decimals)));
            row
        });
        let heads = measures.iter().map(|measure| measure.title());
        let heads: Vec<&str> = [""].into_iter().chain(heads).chain(["difference"]).collect();
        let mut text = format!("### {title}{of}\n\n{}", Table::new(&heads, rows).markdown());
        let _ = writeln!(
            text,
            "\nMeans over {}; in brackets the paper's, of another capture. The difference is to the first row, \
             paired by seed, with its 95 % interval.",
            count(n_seeds, "seed")
        );
        if let Some(budget) = self.budget {
            let _ = writeln!(text, "Each arm may have {budget} Gaussians, twice as many as the largest start.");
        }
        if let (Some(trunk), true) = (&self.trunk, measures.contains(&Measure::Lpips)) {
            let _ = writeln!(text, "LPIPS is by {trunk}; the paper's is by AlexNet.");
        }
        text
    }

    /// The last measure of every arm as a picture: a dot per seed and a bar at the mean.
    pub fn svg(&self) -> String {
        let (measure, decimals) =
            self.study.measures.last().map_or(("", 2), |measure| (measure.title(), measure.decimals()));
        let values = |index: usize| self.arms[index].values.last().map_or(&[][..], Vec::as_slice);
        let rows = 0..self.study.arms.len().min(self.arms.len());
        let x = Axis::around("", rows.clone().flat_map(values).copied(), 1e-3);
        let [_, end] = x.ends();
        let dot = |row: usize| {
            values(row).iter().map(move |value| Mark { at: [*value, row as f64], radius: 4.0, ..Mark::default() })
        };
        let means = || rows.clone().filter_map(|row| Some((row as f64, Estimate::new(values(row))?.mean)));
        let bar =
            |(row, mean): (f64, f64)| Mark { at: [mean, row], range: Some([row - 0.3, row + 0.3]), ..Mark::default() };
        let series = |marks: Vec<Mark>| Series { colour: Some(0), is_joined: false, marks };
        let note = |(row, mean): (f64, f64)| Note {
            at: [end, row],
            shift: [16.0, 4.0],
            anchor: Anchor::Start,
            look: Look::Plain,
            text: format!("{mean:.decimals$}"),
        };
        let panel = Panel {
            title: format!("{}: {measure}", self.study.title),
            margin: MARGIN,
            y: Axis::rows(rows.clone().map(|row| self.study.arms[row].name.to_owned())),
            series: vec![series(rows.clone().flat_map(dot).collect()), series(means().map(bar).collect())],
            notes: means().map(note).collect(),
            list: Vec::new(),
            x,
        };
        Chart::of(panel, [WIDTH, MARGIN[1] + ROW * rows.len() as f64 + MARGIN[3]]).svg()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::study::STUDIES;
    use crate::study::studies::tests::result;

    #[test]
    fn tables_and_pictures_hold_every_arm() {
        let found = result([[10.0, 11.0, 12.0], [11.0; 3], [12.0; 3], [13.0; 3]]);
        let (table, svg) = (found.markdown(), found.svg());
        for arm in STUDIES[1].arms {
            assert!(table.contains(arm.name) && svg.contains(arm.name), "{}", arm.name);
        }
        assert!(table.contains("11.00 (29.93)") && table.contains("3 seeds"), "{table}");
        assert_eq!(svg.matches("<circle").count(), 12);
    }

    #[test]
    fn the_table_says_the_budget_of_all_arms_and_whose_features_lpips_compares() {
        let mut found = result([[10.0, 11.0, 12.0], [11.0; 3], [12.0; 3], [13.0; 3]]);
        (found.base, found.budget, found.trunk) = (Base::Paper, Some(48_000), Some("SqueezeNet 1.1".to_owned()));
        let table = found.markdown();
        for part in ["the paper's weights and rates", "48000 Gaussians", "LPIPS is by SqueezeNet 1.1"] {
            assert!(table.contains(part), "{part} is not in {table}");
        }
    }
}
