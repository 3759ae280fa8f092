//! The trace: signals of the drive, period by period, recorded in RAM.
//!
//! The main loop requests it, the control interrupt writes it, the main loop reads it; `stage` says who owns the
//! memory.

use core::cell::UnsafeCell;
use core::sync::atomic::{AtomicBool, AtomicU8, Ordering};

use drive_core::Telemetry;
use heapless::Vec;

/// Signals that can be recorded: currents in A, voltages in V, steps in electrical turns per period.
pub const SIGNALS: [&str; 13] = [
    "phi_deg",
    "flux_step",
    "rotor_step",
    "i_d_ref",
    "i_q_ref",
    "i_d",
    "i_q",
    "v_d",
    "v_q",
    "delta_i",
    "saliency",
    "dc_link",
    "turns",
];

/// Most signals in one record.
pub const MOST: usize = 8;

/// The signals of a trace, in their order.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SignalChoice {
    /// Indices into [`SIGNALS`].
    signals: Vec<u8, MOST>,
}

impl SignalChoice {
    /// No signal.
    pub const fn none() -> Self {
        Self { signals: Vec::new() }
    }

    /// The default: angle, currents and their reference, voltages, saliency, position.
    pub fn usual() -> Self {
        Self { signals: [0, 5, 6, 4, 7, 8, 9, 12].into_iter().collect() }
    }

    /// Adds the signal with this name; `false` if there is none, or no room for it.
    pub fn add(&mut self, name: &str) -> bool {
        let signal = SIGNALS.iter().position(|known| *known == name);
        signal.is_some_and(|index| self.signals.push(index as u8).is_ok())
    }

    /// Names of the signals.
    pub fn names(&self) -> impl Iterator<Item = &'static str> {
        self.signals.iter().filter_map(|signal| SIGNALS.get(usize::from(*signal)).copied())
    }

    /// Number of signals.
    pub fn count(&self) -> usize {
        self.signals.len()
    }

    /// Values of the signals.
    fn values(&self, t: &Telemetry) -> Record {
        let mut record = [0.0; MOST];
        for (value, signal) in record.iter_mut().zip(&self.signals) {
            *value = match signal {
                0 => t.phi.to_bits() as f32 * (180.0 / 2_147_483_648.0),
                1 => t.flux_freq,
                2 => t.rotor_freq,
                3 => t.reference.d,
                4 => t.reference.q,
                5 => t.current.d,
                6 => t.current.q,
                7 => t.voltage.d,
                8 => t.voltage.q,
                9 => t.delta_i,
                10 => t.saliency,
                11 => t.dc_link,
                _ => t.turns,
            };
        }
        record
    }
}

/// One record: the values of a [`SignalChoice`], in its order.
pub type Record = [f32; MOST];

/// Before the first request: the memory is the main loop's.
const IDLE: u8 = 0;
/// Being written: the memory is the interrupt's.
const RECORDING: u8 = 1;
/// Written: the memory is the main loop's.
const DONE: u8 = 2;

struct Inner<const N: usize> {
    records: [Record; N],
    wanted: usize,
    divider: u16,
    choice: SignalChoice,
    /// Next record to write.
    next: usize,
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
        let inner = Inner {
            records: [[0.0; MOST]; N],
            wanted: 0,
            divider: 0,
            choice: SignalChoice::none(),
            next: 0,
            wait: 0,
        };
        Self {
            taken: AtomicBool::new(false),
            stage: AtomicU8::new(IDLE),
            inner: UnsafeCell::new(inner),
        }
    }

    /// Its two ends; only the first time.
    pub fn take(&self) -> Option<(Recorder<'_, N>, Reader<'_, N>)> {
        let first = !self.taken.swap(true, Ordering::AcqRel);
        first.then_some((Recorder(self), Reader(self)))
    }
}

