//! Any text is a protocol or is refused; what is accepted can be ordered and run.
#![no_main]

use libfuzzer_sys::fuzz_target;
use ramphold::protocol::ValidProtocol;
use ramphold::schedule;
use ramphold::session::Settings;

fuzz_target!(|text: &str| {
    if let Ok(protocol) = ValidProtocol::parse(text, "fuzz") {
        if protocol.trial_count() < 1000
            && let Ok(order) = schedule::draw(&protocol, 1, Some(1))
        {
            Settings::new(&protocol, 1, &order).expect("a valid protocol can be run");
        }
    }
});
