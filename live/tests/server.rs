//! Tests which clients may connect, what a bad or slow page can do, and what its loss causes. The drive is a stand-in that accepts every
//! line.

use std::io::{BufRead as _, BufReader, Read as _, Write as _};
use std::net::{SocketAddr, TcpStream};
use std::os::unix::net::UnixStream;
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use drive_live::shared::Shared;
use drive_live::{drive, server, shared};
use drive_stream::{Frame, LONGEST};
use drive_web::loops;
use hil_sim::console::link::Link;
use serde_json::{Value, json};
use tungstenite::client::IntoClientRequest as _;
use tungstenite::stream::MaybeTlsStream;
use tungstenite::{Error, Message, WebSocket};

const TOKEN: &str = "0123456789abcdef";
type Page = WebSocket<MaybeTlsStream<TcpStream>>;
type Lines = Arc<Mutex<Vec<(Instant, String)>>>;

/// A server with a drive that notes the lines that it receives.
struct Served {
    address: SocketAddr,
    lines: Lines,
    wire: UnixStream,
    shared: Arc<Shared>,
}

/// Answers as the console does, except for the tag.
fn answer(line: &str) -> &'static str {
    match line {
        "describe stream" => {
            "{\"signal\":\"i_q_a\",\"unit\":\"a\"}\r\n{\"frame\":[\"u16 sequence\",\"u32 period\",\"f32 per signal\",\"u16 crc\"]}\r\nok\r\n"
        }
        "status" => "regulating torque; i_q 1.00 of 1.00 A, dc link 311 V\r\n",
        "version" => "0.1.0, commit 1234\r\n",
        "" => "",
        _ => "ok\r\n",
    }
}

fn served() -> Served {
    served_with(answer)
}

fn served_with(answer: fn(&str) -> &'static str) -> Served {
    let (ours, theirs) = UnixStream::pair().unwrap();
    let lines = Lines::default();
    let (heard, mut out) = (lines.clone(), theirs.try_clone().unwrap());
    let reader = theirs.try_clone().unwrap();
    std::thread::spawn(move || {
        for line in BufReader::new(reader).lines().map_while(Result::ok) {
            let (tag, line) = match line.split_once(' ') {
                Some((tag, line)) if tag.starts_with('@') => (format!("{tag} "), line.to_owned()),
                _ => (String::new(), line),
            };
            // The last line of an answer repeats the tag.
            let said = answer(&line);
            let last = said.trim_end().rfind('\n').map_or(0, |at| at + 1);
            let _ = write!(out, "{}{tag}{}", &said[..last], &said[last..]);
            heard.lock().unwrap().push((Instant::now(), line));
        }
    });
    let shared = Shared::new();
    let worker = shared.clone();
    let mut link = Some(ours);
    std::thread::spawn(move || {
        drive::run(&worker, |shared| {
            let ours = link.take().ok_or("once")?;
            let (writer, frames) = (ours.try_clone().unwrap(), shared.clone());
            Ok(Link::with_frames(ours, writer, |_| (), move |frame| frames.frame(frame)))
        });
    });
    let watcher = shared.clone();
    std::thread::spawn(move || drive::watch(&watcher));
    let (send, address) = std::sync::mpsc::channel();
    let used = shared.clone();
    std::thread::spawn(move || {
        let runtime = tokio::runtime::Builder::new_multi_thread().enable_all().build().unwrap();
        runtime.block_on(async {
            let listener = tokio::net::TcpListener::bind("127.0.0.1:0").await.unwrap();
            send.send(listener.local_addr().unwrap()).unwrap();
            server::serve(listener, TOKEN.to_owned(), used).await.unwrap();
        });
    });
    Served { address: address.recv().unwrap(), lines, wire: theirs, shared }
}

impl Served {
    fn open(&self, token: &str, origin: Option<&str>, host: Option<&str>) -> Result<Page, Error> {
        let url = format!("ws://{}/ws?token={token}", self.address);
        let mut request = url.into_client_request().unwrap();
        let headers = request.headers_mut();
        origin.map(|origin| headers.insert("origin", origin.parse().unwrap()));
        host.map(|host| headers.insert("host", host.parse().unwrap()));
        let (page, _) = tungstenite::connect(request)?;
        if let MaybeTlsStream::Plain(stream) = page.get_ref() {
            stream.set_read_timeout(Some(Duration::from_secs(5))).unwrap();
        }
        Ok(page)
    }

    fn own(&self) -> Page {
        self.open(TOKEN, Some(&format!("http://{}", self.address)), None).unwrap()
    }

