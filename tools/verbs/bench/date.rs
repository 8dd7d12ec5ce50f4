//! Dates without a time of day.

use std::time::UNIX_EPOCH;

/// Year-month-day, UTC.
pub fn today() -> String {
    date(UNIX_EPOCH.elapsed().map_or(0, |since| since.as_secs()) / 86_400)
}

/// The date that many days after 1970-01-01.
fn date(days: u64) -> String {
    // Years from March on, in eras of 400: Howard Hinnant, "chrono-compatible low-level date algorithms", 2013.
    let z = days + 719_468;
    let (era, day) = (z / 146_097, z % 146_097);
    let year = (day - day / 1460 + day / 36_524 - day / 146_096) / 365;
    let of_year = day - (365 * year + year / 4 - year / 100);
    let month = (5 * of_year + 2) / 153;
    let (day, month) = (of_year - (153 * month + 2) / 5 + 1, if month < 10 { month + 3 } else { month - 9 });
    format!("{}-{month:02}-{day:02}", era * 400 + year + u64::from(month <= 2))
}

#[cfg(test)]
mod tests {
    use super::date;

    #[test]
    fn days_are_dates() {
        let days = [0, 11_016, 19_782, 19_783, 20_778];
        assert_eq!(days.map(date), ["1970-01-01", "2000-02-29", "2024-02-29", "2024-03-01", "2026-11-21"]);
    }
}
