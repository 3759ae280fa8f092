//! The connection to the drive.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};

use drive_stream::client::Answer;

use crate::console::link::{Link, LinkError, Urgent, locked};
use crate::console::open;
use crate::prelude::*;

/// Time between two signs of life: a quarter of the time after which the drive stops ([`super::walk::TIMEOUT_S`]).
const ALIVE: Duration = Duration::from_millis(500);
/// Longest time for which a port is absent while the controller restarts.
const AWAY: Duration = Duration::from_secs(60);

/// A drive, together with a clock.
pub trait Wire {
    /// Sends a line and receives its answer.
    ///
    /// # Errors
    /// There is no complete answer.
    fn ask(&mut self, line: &str) -> Result<Answer, LinkError>;
    /// Lets some seconds pass.
    fn wait(&mut self, seconds: f64);
    /// Returns the unsolicited lines since the last call.
    fn unasked(&mut self) -> Vec<String>;
    /// Opens the port again after a restart of the controller.
    ///
    /// # Errors
    /// The port does not come back.
    fn reopen(&mut self) -> Result<(), Error>;
}

/// A drive at a serial port. A thread sends signs of life, and `stop` when the person interrupts.
pub struct Port {
    path: String,
    baud: u32,
    link: Link,
    urgent: Arc<Mutex<Urgent>>,
    unasked: Arc<Mutex<Vec<String>>>,
}

impl Port {
    /// Opens a port.
    ///
    /// # Errors
    /// [`Error::Refused`] if it cannot be opened.
    pub fn new(path: &str, baud: u32, interrupted: Arc<AtomicBool>) -> Result<Self, Error> {
        let unasked = Arc::default();
        let link = connect(path, baud, &unasked)?;
        let urgent = Arc::new(Mutex::new(link.urgent()));
        let alive = Arc::downgrade(&urgent);
        std::thread::spawn(move || {
            let mut told = false;
            while let Some(urgent) = alive.upgrade() {
                // Only once: a second `stop` would cut short the answers for which the walk waits.
                let stops = !told && interrupted.load(Ordering::Relaxed);
                told |= stops;
                // The next request detects a port that is closed.
                let _ = locked(&urgent).send(if stops { "stop" } else { "" });
                drop(urgent);
                std::thread::sleep(ALIVE);
            }
        });
        Ok(Self { path: path.to_owned(), baud, link, urgent, unasked })
    }
}

impl Wire for Port {
    fn ask(&mut self, line: &str) -> Result<Answer, LinkError> {
        self.link.ask(line, |_| ())
    }

    fn wait(&mut self, seconds: f64) {
        std::thread::sleep(Duration::from_secs_f64(seconds));
    }

    fn unasked(&mut self) -> Vec<String> {
        std::mem::take(&mut *locked(&self.unasked))
    }

    fn reopen(&mut self) -> Result<(), Error> {
        let began = Instant::now();
        loop {
            match connect(&self.path, self.baud, &self.unasked) {
                Err(_) if began.elapsed() < AWAY => std::thread::sleep(ALIVE),
                link => {
                    self.link = link?;
                    *locked(&self.urgent) = self.link.urgent();
                    return Ok(());
                }
            }
        }
    }
}

fn connect(path: &str, baud: u32, unasked: &Arc<Mutex<Vec<String>>>) -> Result<Link, Error> {
    let (reader, writer) = open(path, baud)?;
    let to = unasked.clone();
    let mut link = Link::new(reader, writer, move |line: &str| locked(&to).push(line.to_owned()));
    link.begin();
    Ok(link)
}
