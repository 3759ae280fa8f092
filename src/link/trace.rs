//! The trace: signals of the drive, period by period, recorded in RAM.
//!
//! The main loop requests it, the control interrupt writes it, the main loop reads it; `stage` says who owns the
//! memory. The records form a ring, so that a trace with a trigger holds what came before it. It is not the
//! [ring](super::ring) of the other readers: it is a hundred times as long, holds the chosen signals alone, and stands still
//! once its trigger has come.

mod signals;
#[cfg(test)]
mod tests;

use core::cell::UnsafeCell;
use core::sync::atomic::{AtomicBool, AtomicU8, Ordering};

use drive_core::Telemetry;

pub use signals::{
    MOST, Record, SIGNALS, Sampled, Signal, SignalChoice, Values, find, shown, values,
};

/// What starts the part of a trace that is kept.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Trigger {
    /// The request.
    Now,
    /// A fault: all records are from before it, but the last.
    Fault,
    /// A signal that is above or below a level: a quarter of the records are from before that.
    Level {
        /// Index into [`SIGNALS`].
        signal: u8,
        /// The level, in the unit of the signal in a plan of the console, and as recorded in the recorder.
        level: f32,
        /// Whether the signal has to be above it.
        above: bool,
    },
}

/// A trace that is asked for.
#[derive(Clone, Debug, PartialEq)]
pub struct Plan {
    /// Number of records.
    pub records: u16,
    /// Periods from one record to the next.
    pub divider: u16,
    /// Recorded signals.
    pub choice: SignalChoice,
    /// Its start.
    pub trigger: Trigger,
}

/// Before the first request: the memory is the main loop's.
const IDLE: u8 = 0;
/// Being written: the memory is the interrupt's.
const RECORDING: u8 = 1;
/// Written: the memory is the main loop's.
const DONE: u8 = 2;

struct Inner<const N: usize> {
    records: [Record; N],
    plan: Plan,
    /// Place of the next record.
    next: usize,
    /// Number of records that were written, at most the size of the ring.
    written: usize,
    /// Records still to be written; `None` before the trigger.
    left: Option<usize>,
    /// Records behind the one of the trigger.
    behind: usize,
    /// Periods until the next record.
    wait: u16,
}

/// Memory for `N` records.
pub struct Trace<const N: usize> {
    taken: AtomicBool,
    stage: AtomicU8,
    inner: UnsafeCell<Inner<N>>,
}

// SAFETY: `stage` gives the memory one owner at a time, and there is one writer and one reader, because `take` hands
// them out once.
unsafe impl<const N: usize> Sync for Trace<N> {}

/// The control interrupt's end.
pub struct Recorder<'a, const N: usize>(&'a Trace<N>);

/// The main loop's end.
pub struct Reader<'a, const N: usize>(&'a Trace<N>);

impl<const N: usize> Trace<N> {
    /// An empty trace.
    pub const fn new() -> Self {
        // Zeros only: otherwise 32 KiB of the flash would hold the initial contents.
        let choice = SignalChoice::none();
        let plan = Plan { records: 0, divider: 0, choice, trigger: Trigger::Now };
        let records = [[0.0; MOST]; N];
        let inner = Inner { records, plan, next: 0, written: 0, left: None, behind: 0, wait: 0 };
        let inner = UnsafeCell::new(inner);
        Self { taken: AtomicBool::new(false), stage: AtomicU8::new(IDLE), inner }
    }

    /// Its two ends; only the first time.
    pub fn take(&self) -> Option<(Recorder<'_, N>, Reader<'_, N>)> {
        let first = !self.taken.swap(true, Ordering::AcqRel);
        first.then_some((Recorder(self), Reader(self)))
    }
}

impl<const N: usize> Inner<N> {
    /// Size of the ring.
    fn size(&self) -> usize {
        usize::from(self.plan.records).min(N)
    }

