//! Moves lines between this program and the drive. A thread reads; its lines go to the command that awaits an answer, or
//! are shown at once. Frames of a stream between the lines go their own way.

use std::io::{ErrorKind, Read, Write};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use drive_stream::{Frame, Piece, Splitter};

use super::answer::{Awaited, Meaning, is_error};
use super::trace::{Collector, Trace};

/// Longest silence within an answer: a setting is designed for seconds, on a virtual board at a fraction of real time.
const PATIENCE: Duration = Duration::from_secs(20);
/// The same of a trace, which is recorded before anything is said.
const PATIENCE_WITH_TRACE: Duration = Duration::from_secs(600);
/// Longest line that is put together.
const LONGEST: usize = 4096;

/// Why there is no answer.
#[derive(Debug, thiserror::Error)]
pub enum LinkError {
    /// The drive says nothing.
    #[error("`{0}`: no answer within {1} s")]
    Silence(String, u64),
    /// The port is gone: unplugged, or the virtual board has ended.
    #[error("the port is closed")]
    Closed,
    /// A line that could not wait was sent meanwhile; it ends a list.
    #[error("`{0}`: cut short by another line")]
    Cut(String),
}

/// The answer to a command.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Answer {
    /// Its lines, the last one included.
    pub lines: Vec<String>,
}

impl Answer {
    /// The line that refuses the command.
    pub fn error(&self) -> Option<&str> {
        self.lines.last().map(String::as_str).filter(|line| is_error(line))
    }

    /// The lines but an `ok` at the end.
    pub fn contents(&self) -> &[String] {
        match self.lines.split_last() {
            Some((last, before)) if last == "ok" => before,
            _ => &self.lines,
        }
    }
}

/// Where the lines of the drive go.
struct Route {
    /// To the command that awaits them.
    asked: Option<Sender<String>>,
    /// Or to the person.
    show: Box<dyn FnMut(&str) + Send>,
    frames: Box<dyn FnMut(Option<Frame>) + Send>,
    traces: Collector,
    closed: bool,
    /// Answers to urgent lines that come before that to the command, and behind it.
    owed: u32,
    owed_behind: u32,
}

impl Route {
    fn line(&mut self, line: String) {
        self.traces.push(&line);
        match &self.asked {
            Some(asked) if self.owed == 0 || !ends_answer(&line) => drop(asked.send(line)),
            _ => self.unasked(&line),
        }
    }

    /// Shows a line that answers no command.
    fn unasked(&mut self, line: &str) {
        if ends_answer(line) {
            self.owed = self.owed.saturating_sub(1);
        }
        (self.show)(line);
    }
}

/// The direction to the drive.
type Port = Arc<Mutex<Outgoing>>;

struct Outgoing(Box<dyn Write + Send>);

impl Outgoing {
    fn send(&mut self, line: &str) -> std::io::Result<()> {
        self.0.write_all(format!("{line}\n").as_bytes())?;
        self.0.flush()
    }
}

/// Whether a line ends an answer, whatever the command was.
fn ends_answer(line: &str) -> bool {
    line == "ok" || line.starts_with("ok:") || is_error(line)
}

/// A connection to a drive.
pub struct Link {
    port: Port,
    route: Arc<Mutex<Route>>,
}

/// Sends lines that cannot wait for an answer that is awaited.
#[derive(Clone)]
pub struct Urgent(Port, Arc<Mutex<Route>>);

impl Urgent {
    /// Sends a line at once. Its answer is shown, unless a list is being answered: the line cuts that short.
    ///
    /// # Errors
    /// The port is gone.
    pub fn send(&self, line: &str) -> Result<(), LinkError> {
        // Locked while it is noted as well: the answers come in the order of the lines.
        let mut port = locked(&self.0);
        // An empty line is a sign of life, which has no answer and cuts nothing short.
        if !line.is_empty() {
            let mut route = locked(&self.1);
            match route.asked {
                Some(_) => route.owed_behind += 1,
                None => route.owed += 1,
            }
        }
        port.send(line).map_err(|_| LinkError::Closed)
    }
}

impl Link {
    /// A connection over two directions of a port; `show` gets the lines that answer nothing.
    pub fn new(
        reader: impl Read + Send + 'static,
        port: impl Write + Send + 'static,
        show: impl FnMut(&str) + Send + 'static,
    ) -> Self {
        Self::with_frames(reader, port, show, |_| ())
    }

    /// The same; `frames` gets the frames of a stream, and `None` for bytes that were damaged.
    pub fn with_frames(
        reader: impl Read + Send + 'static,
        port: impl Write + Send + 'static,
        show: impl FnMut(&str) + Send + 'static,
        frames: impl FnMut(Option<Frame>) + Send + 'static,
    ) -> Self {
        let (show, frames) = (Box::new(show), Box::new(frames));
        let route = Route {
            asked: None,
            show,
            frames,
            traces: Collector::default(),
            closed: false,
            owed: 0,
            owed_behind: 0,
        };
        let route = Arc::new(Mutex::new(route));
        let to = route.clone();
        std::thread::spawn(move || read_lines(reader, &to));
        let port = Arc::new(Mutex::new(Outgoing(Box::new(port))));
        Self { port, route }
    }

    /// A way for lines that cannot wait.
    pub fn urgent(&self) -> Urgent {
        Urgent(self.port.clone(), self.route.clone())
    }

