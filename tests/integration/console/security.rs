//! Nobody else gets in, and nobody delays the session.

use std::io::{ErrorKind, Read, Write};
use std::net::TcpStream;
use std::time::Duration;

use serde_json::{Value, json};
use tungstenite::Message;

use super::program::{Program, Socket, status};
use crate::workspace::FOREVER;

/// As fast as the loop and the disk allow.
const FAST: [&str; 2] = ["--speed", "50"];

#[test]
fn every_answer_forbids_what_comes_from_elsewhere_and_no_file_asks_for_it() {
    let program = Program::run(&[]);
    for page in [&program.operator, &program.subject] {
        let html = page.get(&page.path);
        assert_eq!(status(&html), "200");
        let mut files: Vec<String> =
            html.split(['"', '\'']).filter(|part| part.contains('.')).map(str::to_owned).collect();
        files.retain(|file| ["css", "js", "svg"].iter().any(|kind| file.ends_with(kind)));
        assert!(files.len() >= 3, "{files:?}");
        files.extend(["link.js".to_owned()]);
        for path in files.iter().map(|file| format!("{}{file}", page.path)).chain([page.path.clone()]) {
            let answer = page.get(&path);
            assert_eq!(status(&answer), "200", "{path}");
            let head = answer.split("\r\n\r\n").next().unwrap().to_ascii_lowercase();
            for wanted in [
                "content-security-policy: default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self'",
                "frame-ancestors 'none'",
                "x-content-type-options: nosniff",
                "referrer-policy: no-referrer",
                "cache-control: no-store",
            ] {
                assert!(head.contains(wanted), "{path}: {head}");
            }
            let body = answer.split_once("\r\n\r\n").unwrap().1;
            let body = body.replace("http://www.w3.org/2000/svg", "");
            assert!(!body.contains("http://") && !body.contains("https://"), "{path} names an address");
            assert!(!body.contains(" style=\"") && !body.contains("<style"), "{path} has a style of its own");
        }
    }
}

#[test]
fn without_the_right_token_there_is_no_way_in() {
    let program = Program::run(&[]);
    let (operator, subject) = (&program.operator, &program.subject);
    let mut wrong = operator.token().to_owned();
    wrong.replace_range(..1, if wrong.starts_with('0') { "1" } else { "0" });
    for path in [
        "/".to_owned(),
        "/operator/".to_owned(),
        "/operator//".to_owned(),
        "/operator.html".to_owned(),
        format!("/operator/{wrong}/"),
        format!("/operator/{}/", &operator.token()[..63]),
        format!("/operator/{}/", subject.token()),
        format!("/subject/{}/", operator.token()),
        format!("/operator/{wrong}/operator.js"),
        format!("/operator/{}/../../etc/passwd", operator.token()),
    ] {
        let answer = operator.get(&path);
        assert!(["403", "400"].contains(&status(&answer)), "{path}: {}", status(&answer));
        assert!(!answer.contains("<script"), "{path}");
    }
    let own = format!("http://{}", operator.host);
    for path in [
        "/live".to_owned(),
        format!("/operator/{wrong}/live"),
        format!("/operator/{}/live", subject.token()),
        format!("/subject/{}/live", operator.token()),
    ] {
        assert_eq!(operator.open(&path, Some(&own)).err(), Some(403), "{path}");
    }
    // A file that is not one of the pages is not there, whatever it is called.
    for file in ["Cargo.toml", "..%2f..%2fmod.rs", "%2e%2e%2fmod.rs", "session.json"] {
        let answer = operator.get(&format!("{}{file}", operator.path));
        assert_eq!(status(&answer), "404", "{file}");
    }
}

#[test]
fn requests_for_other_names_and_of_other_pages_are_turned_away() {
    let program = Program::run(&[]);
    let page = &program.operator;
    let port = page.host.rsplit_once(':').unwrap().1;
    // A name that somebody made to point here (DNS rebinding).
    for host in
        [format!("evil.example:{port}"), "evil.example".to_owned(), format!("127.0.0.1.evil.example:{port}")]
    {
        assert_eq!(status(&page.ask(&page.path, &format!("Host: {host}\r\n"))), "421", "{host}");
    }
    assert_eq!(status(&page.ask(&page.path, "")), "421");
    let headers = format!("Host: {}\r\nOrigin: http://evil.example\r\n", page.host);
    assert_eq!(status(&page.ask(&page.path, &headers)), "403");
    let live = format!("{}live", page.path);
    for origin in [Some("http://evil.example"), Some("null"), Some("https://127.0.0.1"), Some(""), None] {
        assert_eq!(page.open(&live, origin).err(), Some(403), "{origin:?}");
    }
    let localhost = format!("Host: localhost:{port}\r\n");
    assert_eq!(status(&page.ask(&page.path, &localhost)), "200");
}

