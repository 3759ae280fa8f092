//! `cargo sim console` at a pseudo-terminal, with a thread in place of the firmware.
#![cfg(unix)]

use std::collections::BTreeMap;
use std::io::{Read, Write};
use std::os::unix::net::UnixStream;
use std::process::{Command, Output};
use std::sync::{Arc, Mutex};

use crate::cli_common::folder;
use drive_core::{Fault, State};
use hil_sim::console::catalogue::Catalogue;
use hil_sim::console::link::{Link, LinkError, is_off};
use serialport::{SerialPort as _, TTYPort};

/// A firmware with two settings.
#[derive(Default)]
struct Firmware {
    echo: bool,
    settings: BTreeMap<&'static str, f64>,
    heard: Vec<String>,
}

type Shared = Arc<Mutex<Firmware>>;

fn firmware(echo: bool) -> Shared {
    let settings = BTreeMap::from([("motor.r_r", 1.1), ("motor.r_s", 5.4)]);
    Arc::new(Mutex::new(Firmware { echo, settings, heard: Vec::new() }))
}

impl Firmware {
    fn answer(&mut self, line: &str) -> String {
        self.heard.push(line.to_owned());
        let words: Vec<&str> = line.split_whitespace().collect();
        let listed = |line: &dyn Fn((&&str, &f64)) -> String| {
            let lines = self.settings.iter().map(|setting| line(setting) + "\r\n");
            lines.collect::<String>() + "ok\r\n"
        };
        match words[..] {
            ["help"] => "status   the state\r\nset KEY VALUE  sets\r\nok\r\n".into(),
            ["status"] => "* fault 4: dc link above its limit\r\noff; i_d 0.00 A\r\n".into(),
            ["trace", ..] => "t_s,i_q_a,v_q_v\r\n0,1,20\r\n0.1,2,30\r\nok\r\n".into(),
            ["board"] => "board bench: two settings\r\nok\r\n".into(),
            ["board", "bench"] | ["apply" | "revert"] => "ok\r\n".into(),
            ["backup"] => listed(&|(name, value)| format!("set {name} {value}")),
            ["describe"] => {
                listed(&|(name, value)| format!("{{\"name\":\"{name}\",\"value\":{value}}}"))
            }
            ["set", name, value] => match (self.settings.get_mut(name), value.parse::<f64>()) {
                (Some(setting), Ok(value)) if (0.1..=9.0).contains(&value) => {
                    *setting = value;
                    "ok\r\n".into()
                }
                _ => format!("error: {name} {value}: allowed 0.1 to 9\r\n"),
            },
            [] => String::new(),
            _ => "error: no such command\r\n".into(),
        }
    }
}

/// Answers at a port until it is closed.
fn serve(mut port: impl Read + Write, firmware: &Shared) {
    let (mut line, mut byte) = (Vec::new(), [0]);
    loop {
        match port.read(&mut byte) {
            Ok(1) => {}
            Err(error) if error.kind() == std::io::ErrorKind::TimedOut => continue,
            _ => return,
        }
        if byte[0] != b'\n' {
            line.push(byte[0]);
            continue;
        }
        let text = String::from_utf8(std::mem::take(&mut line)).unwrap();
        let mut firmware = firmware.lock().unwrap();
        let echo = if firmware.echo { format!("{text}\r\n") } else { String::new() };
        // A sign of life has no answer; every other line has a tag, which the last line of the answer repeats.
        let (tag, request) = text.split_once(' ').unwrap_or_default();
        let answer = firmware.answer(request);
        let (before, last) = answer.trim_end().rsplit_once('\n').unwrap_or(("", answer.trim_end()));
        let before = if before.is_empty() { String::new() } else { format!("{before}\n") };
        let last = if tag.is_empty() { String::new() } else { format!("{tag} {last}\r\n") };
        let answer = echo + &before + &last;
        if port.write_all(answer.as_bytes()).is_err() {
            return;
        }
    }
}

/// Opens a pseudo-terminal with a firmware behind it. The second end stays open, as with the virtual board.
fn port(firmware: &Shared) -> (TTYPort, String) {
    let (ours, theirs) = TTYPort::pair().expect("a pseudo-terminal");
    let firmware = firmware.clone();
    std::thread::spawn(move || serve(ours, &firmware));
    let name = theirs.name().expect("a name");
    (theirs, name)
}

fn console(port: &str, commands: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_hil-sim"));
    command.args(["console", "--port", port]);
    command.args(commands.iter().flat_map(|line| ["--command", line]));
    command.output().expect("the binary runs")
}

fn texts(output: &Output) -> (Option<i32>, String, String) {
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    (output.status.code(), text(&output.stdout), text(&output.stderr))
}

#[test]
fn answers_are_printed_and_unasked_lines_kept_apart() {
    for echo in [false, true] {
        let firmware = firmware(echo);
        let (_theirs, port) = port(&firmware);
        let (code, out, err) = texts(&console(&port, &["status", "set motor.r_s 6", "help"]));
        assert_eq!(code, Some(0), "{err}");
        let help = "status   the state\nset KEY VALUE  sets\nok\n";
        assert_eq!(out, format!("off; i_d 0.00 A\nok\n{help}"));
        assert!(err.contains("fault 4: dc link above its limit"), "{err}");
        assert_eq!(firmware.lock().unwrap().settings["motor.r_s"], 6.0);
    }
}