    fn get(&self, path: &str, host: &str) -> String {
        let mut stream = TcpStream::connect(self.address).unwrap();
        write!(stream, "GET {path} HTTP/1.1\r\nHost: {host}\r\nConnection: close\r\n\r\n").unwrap();
        let mut answer = String::new();
        stream.read_to_string(&mut answer).unwrap();
        answer
    }

    fn got(&self, line: &str) -> Option<Instant> {
        self.lines.lock().unwrap().iter().find(|(_, known)| known == line).map(|(at, _)| *at)
    }

    fn waits_for(&self, line: &str) -> Instant {
        let began = Instant::now();
        loop {
            if let Some(at) = self.got(line) {
                return at;
            }
            assert!(began.elapsed() < Duration::from_secs(5), "the drive never got {line:?}");
            std::thread::sleep(Duration::from_millis(5));
        }
    }
}

/// Reads, and answers as a page does, until a message has this member.
fn until(page: &mut Page, member: &str) -> Value {
    for _ in 0..200 {
        if let Message::Text(text) = page.read().unwrap() {
            let messages: Vec<Value> = serde_json::from_str(&text).unwrap();
            page.send(Message::text("\"ack\"")).unwrap();
            if let Some(found) = messages.into_iter().find(|m| !m[member].is_null()) {
                return found;
            }
        }
    }
    panic!("no {member}");
}

fn ask(page: &mut Page, id: u64, line: &str) -> Value {
    page.send(Message::text(json!({ "ask": [id, line] }).to_string())).unwrap();
    loop {
        let answer = until(page, "id");
        if answer["id"] == id {
            return answer;
        }
    }
}

#[test]
fn only_the_own_page_with_its_token_is_served() {
    let served = served();
    let host = served.address.to_string();
    let page = served.get(&format!("/?token={TOKEN}"), &host);
    assert!(page.starts_with("HTTP/1.1 200") && page.contains("uPlot") && page.contains("STOP"));
    assert!(page.contains("content-security-policy: default-src 'none'"));
    // Nothing is loaded from elsewhere, so the page works offline.
    assert!(!page.contains("src=\"http") && !page.contains("href=\"http"));
    for path in ["/", "/?token=", "/?token=0123", "/ws", "/other"] {
        assert!(served.get(path, &host).starts_with("HTTP/1.1 403"), "{path}");
    }
    // A name that somebody points to this computer.
    let foreign = served.get(&format!("/?token={TOKEN}"), "evil.example");
    assert!(foreign.starts_with("HTTP/1.1 403"), "{foreign}");
    let own = format!("http://{host}");
    for (token, origin, name) in [
        (TOKEN, Some("http://evil.example"), None),
        (TOKEN, Some("null"), None),
        (TOKEN, None, None),
        ("wrong", Some(own.as_str()), None),
        ("", Some(own.as_str()), None),
        (TOKEN, Some(own.as_str()), Some("evil.example")),
    ] {
        match served.open(token, origin, name) {
            Err(Error::Http(answer)) => assert_eq!(answer.status(), 403),
            other => panic!("{token}, {origin:?}, {name:?}: {other:?}"),
        }
    }
    assert!(served.got("stop").is_none() && served.got("start").is_none());
    assert_eq!(until(&mut served.own(), "hello")["hello"]["misfit"], Value::Null);
}

#[test]
fn malformed_and_oversized_messages_reach_no_drive() {
    let served = served();
    let mut page = served.own();
    until(&mut page, "hello");
    for bad in [
        "",
        "{",
        "null",
        "[]",
        "{\"ask\":[1]}",
        "{\"ask\":[-1,\"start\"]}",
        "{\"run\":\"start\"}",
        "\"start\"",
    ] {
        page.send(Message::text(bad)).unwrap();
        assert!(
            until(&mut page, "refused")["refused"].as_str().unwrap().starts_with("not understood")
        );
    }
    page.send(Message::binary(vec![0; 100])).unwrap();
    until(&mut page, "refused");
    for line in ["", " ", "start\nstart", "start\rstart", "stärt", "baud 9600", &"a".repeat(121)] {
        assert!(ask(&mut page, 7, line)["error"].is_string(), "{line:?}");
    }
    // If a stream ends, the drive ends with this program.
    assert_eq!(ask(&mut page, 9, "STREAM i_q_a 6000")["lines"], json!(["ok"]));
    assert_eq!(ask(&mut page, 8, "torque 1")["lines"], json!(["ok"]));
    // A message that is too long ends the connection, and so stops the drive.
    let sent = page.send(Message::text("x".repeat(server::LONGEST + 1)));
    let ended = sent.is_err() || (0..100).any(|_| page.read().is_err());
    assert!(ended, "it is still connected");
    served.waits_for("stop");
    let stream = "STREAM i_q_a 6000 alive 0.4";
    let known = ["", "stop", "status", "version", "describe stream", "torque 1", stream];
    let lines = served.lines.lock().unwrap();
    assert!(lines.iter().all(|(_, line)| known.contains(&&**line)), "{lines:?}");
}

