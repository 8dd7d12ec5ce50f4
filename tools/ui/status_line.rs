//! A line of progress, cut to the width of a terminal.

/// Most cells of the bar.
const BAR: usize = 24;

/// A bar and `text` in fewer than `columns` columns, as text in the last one would wrap. Parts between commas are cut whole.
pub fn fit(done: u64, total: u64, text: &str, columns: usize) -> String {
    let room = columns.saturating_sub(1);
    let cells = BAR.min(room / 5);
    if cells == 0 {
        return shortened(text, room).to_owned();
    }
    let filled =
        (u128::from(done.min(total)) * cells as u128).checked_div(total.into()).unwrap_or(cells as u128) as usize;
    format!("{}{} {}", "█".repeat(filled), "░".repeat(cells - filled), shortened(text, room - cells - 1))
}

/// The longest beginning of `text` that fits and ends with a part; if no part fits, as much of the first as fits.
fn shortened(text: &str, room: usize) -> &str {
    if width(text) <= room {
        return text;
    }
    let parts = text.match_indices(", ").map(|(at, _)| &text[..at]);
    if let Some(longest) = parts.take_while(|part| width(part) <= room).last() {
        return longest;
    }
    let fits = text.char_indices().map(|(at, c)| &text[..at + c.len_utf8()]).take_while(|part| width(part) <= room);
    fits.last().unwrap_or("")
}

/// Columns of `text`: two for each character that is not ASCII, which may be too many but never too few.
fn width(text: &str) -> usize {
    text.chars().map(|c| if c.is_ascii() { 1 } else { 2 }).sum()
}