    /// Number of records behind that of the trigger, if it has come with the record just written.
    fn triggered(&self, values: &Values, fault: bool) -> Option<usize> {
        let size = self.size();
        match self.plan.trigger {
            Trigger::Now => Some(size.saturating_sub(1)),
            Trigger::Fault => fault.then_some(0),
            Trigger::Level { signal, level, above } => {
                let value = values.get(usize::from(signal)).copied().unwrap_or(0.0);
                let beyond = if above { value > level } else { value < level };
                let before = (size / 4).min(self.written.saturating_sub(1));
                beyond.then_some(size.saturating_sub(before + 1))
            }
        }
    }
}

impl<const N: usize> Recorder<'_, N> {
    /// Records the present control period, if one is due, and tells whether it was.
    pub fn step(&mut self, sampled: &Sampled, t: &Telemetry) -> bool {
        self.0.stage.load(Ordering::Acquire) == RECORDING && self.record(sampled, t)
    }

    fn record(&mut self, sampled: &Sampled, t: &Telemetry) -> bool {
        // SAFETY: the memory is the interrupt's while recording; `&mut self` excludes others.
        let inner = unsafe { &mut *self.0.inner.get() };
        // A fault is recorded at once: what follows it stands still.
        let fault = sampled.state >= signals::FAULT;
        if inner.wait > 0 && !(fault && inner.plan.trigger == Trigger::Fault) {
            inner.wait -= 1;
            return false;
        }
        inner.wait = inner.plan.divider.saturating_sub(1);
        let (size, values) = (inner.size(), values(t, sampled));
        if let Some(place) = inner.records.get_mut(inner.next) {
            inner.plan.choice.record(place, &values);
            inner.next = if inner.next + 1 < size { inner.next + 1 } else { 0 };
            inner.written = size.min(inner.written + 1);
        }
        match inner.left {
            Some(left) => inner.left = Some(left.saturating_sub(1)),
            None => {
                inner.left = inner.triggered(&values, fault);
                inner.behind = inner.left.unwrap_or(0);
            }
        }
        if inner.left == Some(0) {
            self.0.stage.store(DONE, Ordering::Release);
        }
        true
    }
}

impl<const N: usize> Reader<'_, N> {
    /// Requests a trace; `false`, and nothing changed, while recording.
    pub fn begin(&mut self, plan: &Plan) -> bool {
        if self.recording() {
            return false;
        }
        // SAFETY: the memory is the main loop's while not recording; `&mut self` excludes others.
        let inner = unsafe { &mut *self.0.inner.get() };
        inner.plan = plan.clone();
        (inner.next, inner.written, inner.wait) = (0, 0, 0);
        (inner.left, inner.behind) = (None, 0);
        self.0.stage.store(RECORDING, Ordering::Release);
        true
    }

    /// Ends a recording without a result.
    pub fn cancel(&mut self) {
        // The interrupt cannot be in the midst of a record: it is never interrupted by the main loop.
        self.0.stage.store(IDLE, Ordering::Release);
    }

    /// Record number `i` of a finished recording, from the oldest on, and its number from that of the trigger.
    pub fn get(&self, i: u16) -> Option<(i16, Record)> {
        if self.0.stage.load(Ordering::Acquire) != DONE {
            return None;
        }
        // SAFETY: the memory is the main loop's when done.
        let inner = unsafe { &*self.0.inner.get() };
        let (i, size) = (usize::from(i), inner.size());
        if i >= inner.written {
            return None;
        }
        let oldest = if inner.written < size { 0 } else { inner.next };
        let place = if oldest + i < size { oldest + i } else { oldest + i - size };
        let from_trigger = i as i16 - (inner.written as i16 - 1 - inner.behind as i16);
        inner.records.get(place).map(|record| (from_trigger, *record))
    }

    /// Whether a recording is in progress.
    pub fn recording(&self) -> bool {
        self.0.stage.load(Ordering::Acquire) == RECORDING
    }
}
