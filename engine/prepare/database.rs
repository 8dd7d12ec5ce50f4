//! COLMAP's database, to say why pictures were not placed: the features of each, and how many they share. COLMAP has no command for this,
//! but Python reads SQLite's files.

use std::collections::BTreeMap;
use std::ffi::OsStr;
use std::path::Path;

use super::pictures::Pictures;
use super::program::PYTHON;
use crate::error::Error;
use crate::words::count;

/// Prints the features of each picture, and the pictures and matches of each pair. COLMAP numbers pairs with the factor `kMaxNumImages`.
const SCRIPT: &str = "
import json, sqlite3, sys
rows = sqlite3.connect(sys.argv[1]).execute
names = dict(rows('select image_id, name from images'))
features = dict.fromkeys(names.values(), 0)
features.update((names[id], n) for id, n in rows('select image_id, rows from keypoints') if id in names)
pairs = [(*divmod(id, 2147483647), n) for id, n in rows('select pair_id, rows from two_view_geometries where rows > 0')]
print(json.dumps({'features': features, 'pairs': [(names[a], names[b], n) for a, b, n in pairs if a in names and b in names]}))
";
/// Up to so many pictures, each is named with what it shares.
const NAMED: usize = 12;

#[derive(serde::Deserialize)]
struct Shared {
    features: BTreeMap<String, u64>,
    /// Pairs of pictures that see the same, and the number of features that they share.
    pairs: Vec<(String, String, u64)>,
}

impl Shared {
    /// Reads a database; nothing where it, or Python, is missing.
    fn read(path: &Path) -> Option<Shared> {
        let said = PYTHON.run([OsStr::new("-c"), OsStr::new(SCRIPT), path.as_os_str()], path).ok()?;
        serde_json::from_slice(&said).ok()
    }

    fn words(&self) -> String {
        let Shared { features, pairs } = self;
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
        let mut of: BTreeMap<&str, Vec<(u64, &str)>> =
            features.keys().map(|name| (name.as_str(), Vec::new())).collect();
        for (a, b, n) in pairs {
            for (one, other) in [(a, b), (b, a)] {
                of.entry(one).or_default().push((*n, stem(other)));
            }
        }
        for (name, mut others) in of {
            others.sort_by(|a, b| b.cmp(a));
            let others: Vec<String> = others.iter().take(3).map(|(n, other)| format!("{n} with {other}")).collect();
            text +=
                &format!("; {} {}", stem(name), if others.is_empty() { "none".to_owned() } else { others.join(", ") });
        }
        text
    }
}

pub(super) fn unplaced(source: &Path, pictures: &Pictures, database: &Path) -> Error {
    let what = if matches!(pictures, Pictures::Videos(_)) { "cameras" } else { "pictures" };
    let found = Shared::read(database).map_or_else(String::new, |shared| format!(": {}", shared.words()));
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

/// A picture's name without ending: of a video, that of its camera.
fn stem(name: &str) -> &str {
    name.rsplit_once('.').map_or(name, |(stem, _)| stem)
}
