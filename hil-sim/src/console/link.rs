//! Moves lines between this program and the drive. A thread reads; its lines go to the request that awaits an answer,
//! or are shown at once. Each request has its own tag, which distinguishes its answer from other lines
//! ([`super::answer`]). Frames of a stream between the lines are passed on separately.

use std::io::{ErrorKind, Read, Write};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use drive_stream::{Frame, Piece, Splitter};

use super::answer::{self, Meaning, is_error};
use super::trace::Trace;

/// Longest wait for the next line of an answer: computing a setting takes seconds, on a virtual board at a fraction of real time.
const PATIENCE: Duration = Duration::from_secs(20);
/// Longest wait for a line of a trace, which is recorded before anything is sent.
const PATIENCE_WITH_TRACE: Duration = Duration::from_secs(600);
/// Longest line that is assembled.
const LONGEST: usize = 4096;

/// Reasons for a missing answer.
#[derive(Debug, thiserror::Error)]
pub enum LinkError {
    /// The drive does not answer.
    #[error("`{0}`: no answer within {1} s")]
    Silence(String, u64),
    /// The port is gone: unplugged, or the virtual board has ended.
    #[error("the port is closed")]
    Closed,
    /// An urgent line was sent meanwhile, which ends a list.
    #[error("`{0}`: cut short by another line")]
    Cut(String),
}

/// The answer to a command.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Answer {
    /// The lines of the answer, including the last one.
    pub lines: Vec<String>,
}

impl Answer {
    /// Returns the line that refuses the command.
    pub fn error(&self) -> Option<&str> {
        self.lines.last().map(String::as_str).filter(|line| is_error(line))
    }

    /// Returns the lines without an `ok` at the end.
    pub fn contents(&self) -> &[String] {
        match self.lines.split_last() {
            Some((last, before)) if last == "ok" => before,
            _ => &self.lines,
        }
    }
}

/// Destinations of the lines from the drive.
struct Route {
    /// The command that awaits them.
    asked: Option<Sender<String>>,
    /// Otherwise the person.
    show: Box<dyn FnMut(&str) + Send>,
    frames: Box<dyn FnMut(Option<Frame>) + Send>,
    trace: Trace,
    closed: bool,
}

impl Route {
    fn line(&mut self, line: String) {
        self.trace.push(&line);
        match &self.asked {
            Some(asked) => drop(asked.send(line)),
            None => self.unawaited(&line),
        }
    }

    /// Shows a line that no command awaits, without its tag.
    fn unawaited(&mut self, line: &str) {
        (self.show)(answer::split_tag(line).map_or(line, |(_, rest)| rest));
    }
}

/// The direction to the drive.
type Port = Arc<Mutex<Outgoing>>;

struct Outgoing {
    port: Box<dyn Write + Send>,
    /// Tag of the last request.
    tag: u32,
}

impl Outgoing {
    /// Sends a request and returns its tag. An empty line is a sign of life, which has no answer and interrupts nothing.
    fn send(&mut self, request: &str) -> std::io::Result<u32> {
        let line = if request.is_empty() {
            String::new()
        } else {
            self.tag = self.tag.wrapping_add(1);
            answer::tagged(self.tag, request)
        };
        self.port.write_all(format!("{line}\n").as_bytes())?;
        self.port.flush()?;
        Ok(self.tag)
    }
}

/// A connection to a drive.
pub struct Link {
    port: Port,
    route: Arc<Mutex<Route>>,
}

/// Sends urgent lines, without waiting for an answer that is awaited.
#[derive(Clone)]
pub struct Urgent(Port);

impl Urgent {
    /// Sends a line at once. Its answer is shown, unless a list is being answered: then the line cuts the list short.
    ///
    /// # Errors
    /// The port is closed.
    pub fn send(&self, line: &str) -> Result<(), LinkError> {
        locked(&self.0).send(line).map(drop).map_err(|_| LinkError::Closed)
    }
}

impl Link {
    /// Makes a connection over two directions of a port; `show` gets the lines that answer nothing.
    pub fn new(
        reader: impl Read + Send + 'static,
        port: impl Write + Send + 'static,
        show: impl FnMut(&str) + Send + 'static,
    ) -> Self {
        Self::with_frames(reader, port, show, |_| ())
    }

