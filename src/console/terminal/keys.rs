//! What keys mean. They are the same on the operator's page.

use ratatui_crossterm::crossterm::event::{KeyCode, KeyEvent, KeyEventKind, KeyModifiers};

use crate::console::live::is_final;
use crate::console::{Request, Snapshot};
use crate::dataset::LONGEST_NOTE;
use crate::session::Event;

/// What the operator is at.
#[derive(Debug, Default, PartialEq)]
pub enum KeyInput {
    /// Nothing in particular.
    #[default]
    Playback,
    /// Instruction whether a word is meant.
    Instruction(Event),
    /// Instruction whether the program is to end the session, motor and all, at once.
    AskedToStop,
    /// Writing a note.
    Writing(String),
}

/// What a key brings about.
#[derive(Debug, PartialEq)]
pub enum KeyAction {
    /// Something is asked for.
    Ask(Request),
    /// The session ends at once.
    Stop,
}

impl KeyInput {
    /// A key was pressed while things were so.
    pub fn press(&mut self, key: KeyEvent, now: &Snapshot) -> Option<KeyAction> {
        if key.kind == KeyEventKind::Release {
            return None;
        }
        let is_interrupt = key.code == KeyCode::Char('c') && key.modifiers.contains(KeyModifiers::CONTROL);
        if is_interrupt {
            let again = std::mem::replace(self, Self::AskedToStop) == Self::AskedToStop;
            return again.then_some(KeyAction::Stop);
        }
        match std::mem::take(self) {
            Self::Playback => self.choose(key.code, now),
            Self::Instruction(word) if is_yes(key.code) => {
                Some(KeyAction::Ask(Request::Word { word, sure: true }))
            }
            Self::AskedToStop if is_yes(key.code) => Some(KeyAction::Stop),
            Self::Instruction(_) | Self::AskedToStop => None,
            Self::Writing(text) => self.write(text, key.code),
        }
    }

    fn choose(&mut self, key: KeyCode, now: &Snapshot) -> Option<KeyAction> {
        let is_possible = |word: &Event| now.possible.contains(&word.name());
        let word = match key {
            KeyCode::Char('s') => [Event::Start, Event::Rearm].into_iter().find(is_possible)?,
            KeyCode::Char(' ') => [Event::Resume, Event::Pause].into_iter().find(is_possible)?,
            KeyCode::Char('k') => Event::Skip,
            KeyCode::Char('b') => Event::Repeat,
            KeyCode::Char('x') => Event::Abort,
            KeyCode::Char('e') => return Some(KeyAction::Ask(Request::PauseAfterTrial)),
            KeyCode::Char('n') => {
                *self = Self::Writing(String::new());
                return None;
            }
            _ => return None,
        };
        if !is_possible(&word) {
            return None;
        }
        if is_final(word) {
            *self = Self::Instruction(word);
            return None;
        }
        Some(KeyAction::Ask(Request::Word { word, sure: false }))
    }

    fn write(&mut self, mut text: String, key: KeyCode) -> Option<KeyAction> {
        match key {
            KeyCode::Enter => return Some(KeyAction::Ask(Request::Note { text, clock: None })),
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
    use crate::console::view_model::waiting;

    fn now(possible: &[&'static str]) -> Snapshot {
        Snapshot { possible: possible.to_vec(), ..waiting(None) }
    }

    fn press(desk: &mut KeyInput, keys: &str, now: &Snapshot) -> Vec<KeyAction> {
        keys.chars()
            .filter_map(|key| {
                let code = match key {
                    '\n' => KeyCode::Enter,
                    '\u{1b}' => KeyCode::Esc,
                    letter => KeyCode::Char(letter),
                };
                desk.press(KeyEvent::from(code), now)
            })
            .collect()
    }

    #[test]
    fn what_cannot_be_taken_back_is_asked_for_twice() {
        let (mut desk, now) = (KeyInput::default(), now(&["start", "abort"]));
        assert_eq!(press(&mut desk, "s", &now), []);
        assert_eq!(desk, KeyInput::Instruction(Event::Start));
        let start = KeyAction::Ask(Request::Word { word: Event::Start, sure: true });
        assert_eq!(press(&mut desk, "\n", &now), [start]);
        assert_eq!(press(&mut desk, "x\u{1b}x ", &now), []);
        assert_eq!(desk, KeyInput::Playback);
    }

    #[test]
    fn what_is_not_possible_is_not_asked_for() {
        let (mut desk, now) = (KeyInput::default(), now(&["pause"]));
        assert_eq!(press(&mut desk, "skbx", &now), []);
        assert_eq!(desk, KeyInput::Playback);
        let pause = KeyAction::Ask(Request::Word { word: Event::Pause, sure: false });
        assert_eq!(press(&mut desk, " ", &now), [pause]);
    }

    #[test]
    fn letters_in_a_note_are_no_commands() {
        let (mut desk, now) = (KeyInput::default(), now(&["pause", "abort"]));
        let note = KeyAction::Ask(Request::Note { text: "x is ok".to_owned(), clock: None });
        assert_eq!(press(&mut desk, "nx is ok\n", &now), [note]);
        assert_eq!(press(&mut desk, "nabc\u{1b}", &now), []);
    }

    #[test]
    fn the_interrupt_key_ends_the_session_the_second_time() {
        let (mut desk, now) = (KeyInput::default(), now(&[]));
        let interrupt = KeyEvent::new(KeyCode::Char('c'), KeyModifiers::CONTROL);
        assert_eq!(desk.press(interrupt, &now), None);
        assert_eq!(desk.press(interrupt, &now), Some(KeyAction::Stop));
    }
}
