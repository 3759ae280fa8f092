//! The ring: signals of control periods, from the control interrupt to its readers in the main loop.
//!
//! The interrupt writes a record in each period that a reader has requested, and none in others. It never waits: the newest record
//! replaces the oldest. Each reader sees every record, at its own pace, from the oldest one that is left. A reader that was overtaken
//! misses records, and the numbers of the periods show the gap.
//!
//! Own code: the queues of `heapless` and `bbqueue` keep the oldest items, and give each item to one reader.

use core::cell::UnsafeCell;
use core::sync::atomic::{AtomicBool, AtomicU32, Ordering};

use drive_core::Telemetry;

use super::trace::Sampled;
use crate::board::{PWM_HZ, WATCHDOG_HZ, WATCHDOG_RELOAD};

/// Size of the ring for stream, identification and commissioning in the main loop, control periods. It holds one less: 5.2 ms if every
/// period is recorded. The watchdog allows the main loop to be late by less, even with its slowest clock.
pub const PERIODS: usize = 32;
const _: () =
    assert!((PERIODS as u32 - 1) * WATCHDOG_HZ > (WATCHDOG_RELOAD as u32 + 1) * 4 * PWM_HZ);

/// Signals of the drive in one control period.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Record {
    /// Control periods since the start, wrapping.
    pub period: u32,
    /// The signals.
    pub telemetry: Telemetry,
    /// The rest of the signals.
    pub sampled: Sampled,
    /// Whether the record is for tracking and commissioning; while they observe, every period is.
    pub observed: bool,
    /// Whether the record is for the stream.
    pub streamed: bool,
}

impl Record {
    /// Sets the signals.
    pub fn set(&mut self, telemetry: &Telemetry) {
        /// Copied in two parts: the compiler copies up to 64 bytes without a call, in a third of the cycles.
        type Parts = ([u32; 11], [u32; 10]);
        const _: () = assert!(size_of::<Parts>() == size_of::<Telemetry>());
        const _: () = assert!(align_of::<Parts>() == align_of::<Telemetry>());
        // SAFETY: both are words without padding, of which every value is valid.
        let (to, from) = unsafe {
            (
                &mut *(&raw mut self.telemetry).cast::<Parts>(),
                &*(&raw const *telemetry).cast::<Parts>(),
            )
        };
        to.0 = from.0;
        to.1 = from.1;
    }
}

/// Memory for `N` records, a power of two; readers see at most one less.
pub struct Ring<const N: usize> {
    slots: [Slot; N],
    /// Records so far, wrapping.
    written: AtomicU32,
}

struct Slot {
    /// Whether somebody reads or writes the record.
    held: AtomicBool,
    record: UnsafeCell<Record>,
}

// SAFETY: only the side that has set `held`, which was clear before, touches the record.
unsafe impl Sync for Slot {}

/// The control interrupt's end.
pub struct Writer<'a, const N: usize>(&'a Ring<N>);

/// A reader in the main loop.
#[derive(Clone)]
pub struct Reader<'a, const N: usize> {
    ring: &'a Ring<N>,
    /// Number of the next record, wrapping.
    next: u32,
}

impl Slot {
    /// Calls `with` with the record, unless somebody else holds it.
    fn hold<R>(&self, with: impl FnOnce(&mut Record) -> R) -> Option<R> {
        if self.held.swap(true, Ordering::Acquire) {
            return None;
        }
        // SAFETY: see `Sync`.
        let result = with(unsafe { &mut *self.record.get() });
        self.held.store(false, Ordering::Release);
        Some(result)
    }
}

impl<const N: usize> Ring<N> {
    // SAFETY: a record consists of numbers and `bool`s, so zeros are a valid record.
    const EMPTY: Record = unsafe { core::mem::zeroed() };

    /// A ring without records. It is a constant, so that none is built on the stack.
    pub const fn new() -> Self {
        const { assert!(N.is_power_of_two(), "the number of a record wraps") };
        let slots =
            [const { Slot { held: AtomicBool::new(false), record: UnsafeCell::new(Self::EMPTY) } };
                N];
        Self { slots, written: AtomicU32::new(0) }
    }

    /// The two ends of the ring. A reader can be cloned.
    pub fn split(&mut self) -> (Writer<'_, N>, Reader<'_, N>) {
        (Writer(self), Reader { ring: self, next: 0 })
    }
}

impl<const N: usize> Writer<'_, N> {
    /// Adds a record, which `write` writes in place over the oldest one. The record is left out if the oldest one is being read.
    pub fn write(&mut self, write: impl FnOnce(&mut Record)) {
        let number = self.0.written.load(Ordering::Relaxed);
        let Some(slot) = self.0.slots.get(number as usize % N) else { return };
        let _ = slot.hold(|record| {
            write(record);
            // Stored while the record is held, so that the next holder knows that it is another record.
            self.0.written.store(number.wrapping_add(1), Ordering::Release);
        });
    }
}

