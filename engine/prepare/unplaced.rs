//! What is said where COLMAP places no pictures: what it found, and what helps.

use std::collections::BTreeMap;
use std::path::Path;

use super::database::{self, Shared};
use super::pictures::Pictures;
use crate::error::Error;
use crate::words::count;

/// Up to so many pictures, each is named with what it shares.
const NAMED: usize = 12;

/// The error of pictures that hang together too little, from the database of the attempt.
pub(super) fn error(source: &Path, pictures: &Pictures, database: &Path) -> Error {
    let what = if matches!(pictures, Pictures::Videos(_)) { "cameras" } else { "pictures" };
    let found = database::read(database).map_or_else(String::new, |shared| format!(": {}", told(&shared)));
    let reason = format!("holds {what} that COLMAP cannot place, since too little of each is in others{found}");
    let remedy = match pictures {
        Pictures::Videos(_) => {
            "try another moment (--frames 100: with --force), larger pictures, or photographs of the place taken from between the cameras \
             (--static PHOTOS); or calibrate the cameras with caliscope or Pose2Sim, or with RealityScan and its export for COLMAP, and \
             give that"
        }
        _ => {
            "take more pictures with much overlap, sharp and large, of a scene with texture, from different places; or give the poses of \
             another program as a COLMAP model or transforms.json"
        }
    };
    Error::data(source, "", reason, remedy)
}

/// What pictures share.
fn told(shared: &Shared) -> String {
    let Shared { features, pairs } = shared;
    let n = features.len();
    let (least, most) = (features.values().min().unwrap_or(&0), features.values().max().unwrap_or(&0));
    let mean = features.values().sum::<u64>() / (n as u64).max(1);
    let mut text = format!(
        "{} with {mean} features in the mean ({least} to {most}), and {} of {} share some",
        count(n, "picture"),
        pairs.len(),
        count(n * n.saturating_sub(1) / 2, "pair")
    );
    if n > NAMED {
        return text;
    }
    let mut of: BTreeMap<&str, Vec<(u64, &str)>> = features.keys().map(|name| (name.as_str(), Vec::new())).collect();
    for (a, b, n) in pairs {
        for (one, other) in [(a, b), (b, a)] {
            of.entry(one).or_default().push((*n, stem(other)));
        }
    }
    for (name, mut others) in of {
        others.sort_by(|a, b| b.cmp(a));
        let others: Vec<String> = others.iter().take(3).map(|(n, other)| format!("{n} with {other}")).collect();
        text += &format!("; {} {}", stem(name), if others.is_empty() { "none".to_owned() } else { others.join(", ") });
    }
    text
}

/// A picture's name without ending: of a video, that of its camera.
fn stem(name: &str) -> &str {
    name.rsplit_once('.').map_or(name, |(stem, _)| stem)
}
