//! `train.jsonl`: one JSON object a line, each with its `kind` and `step`.

use crate::error::{Error, Result};
use crate::files::{read_text, write_atomic};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};

#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Kind {
    Step,
    Evaluation,
    Profile,
    Review,
    Fall,
}

#[derive(Clone, Debug, Default, PartialEq)]
pub struct Log {
    file: PathBuf,
    lines: Vec<Value>,
}

impl Log {
    /// The log in `folder`, with the lines of an earlier part of the run up to `step`; any other line is dropped.
    pub fn open(folder: &Path, step: u64) -> Self {
        let file = folder.join("train.jsonl");
        let text = if step > 0 { read_text(&file).unwrap_or_default() } else { String::new() };
        let lines = text.lines().filter_map(|line| serde_json::from_str::<Value>(line).ok());
        let lines = lines.filter(|line| line["step"].as_u64().is_some_and(|at| at <= step)).collect();
        Log { file, lines }
    }

    /// Appends a line with the fields of `of`, which must have a `step`, in the place of a line of the same kind and step.
    pub fn push(&mut self, kind: Kind, of: &impl serde::Serialize) -> Result<()> {
        let fault = |reason: String| Error::data(&self.file, "", reason, "this is a fault of the program");
        match serde_json::to_value(of).map_err(|e| fault(e.to_string()))? {
            Value::Object(mut line) if line.contains_key("step") => {
                line.insert("kind".to_owned(), json!(kind));
                let is_same = |other: &Value| other["kind"] == line["kind"] && other["step"] == line["step"];
                let recent =
                    self.lines.iter().rev().take_while(|other| other["step"].as_u64() >= line["step"].as_u64());
                if let Some(at) = recent.enumerate().find(|(_, other)| is_same(other)).map(|(at, _)| at) {
                    self.lines.remove(self.lines.len() - 1 - at);
                }
                self.lines.push(Value::Object(line));
                Ok(())
            }
            other => Err(fault(format!("`{other}` is no line"))),
        }
    }

    pub fn write(&self) -> Result<()> {
        write_atomic(&self.file, |to| {
            for line in &self.lines {
                serde_json::to_writer(&mut *to, line)?;
                writeln!(to)?;
            }
            Ok(())
        })
    }

    pub fn lines(&self, kind: Kind) -> impl Iterator<Item = &Value> {
        let kind = json!(kind);
        self.lines.iter().filter(move |line| line["kind"] == kind)
    }

    /// `key` of the lines of a kind against their steps, if it is a number.
    pub fn series(&self, kind: Kind, key: &str) -> Vec<[f64; 2]> {
        self.lines(kind).filter_map(|line| Some([line["step"].as_f64()?, line[key].as_f64()?])).collect()
    }
}