impl<const N: usize> Reader<'_, N> {
    /// Passes the next remaining record to `with`; `None` if there is none yet, or if it is being overwritten.
    pub fn take_with<R>(&mut self, with: impl FnOnce(&Record) -> R) -> Option<R> {
        let left =
            |next: u32| self.ring.written.load(Ordering::Acquire).wrapping_sub(next) as usize;
        match left(self.next) {
            0 => return None,
            // The oldest record is skipped: the writer needs its place next, and would lose a period.
            more if more >= N => self.next = self.next.wrapping_add((more - N + 1) as u32),
            _ => {}
        }
        let slot = self.ring.slots.get(self.next as usize % N)?;
        // The writer may have overtaken the reader before the record was held.
        let result = slot.hold(|record| (left(self.next) < N).then(|| with(record)))??;
        self.next = self.next.wrapping_add(1);
        Some(result)
    }
}

impl<const N: usize> Iterator for Reader<'_, N> {
    type Item = Record;

    fn next(&mut self) -> Option<Record> {
        self.take_with(|record| *record)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn write<const N: usize>(writer: &mut Writer<'_, N>, periods: core::ops::Range<u32>) {
        for period in periods {
            writer.write(|record| record.period = period);
        }
    }

    fn read<const N: usize>(reader: &mut Reader<'_, N>) -> Vec<u32> {
        reader.map(|record| record.period).collect()
    }

    #[test]
    fn every_reader_sees_every_record_and_the_newest_are_kept() {
        let mut ring = Ring::<4>::new();
        let (mut writer, mut first) = ring.split();
        let mut second = first.clone();
        assert_eq!(first.next(), None);
        write(&mut writer, 0..3);
        assert_eq!(read(&mut first), [0, 1, 2]);
        write(&mut writer, 3..5);
        assert_eq!(read(&mut first), [3, 4]);
        assert_eq!(
            read(&mut second),
            [2, 3, 4],
            "the oldest is overwritten, the next one about to be"
        );
        write(&mut writer, 5..100);
        assert_eq!(second.by_ref().last().map(|record| record.period), Some(99));
        assert_eq!(read(&mut first), [97, 98, 99]);
        assert_eq!((first.next(), second.next()), (None, None));
    }

    #[test]
    fn the_numbers_of_the_records_wrap() {
        let mut ring = Ring::<4>::new();
        ring.written = AtomicU32::new(u32::MAX - 1);
        let (mut writer, mut reader) = ring.split();
        reader.next = u32::MAX - 1;
        write(&mut writer, 0..3);
        assert_eq!(read(&mut reader), [0, 1, 2]);
        write(&mut writer, 3..9);
        assert_eq!(read(&mut reader), [6, 7, 8]);
    }

    #[test]
    fn a_record_that_is_being_read_is_not_overwritten() {
        let mut ring = Ring::<2>::new();
        let (mut writer, mut reader) = ring.split();
        write(&mut writer, 0..1);
        reader.take_with(|record| {
            write(&mut writer, 1..4);
            assert_eq!(record.period, 0);
        });
        write(&mut writer, 4..5);
        assert_eq!(read(&mut reader), [4], "periods 2 and 3 are missing");
    }

    /// A reader takes no period from the others, however far behind it is.
    #[test]
    fn a_late_reader_is_not_in_the_way_of_the_writer() {
        let mut ring = Ring::<4>::new();
        let (mut writer, mut late) = ring.split();
        let mut prompt = late.clone();
        for period in 0..20 {
            write(&mut writer, period..period + 1);
            assert_eq!(read(&mut prompt), [period]);
        }
        late.take_with(|_| write(&mut writer, 20..21));
        assert_eq!(read(&mut prompt), [20]);
    }

    /// Two readers, one of which hardly keeps up: no record is torn, and each comes once and in order.
    #[test]
    fn records_arrive_whole_and_in_order_across_threads() {
        const LAST: u32 = 300_000;
        let mut ring = Ring::<8>::new();
        let (mut writer, reader) = ring.split();
        let follow = |mut reader: Reader<'_, 8>, pause: u32| {
            let (mut before, mut read) = (0, 0);
            while before < LAST {
                (0..pause).for_each(|_| core::hint::spin_loop());
                for Record { period, telemetry, sampled, .. } in reader.by_ref() {
                    assert!(period > before, "{period} after {before}");
                    let value = period as f32;
                    assert_eq!((telemetry.flux_freq, telemetry.turns), (value, value));
                    assert_eq!(sampled.currents, [period as u16; 3]);
                    (before, read) = (period, read + 1);
                }
            }
            read
        };
        std::thread::scope(|scope| {
            let fast = reader.clone();
            let readers =
                [scope.spawn(move || follow(fast, 0)), scope.spawn(move || follow(reader, 500))];
            // Repeated until the last record has arrived, because a record that is being read is left out.
            let mut period = 0;
            while readers.iter().any(|reader| !reader.is_finished()) {
                period += 1;
                writer.write(|record| {
                    record.period = period;
                    record.telemetry.flux_freq = period as f32;
                    record.telemetry.turns = period as f32;
                    record.sampled.currents = [period as u16; 3];
                });
            }
            for reader in readers {
                assert!(reader.join().unwrap() > 0);
            }
        });
    }
}
