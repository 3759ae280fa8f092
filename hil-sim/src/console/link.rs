//! A port to the drive, and a thread that reads it: answers go to the request that awaits them, other lines are shown
//! at once, and the frames of a stream are passed on separately. The protocol is that of [`drive_stream::client`].

use std::io::{ErrorKind, Read, Write};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use drive_core::State;
use drive_stream::Frame;
use drive_stream::client::{Answer, Client, Event};

use super::trace::Trace;

/// Longest wait for the next line of an answer: computing a setting takes seconds, on a virtual board at a fraction of real time.
const PATIENCE: Duration = Duration::from_secs(20);
/// Longest wait for a line of a trace, which is recorded before anything is sent.
const PATIENCE_WITH_TRACE: Duration = Duration::from_secs(600);

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

/// Whether the outputs are off, by the state with which the line of `status` begins.
pub fn is_off(status: &str) -> bool {
    let state = status.split_once("; ").map(|(state, _)| state);
    state.is_some_and(|state| state == State::Off.to_string() || state.starts_with("in fault "))
}

/// Destinations of the drive's lines and frames.
struct Route {
    client: Client,
    /// The command that awaits an answer.
    asked: Option<Sender<Event>>,
    /// The person, who gets the other lines.
    show: Box<dyn FnMut(&str) + Send>,
    frames: Box<dyn FnMut(Option<Frame>) + Send>,
    trace: Trace,
    closed: bool,
}

impl Route {
    fn take(&mut self, event: Event) {
        match event {
            Event::Frame(frame) => return (self.frames)(frame),
            Event::Unasked(line) => {
                self.trace.push(&line);
                return (self.show)(&line);
            }
            Event::Cut(ref line) => (self.show)(line),
            Event::Line(ref line) => self.trace.push(line),
            Event::Answer(_) => {}
        }
        self.asked.as_ref().map(|asked| asked.send(event));
    }
}

/// Both directions of a connection.
pub struct Wire {
    port: Mutex<Box<dyn Write + Send>>,
    route: Mutex<Route>,
}

impl Wire {
    /// Sends a line at once, without waiting for an answer that is awaited. Its answer is shown, unless a list is being answered: then the
    /// line cuts the list short.
    ///
    /// # Errors
    /// The port is closed.
    pub fn send(&self, line: &str) -> Result<(), LinkError> {
        self.write(|route| route.client.send(line))
    }

    /// Sends the line that the client makes; lines leave in the order of their tags.
    fn write(&self, line: impl FnOnce(&mut Route) -> String) -> Result<(), LinkError> {
        let mut port = locked(&self.port);
        let line = line(&mut locked(&self.route));
        let sent = port.write_all(line.as_bytes()).and_then(|()| port.flush());
        sent.map_err(|_| LinkError::Closed)
    }
}

/// Sends urgent lines; see [`Wire::send`].
pub type Urgent = Arc<Wire>;

/// A connection to a drive.
pub struct Link(Arc<Wire>);

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
        let (client, trace) = (Client::default(), Trace::default());
        let (show, frames) = (Box::new(show), Box::new(frames));
        let route = Route { client, asked: None, show, frames, trace, closed: false };
        let wire = Arc::new(Wire { port: Mutex::new(Box::new(port)), route: Mutex::new(route) });
        let to = wire.clone();
        std::thread::spawn(move || read(reader, &to.route));
        Self(wire)
    }

    /// Returns a sender for urgent lines.
    pub fn urgent(&self) -> Urgent {
        self.0.clone()
    }

    /// Whether the port is closed.
    pub fn is_closed(&self) -> bool {
        locked(&self.0.route).closed
    }

    /// Ends a line that may have begun on the drive's side, and ignores its answer.
    pub fn begin(&mut self) {
        // A closed port is detected by the first command.
        let _ = self.0.send("");
        std::thread::sleep(Duration::from_millis(100));
    }

    /// Sends a command and receives its answer; `show` gets every line when it comes.
    ///
    /// # Errors
    /// There is no complete answer.
    pub fn ask(&mut self, command: &str, show: impl FnMut(&str)) -> Result<Answer, LinkError> {
        let (send, events) = channel();
        if self.is_closed() {
            return Err(LinkError::Closed);
        }
        let sent = self.0.write(|route| {
            route.asked = Some(send);
            route.client.ask(command)
        });
        let answer = sent.and_then(|()| hear(command, &events, show));
        let mut route = locked(&self.0.route);
        route.asked = None;
        route.client.give_up();
        answer
    }

    /// Returns the last trace that the drive has printed.
    pub fn last_trace(&self) -> Option<Trace> {
        Some(locked(&self.0.route).trace.clone()).filter(|trace| trace.records() > 0)
    }
}

/// Receives the answer to a command.
fn hear(
    command: &str,
    events: &Receiver<Event>,
    mut show: impl FnMut(&str),
) -> Result<Answer, LinkError> {
    // A trace is recorded before anything is sent.
    let is_trace = command.split_whitespace().next() == Some("trace");
    let patience = if is_trace { PATIENCE_WITH_TRACE } else { PATIENCE };
    loop {
        let event = events.recv_timeout(patience).map_err(|why| match why {
            RecvTimeoutError::Timeout => LinkError::Silence(command.to_owned(), patience.as_secs()),
            RecvTimeoutError::Disconnected => LinkError::Closed,
        })?;
        match event {
            Event::Line(line) => show(&line),
            Event::Answer(answer) => {
                show(answer.last());
                return Ok(answer);
            }
            _ => return Err(LinkError::Cut(command.to_owned())),
        }
    }
}

/// Ends the reading thread, and with it closes the port, within the time limit of a read.
impl Drop for Link {
    fn drop(&mut self) {
        locked(&self.0.route).closed = true;
    }
}

/// If a thread panicked while it held the lock, the data behind the lock are still valid.
pub(crate) fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

fn read(mut reader: impl Read, route: &Mutex<Route>) {
    let mut buffer = [0; 1024];
    while !locked(route).closed {
        match reader.read(&mut buffer) {
            Ok(0) => break,
            Ok(read) => {
                let mut route = locked(route);
                for byte in &buffer[..read] {
                    if let Some(event) = route.client.push(*byte) {
                        route.take(event);
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
