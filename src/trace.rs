//! The trace: what the drive saw, period by period, in RAM.
//!
//! The main loop asks for it, the control interrupt writes it, the main loop reads it: the memory
//! changes hands with `stage`.

use core::cell::UnsafeCell;
use core::sync::atomic::{AtomicU8, Ordering};

use drive_core::Telemetry;

/// Names of the signals, as the first line of a CSV file.
pub const HEADER: &str = "record,phi_deg,i_d,i_q,i_q_ref,v_d,v_q,delta_i,turns";

/// One record.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Record {
    /// Electrical angle of the flux, bits of a signed fraction of a turn.
    pub phi: i32,
    /// d and q current, reference of the q current, d and q voltage, current difference, position.
    pub signals: [f32; 7],
}

impl Record {
    const EMPTY: Self = Self { phi: 0, signals: [0.0; 7] };

    /// What of the telemetry is recorded.
    pub fn of(t: &Telemetry) -> Self {
        let signals =
            [t.current.d, t.current.q, t.reference.q, t.voltage.d, t.voltage.q, t.delta_i, t.turns];
        Self { phi: t.phi.to_bits(), signals }
    }

    /// The angle in degrees.
    pub fn phi_degrees(&self) -> f32 {
        self.phi as f32 * (180.0 / 2_147_483_648.0)
    }
}

/// Nothing asked for or all read: the main loop's.
const IDLE: u8 = 0;
/// Being written: the interrupt's.
const RECORDING: u8 = 1;
/// Written: the main loop's.
const DONE: u8 = 2;

struct Inner<const N: usize> {
    records: [Record; N],
    wanted: usize,
    divider: u16,
    /// Next record to write.
    next: usize,
    /// Periods until the next record.
    wait: u16,
}

/// Memory for `N` records.
pub struct Trace<const N: usize> {
    stage: AtomicU8,
    inner: UnsafeCell<Inner<N>>,
}

// SAFETY: `stage` says whose the memory is, and there is one writer and one reader, because `split`
// borrows the trace mutably.
unsafe impl<const N: usize> Sync for Trace<N> {}

/// The end of the control interrupt.
pub struct Recorder<'a, const N: usize>(&'a Trace<N>);

/// The end of the main loop.
pub struct Reader<'a, const N: usize>(&'a Trace<N>);

impl<const N: usize> Trace<N> {
    /// Nothing recorded.
    pub const fn new() -> Self {
        let inner = Inner { records: [Record::EMPTY; N], wanted: 0, divider: 1, next: 0, wait: 0 };
        Self { stage: AtomicU8::new(IDLE), inner: UnsafeCell::new(inner) }
    }

    /// Its two ends.
    pub fn split(&mut self) -> (Recorder<'_, N>, Reader<'_, N>) {
        (Recorder(self), Reader(self))
    }
}

impl<const N: usize> Recorder<'_, N> {
    /// One period.
    pub fn step(&mut self, telemetry: &Telemetry) {
        if self.0.stage.load(Ordering::Acquire) != RECORDING {
            return;
        }
        // SAFETY: the interrupt's while recording; `&mut self` keeps others out.
        let inner = unsafe { &mut *self.0.inner.get() };
        if inner.wait > 0 {
            inner.wait -= 1;
            return;
        }
        inner.wait = inner.divider.saturating_sub(1);
        if let Some(place) = inner.records.get_mut(inner.next) {
            *place = Record::of(telemetry);
            inner.next += 1;
        }
        if inner.next >= inner.wanted {
            self.0.stage.store(DONE, Ordering::Release);
        }
    }
}

impl<const N: usize> Reader<'_, N> {
    /// Asks for `records`, one in `divider` periods. Not while recording: says whether it did.
    pub fn begin(&mut self, records: u16, divider: u16) -> bool {
        if self.0.stage.load(Ordering::Acquire) == RECORDING {
            return false;
        }
        // SAFETY: the main loop's while not recording; `&mut self` keeps others out.
        let inner = unsafe { &mut *self.0.inner.get() };
        inner.wanted = usize::from(records).min(N);
        inner.divider = divider;
        inner.next = 0;
        inner.wait = 0;
        self.0.stage.store(RECORDING, Ordering::Release);
        true
    }

    /// Record number `i`, if it is recorded and the recording has ended.
    pub fn get(&self, i: u16) -> Option<Record> {
        if self.0.stage.load(Ordering::Acquire) != DONE {
            return None;
        }
        // SAFETY: the main loop's when done.
        let inner = unsafe { &*self.0.inner.get() };
        let i = usize::from(i);
        if i < inner.wanted { inner.records.get(i).copied() } else { None }
    }

    /// Whether a recording goes on.
    pub fn recording(&self) -> bool {
        self.0.stage.load(Ordering::Acquire) == RECORDING
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn records_every_nth_period_and_gives_them_back_when_done() {
        let mut trace = Trace::<4>::new();
        let (mut recorder, mut reader) = trace.split();
        assert_eq!(reader.get(0), None);
        assert!(reader.begin(3, 2));
        assert!(!reader.begin(1, 1));
        for period in 0..5 {
            assert!(reader.recording());
            assert_eq!(reader.get(0), None);
            recorder.step(&Telemetry { turns: period as f32, ..Telemetry::default() });
        }
        recorder.step(&Telemetry::default());
        let turns = |i| reader.get(i).map(|record: Record| record.signals[6]);
        assert_eq!(
            [turns(0), turns(1), turns(2), turns(3)],
            [Some(0.0), Some(2.0), Some(4.0), None]
        );
    }

    #[test]
    fn asks_for_no_more_than_there_is_room() {
        let mut trace = Trace::<4>::new();
        let (mut recorder, mut reader) = trace.split();
        assert!(reader.begin(100, 1));
        for _ in 0..4 {
            recorder.step(&Telemetry::default());
        }
        assert!(!reader.recording());
        assert!(reader.get(3).is_some() && reader.get(4).is_none());
    }

    #[test]
    fn angles_are_shown_in_degrees() {
        let phi = drive_core::Angle::QUARTER;
        let record = Record::of(&Telemetry { phi, ..Telemetry::default() });
        assert_eq!(record.phi_degrees(), 90.0);
    }
}
