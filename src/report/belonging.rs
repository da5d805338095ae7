//! Whether fit and diagnosis belong to the session as it is now, and to each other.

use serde_json::Value;

use super::fitted::Fitted;

/// Why the fit does not belong to the session whose sum is `digest`; `None` if it does, or does not say what it was made from.
pub fn foreign_fit(fitted: &Fitted, digest: &str) -> Option<String> {
    let made_from = fitted.made_from.as_ref()?;
    (made_from.session_sha256 != digest).then(|| {
        "The fit was made before the session was changed (a record, the table, or a trial judged anew). Run: ramphold fit SESSION."
            .to_owned()
    })
}

/// Why the diagnosis does not belong to the session or the fit beside it.
pub fn foreign_diagnosis(diagnosis: &Value, fitted: Option<&Fitted>, digest: &str) -> Option<String> {
    let made_from = diagnosis.pointer("/made_from/session_sha256").and_then(Value::as_str);
    if made_from.is_some_and(|own| own != digest) {
        return Some(
            "The diagnosis was made before the session was changed (a record, the table, or a trial judged anew). Run: ramphold \
             diagnose SESSION."
                .to_owned(),
        );
    }
    let fitted = fitted?;
    let window_s = diagnosis.pointer("/settings/window_s").and_then(Value::as_f64);
    if let Some(window_s) = window_s.filter(|own| (own - fitted.settings.window_s).abs() > 1e-9) {
        return Some(format!(
            "The diagnosis is of a window of {:.1} ms and the fit of {:.1} ms: they do not belong together. Run: ramphold \
             diagnose SESSION --window {}.",
            1e3 * window_s,
            1e3 * fitted.settings.window_s,
            fitted.settings.window_s
        ));
    }
    let calibration = diagnosis.pointer("/settings/calibration_sha256").and_then(Value::as_str);
    if calibration != fitted.settings.calibration_sha256.as_deref() {
        return Some(
            "The diagnosis and the fit used different constants of the rig: they do not belong together. Run: ramphold diagnose \
             SESSION --calibration FILE."
                .to_owned(),
        );
    }
    let model = diagnosis.get("model").filter(|model| !model.is_null())?;
    (*model != fitted.model).then(|| {
        "The diagnosis starts from another model than that of the fit: they do not belong together. Run: ramphold \
         diagnose SESSION --model FILE."
            .to_owned()
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    fn fitted(window_s: f64) -> Fitted {
        let json = json!({
            "format": "ramphold-fit/1", "version": "0", "model": {}, "trials": [], "conditions": [],
            "settings": { "window_s": window_s, "filter": null, "weighting": "plain" },
            "made_from": { "session_sha256": "a", "program": "ramphold" },
        });
        serde_json::from_value(json).unwrap()
    }

    #[test]
    fn results_of_another_session_window_or_model_do_not_belong() {
        assert!(foreign_fit(&fitted(0.04), "a").is_none());
        assert!(foreign_fit(&fitted(0.04), "b").unwrap().contains("ramphold fit"));
        let diagnosis =
            json!({ "made_from": { "session_sha256": "a" }, "settings": { "window_s": 0.04 }, "model": {} });
        assert!(foreign_diagnosis(&diagnosis, Some(&fitted(0.04)), "a").is_none());
        assert!(foreign_diagnosis(&diagnosis, None, "b").is_some());
        let why = foreign_diagnosis(&diagnosis, Some(&fitted(0.3)), "a").unwrap();
        assert!(why.contains("40.0 ms") && why.contains("300.0 ms") && why.contains("--window 0.3"), "{why}");
        let calibrated = json!({ "settings": { "calibration_sha256": "c" } });
        let why = foreign_diagnosis(&calibrated, Some(&fitted(0.04)), "a").unwrap();
        assert!(why.contains("different constants of the rig"), "{why}");
        let other = json!({ "settings": { "window_s": 0.04 }, "model": { "mechanisms": [1] } });
        assert!(foreign_diagnosis(&other, Some(&fitted(0.04)), "a").unwrap().contains("another model"));
        assert!(
            foreign_diagnosis(&json!({}), Some(&fitted(0.04)), "a").is_none(),
            "an older file says nothing"
        );
    }
}
