//! Times of day in UTC, as text such as `2026-11-24T15:00:00Z`.

/// Seconds of a day.
const DAY_S: i64 = 86_400;

/// Days from 0000-03-01 to 1970-01-01.
const DAYS_TO_1970: i64 = 719_468;

/// What such a text is, for messages.
pub(super) const A_UTC_TIME: &str = "a time in UTC, such as 2026-11-24T15:00:00Z";

/// A time given in seconds since 1970, as text.
pub fn utc_text(seconds: i64) -> String {
    let (year, month, day) = date(seconds.div_euclid(DAY_S));
    let of_day = seconds.rem_euclid(DAY_S);
    let [hour, minute, second] = [of_day / 3600, of_day / 60 % 60, of_day % 60];
    format!("{year:04}-{month:02}-{day:02}T{hour:02}:{minute:02}:{second:02}Z")
}

/// Seconds since 1970 of a time as [`utc_text`] writes it; `None` of another text.
pub fn utc_seconds(text: &str) -> Option<i64> {
    let (date, time) = text.strip_suffix('Z')?.split_once('T')?;
    let [hour, minute, second] = numbers(time, ':')?;
    let is_time = (0..24).contains(&hour) && (0..60).contains(&minute) && (0..=60).contains(&second);
    is_time.then_some(())?;
    Some(utc_day(date)? * DAY_S + 3600 * hour + 60 * minute + second)
}

/// Days since 1970 of a text that begins with a date, in the Gregorian calendar.
pub fn utc_day(text: &str) -> Option<i64> {
    let [year, month, day] = numbers(text.get(..10)?, '-')?;
    let stated = (year, month, day);
    if !((1..=12).contains(&month) && (1..=31).contains(&day)) {
        return None;
    }
    // Years that begin in March end with the leap day.
    let (year, month) = if month > 2 { (year, month - 3) } else { (year - 1, month + 9) };
    let leap_days = year.div_euclid(4) - year.div_euclid(100) + year.div_euclid(400);
    let since_1970 = 365 * year + leap_days + (153 * month + 2) / 5 + day - 1 - DAYS_TO_1970;
    // A day that its month does not have is one of the next month.
    (date(since_1970) == stated).then_some(since_1970)
}

fn numbers(text: &str, separator: char) -> Option<[i64; 3]> {
    let numbers: Vec<i64> =
        text.split(separator).map(|part| part.parse().ok()).collect::<Option<Vec<i64>>>()?;
    numbers.try_into().ok()
}

/// Year, month and day of a day counted from 1970-01-01, in the Gregorian calendar: eras of 400 years that begin in March, so that the
/// leap day comes last.
fn date(day: i64) -> (i64, i64, i64) {
    let from_march_0000 = day + DAYS_TO_1970;
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
        for (seconds, text) in [
            (0, "1970-01-01T00:00:00Z"),
            (951_782_399, "2000-02-28T23:59:59Z"),
            (951_782_400, "2000-02-29T00:00:00Z"),
            (1_795_532_239, "2026-11-24T14:57:19Z"),
            (4_107_542_400, "2100-03-01T00:00:00Z"),
        ] {
            assert_eq!(utc_text(seconds), text);
            assert_eq!(utc_seconds(text), Some(seconds));
        }
        for wrong in [
            "",
            "yesterday",
            "2026-11-24",
            "2026-11-24T14:57:19",
            "2026-11-24T25:00:00Z",
            "2026-11-24T1:2Z",
            "2026-13-24T14:57:19Z",
            "2026-02-29T14:57:19Z",
            "2026-11-00T14:57:19Z",
        ] {
            assert_eq!(utc_seconds(wrong), None, "{wrong}");
        }
    }
}
