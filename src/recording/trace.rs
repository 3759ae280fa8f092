//! The trace: signals of the drive, period by period, recorded in RAM.
//!
//! The main loop requests it, the control interrupt writes it, the main loop reads it; `stage` says who owns the memory. The records form
//! a ring, so that a trace with a trigger holds the periods before the trigger. It is not the [ring](super::ring) of the other readers:
//! it is a hundred times as long, holds only the chosen signals, and stops after its trigger.

mod signals;
#[cfg(test)]
mod tests;

use core::cell::UnsafeCell;
use core::sync::atomic::{AtomicBool, AtomicU8, Ordering};

use drive_core::Telemetry;

pub use signals::{
    MOST, Record, SIGNALS, Sampled, Signal, SignalChoice, Values, find, shown, values,
};

/// Event that starts the kept part of a trace.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Trigger {
    /// The request itself.
    Now,
    /// A fault: all records but the last are from before the fault.
    Fault,
    /// A signal crosses a level: a quarter of the records are from before the crossing.
    Level {
        /// Index into [`SIGNALS`].
        signal: u8,
        /// The level, in the unit of the signal for a plan of the console, and as recorded for the recorder.
        level: f32,
        /// Whether the signal has to be above the level.
        above: bool,
    },
}

/// A requested trace.
#[derive(Clone, Debug, PartialEq)]
pub struct Plan {
    /// Number of records.
    pub records: u16,
    /// Periods from one record to the next.
    pub divider: u16,
    /// Recorded signals.
    pub choice: SignalChoice,
    /// The trigger that starts it.
    pub trigger: Trigger,
}

/// No request yet: the memory belongs to the main loop.
const IDLE: u8 = 0;
/// The trace is being written: the memory belongs to the interrupt.
const RECORDING: u8 = 1;
/// The trace is complete: the memory belongs to the main loop.
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
    /// Number of records after the trigger's record.
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

    /// The two ends of the trace; only at the first call.
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

    /// Number of records still to be written after the trigger's, if the record just written triggers.
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
    /// Records the present control period, if it is due, and returns whether it was.
    pub fn step(&mut self, sampled: &Sampled, t: &Telemetry) -> bool {
        self.0.stage.load(Ordering::Acquire) == RECORDING && self.record(sampled, t)
    }

    fn record(&mut self, sampled: &Sampled, t: &Telemetry) -> bool {
        // SAFETY: the memory is the interrupt's while recording; `&mut self` excludes others.
        let inner = unsafe { &mut *self.0.inner.get() };
        // A fault is recorded at once, because the signals no longer change after it.
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
        // The interrupt cannot be in the middle of a record: the main loop never interrupts it.
        self.0.stage.store(IDLE, Ordering::Release);
    }

    /// Record number `i` of a finished recording, from the oldest, and its position relative to the trigger's record.
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
