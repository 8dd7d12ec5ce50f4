//! What a reader gives.

use std::collections::BTreeMap;

use crate::scene::Splats;

/// What is this project's own in a file, by name: how the scene is rendered.
pub type Own = BTreeMap<String, String>;

/// A scene as its file tells it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Imported {
    /// The Gaussians.
    pub splats: Splats,
    /// What the reader left out, guessed or converted: a sentence each, without the file's name.
    pub notes: Vec<String>,
    /// What is this project's own; none in a file of another program.
    pub own: Option<Own>,
}

impl From<Splats> for Imported {
    fn from(splats: Splats) -> Self {
        Imported { splats, ..Imported::default() }
    }
}

/// The note on a scene whose `tag` says that it was trained for a renderer that compensates for its blur.
pub(super) fn compensated(tag: &str) -> String {
    format!(
        "it was trained for a renderer that makes Gaussians fainter as blur makes them larger ({tag}); ivv does not, so thin and \
         distant things look thicker than they should, and a smaller --blur comes nearer"
    )
}

/// The note on `n_cut` of `n` Gaussians that lose harmonics of degree `degree`.
pub(super) fn cut_harmonics(degree: u32, n_cut: usize, n: usize) -> String {
    format!("harmonics of degree {degree} are cut to degree 3, of {n_cut} of {n} Gaussians")
}
