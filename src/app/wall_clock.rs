//! The time of day, for records of who did what when. Nothing of a session or an analysis depends on it.

use std::time::{SystemTime, UNIX_EPOCH};

use crate::dataset::utc_text;

/// The time of day in UTC, as `2026-11-24T15:00:00Z`.
pub fn now_utc() -> String {
    utc_text(seconds_now())
}

/// Name of the user at this computer, for judgements that name nobody else.
pub fn operator_name() -> String {
    let named = ["USER", "LOGNAME", "USERNAME"].iter().find_map(|name| std::env::var(name).ok());
    named.filter(|name| !name.is_empty()).unwrap_or_else(|| "not named".to_owned())
}

/// Seconds since 1970 in UTC.
pub fn seconds_now() -> i64 {
    SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |since| since.as_secs() as i64)
}

/// How far local time is ahead of UTC now, s; `None` where the operating system does not say.
#[cfg(target_os = "linux")]
pub fn utc_offset_s() -> Option<i64> {
    let now: libc::time_t = seconds_now();
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