    /// Makes a connection like [`Link::new`]; `frames` gets the frames of a stream, and `None` for damaged bytes.
    pub fn with_frames(
        reader: impl Read + Send + 'static,
        port: impl Write + Send + 'static,
        show: impl FnMut(&str) + Send + 'static,
        frames: impl FnMut(Option<Frame>) + Send + 'static,
    ) -> Self {
        let (show, frames) = (Box::new(show), Box::new(frames));
        let route = Route { asked: None, show, frames, trace: Trace::default(), closed: false };
        let route = Arc::new(Mutex::new(route));
        let to = route.clone();
        std::thread::spawn(move || read_lines(reader, &to));
        let port = Arc::new(Mutex::new(Outgoing { port: Box::new(port), tag: 0 }));
        Self { port, route }
    }

    /// Returns a sender for urgent lines.
    pub fn urgent(&self) -> Urgent {
        Urgent(self.port.clone())
    }

    /// Whether the port is closed.
    pub fn is_closed(&self) -> bool {
        locked(&self.route).closed
    }

    /// Ends a line that may have begun on the drive's side, and ignores its answer.
    pub fn begin(&mut self) {
        // A closed port is detected by the first command.
        let _ = locked(&self.port).send("");
        std::thread::sleep(Duration::from_millis(100));
    }

    /// Sends a command and receives its answer; `show` gets every line when it comes.
    ///
    /// # Errors
    /// There is no complete answer.
    pub fn ask(&mut self, command: &str, mut show: impl FnMut(&str)) -> Result<Answer, LinkError> {
        let (send, lines) = channel();
        {
            let mut route = locked(&self.route);
            if route.closed {
                return Err(LinkError::Closed);
            }
            route.asked = Some(send);
        }
        let sent = locked(&self.port).send(command);
        let answer = match sent {
            Ok(tag) => self.hear(command, tag, &lines, &mut show),
            Err(_) => Err(LinkError::Closed),
        };
        let mut route = locked(&self.route);
        route.asked = None;
        lines.try_iter().for_each(|line| route.unawaited(&line));
        answer
    }

    fn hear(
        &self,
        command: &str,
        tag: u32,
        lines: &Receiver<String>,
        show: &mut impl FnMut(&str),
    ) -> Result<Answer, LinkError> {
        let mut answer = Answer::default();
        // A trace is recorded before anything is sent.
        let is_trace = command.split_whitespace().next() == Some("trace");
        let patience = if is_trace { PATIENCE_WITH_TRACE } else { PATIENCE };
        loop {
            let line = lines.recv_timeout(patience).map_err(|why| match why {
                RecvTimeoutError::Timeout => {
                    LinkError::Silence(command.to_owned(), patience.as_secs())
                }
                RecvTimeoutError::Disconnected => LinkError::Closed,
            })?;
            match answer::meaning(tag, command, &line) {
                Meaning::Echo => {}
                Meaning::Unasked => (locked(&self.route).show)(&line),
                Meaning::Older(rest) => (locked(&self.route).show)(rest),
                Meaning::Younger(rest) => {
                    (locked(&self.route).show)(rest);
                    return Err(LinkError::Cut(command.to_owned()));
                }
                Meaning::Answer => {
                    show(&line);
                    answer.lines.push(line);
                }
                Meaning::Last(rest) => {
                    show(rest);
                    answer.lines.push(rest.to_owned());
                    return Ok(answer);
                }
            }
        }
    }

    /// Returns the last trace that the drive has printed.
    pub fn last_trace(&self) -> Option<Trace> {
        Some(locked(&self.route).trace.clone()).filter(|trace| trace.records() > 0)
    }
}

/// Ends the reading thread, and with it closes the port, within the time limit of a read.
impl Drop for Link {
    fn drop(&mut self) {
        locked(&self.route).closed = true;
    }
}

/// If a thread panicked while it held the lock, the data behind the lock are still valid.
pub(crate) fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

fn read_lines(mut reader: impl Read, route: &Mutex<Route>) {
    let (mut buffer, mut line, mut splitter) = ([0; 1024], Vec::new(), Splitter::new());
    while !locked(route).closed {
        match reader.read(&mut buffer) {
            Ok(0) => break,
            Ok(read) => {
                for byte in &buffer[..read] {
                    match splitter.push(*byte) {
                        Piece::Nothing => {}
                        Piece::Frame(frame) => (locked(route).frames)(Some(frame)),
                        Piece::Damaged => (locked(route).frames)(None),
                        Piece::Text(byte)
                            if !matches!(byte, b'\r' | b'\n') && line.len() < LONGEST =>
                        {
                            line.push(byte);
                        }
                        Piece::Text(_) => {
                            let text = readable(&std::mem::take(&mut line));
                            if !text.is_empty() {
                                locked(route).line(text);
                            }
                        }
                    }
                }
            }
            Err(error) => match error.kind() {
                ErrorKind::TimedOut | ErrorKind::WouldBlock | ErrorKind::Interrupted => {}
                _ => break,
            },
        }
    }
    let mut route = locked(route);
    route.closed = true;
    route.asked = None;
}