/// The thread that a connection is served on is that of its first request's page.
#[test]
fn an_operators_socket_is_not_opened_on_a_connection_of_another_page() {
    let program = Program::run(&[]);
    let (operator, subject) = (&program.operator, &program.subject);
    let first = format!("GET {} HTTP/1.1\r\nHost: {}\r\n\r\n", subject.path, subject.host);
    let second = format!(
        "GET {}live HTTP/1.1\r\nHost: {host}\r\nOrigin: http://{host}\r\nConnection: Upgrade\r\nUpgrade: websocket\r\n\
         Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\n\r\n",
        operator.path,
        host = operator.host
    );
    let answers = subject.send((first + &second).as_bytes());
    assert!(answers.starts_with("HTTP/1.1 200") && answers.contains("HTTP/1.1 421"), "{answers}");
    assert!(!answers.contains("HTTP/1.1 101"), "{answers}");
}

#[test]
fn the_subjects_page_gives_no_commands() {
    let program = Program::run(&[]);
    for message in [
        json!({ "word": { "word": "start", "sure": true } }),
        json!({ "word": { "word": "abort", "sure": true } }),
        json!({ "note": { "text": "it was me", "clock": null } }),
        json!("pause_after_trial"),
    ] {
        let mut subject = program.subject.live();
        let seen = subject.until("a picture", |message| message["kind"] == "now");
        for hidden in ["phase", "trial", "possible", "bins"] {
            assert!(seen.get(hidden).is_none(), "the subject is told {hidden}");
        }
        subject.send(&message);
        assert_eq!(subject.closed(), "the subject's page gives no commands", "{message}");
    }
    let mut operator = program.operator.live();
    operator.phase("ready");
    assert!(program.deeds().iter().all(|deed| deed["deed"].get("said").is_none()));
}

