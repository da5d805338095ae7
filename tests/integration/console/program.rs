//! A program with its console, and what a browser would say to it.

use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::Arc;
use std::time::{Duration, Instant};

use serde_json::{Value, json};
use tempfile::TempDir;
use tungstenite::client::IntoClientRequest;
use tungstenite::http::HeaderValue;
use tungstenite::{Message, WebSocket};

use crate::workspace::{FOREVER, PROGRAM};

/// A session that runs.
pub struct Program {
    child: Child,
    pub operator: Page,
    pub subject: Page,
    pub session: PathBuf,
    folder: Arc<TempDir>,
}

/// Where a page is.
#[derive(Debug, Clone)]
pub struct Page {
    pub host: String,
    pub path: String,
}

impl Page {
    fn parse(url: &str) -> Self {
        let rest = url.split_once("://").unwrap().1;
        let (host, path) = rest.split_at(rest.find('/').unwrap());
        Self { host: host.to_owned(), path: path.to_owned() }
    }

    pub fn token(&self) -> &str {
        self.path.trim_matches('/').split('/').nth(1).unwrap()
    }

    /// A request as a browser makes it; the whole answer.
    pub fn get(&self, path: &str) -> String {
        self.ask(path, &format!("Host: {}\r\n", self.host))
    }

    pub fn ask(&self, path: &str, headers: &str) -> String {
        self.send(format!("GET {path} HTTP/1.1\r\n{headers}Connection: close\r\n\r\n").as_bytes())
    }

    pub fn send(&self, request: &[u8]) -> String {
        let mut stream = self.connect();
        stream.write_all(request).unwrap();
        let mut answer = Vec::new();
        // A connection that is cut has said all it will.
        let _ = stream.read_to_end(&mut answer);
        String::from_utf8_lossy(&answer).into_owned()
    }

    pub fn connect(&self) -> TcpStream {
        let stream = TcpStream::connect(&self.host).unwrap();
        stream.set_read_timeout(Some(FOREVER)).unwrap();
        stream
    }

    pub fn live(&self) -> Socket {
        self.open(&format!("{}live", self.path), Some(&format!("http://{}", self.host))).unwrap()
    }

    /// Opens a socket; the status if that is refused.
    pub fn open(&self, path: &str, origin: Option<&str>) -> Result<Socket, u16> {
        let mut request = format!("ws://{}{path}", self.host).into_client_request().unwrap();
        if let Some(origin) = origin {
            request.headers_mut().insert("Origin", HeaderValue::from_str(origin).unwrap());
        }
        match tungstenite::client(request, self.connect()) {
            Ok((socket, _)) => Ok(Socket(socket)),
            Err(tungstenite::HandshakeError::Failure(tungstenite::Error::Http(answer))) => {
                Err(answer.status().as_u16())
            }
            Err(error) => panic!("{error}"),
        }
    }
}

/// The line of an open page.
pub struct Socket(pub WebSocket<TcpStream>);

impl Socket {
    pub fn send(&mut self, message: &Value) {
        self.0.send(Message::text(message.to_string())).unwrap();
    }

    pub fn word(&mut self, word: &str) {
        self.send(&json!({ "word": { "word": word, "sure": true } }));
    }

    /// The next message, answered as a page does; or why the socket was closed.
    pub fn next(&mut self) -> Result<Value, String> {
        loop {
            match self.0.read() {
                Ok(Message::Text(text)) => {
                    let message: Value = serde_json::from_str(&text).unwrap();
                    if message.get("n").is_some() {
                        // The other side may have closed already.
                        let _ = self.0.send(Message::text(json!({ "seen": message["n"] }).to_string()));
                    }
                    return Ok(message);
                }
                Ok(Message::Close(frame)) => {
                    return Err(frame.map_or(String::new(), |frame| frame.reason.to_string()));
                }
                Ok(_) => {}
                Err(tungstenite::Error::Io(error)) if error.kind() == std::io::ErrorKind::Interrupted => {}
                Err(error) => return Err(error.to_string()),
            }
        }
    }

    /// The first message of which something is true.
    pub fn until(&mut self, what: &str, is: impl Fn(&Value) -> bool) -> Value {
        let begun = Instant::now();
        while begun.elapsed() < FOREVER {
            let message = self.next().unwrap_or_else(|why| panic!("closed ({why}) before {what}"));
            if is(&message) {
                return message;
            }
        }
        panic!("never: {what}")
    }

    pub fn phase(&mut self, phase: &str) -> Value {
        self.until(phase, |message| message["kind"] == "now" && message["phase"] == phase)
    }

