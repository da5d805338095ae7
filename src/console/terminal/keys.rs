//! What the keys do. The operator's page has the same keys.

use ratatui_crossterm::crossterm::event::{KeyCode, KeyEvent, KeyEventKind, KeyModifiers};

use crate::console::controls::Request;
use crate::console::snapshot::Snapshot;
use crate::dataset::LONGEST_NOTE;
use crate::session::Event;

/// State of the operator's input at the terminal.
#[derive(Debug, Default, PartialEq)]
pub enum KeyInput {
    /// Waiting for a key.
    #[default]
    Idle,
    /// Waiting for the confirmation of a command.
    Confirming(Event),
    /// Waiting for the confirmation that the session is to end at once.
    ConfirmingStop,
    /// Writing a note.
    Writing(String),
}

/// What a key brings info.
#[derive(Debug, PartialEq)]
pub enum KeyAction {
    /// A request of the operator.
    Request(Request),
    /// The session ends at once.
    Stop,
}

impl KeyInput {
    /// Takes a key; `snapshot` says which commands are possible.
    pub fn press(&mut self, key: KeyEvent, snapshot: &Snapshot) -> Option<KeyAction> {
        if key.kind == KeyEventKind::Release {
            return None;
        }
        let is_interrupt = key.code == KeyCode::Char('c') && key.modifiers.contains(KeyModifiers::CONTROL);
        if is_interrupt {
            let again = std::mem::replace(self, Self::ConfirmingStop) == Self::ConfirmingStop;
            return again.then_some(KeyAction::Stop);
        }
        match std::mem::take(self) {
            Self::Idle => self.choose(key.code, snapshot),
            Self::Confirming(command) if is_yes(key.code) => {
                Some(KeyAction::Request(Request::Command { command, confirmed: true }))
            }
            Self::ConfirmingStop if is_yes(key.code) => Some(KeyAction::Stop),
            Self::Confirming(_) | Self::ConfirmingStop => None,
            Self::Writing(text) => self.write(text, key.code),
        }
    }

    fn choose(&mut self, key: KeyCode, snapshot: &Snapshot) -> Option<KeyAction> {
        let is_possible = |command: &Event| snapshot.possible.contains(&command.name());
        let command = match key {
            KeyCode::Char('s') => [Event::Start, Event::Rearm].into_iter().find(is_possible)?,
            KeyCode::Char(' ') => [Event::Resume, Event::Pause].into_iter().find(is_possible)?,
            KeyCode::Char('k') => Event::Skip,
            KeyCode::Char('b') => [Event::RepeatEffort, Event::Repeat].into_iter().find(is_possible)?,
            KeyCode::Char('x') => Event::Abort,
            KeyCode::Char('e') => return Some(KeyAction::Request(Request::PauseAfterTrial)),
            KeyCode::Char('n') => {
                *self = Self::Writing(String::new());
                return None;
            }
            _ => return None,
        };
        if !is_possible(&command) {
            return None;
        }
        if snapshot.questions.contains_key(command.name()) {
            *self = Self::Confirming(command);
            return None;
        }
        // What asks nothing needs no answer.
        Some(KeyAction::Request(Request::Command { command, confirmed: true }))
    }

    fn write(&mut self, mut text: String, key: KeyCode) -> Option<KeyAction> {
        match key {
            KeyCode::Enter => return Some(KeyAction::Request(Request::Note { text, clock: None })),
            KeyCode::Esc => return None,
            KeyCode::Backspace => drop(text.pop()),
            KeyCode::Char(letter) if text.len() < LONGEST_NOTE - 4 => text.push(letter),
            _ => {}
        }
        *self = Self::Writing(text);
        None
    }
}

fn is_yes(key: KeyCode) -> bool {
    matches!(key, KeyCode::Enter | KeyCode::Char('y'))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn snapshot(possible: &[&'static str]) -> Snapshot {
        let asking = possible.iter().filter(|command| ["start", "abort"].contains(command));
        let questions = asking.map(|command| (*command, "Sure?".to_owned())).collect();
        Snapshot { possible: possible.to_vec(), questions, ..Snapshot::before_start(None) }
    }

    fn press(input: &mut KeyInput, keys: &str, snapshot: &Snapshot) -> Vec<KeyAction> {
        keys.chars()
            .filter_map(|key| {
                let code = match key {
                    '\n' => KeyCode::Enter,
                    '\u{1b}' => KeyCode::Esc,
                    letter => KeyCode::Char(letter),
                };
                input.press(KeyEvent::from(code), snapshot)
            })
            .collect()
    }

    #[test]
    fn a_command_that_cannot_be_undone_must_be_confirmed() {
        let (mut input, now) = (KeyInput::default(), snapshot(&["start", "abort"]));
        assert_eq!(press(&mut input, "s", &now), []);
        assert_eq!(input, KeyInput::Confirming(Event::Start));
        let start = KeyAction::Request(Request::Command { command: Event::Start, confirmed: true });
        assert_eq!(press(&mut input, "\n", &now), [start]);
        assert_eq!(press(&mut input, "x\u{1b}x ", &now), []);
        assert_eq!(input, KeyInput::Idle);
    }

    #[test]
    fn a_command_without_a_question_is_requested_at_once() {
        let (mut input, mut now) = (KeyInput::default(), snapshot(&["start", "repeat", "repeat_effort"]));
        now.questions.clear();
        let request = |command| KeyAction::Request(Request::Command { command, confirmed: true });
        assert_eq!(press(&mut input, "sb", &now), [request(Event::Start), request(Event::RepeatEffort)]);
    }

    #[test]
    fn an_impossible_command_is_not_requested() {
        let (mut input, now) = (KeyInput::default(), snapshot(&["pause"]));
        assert_eq!(press(&mut input, "skbx", &now), []);
        assert_eq!(input, KeyInput::Idle);
        let pause = KeyAction::Request(Request::Command { command: Event::Pause, confirmed: true });
        assert_eq!(press(&mut input, " ", &now), [pause]);
    }

    #[test]
    fn letters_in_a_note_are_no_commands() {
        let (mut input, now) = (KeyInput::default(), snapshot(&["pause", "abort"]));
        let note = KeyAction::Request(Request::Note { text: "x is ok".to_owned(), clock: None });
        assert_eq!(press(&mut input, "nx is ok\n", &now), [note]);
        assert_eq!(press(&mut input, "nabc\u{1b}", &now), []);
    }

    #[test]
    fn the_interrupt_key_ends_the_session_the_second_time() {
        let (mut input, now) = (KeyInput::default(), snapshot(&[]));
        let interrupt = KeyEvent::new(KeyCode::Char('c'), KeyModifiers::CONTROL);
        assert_eq!(input.press(interrupt, &now), None);
        assert_eq!(input.press(interrupt, &now), Some(KeyAction::Stop));
    }
}
