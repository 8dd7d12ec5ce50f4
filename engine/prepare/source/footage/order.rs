//! The order of files that are numbered.

use std::path::PathBuf;

/// The key that sorts names as people count: 2.png comes before 10.png.
pub(in crate::prepare) fn by_number(name: &str) -> Vec<(u64, String)> {
    let mut parts = Vec::new();
    let mut rest = name;
    while !rest.is_empty() {
        let (text, other) = rest.split_at(rest.find(|c: char| c.is_ascii_digit()).unwrap_or(rest.len()));
        let (number, after) = other.split_at(other.find(|c: char| !c.is_ascii_digit()).unwrap_or(other.len()));
        // Text decides before the number behind it; of equal numbers the one that is written first comes first.
        parts.push((0, text.to_owned()));
        parts.push((number.parse().unwrap_or(u64::MAX), number.to_owned()));
        rest = after;
    }
    parts
}

/// The frames of `files` by the numbers that their names end with, so that a lost image does not move those behind it to earlier
/// frames. None where the names are not numbers in even steps with most of them there, such as times.
pub(in crate::prepare) fn numbered(files: &[PathBuf]) -> Option<Vec<u32>> {
    let split = |path: &PathBuf| -> Option<(String, u64)> {
        let stem = path.file_stem()?.to_str()?;
        let text = stem.trim_end_matches(|c: char| c.is_ascii_digit());
        Some((text.to_owned(), stem[text.len()..].parse().ok()?))
    };
    let names: Vec<(String, u64)> = files.iter().map(split).collect::<Option<_>>()?;
    let (text, first) = names.first()?;
    let steps: Vec<u64> = names.windows(2).map(|two| two[1].1.checked_sub(two[0].1)).collect::<Option<_>>()?;
    let step = steps.iter().copied().min().unwrap_or(1).max(1);
    let is_even = steps.iter().all(|&n| n > 0 && n % step == 0) && names.iter().all(|(other, _)| other == text);
    let frames = names.iter().map(|(_, number)| u32::try_from((number - first) / step).ok());
    let frames: Vec<u32> = frames.collect::<Option<_>>()?;
    let most_are_there = frames.last().is_some_and(|&last| (last as usize) < 2 * files.len());
    (is_even && most_are_there).then_some(frames)
}