    /// Starts the session, and pauses it after its first trial; the message that it is paused.
    pub fn pause_after_the_first_trial(&mut self) -> Value {
        self.phase("ready");
        self.word("start");
        self.until("a trial that counts", |message| message["done"] == 1);
        self.send(&json!("pause_after_trial"));
        self.phase("paused")
    }

    /// Reads until the session is over. The last picture may not be sent any more when the program ends.
    pub fn read_to_the_end(&mut self) {
        let why = loop {
            if let Err(why) = self.next() {
                break why;
            }
        };
        assert_eq!(why, "over");
    }

    /// Why it is closed, whatever comes before.
    pub fn closed(&mut self) -> String {
        let begun = Instant::now();
        while begun.elapsed() < FOREVER {
            if let Err(why) = self.next() {
                return why;
            }
        }
        panic!("never closed")
    }
}

/// A session with a bit of everything that is soon over.
pub fn protocol(folder: &Path) -> PathBuf {
    let mut protocol: Value = serde_json::from_str(include_str!("../../../protocols/quick.json")).unwrap();
    protocol["rest_s"] = json!(0.4);
    protocol["before"]["offset_s"] = json!(0.2);
    protocol["before"]["mvc"] = json!({ "efforts": 1, "duration_s": 0.5, "rest_s": 0.2 });
    let path = folder.join("protocol.json");
    std::fs::write(&path, protocol.to_string()).unwrap();
    path
}

impl Program {
    /// Runs a session with its console and whatever else is asked for.
    pub fn run(arguments: &[&str]) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let (protocol, session) = (protocol(folder.path()), folder.path().join("session"));
        let mut command = Command::new(PROGRAM);
        command.arg("run").arg(protocol).args(["--seed", "1", "--console", "--out"]).arg(&session);
        Self::start(command.args(arguments), session, Arc::new(folder))
    }

    /// Another verb on the same session.
    pub fn again(self, verb: &str, arguments: &[&str]) -> Self {
        let (session, folder) = (self.session.clone(), self.folder.clone());
        let mut command = Command::new(PROGRAM);
        command.arg(verb).arg(&session).args(arguments);
        Self::start(&mut command, session, folder)
    }

    /// The console of a laboratory with these subjects and the soonest protocol; its sessions are in `session`.
    pub fn laboratory(subjects: &str, arguments: &[&str]) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let laboratory = folder.path().join("lab");
        let made =
            Command::new(PROGRAM).arg("new").arg(&laboratory).args(["--yes", "--quiet"]).output().unwrap();
        assert!(made.status.success());
        protocol(&laboratory);
        std::fs::write(laboratory.join("subjects.csv"), subjects).unwrap();
        let mut command = Command::new(PROGRAM);
        command.arg("console").arg(&laboratory).args(arguments);
        Self::start(&mut command, laboratory.join("sessions"), Arc::new(folder))
    }

    /// Asks the program to end, as Ctrl-C does.
    #[cfg(unix)]
    pub fn interrupt(&self) {
        let sent = Command::new("kill").args(["-INT", &self.child.id().to_string()]).status().unwrap();
        assert!(sent.success());
    }

    fn start(command: &mut Command, session: PathBuf, folder: Arc<TempDir>) -> Self {
        let mut child = command.stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap();
        let mut said = BufReader::new(child.stderr.take().unwrap()).lines();
        let mut heard = Vec::new();
        let mut url = || loop {
            let line = said.next().unwrap_or_else(|| panic!("it ended: {heard:?}")).unwrap();
            if line.starts_with("http") {
                return Page::parse(&line);
            }
            heard.push(line);
        };
        let (operator, subject) = (url(), url());
        // Somebody reads on, or the program would wait for that.
        std::thread::spawn(move || said.for_each(drop));
        Self { child, operator, subject, session, folder }
    }

    /// Waits for the end of the program; its exit code.
    pub fn ends(&mut self) -> Option<i32> {
        let begun = Instant::now();
        while begun.elapsed() < FOREVER {
            if let Some(status) = self.child.try_wait().unwrap() {
                return status.code();
            }
            std::thread::sleep(Duration::from_millis(10));
        }
        panic!("never ended")
    }

    /// The journal's records.
    pub fn journal(&self) -> Vec<Value> {
        let text = std::fs::read_to_string(self.session.join("journal.log")).unwrap();
        text.lines().map(|line| serde_json::from_str(&line[26..]).unwrap()).collect()
    }

    /// What was done at the console.
    pub fn deeds(&self) -> Vec<Value> {
        self.journal().into_iter().filter(|record| record["record"] == "console").collect()
    }
}

impl Drop for Program {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// The status of an answer.
pub fn status(answer: &str) -> &str {
    answer.split(' ').nth(1).unwrap_or("none")
}