#[test]
fn what_is_no_request_closes_the_page_and_the_session_goes_on() {
    let mut program = Program::run(&FAST);
    let mut operator = program.operator.live();
    operator.phase("ready");
    operator.word("start");
    let long = json!({ "note": { "text": "x".repeat(5000), "clock": null } }).to_string();
    for (message, why) in [
        (Message::text("{"), "not understood"),
        (Message::text("null"), "not understood"),
        (Message::text(r#"{"word":{"word":"explode"}}"#), "not understood"),
        (Message::text(r#"{"word":{"word":"start","sure":true,"more":1}}"#), "not understood"),
        (Message::text(r#"{"seen":18446744073709551615}"#), "not understood"),
        (Message::text("[".repeat(4000)), "not understood"),
        (Message::binary(vec![0; 10]), "text only"),
        (Message::text(long), "malformed or too long"),
    ] {
        let mut other = program.operator.live();
        other.0.send(message).unwrap();
        assert_eq!(other.closed(), why);
    }
    // Frames that are none: a reserved opcode, no mask, a length of 2^63.
    for frame in
        [&[0x83u8, 0x80, 0, 0, 0, 0][..], &[0x81, 0x01, b'x'], &[0x81, 0xff, 0x80, 0, 0, 0, 0, 0, 0, 0]]
    {
        let mut other = program.operator.live();
        other.0.get_mut().write_all(frame).unwrap();
        other.closed();
    }
    operator.read_to_the_end();
    drop(operator);
    assert_eq!(program.ends(), Some(0));
}

#[test]
fn who_sends_too_much_is_sent_away() {
    let program = Program::run(&[]);
    let mut flood = program.operator.live();
    for _ in 0..200 {
        // It is closed before the last one.
        let _ = flood.0.send(Message::text(json!({ "word": { "word": "pause" } }).to_string()));
    }
    let why = flood.closed();
    assert!(why.contains("too many requests") || why.contains("IO error"), "{why}");
    let said = program.deeds().iter().filter(|deed| deed["deed"].get("said").is_some()).count();
    assert!(said <= 25, "{said} words were let through");
    // Heads that never end, and bodies that nobody asked for.
    let page = &program.operator;
    let endless = format!("GET {} HTTP/1.1\r\nHost: {}\r\nX: {}", page.path, page.host, "y".repeat(100_000));
    assert!(!page.send(endless.as_bytes()).contains("<script"));
    let post = format!(
        "POST {} HTTP/1.1\r\nHost: {}\r\nContent-Length: 0\r\nConnection: close\r\n\r\n",
        page.path, page.host
    );
    assert_eq!(status(&page.send(post.as_bytes())), "405");
}

/// Frames count, not messages: a message that never ends made the operator wait for 2 s.
#[test]
fn who_begins_a_message_and_never_ends_it_is_sent_away_and_the_operator_does_not_wait() {
    use std::io::Write;
    let program = Program::run(&["--speed", "1"]);
    let flood = |mut socket: Socket| {
        // Masked frames of text without any bytes: the first one begins a message, the others go on with it.
        let more = [0x00, 0x80, 1, 2, 3, 4].repeat(1000);
        let stream = socket.0.get_mut();
        let mut sent = stream.write_all(&[0x01, 0x80, 1, 2, 3, 4]);
        let mut frames = 1;
        while sent.is_ok() && frames < 10_000_000 {
            sent = stream.write_all(&more);
            frames += 1000;
        }
        (frames, sent.is_err())
    };
    let looking: Vec<Socket> = (0..8).map(|_| program.subject.live()).collect();
    let mut operator = program.operator.live();
    operator.word("start");
    operator.phase("rest");
    let floods: Vec<_> =
        looking.into_iter().map(|socket| std::thread::spawn(move || flood(socket))).collect();
    let asked = std::time::Instant::now();
    operator.word("pause");
    operator.phase("paused");
    let waited = asked.elapsed();
    for flood in floods {
        let (frames, was_sent_away) = flood.join().unwrap();
        assert!(was_sent_away, "{frames} frames were taken");
    }
    // On an idle machine 40 ms.
    assert!(waited < Duration::from_secs(30), "{waited:?}");
}

#[test]
fn no_more_pages_are_open_than_anybody_needs() {
    let program = Program::run(&[]);
    let open: Vec<_> = (0..8).map(|_| program.operator.live()).collect();
    let own = format!("http://{}", program.operator.host);
    let live = format!("{}live", program.operator.path);
    assert_eq!(program.operator.open(&live, Some(&own)).err(), Some(503));
    // The subject's page is not kept out by them.
    program.subject.live().until("a picture", |message| message["kind"] == "now");
    drop(open);
    // As soon as one is gone, there is room.
    let begun = std::time::Instant::now();
    while program.operator.open(&live, Some(&own)).is_err() {
        assert!(begun.elapsed() < FOREVER);
        std::thread::sleep(Duration::from_millis(20));
    }
}

/// The figures of the loop's lateness are `scripts/console-latency`'s; here it must come through, sample by sample.
#[test]
fn ten_thousand_connections_keep_nobody_out_and_delay_nothing() {
    let mut program = Program::run(&["--speed", "4"]);
    let mut operator = program.operator.live();
    operator.phase("ready");
    operator.word("start");
    // The first trial runs in the flood; then the loop goes on, paused, until it is over.
    operator.phase("hold");
    operator.send(&json!("pause_after_trial"));
    let (host, page) = (program.operator.host.clone(), program.operator.clone());
    let flood = std::thread::spawn(move || {
        let mut held: Vec<TcpStream> = Vec::new();
        for number in 0..10_000 {
            // Refused or cut is as good as let in.
            if let Ok(mut stream) = TcpStream::connect(&host) {
                let _ = stream.write_all(b"GET / HTTP/1.1\r\n");
                held.push(stream);
            }
            if held.len() > 500 {
                held.drain(..250);
            }
            if number % 1000 == 999 {
                // A page can be opened in the middle of it.
                let answer = page.get(&page.path);
                assert_eq!(status(&answer), "200", "after {number} connections");
            }
        }
    });
    while !flood.is_finished() {
        operator.until("a picture", |message| message["kind"] == "now");
    }
    flood.join().unwrap();
    operator.phase("paused");
    operator.word("resume");
    let last = operator.phase("finished");
    assert_eq!(last["left_out"], 0, "the hub missed samples");
    drop(operator);
    assert_eq!(program.ends(), Some(0));
    let trials = std::fs::read_to_string(program.session.join("trials.csv")).unwrap();
    assert_eq!(trials.lines().filter(|line| line.contains(",ok,")).count(), 8);
    let replayed = ramphold::dataset::replay(&program.session).unwrap();
    assert_eq!(replayed.difference, None);
}

/// Who connects and says nothing has its place for a few seconds.
#[test]
fn a_silent_connection_is_cut() {
    let program = Program::run(&[]);
    let mut silent = program.operator.connect();
    let mut answer = Vec::new();
    // A read that ends by its own time limit is an error of another kind.
    match silent.read_to_end(&mut answer) {
        Ok(_) => {}
        Err(error) => assert_eq!(error.kind(), ErrorKind::ConnectionReset, "{error}"),
    }
    assert!(!String::from_utf8_lossy(&answer).contains("200 OK"));
}

/// Reads three pictures without an answer to them, and checks that no fourth comes.
fn three_pictures(page: &mut Socket) -> Vec<Value> {
    let mut next = |patience| {
        page.0.get_mut().set_read_timeout(Some(patience)).unwrap();
        loop {
            let Ok(Message::Text(text)) = page.0.read() else { return None };
            let message: Value = serde_json::from_str(&text).unwrap();
            if message["kind"] == "now" {
                return Some(message);
            }
        }
    };
    let pictures: Vec<Value> = (0..3).map(|_| next(FOREVER).expect("a picture")).collect();
    assert_eq!(next(Duration::from_millis(300)), None, "a picture more than the page can have");
    pictures
}

/// A page that does not answer is sent three pictures, and no more until it does.
#[test]
fn a_slow_page_misses_pictures_instead_of_getting_old_ones() {
    let program = Program::run(&["--speed", "5"]);
    let mut operator = program.operator.live();
    operator.phase("ready");
    let own = format!("http://{}", program.subject.host);
    let mut slow = program.subject.open(&format!("{}live", program.subject.path), Some(&own)).unwrap();
    operator.word("start");
    operator.phase("hold");
    three_pictures(&mut slow);
    slow.send(&json!({ "seen": 3 }));
    let then = three_pictures(&mut slow);
    assert_ne!(then[0]["cue"], "wait", "it got an old picture");
}
