//! State shared by the connection to the drive and the page: texts for the page, its questions, and whether it is connected.

use std::collections::VecDeque;
use std::io::Write as _;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use drive_stream::Frame;
use drive_web::talk::Frames;
use hil_sim::console::link::Urgent;
use serde_json::{Value, json};

/// Time without an answer after which a page counts as lost, and the drive is stopped.
pub const PAGE_LOST: Duration = Duration::from_millis(350);
/// Time of silence after which a drive counts as busy with a design: signs of life would only fill its receive queue.
const BUSY: Duration = Duration::from_secs(1);
/// Most texts that wait for a slow page; the oldest are dropped first.
const MOST_TEXTS: usize = 2000;
/// Most questions that wait for the drive: a page has one or two.
pub const MOST_ASKS: usize = 64;

/// A question of the page.
#[derive(Debug)]
pub enum Ask {
    /// The identity of the drive, for a new page.
    Hello,
    /// A line to the console; the answer gets this number.
    Line(u64, String),
}

/// The shared state, see the head of the module.
pub struct Shared {
    inner: Mutex<Inner>,
    asked: Condvar,
}

#[derive(Default)]
struct Inner {
    texts: VecDeque<Value>,
    asks: VecDeque<Ask>,
    frames: Frames,
    flux: Option<[f64; 3]>,
    /// Number of the connected page, and the time of its last answer.
    page: u64,
    answered: Option<Instant>,
    /// Whether the drive is to be stopped when no page is connected.
    watched: bool,
    urgent: Option<Urgent>,
    /// Time of the drive's last byte.
    heard: Option<Instant>,
}

impl Shared {
    /// An empty state.
    pub fn new() -> Arc<Self> {
        Arc::new(Self { inner: Mutex::default(), asked: Condvar::new() })
    }

    /// If a thread panicked, texts and frames are still whole.
    fn inner(&self) -> MutexGuard<'_, Inner> {
        self.inner.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Queues a text for the page.
    pub fn tell(&self, text: Value) {
        let mut inner = self.inner();
        if inner.texts.len() >= MOST_TEXTS {
            inner.texts.pop_front();
        }
        inner.texts.push_back(text);
    }

    /// Takes a frame of the drive; `None` for damaged bytes.
    pub fn frame(&self, frame: Option<Frame>) {
        self.heard();
        self.inner().frames.push(frame);
    }

    /// Notes that the drive has sent something.
    pub fn heard(&self) {
        self.inner().heard = Some(Instant::now());
    }

    /// Whether the drive has sent something recently.
    pub fn drive_listens(&self) -> bool {
        self.inner().heard.is_some_and(|heard| heard.elapsed() < BUSY)
    }

    /// A new stream begins, with other signals.
    pub fn new_stream(&self) {
        self.inner().frames = Frames::default();
    }

    /// Queues the flux of the virtual board: the drive's angle, the motor's, turns, and the motor's flux, Wb.
    pub fn flux(&self, flux: [f64; 3]) {
        self.inner().flux = Some(flux);
    }

    /// Everything that is due for the page: texts, and [frames](Frames::take).
    pub fn take(&self) -> (Vec<Value>, Vec<u8>) {
        let mut inner = self.inner();
        let mut texts: Vec<Value> = inner.texts.drain(..).collect();
        texts.push(json!({ "tick": inner.frames.counts, "flux": inner.flux.take() }));
        (texts, inner.frames.take())
    }

    /// Notes a new page and returns its number. The new page takes over from the previous one. Then the drive is stopped, so that nobody
    /// runs a drive that another page has started.
    pub fn page_comes(&self) -> u64 {
        // The previous page may have gone so recently that its loss was not noticed yet, as with a reload.
        if self.inner().watched {
            self.stop("another page took over");
        }
        let mut inner = self.inner();
        inner.page += 1;
        (inner.answered, inner.watched) = (Some(Instant::now()), true);
        inner.texts.clear();
        inner.frames.take();
        // Questions of the previous page are dropped.
        inner.asks = VecDeque::from([Ask::Hello]);
        self.asked.notify_one();
        inner.page
    }

    /// Whether this page is still the connected one.
    pub fn is_present(&self, page: u64) -> bool {
        self.inner().page == page
    }

    /// Notes an answer of the page.
    pub fn page_answers(&self, page: u64) {
        let mut inner = self.inner();
        if inner.page == page {
            (inner.answered, inner.watched) = (Some(Instant::now()), true);
        }
    }

    /// Notes that the page has gone.
    pub fn page_goes(&self, page: u64) {
        let mut inner = self.inner();
        if inner.page == page {
            inner.answered = None;
        }
    }

    /// Whether a page is connected and answers.
    pub fn page_is_alive(&self) -> bool {
        self.inner().answered.is_some_and(|answered| answered.elapsed() < PAGE_LOST)
    }

    /// Whether a page was connected and is lost; true once for each loss.
    pub fn page_was_lost(&self) -> bool {
        let alive = self.page_is_alive();
        !alive && std::mem::take(&mut self.inner().watched)
    }

    /// Whether the drive runs without a page: one was connected, and none is.
    pub fn is_abandoned(&self) -> bool {
        let inner = self.inner();
        inner.page > 0 && !inner.watched
    }

    /// Queues a line of the page for the drive, with a number for the answer, unless too many wait.
    pub fn ask(&self, id: u64, line: String) {
        let mut inner = self.inner();
        if inner.asks.len() < MOST_ASKS {
            inner.asks.push_back(Ask::Line(id, line));
            self.asked.notify_one();
        } else {
            drop(inner);
            let why = format!("not sent: {MOST_ASKS} lines wait for the drive already");
            self.tell(json!({ "id": id, "error": why }));
        }
    }

    /// The next question, if one comes within this time.
    pub fn next_ask(&self, patience: Duration) -> Option<Ask> {
        let none = |inner: &mut Inner| inner.asks.is_empty();
        let waited = self.asked.wait_timeout_while(self.inner(), patience, none);
        waited.unwrap_or_else(PoisonError::into_inner).0.asks.pop_front()
    }

    /// Answers all waiting lines with an error.
    pub fn drop_asks(&self, why: &str) {
        let waiting = std::mem::take(&mut self.inner().asks);
        for ask in waiting {
            match ask {
                Ask::Hello => self.inner().asks.push_back(ask),
                Ask::Line(id, _) => self.tell(json!({ "id": id, "error": why })),
            }
        }
    }

    /// Sets the connection to the drive for urgent lines; `None` while it is not connected.
    pub fn connect(&self, urgent: Option<Urgent>) {
        self.inner().urgent = urgent;
    }

    /// Stops the drive at once, for a reason that the page shows. A start that still waits is not sent.
    pub fn stop(&self, why: &str) {
        self.drop_asks("not sent: the drive was stopped");
        self.tell(json!({ "stopped": why }));
        // The reader of the output may have gone.
        let _ = writeln!(std::io::stdout(), "drive stopped: {why}");
        self.send("stop");
    }

    /// Sends a line ahead of all questions.
    pub fn send(&self, line: &str) {
        let urgent = self.inner().urgent.clone();
        // If the port is gone, the thread that reads it reports that.
        urgent.map(|urgent| urgent.send(line));
    }
}
