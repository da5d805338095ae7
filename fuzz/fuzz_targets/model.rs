//! Any text is a fit model or is refused.
#![no_main]

use libfuzzer_sys::fuzz_target;
use ramphold::fit::Model;

fuzz_target!(|text: &str| {
    let _ = Model::parse(text);
});
