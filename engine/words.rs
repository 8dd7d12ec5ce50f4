//! Words that messages share.

/// `n` things, in the plural unless there is one: `1 frame`, `2 frames`.
pub fn count(n: impl TryInto<u64>, thing: &str) -> String {
    let n = n.try_into().unwrap_or(u64::MAX);
    format!("{n} {thing}{}", if n == 1 { "" } else { "s" })
}
