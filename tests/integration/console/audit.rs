//! Every click is in the journal, and a replay shows the same.

use ramphold::dataset::{ActionOrigin, OperatorAction, operator_actions, replay};
use ramphold::session::Event;
use serde_json::json;

use super::program::Program;

#[test]
fn every_word_and_note_is_in_the_journal_with_its_place() {
    let mut program = Program::run(&["--speed", "20"]);
    let mut operator = program.operator.live();
    operator.phase("ready");
    // Not the operator's to say, and so not said.
    operator.send(&json!({ "word": { "word": "gate_opened", "sure": true } }));
    // Not possible here, and said all the same.
    operator.send(&json!({ "word": { "word": "resume" } }));
    operator.until("its refusal", |message| {
        message.to_string().contains("resume is not possible in phase ready")
    });
    operator.word("start");
    operator.phase("rest");
    let note =
        json!({ "note": { "text": " electrode\u{7} re-glued\n", "clock": "2026-01-02T03:04:05+01:00" } });
    operator.send(&note);
    operator.until("the note", |message| message.to_string().contains("re-glued"));
    operator.send(&json!({ "word": { "word": "pause" } }));
    operator.phase("paused");
    operator.send(&json!({ "word": { "word": "resume" } }));
    operator.phase("finished");
    drop(operator);
    assert_eq!(program.ends(), Some(0));

    let actions = operator_actions(&program.session).unwrap();
    let said: Vec<Event> = actions
        .iter()
        .filter_map(|(_, entry)| match (&entry.action, entry.origin) {
            (OperatorAction::Commanded { command }, ActionOrigin::Page) => Some(*command),
            _ => None,
        })
        .collect();
    assert_eq!(said, [Event::Resume, Event::Start, Event::Pause, Event::Resume]);
    let kept =
        actions.iter().find(|(_, entry)| matches!(entry.action, OperatorAction::Noted { .. })).unwrap();
    let action = OperatorAction::Noted {
        text: "electrode  re-glued".to_owned(),
        clock: Some("2026-01-02T03:04:05+01:00".to_owned()),
    };
    assert_eq!(kept.1.action, action);
    assert!(kept.1.sample > 0);

    let played = replay(&program.session).unwrap();
    assert_eq!(played.difference, None);
    // Each word that was possible made something happen; the other was refused.
    let journal = program.journal();
    for (word, wanted) in [("start", 1), ("pause", 1), ("resume", 1)] {
        assert_eq!(journal.iter().filter(|record| record["event"] == word).count(), wanted, "{word}");
    }
    assert_eq!(journal.iter().filter(|record| record["record"] == "refused").count(), 1);
}