/// Returns the text of a line without the sequences that move the cursor of a terminal.
fn readable(bytes: &[u8]) -> String {
    let text = String::from_utf8_lossy(bytes);
    let mut shown = String::new();
    let mut rest = text.chars();
    while let Some(c) = rest.next() {
        match c {
            // ESC [ parameters letter
            '\x1b' => drop(rest.by_ref().find(|c| c.is_ascii_alphabetic())),
            c if c.is_control() => {}
            c => shown.push(c),
        }
    }
    shown.trim_end().to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Simulates a drive that answers each request with the next of these texts; returns the lines that were shown as unsolicited.
    #[cfg(unix)]
    fn talk(answers: &'static [&str], with: impl FnOnce(&mut Link, &Urgent)) -> Vec<String> {
        use std::io::{BufRead as _, BufReader};
        use std::os::unix::net::UnixStream;
        let (ours, theirs) = UnixStream::pair().unwrap();
        let (shown, unasked) = channel();
        let show = move |line: &str| drop(shown.send(line.to_owned()));
        let mut link = Link::new(ours.try_clone().unwrap(), ours, show);
        let mut out = theirs.try_clone().unwrap();
        let drive = std::thread::spawn(move || {
            let lines = BufReader::new(theirs).lines().map_while(Result::ok);
            // The order matters: the simulated drive does not wait for a line after the last answer.
            for (answer, _) in answers.iter().zip(lines.filter(|line| !line.is_empty())) {
                std::thread::sleep(Duration::from_millis(30));
                out.write_all(answer.as_bytes()).unwrap();
            }
        });
        let urgent = link.urgent();
        with(&mut link, &urgent);
        drive.join().unwrap();
        std::thread::sleep(Duration::from_millis(50));
        unasked.try_iter().collect()
    }

    #[cfg(unix)]
    #[test]
    fn the_answer_to_an_urgent_line_is_no_answer_to_the_next_command() {
        let answers = &["@1 ok\r\n", "* running: torque\r\n@2 off; dc link 311 V\r\n"];
        let shown = talk(answers, |link, urgent| {
            urgent.send("stop").unwrap();
            urgent.send("").unwrap();
            assert_eq!(link.ask("status", |_| ()).unwrap().lines, ["off; dc link 311 V"]);
        });
        assert_eq!(shown, ["ok", "* running: torque"]);
    }

    #[cfg(unix)]
    #[test]
    fn an_urgent_line_cuts_a_list_short_and_nothing_else() {
        let answers = &[
            "a  b\r\nc  d\r\n",
            "@2 ok\r\n",
            "@3 off; x\r\n",
            "@4 ok\r\n",
            "off: y\r\nok\r\n@5 ok\r\n",
        ];
        let shown = talk(answers, |link, urgent| {
            let later = |urgent: Urgent| {
                std::thread::spawn(move || {
                    std::thread::sleep(Duration::from_millis(10));
                    urgent.send("stop").unwrap();
                })
            };
            let sent = later(urgent.clone());
            let cut = link.ask("help", |_| ());
            assert!(matches!(cut, Err(LinkError::Cut(_))), "{cut:?}");
            sent.join().unwrap();
            let sent = later(urgent.clone());
            assert_eq!(link.ask("status", |_| ()).unwrap().lines, ["off; x"]);
            sent.join().unwrap();
            // Lines that look like unsolicited ones, or like an end, still belong to a list.
            assert_eq!(link.ask("help", |_| ()).unwrap().lines, ["off: y", "ok", "ok"]);
        });
        assert_eq!(shown, ["ok", "ok"]);
    }

    #[test]
    fn sequences_of_a_terminal_are_no_text() {
        assert_eq!(readable(b"\x1b[Kstatus \x07"), "status");
        assert_eq!(readable("25 °C".as_bytes()), "25 °C");
    }
}