#[test]
fn a_page_that_closes_or_falls_silent_stops_the_drive_in_time() {
    for closes in [true, false] {
        let served = served();
        let mut page = served.own();
        let began = Instant::now();
        while began.elapsed() < Duration::from_secs(1) {
            until(&mut page, "tick");
        }
        assert!(served.got("stop").is_none(), "stopped a page that answers");
        assert!(served.got("").is_some(), "no sign of life");
        let left = Instant::now();
        let kept = if closes {
            page.close(None).unwrap();
            None
        } else {
            Some(page)
        };
        let after = served.waits_for("stop") - left;
        assert!(after < Duration::from_millis(500), "{after:?}, closed: {closes}");
        drop(kept);
    }
}

#[test]
fn a_slow_page_loses_frames_and_nothing_else() {
    let mut served = served();
    let mut page = served.own();
    until(&mut page, "hello");
    // The page accepts nothing while two minutes of frames come: far more than the sockets hold.
    let mut wire = [0; LONGEST];
    for sequence in 0..60_000_u16 {
        let frame =
            Frame { sequence, period: sequence.into(), values: [1.0; 8].into_iter().collect() };
        let length = frame.write(&mut wire);
        served.wire.write_all(&wire[..length]).unwrap();
    }
    // The drive was stopped, its lines are still answered, and a new page is served.
    served.waits_for("stop");
    let mut other = served.own();
    until(&mut other, "hello");
    let counts = until(&mut other, "tick")["tick"].clone();
    assert_eq!((&counts[0], &counts[1], &counts[2]), (&json!(60_000), &json!(0), &json!(0)));
    assert_eq!(ask(&mut other, 1, "torque 1")["lines"], json!(["ok"]));
    assert!(served.shared.page_is_alive());
}

#[test]
fn clients_that_send_slowly_or_too_much_hold_up_nobody() {
    let served = served();
    let mut page = served.own();
    until(&mut page, "hello");
    // A hundred clients that never end their request, and one with a head of a megabyte.
    let _half: Vec<_> = (0..100)
        .map(|_| {
            let mut stream = TcpStream::connect(served.address).unwrap();
            stream.write_all(b"GET /?token=").unwrap();
            stream
        })
        .collect();
    let mut stream = TcpStream::connect(served.address).unwrap();
    stream.set_read_timeout(Some(Duration::from_secs(5))).unwrap();
    let sent = stream.write_all(format!("GET /?token={}", "0".repeat(1 << 20)).as_bytes());
    let mut told = Vec::new();
    let read = stream.read_to_end(&mut told);
    let told = String::from_utf8_lossy(&told).into_owned();
    assert!(sent.is_err() || read.is_err() || told.starts_with("HTTP/1.1 4"), "{told}");
    assert_eq!(ask(&mut page, 1, "torque 1")["lines"], json!(["ok"]));
    assert!(served.got("stop").is_none(), "the drive was stopped");
}

/// The request may also follow one that has been answered.
#[test]
fn half_a_request_is_disconnected() {
    let served = served();
    let mut halves = [0, 1].map(|_| TcpStream::connect(served.address).unwrap());
    let whole = format!("GET / HTTP/1.1\r\nHost: {}\r\n\r\n", served.address);
    write!(halves[1], "{whole}{whole}").unwrap();
    for half in &mut halves {
        half.set_read_timeout(Some(2 * server::HEAD)).unwrap();
        write!(half, "GET /?token=").unwrap();
    }
    for mut half in halves {
        let mut told = String::new();
        half.read_to_string(&mut told).expect("it is still connected");
    }
}

