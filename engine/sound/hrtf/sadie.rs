//! Folders of WAV files, one for each direction, named as the SADIE database names them: `azi_30_ele_-10_DFC.wav`,
//! `azi_30,0_ele_0,0.wav`. Azimuth is counter-clockwise: 90 degrees is left.

use std::fs;
use std::path::{Path, PathBuf};

use sha2::{Digest, Sha256};

use super::{Measured, Meta};
use crate::error::{Error, Result};
use crate::files::{read_file, read_text};
use crate::internals::sound::geometry::degrees;
use crate::internals::sound::wav;

/// Names by which a licence lies in a folder or above it.
const LICENCES: [&str; 4] = ["LICENSE", "LICENSE.txt", "LICENSE.md", "COPYING"];

pub fn read(folder: &Path) -> Result<Measured> {
    let fault = |path: &Path, reason: String| {
        Error::data(path, "", reason, "give a folder of stereo WAV files named azi_<degrees>_ele_<degrees>.wav")
    };
    let list = fs::read_dir(folder).map_err(|e| fault(folder, format!("cannot be listed: {e}")))?;
    let mut files: Vec<(PathBuf, [f64; 2])> =
        list.flatten().filter_map(|entry| Some((entry.path(), angles(entry.file_name().to_str()?)?))).collect();
    files.sort_by(|a, b| a.0.cmp(&b.0));
    if files.is_empty() {
        return Err(fault(folder, "no file in it is named by its direction".into()));
    }
    let mut hash = Sha256::new();
    let mut fs_of_all = 0;
    let (mut directions, mut irs) = (Vec::new(), Vec::new());
    for (path, [az, el]) in &files {
        let recording = wav::read(path)?;
        hash.update(read_file(path).map_err(|e| fault(path, format!("cannot be read: {e}")))?);
        let [left, right] = <[Vec<f32>; 2]>::try_from(recording.channels)
            .map_err(|channels| fault(path, format!("it has {} channels, not 2", channels.len())))?;
        if fs_of_all != 0 && recording.fs != fs_of_all {
            return Err(fault(path, format!("its rate is {} Hz, that of the others {fs_of_all}", recording.fs)));
        }
        fs_of_all = recording.fs;
        directions.push(degrees(*az, *el));
        irs.push([left, right]);
    }
    Ok(Measured {
        fs: f64::from(fs_of_all),
        delays: vec![[0.0; 2]; irs.len()],
        directions,
        irs,
        meta: Meta {
            title: format!("WAV files of {}", folder.display()),
            licence: licence(folder).unwrap_or_else(|| "not stated".into()),
            sha256: format!("{:x}", hash.finalize()),
        },
    })
}

fn angles(name: &str) -> Option<[f64; 2]> {
    let stem = name.strip_suffix(".wav")?;
    let (_, rest) = stem.split_once("azi_")?;
    let (az, rest) = rest.split_once("_ele_")?;
    let el = rest.split('_').next()?;
    let number = |text: &str| text.replace(',', ".").parse::<f64>().ok().filter(|value| value.is_finite());
    Some([number(az)?, number(el)?])
}

/// The first line of the nearest licence that has words.
fn licence(folder: &Path) -> Option<String> {
    let text = folder
        .ancestors()
        .take(6)
        .find_map(|folder| LICENCES.iter().find_map(|name| read_text(&folder.join(name)).ok()))?;
    text.lines().map(str::trim).find(|line| !line.is_empty()).map(str::to_owned)
}
