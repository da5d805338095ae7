//! Messages that are written while a motor has power: on a thread of their own, because a terminal may block for ever.

use std::sync::mpsc::{self, Sender, SyncSender};
use std::thread::{self, JoinHandle};
use std::time::Duration;

use super::Console;

/// How long [`BackgroundMessages::flush`] waits for a terminal that takes nothing.
const PATIENCE: Duration = Duration::from_secs(2);

/// A thread that writes messages on standard error.
pub struct BackgroundMessages {
    messages: Sender<Message>,
    /// Not joined: it ends with the program if the terminal never takes what is left.
    _thread: JoinHandle<()>,
}

enum Message {
    /// Left out with `--quiet`.
    Note(String),
    Error(String),
    /// Answered when everything before it is written.
    Flush(SyncSender<()>),
}

impl BackgroundMessages {
    /// Starts the thread.
    pub fn start(console: Console) -> Self {
        let (messages, received) = mpsc::channel();
        let thread = thread::spawn(move || {
            for message in received {
                match message {
                    Message::Note(text) => console.message(text),
                    Message::Error(text) => console.error(text),
                    // Whoever asked may have given up.
                    Message::Flush(written) => drop(written.try_send(())),
                }
            }
        });
        Self { messages, _thread: thread }
    }

    /// Writes a message, except with `--quiet`. Does not wait for it.
    pub fn note(&self, text: String) {
        self.send(Message::Note(text));
    }

    /// Writes an error. Does not wait for it.
    pub fn error(&self, text: String) {
        self.send(Message::Error(text));
    }

    /// Waits until everything is written, or for two seconds. For when the motor has no power.
    pub fn flush(&self) {
        let (written, is_written) = mpsc::sync_channel(1);
        self.send(Message::Flush(written));
        // A terminal that blocks must not keep the session from being written down.
        let _ = is_written.recv_timeout(PATIENCE);
    }

    fn send(&self, message: Message) {
        // The thread lives as long as this sender.
        let _ = self.messages.send(message);
    }
}

impl Drop for BackgroundMessages {
    fn drop(&mut self) {
        self.flush();
    }
}
