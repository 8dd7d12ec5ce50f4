use super::page::escape;
use std::fmt::Write;

/// The first columns are text, the others numbers.
#[derive(Clone, Debug)]
pub struct Table {
    pub n_text: usize,
    pub heads: Vec<String>,
    pub rows: Vec<Vec<String>>,
}

impl Table {
    pub fn new(heads: &[&str], rows: impl IntoIterator<Item = Vec<String>>) -> Self {
        Table {
            n_text: 1,
            heads: heads.iter().map(|head| (*head).to_owned()).collect(),
            rows: rows.into_iter().collect(),
        }
    }

    pub fn with_text(self, n_text: usize) -> Self {
        Table { n_text, ..self }
    }

    pub fn html(&self) -> String {
        self.html_marked(|_| false)
    }

    pub fn html_marked(&self, is_marked: impl Fn(usize) -> bool) -> String {
        let line = |cells: &[String], tag: &str| -> String {
            let class = |column: usize| if column < self.n_text { "" } else { " class=\"n\"" };
            let cell = |(k, cell): (usize, &String)| format!("<{tag}{}>{}</{tag}>", class(k), escape(cell));
            cells.iter().enumerate().map(cell).collect()
        };
        let mut html = format!("<div class=\"scroll\"><table>\n<tr>{}</tr>\n", line(&self.heads, "th"));
        for (index, row) in self.rows.iter().enumerate() {
            let class = if is_marked(index) { " class=\"changed\"" } else { "" };
            let _ = writeln!(html, "<tr{class}>{}</tr>", line(row, "td"));
        }
        html + "</table></div>\n"
    }

    /// Behind a fold; empty where there is no row.
    pub fn folded(&self, title: &str) -> String {
        if self.rows.is_empty() {
            return String::new();
        }
        format!("<details><summary>{}</summary>\n{}</details>\n", escape(title), self.html())
    }

    pub fn markdown(&self) -> String {
        let line = |cells: &[String]| {
            let cells: Vec<String> = cells.iter().map(|cell| cell.replace('|', "\\|")).collect();
            format!("| {} |\n", cells.join(" | "))
        };
        let rule: Vec<&str> =
            (0..self.heads.len()).map(|column| if column < self.n_text { "---" } else { "---:" }).collect();
        let rows: String = self.rows.iter().map(|row| line(row)).collect();
        format!("{}| {} |\n{rows}", line(&self.heads), rule.join(" | "))
    }

    /// For a terminal.
    pub fn plain(&self) -> String {
        let all = || [&self.heads].into_iter().chain(&self.rows);
        let width = |column: usize| all().map(|row| row[column].chars().count()).max().unwrap_or(0);
        let widths: Vec<usize> = (0..self.heads.len()).map(width).collect();
        let mut text = String::new();
        for row in all().filter(|row| row.iter().any(|cell| !cell.is_empty())) {
            let cells = row.iter().zip(&widths).enumerate().map(|(column, (cell, width))| {
                let gap = if column == 0 { "" } else { "  " };
                if column < self.n_text { format!("{gap}{cell:<width$}") } else { format!("{gap}{cell:>width$}") }
            });
            let _ = writeln!(text, "  {}", cells.collect::<String>().trim_end());
        }
        text
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_same_rows_are_shown_three_ways() {
        let cells = |cells: [&str; 3]| cells.map(str::to_owned).to_vec();
        let table = Table::new(&["what", "n", "ms"], [cells(["a|<b>", "10", "1.5"]), cells(["c", "9", "12.25"])]);
        assert_eq!(
            table.markdown(),
            "| what | n | ms |\n| --- | ---: | ---: |\n| a\\|<b> | 10 | 1.5 |\n| c | 9 | 12.25 |\n"
        );
        assert_eq!(table.plain(), "  what    n     ms\n  a|<b>  10    1.5\n  c       9  12.25\n");
        let html = table.html_marked(|row| row == 1);
        assert!(html.contains("<tr><td>a|&lt;b&gt;</td><td class=\"n\">10</td>"), "{html}");
        assert!(html.contains("<tr class=\"changed\"><td>c</td>"), "{html}");
        assert_eq!(Table::new(&["", ""], [cells(["a", "1", ""])[..2].to_vec()]).plain(), "  a  1\n");
        let text = table.clone().with_text(2);
        assert!(text.markdown().contains("| --- | --- | ---: |") && text.html().contains("<td>10</td>"));
        assert!(table.folded("more").starts_with("<details>") && Table::new(&["what"], []).folded("more").is_empty());
    }
}
