//! Lines of progress fit the terminal.

#[path = "../../tools/ui/status_line.rs"]
mod line;

use line::fit;

const TEXT: &str = "step 7/150, 7.5 it/s, 0:19 left, loss 0.3441, 11.72 dB, 9612 intersections";

#[test]
fn a_line_keeps_whole_parts_and_never_reaches_the_last_column() {
    for columns in 0..200 {
        let line = fit(7, 150, TEXT, columns);
        assert!(line.chars().count() < columns.max(1), "{columns}: {line}");
        if columns > 40 {
            let text = line.trim_start_matches(['█', '░', ' ']);
            let rest = TEXT.strip_prefix(text).unwrap_or_else(|| panic!("{columns}: {line}"));
            assert!(rest.is_empty() || rest.starts_with(", "), "{columns}: {line}");
        }
    }
    assert!(fit(7, 150, TEXT, 120).ends_with(TEXT));
    assert!(fit(7, 150, TEXT, 80).ends_with(", 11.72 dB"), "{}", fit(7, 150, TEXT, 80));
}

#[test]
fn the_bar_is_full_at_the_end_and_never_overfull() {
    let filled = |done, total| fit(done, total, "x", 200).matches('█').count();
    assert_eq!([filled(0, 9), filled(3, 9), filled(9, 9), filled(12, 9), filled(0, 0)], [0, 8, 24, 24, 24]);
    assert_eq!(filled(u64::MAX, u64::MAX), 24);
    assert_eq!(fit(1, 2, "x", 200).chars().filter(|c| "█░".contains(*c)).count(), 24);
}

#[test]
fn characters_that_may_be_wide_count_as_two_columns() {
    let line = fit(0, 1, "カメラカメラカメラカメラ", 20);
    assert!(line.ends_with("カメラカメラカ") && !line.ends_with("カメラカメラカメ"), "{line}");
}