impl<const N: usize> Recorder<'_, N> {
    /// Records the present control period, if one is due.
    pub fn step(&mut self, telemetry: impl FnOnce() -> Telemetry) {
        if self.0.stage.load(Ordering::Acquire) == RECORDING {
            self.record(telemetry);
        }
    }

    fn record(&mut self, telemetry: impl FnOnce() -> Telemetry) {
        // SAFETY: the memory is the interrupt's while recording; `&mut self` excludes others.
        let inner = unsafe { &mut *self.0.inner.get() };
        if inner.wait > 0 {
            inner.wait -= 1;
            return;
        }
        inner.wait = inner.divider.saturating_sub(1);
        if let Some(place) = inner.records.get_mut(inner.next) {
            *place = inner.choice.values(&telemetry());
            inner.next += 1;
        }
        if inner.next >= inner.wanted {
            self.0.stage.store(DONE, Ordering::Release);
        }
    }
}

impl<const N: usize> Reader<'_, N> {
    /// Requests `records` records, one in `divider` periods; `false`, and nothing changed, while recording.
    pub fn begin(&mut self, records: u16, divider: u16, choice: &SignalChoice) -> bool {
        if self.0.stage.load(Ordering::Acquire) == RECORDING {
            return false;
        }
        // SAFETY: the memory is the main loop's while not recording; `&mut self` excludes others.
        let inner = unsafe { &mut *self.0.inner.get() };
        inner.wanted = usize::from(records).min(N);
        inner.divider = divider;
        inner.choice = choice.clone();
        inner.next = 0;
        inner.wait = 0;
        self.0.stage.store(RECORDING, Ordering::Release);
        true
    }

    /// Record number `i` of a finished recording.
    pub fn get(&self, i: u16) -> Option<Record> {
        if self.0.stage.load(Ordering::Acquire) != DONE {
            return None;
        }
        // SAFETY: the memory is the main loop's when done.
        let inner = unsafe { &*self.0.inner.get() };
        let i = usize::from(i);
        inner.records.get(..inner.wanted)?.get(i).copied()
    }

    /// Whether a recording is in progress.
    pub fn recording(&self) -> bool {
        self.0.stage.load(Ordering::Acquire) == RECORDING
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn records_every_nth_period_and_gives_them_back_when_done() {
        let trace = Trace::<4>::new();
        let (mut recorder, mut reader) = trace.take().unwrap();
        assert_eq!(reader.get(0), None);
        assert!(reader.begin(3, 2, &SignalChoice::usual()));
        assert!(!reader.begin(1, 1, &SignalChoice::usual()));
        for period in 0..5 {
            assert!(reader.recording());
            assert_eq!(reader.get(0), None);
            recorder.step(|| Telemetry { turns: period as f32, ..Telemetry::default() });
        }
        recorder.step(Telemetry::default);
        let turns = |i| reader.get(i).map(|record: Record| record[7]);
        assert_eq!(
            [turns(0), turns(1), turns(2), turns(3)],
            [Some(0.0), Some(2.0), Some(4.0), None]
        );
    }

    #[test]
    fn asks_for_no_more_than_there_is_room() {
        let trace = Trace::<4>::new();
        let (mut recorder, mut reader) = trace.take().unwrap();
        assert!(reader.begin(100, 1, &SignalChoice::usual()));
        for _ in 0..4 {
            recorder.step(Telemetry::default);
        }
        assert!(!reader.recording());
        assert!(reader.get(3).is_some() && reader.get(4).is_none());
    }

    /// Every signal is its own, under its name.
    #[test]
    fn signals_are_recorded_as_they_were_chosen() {
        let telemetry = Telemetry {
            phi: drive_core::Angle::QUARTER,
            flux_freq: 1.0,
            rotor_freq: 2.0,
            reference: drive_core::Dq::new(3.0, 4.0),
            current: drive_core::Dq::new(5.0, 6.0),
            voltage: drive_core::Dq::new(7.0, 8.0),
            delta_i: 9.0,
            saliency: 10.0,
            dc_link: 11.0,
            turns: 12.0,
            ..Telemetry::default()
        };
        for (i, name) in SIGNALS.iter().enumerate() {
            let mut choice = SignalChoice::none();
            assert!(choice.add(name) && choice.add("turns"));
            let expected = if i == 0 { 90.0 } else { i as f32 };
            assert_eq!(choice.values(&telemetry)[..2], [expected, 12.0], "{name}");
            assert_eq!(choice.names().collect::<std::vec::Vec<_>>(), [name, "turns"]);
        }
        let mut full = SignalChoice::usual();
        assert!(!full.add("turns") && !SignalChoice::none().add("speed"));
    }
}
