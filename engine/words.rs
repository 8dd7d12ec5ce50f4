//! Words that messages share.

/// `n` things, in the plural unless there is one: `1 frame`, `2 frames`.
pub fn count(n: impl TryInto<u64>, thing: &str) -> String {
    let n = n.try_into().unwrap_or(u64::MAX);
    format!("{n} {thing}{}", if n == 1 { "" } else { "s" })
}

const SHOWN: usize = 8;

/// The names of a list, a long one's first: `a, b` or `a, b and 3 more`.
pub fn listed<S: AsRef<str>>(names: &[S]) -> String {
    let shown = names.iter().take(SHOWN).map(AsRef::as_ref).collect::<Vec<_>>().join(", ");
    if names.len() > SHOWN { format!("{shown} and {} more", names.len() - SHOWN) } else { shown }
}

/// The longest name that a misspelling is looked for in, bytes.
const LONGEST_NAME: usize = 100;

/// Up to three of `names` that `name` may be a misspelling of, the nearest first. The part after the last dot will do.
pub fn nearest<'a>(name: &str, names: impl IntoIterator<Item = &'a str>) -> Vec<&'a str> {
    if name.len() > LONGEST_NAME {
        return Vec::new();
    }
    let distance = |known: &str| {
        let last = known.rsplit('.').next().unwrap_or(known);
        strsim::damerau_levenshtein(name, known).min(strsim::damerau_levenshtein(name, last) + 1)
    };
    let farthest = (name.chars().count() / 3).max(2);
    let mut near: Vec<(usize, &str)> = names.into_iter().map(|known| (distance(known), known)).collect();
    near.retain(|(distance, _)| *distance <= farthest);
    near.sort();
    near.into_iter().take(3).map(|(_, known)| known).collect()
}