#[test]
fn the_first_error_ends_it_with_exit_code_1() {
    let firmware = firmware(false);
    let (_theirs, port) = port(&firmware);
    let (code, out, err) = texts(&console(&port, &["set motor.r_s 99", "status"]));
    assert_eq!((code, out.as_str()), (Some(1), "error: motor.r_s 99: allowed 0.1 to 9\n"));
    assert!(err.contains("the drive refuses `set motor.r_s 99`: motor.r_s 99: allowed"), "{err}");
    assert!(!firmware.lock().unwrap().heard.contains(&"status".to_owned()));
    // A command of this program that does not exist is never sent to the drive.
    let (code, _, err) = texts(&console(&port, &["!backupp x"]));
    assert_eq!(code, Some(2));
    assert!(err.contains("`!backupp x`: no such command") && err.contains("!backup FILE"), "{err}");
}

#[test]
fn settings_go_to_a_file_and_back() {
    let firmware = firmware(false);
    let (_theirs, port) = port(&firmware);
    let file = folder("backup").join("drive.txt");
    let [backup, restore] = ["backup", "restore"].map(|w| format!("!{w} {}", file.display()));
    let (code, out, err) = texts(&console(&port, &[&backup, "set motor.r_s 2", &restore]));
    assert_eq!(code, Some(0), "{out}{err}");
    let text = std::fs::read_to_string(&file).unwrap();
    assert_eq!(text, "set motor.r_r 1.1\nset motor.r_s 5.4\n");
    assert_eq!(firmware.lock().unwrap().settings["motor.r_s"], 5.4);

    // The rest is sent, but not what would put it in force without the refused lines.
    let lines = "# mine\n\nset motor.r_r 2\nset motor.r_s 77\nset motor.r_r 3\nset new 1\napply\n";
    std::fs::write(&file, lines).unwrap();
    let (code, _, err) = texts(&console(&port, &[&restore]));
    assert_eq!(code, Some(1));
    for said in [
        "drive.txt, line 4: `set motor.r_s 77`: ",
        "allowed 0.1 to 9\nline 6: `set new 1`: ",
        "`apply rest`",
    ] {
        assert!(err.contains(said), "{said} is not in {err}");
    }
    let heard = std::mem::take(&mut firmware.lock().unwrap().heard);
    let last =
        ["board bench", "set motor.r_r 2", "set motor.r_s 77", "set motor.r_r 3", "set new 1"];
    assert!(heard.ends_with(&last.map(str::to_owned)), "{heard:?}");
    // A file of another kind is dropped before it is sent whole.
    std::fs::write(&file, "what is this?\n".repeat(40)).unwrap();
    let (code, _, err) = texts(&console(&port, &[&restore]));
    assert!(code == Some(1) && err.contains("all its lines are dropped"), "{err}");
    let heard = &firmware.lock().unwrap().heard;
    let sent = heard.iter().filter(|line| line.starts_with("what")).count();
    assert_eq!((sent, heard.last().map(String::as_str)), (21, Some("revert")));
}

#[test]
fn the_last_trace_is_plotted() {
    let (_theirs, port) = port(&firmware(false));
    let file = folder("plot").join("trace.svg");
    let plot = format!("!plot {}", file.display());
    let (code, _, err) = texts(&console(&port, &[&plot]));
    assert_eq!(code, Some(2));
    assert!(err.contains("no trace yet"), "{err}");
    let (code, out, err) = texts(&console(&port, &["trace 2", &plot]));
    assert_eq!(code, Some(0), "{err}");
    assert!(out.contains("t_s,i_q_a,v_q_v") && out.contains("2 records in"), "{out}");
    let svg = std::fs::read_to_string(file).unwrap();
    assert!(svg.contains("i_q (A)") && svg.contains("v_q (V)") && svg.contains("t (s)"));
}

#[test]
fn the_drive_lists_what_can_be_completed() {
    let (ours, theirs) = UnixStream::pair().unwrap();
    let firmware = firmware(false);
    std::thread::spawn(move || serve(ours, &firmware));
    let mut link = Link::new(theirs.try_clone().unwrap(), theirs, |_: &str| ());
    let catalogue = Catalogue::read(&mut link).unwrap();
    assert_eq!(catalogue.settings(), 2);
    assert_eq!(catalogue.complete("set motor.r_s 1 mo").1, ["motor.r_r", "motor.r_s"]);
    assert_eq!(catalogue.complete("sta").1, ["status"]);
}

/// The port closes, or another line ends the list.
#[test]
fn an_answer_that_cannot_be_whole_ends_the_wait() {
    for said in ["", "a  b\r\n@2 ok\r\n"] {
        let (mut ours, theirs) = UnixStream::pair().unwrap();
        let (show, shown) = std::sync::mpsc::channel();
        let show = move |line: &str| drop(show.send(line.to_owned()));
        let mut link = Link::new(theirs.try_clone().unwrap(), theirs, show);
        std::thread::spawn(move || {
            let _ = ours.read(&mut [0; 8]);
            ours.write_all(said.as_bytes()).unwrap();
        });
        match link.ask("help", |_| ()) {
            Err(LinkError::Cut(line)) => {
                assert_eq!((line.as_str(), shown.recv().unwrap().as_str()), ("help", "ok"));
            }
            Err(LinkError::Closed) => {
                assert!(said.is_empty());
                assert!(matches!(link.ask("status", |_| ()), Err(LinkError::Closed)));
            }
            other => panic!("{said:?}: {other:?}"),
        }
    }
}

/// In the words of the firmware.
#[test]
fn the_outputs_are_off_in_the_states_in_which_they_are() {
    let running =
        [State::Calibrating, State::Torque, State::Learning, State::Braking, State::Stopping];
    let faults = Fault::ALL.iter().map(|fault| State::Fault(*fault));
    for state in running.into_iter().chain([State::Off]).chain(faults) {
        assert_eq!(is_off(&format!("{state}; i_d 0.00 A")), state.is_off(), "{state}");
    }
    assert!(!is_off("error: the control interrupt does not run") && !is_off("off"));
}
