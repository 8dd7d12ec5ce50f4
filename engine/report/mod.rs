//! What all reports are made of: plots as SVG, and text for HTML.

mod chart;
mod plot;

pub(crate) use chart::{Chart, Line, Panel, Row};
pub(crate) use plot::{Bar, Plot, Series, bars, escape};

/// The style sheet of every page.
pub(crate) const STYLE: &str = include_str!("style.css");
