mod axis;
mod page;
mod plot;
pub mod statistics;
mod table;

pub use axis::Axis;
pub use page::{Bar, bars, escape, note, page, section};
pub use plot::{Anchor, Chart, Look, Mark, Note, Panel, Row, Series};
pub use table::Table;