/// If a page asks faster than the drive answers, questions above the limit are refused. A start that waits is not sent after a stop.
#[test]
fn a_flood_of_questions_is_refused_and_a_stop_empties_the_queue() {
    let slow = |line: &str| {
        if line.starts_with("torque") {
            std::thread::sleep(Duration::from_millis(100));
        }
        answer(line)
    };
    let served = served_with(slow);
    let mut page = served.own();
    until(&mut page, "hello");
    let asked = |id: u64, line: &str| Message::text(json!({ "ask": [id, line] }).to_string());
    (1..=5000).for_each(|id| page.send(asked(id, "torque 1")).unwrap());
    let refused = until(&mut page, "error")["error"].to_string();
    assert!(refused.contains(&format!("{} lines wait", shared::MOST_ASKS)), "{refused}");
    page.send(Message::text("\"stop\"")).unwrap();
    while until(&mut page, "stopped")["stopped"] != "by the page" {}
    for (id, line) in [(5001, "torque 2"), (5002, "start torque")] {
        page.send(asked(id, line)).unwrap();
    }
    page.send(Message::text("\"stop\"")).unwrap();
    assert_eq!(ask(&mut page, 5003, "torque 3")["lines"], json!(["ok"]));
    assert!(served.got("start torque").is_none(), "it was sent behind the stop");
}

#[test]
fn firmware_that_does_not_fit_is_told_in_words() {
    let older = |line: &str| match line {
        "describe stream" => "error: no such command: stream\r\n",
        other => answer(other),
    };
    let newer = |line: &str| match line {
        "describe stream" => "{\"frame\":[\"u32 sequence\",\"u32 period\"]}\r\nok\r\n",
        other => answer(other),
    };
    for (answers, says, cure) in [
        (older as fn(&str) -> &'static str, "older than the page", "cargo xtask flash"),
        (newer, "a layout that the page does not know", "git pull"),
    ] {
        let served = served_with(answers);
        let mut page = served.own();
        let hello = until(&mut page, "hello")["hello"].clone();
        let misfit = hello["misfit"].as_str().unwrap();
        assert!(misfit.contains(says) && misfit.contains(cure), "{misfit}");
        // All other requests work.
        assert_eq!(ask(&mut page, 1, "torque 1")["lines"], json!(["ok"]));
    }
}

#[test]
fn a_second_page_takes_over_a_drive_that_is_stopped() {
    let served = served();
    let mut first = served.own();
    until(&mut first, "hello");
    let mut second = served.own();
    until(&mut second, "hello");
    served.waits_for("stop");
    let told = (0..200).find_map(|_| match first.read() {
        Ok(Message::Text(text)) => Some(text.to_string()).filter(|text| text.contains("gone")),
        _ => None,
    });
    assert!(told.unwrap().contains("another page took over"));
    assert_eq!(ask(&mut second, 1, "torque 1")["lines"], json!(["ok"]));
}

fn set(key: &str, value: &str) -> String {
    json!({ "name": key, "value": value }).to_string()
}

/// The loops of the dissertation's drive with an encoder: 60 degrees and 4.4 Hz (`design_motion_loops`), and a current loop
/// whose gain is lowered to its margins.
#[test]
fn figures_of_the_loops_are_those_of_the_design() {
    let loops = loops::of(&[set("angle_source", "encoder"), "ok".into()]);
    let number = |row: usize, column: usize| loops[row][column].as_f64().unwrap();
    assert!((number(2, 2) - 60.0).abs() < 0.1, "{loops}");
    assert!((number(2, 1) - 4.4).abs() < 0.1, "{loops}");
    assert!((number(3, 1) - 1.1).abs() < 0.05, "{loops}");
    assert!(number(0, 2) >= 44.9 && number(0, 3) <= 2.21, "{loops}");
    // More phase margin makes the loop slower; a value may come as a number, as `describe` prints it.
    let margin = json!({ "name": "speed.phase_margin_deg", "value": 70 }).to_string();
    let calm = loops::of(&[set("angle_source", "encoder"), margin]);
    assert!((calm[2][2].as_f64().unwrap() - 70.0).abs() < 0.1, "{calm}");
    assert!(calm[2][1].as_f64().unwrap() < 3.0, "{calm}");
    let refused = loops::of(&[set("motor.r_s", "0")]);
    assert!(refused["error"].as_str().unwrap().contains("r_s in ohm"), "{refused}");
}

/// If a page is reloaded, the drive is stopped each time, however soon the page is back.
#[test]
fn a_page_that_is_reloaded_stops_the_drive() {
    let served = served();
    let mut page = served.own();
    until(&mut page, "hello");
    for reloads in 1..=20 {
        page.close(None).unwrap();
        while page.read().is_ok() {}
        page = served.own();
        until(&mut page, "hello");
        let stops = || served.lines.lock().unwrap().iter().filter(|(_, l)| l == "stop").count();
        let began = Instant::now();
        while stops() < reloads {
            // The stop comes before the page, which no longer answers, counts as lost.
            let waited = began.elapsed();
            assert!(waited < Duration::from_millis(200), "{} stops of {reloads}", stops());
            std::thread::sleep(Duration::from_millis(5));
        }
    }
}