    /// Whether the port is gone.
    pub fn is_closed(&self) -> bool {
        locked(&self.route).closed
    }

    /// Ends a line that may have begun on the drive's side, and lets the answer go by.
    pub fn begin(&mut self) {
        // The port is found closed with the first command.
        let _ = locked(&self.port).send("");
        std::thread::sleep(Duration::from_millis(100));
    }

    /// Sends a command and hears its answer; every line of it is shown when it comes.
    ///
    /// # Errors
    /// There is no whole answer.
    pub fn ask(&mut self, command: &str, mut show: impl FnMut(&str)) -> Result<Answer, LinkError> {
        let (send, lines) = channel();
        let sent = {
            let mut port = locked(&self.port);
            let mut route = locked(&self.route);
            if route.closed {
                return Err(LinkError::Closed);
            }
            route.asked = Some(send);
            drop(route);
            port.send(command)
        };
        let mut answer = match sent {
            Ok(()) => self.hear(command, &lines, &mut show),
            Err(_) => Err(LinkError::Closed),
        };
        let _port = locked(&self.port);
        let mut route = locked(&self.route);
        route.asked = None;
        // The answer to an urgent line has ended a list.
        let many = answer.as_ref().is_ok_and(|answer| answer.lines.len() > 1);
        if route.owed_behind > 0 && many {
            route.owed_behind -= 1;
            answer = Err(LinkError::Cut(command.to_owned()));
        }
        route.owed += std::mem::take(&mut route.owed_behind);
        if matches!(answer, Err(LinkError::Silence(..))) {
            route.owed = 0;
        }
        lines.try_iter().for_each(|line| route.unasked(&line));
        answer
    }

    fn hear(
        &self,
        command: &str,
        lines: &Receiver<String>,
        show: &mut impl FnMut(&str),
    ) -> Result<Answer, LinkError> {
        let (mut awaited, mut answer) = (Awaited::new(command), Answer::default());
        let patience = if awaited.is_slow() { PATIENCE_WITH_TRACE } else { PATIENCE };
        loop {
            let line = lines.recv_timeout(patience).map_err(|why| match why {
                RecvTimeoutError::Timeout => {
                    LinkError::Silence(command.to_owned(), patience.as_secs())
                }
                RecvTimeoutError::Disconnected => LinkError::Closed,
            })?;
            let meaning = awaited.take(&line);
            match meaning {
                Meaning::Echo => {}
                Meaning::Unasked => (locked(&self.route).show)(&line),
                Meaning::Answer | Meaning::Last => {
                    show(&line);
                    answer.lines.push(line);
                }
            }
            if meaning == Meaning::Last {
                return Ok(answer);
            }
        }
    }

    /// The last trace that the drive has printed.
    pub fn last_trace(&self) -> Option<Trace> {
        locked(&self.route).traces.last()
    }
}

/// The thread that reads ends, and with it the port is closed, within the time limit of a read.
impl Drop for Link {
    fn drop(&mut self) {
        locked(&self.route).closed = true;
    }
}

/// A thread that panicked while it showed a line leaves the route whole.
fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

fn read_lines(mut reader: impl Read, route: &Mutex<Route>) {
    let (mut buffer, mut line, mut splitter) = ([0; 1024], Vec::new(), Splitter::new());
    while !locked(route).closed {
        match reader.read(&mut buffer) {
            Ok(0) => break,
            Ok(read) => {
                for byte in &buffer[..read] {
                    let byte = match splitter.push(*byte) {
                        Piece::Text(byte) => byte,
                        Piece::Nothing => continue,
                        Piece::Frame(frame) => {
                            (locked(route).frames)(Some(frame));
                            continue;
                        }
                        Piece::Damaged => {
                            (locked(route).frames)(None);
                            continue;
                        }
                    };
                    if !matches!(byte, b'\r' | b'\n') && line.len() < LONGEST {
                        line.push(byte);
                        continue;
                    }
                    let text = readable(&std::mem::take(&mut line));
                    if !text.is_empty() {
                        locked(route).line(text);
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

/// The text of a line without the sequences that move the cursor of a terminal.
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

    /// A drive that answers each line with the next of these texts; what was shown unasked.
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
            // In this order: it does not wait for a line behind the last answer.
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
        let shown = talk(&["ok\r\n", "off; dc link 311 V\r\n"], |link, urgent| {
            urgent.send("stop").unwrap();
            urgent.send("").unwrap();
            assert_eq!(link.ask("status", |_| ()).unwrap().lines, ["off; dc link 311 V"]);
        });
        assert_eq!(shown, ["ok"]);
    }

    #[cfg(unix)]
    #[test]
    fn an_urgent_line_cuts_a_list_short_and_nothing_else() {
        let answers = &["a  b\r\nc  d\r\n", "ok\r\n", "off; x\r\n", "ok\r\n", "off; y\r\n"];
        talk(answers, |link, urgent| {
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
            assert_eq!(link.ask("status", |_| ()).unwrap().lines, ["off; y"]);
        });
    }

    #[test]
    fn sequences_of_a_terminal_are_no_text() {
        assert_eq!(readable(b"\x1b[Kstatus \x07"), "status");
        assert_eq!(readable("25 °C".as_bytes()), "25 °C");
    }
}
