//! The time of day, for records of who did what when. Nothing of a session or an analysis depends on it.

use std::time::{SystemTime, UNIX_EPOCH};

/// Seconds of a day.
const DAY_S: i64 = 86_400;

/// The time of day in UTC, as `2026-11-24T15:00:00Z`.
pub fn now_utc() -> String {
    utc_text(seconds())
}

/// Name of the user at this computer, for judgements that name nobody else.
pub fn operator_name() -> String {
    let named = ["USER", "LOGNAME", "USERNAME"].iter().find_map(|name| std::env::var(name).ok());
    named.filter(|name| !name.is_empty()).unwrap_or_else(|| "not named".to_owned())
}

/// Seconds since 1970 in UTC.
fn seconds() -> i64 {
    SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |since| since.as_secs() as i64)
}

/// How far local time is ahead of UTC now, s; `None` where the operating system does not say.
#[cfg(target_os = "linux")]
pub fn utc_offset_s() -> Option<i64> {
    let now: libc::time_t = seconds();
    // SAFETY: `tm` is plain data that the call fills in, and both pointers are valid during the call.
    let local = unsafe {
        let mut local: libc::tm = std::mem::zeroed();
        if libc::localtime_r(&raw const now, &raw mut local).is_null() {
            return None;
        }
        local
    };
    Some(local.tm_gmtoff)
}

/// How far local time is ahead of UTC now, s; `None` where the operating system does not say.
#[cfg(not(target_os = "linux"))]
pub fn utc_offset_s() -> Option<i64> {
    None
}

/// A time given in seconds since 1970, as text.
fn utc_text(seconds: i64) -> String {
    let (year, month, day) = date(seconds.div_euclid(DAY_S));
    let of_day = seconds.rem_euclid(DAY_S);
    let [hour, minute, second] = [of_day / 3600, of_day / 60 % 60, of_day % 60];
    format!("{year:04}-{month:02}-{day:02}T{hour:02}:{minute:02}:{second:02}Z")
}

/// Year, month and day of a day counted from 1970-01-01, in the Gregorian calendar: eras of 400 years that begin in March, so that the
/// leap day comes last.
fn date(day: i64) -> (i64, i64, i64) {
    let from_march_0000 = day + 719_468;
    let era = from_march_0000.div_euclid(146_097);
    let of_era = from_march_0000.rem_euclid(146_097);
    let year_of_era = (of_era - of_era / 1460 + of_era / 36_524 - of_era / 146_096) / 365;
    let of_year = of_era - (365 * year_of_era + year_of_era / 4 - year_of_era / 100);
    let from_march = (5 * of_year + 2) / 153;
    let day = of_year - (153 * from_march + 2) / 5 + 1;
    let month = if from_march < 10 { from_march + 3 } else { from_march - 9 };
    (era * 400 + year_of_era + i64::from(month <= 2), month, day)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_are_those_of_the_calendar() {
        assert_eq!(utc_text(0), "1970-01-01T00:00:00Z");
        assert_eq!(utc_text(951_782_399), "2000-02-28T23:59:59Z");
        assert_eq!(utc_text(951_782_400), "2000-02-29T00:00:00Z");
        assert_eq!(utc_text(1_795_532_239), "2026-11-24T14:57:19Z");
        assert_eq!(utc_text(4_107_542_400), "2100-03-01T00:00:00Z");
    }
}
