//! The stream: samples of the drive from the control interrupt to the main loop, while it runs.

use core::array::from_fn;
use core::sync::atomic::{AtomicU16, Ordering};

use super::mailbox::{Mailbox, Receiver, Sender, split_all};
use super::trace::CurrentCodes;
use drive_core::Telemetry;

/// Signals of the drive in one control period.
#[derive(Clone, Copy, Debug, Default)]
pub struct Sample {
    /// One more for each sample that was due, taken or not; wraps.
    pub sequence: u16,
    /// Control periods since the start, wrapping.
    pub period: u32,
    /// The signals.
    pub telemetry: Telemetry,
    /// Codes of the current sensors.
    pub codes: CurrentCodes,
}

/// Most control periods that a sample waits for one that does no other work.
const MOST_LATE: u16 = 2;

/// Memory for `N` samples: mailboxes that are used in turn, because they are written in place.
pub struct Queue<const N: usize> {
    boxes: [Mailbox<Sample>; N],
    /// Control periods from one sample to the next; 0: none.
    divider: AtomicU16,
}

/// The control interrupt's end.
pub struct Source<'a, const N: usize> {
    boxes: [Sender<'a, Sample>; N],
    next: usize,
    divider: &'a AtomicU16,
    wait: u16,
    late: u16,
    sequence: u16,
}

/// The main loop's end.
pub struct Sink<'a, const N: usize> {
    boxes: [Receiver<'a, Sample>; N],
    next: usize,
    divider: &'a AtomicU16,
}

impl<const N: usize> Queue<N> {
    /// No samples, and none asked for. `unread` only initialises the storage.
    pub fn new(unread: Sample) -> Self {
        Self { boxes: from_fn(|_| Mailbox::new(unread)), divider: AtomicU16::new(0) }
    }

    /// Its two ends.
    pub fn split(&mut self) -> (Source<'_, N>, Sink<'_, N>) {
        let (send, receive) = split_all(&mut self.boxes);
        let divider = &self.divider;
        let source = Source { boxes: send, next: 0, divider, wait: 0, late: 0, sequence: 0 };
        (source, Sink { boxes: receive, next: 0, divider })
    }
}

impl<const N: usize> Source<'_, N> {
    /// Takes a sample of the present control period, if one is due. In a `busy` period, which does other work, it waits for
    /// the next, two periods at most: the longest control periods get no longer, and the rate stays.
    pub fn step(&mut self, period: u32, busy: bool, codes: &CurrentCodes, telemetry: &Telemetry) {
        let divider = self.divider.load(Ordering::Relaxed);
        if divider == 0 {
            return;
        }
        self.wait = self.wait.saturating_sub(1);
        if self.wait > 0 {
            return;
        }
        if busy && self.late < MOST_LATE {
            self.late += 1;
            return;
        }
        self.wait = divider.saturating_sub(self.late);
        self.late = 0;
        self.take(period, codes, telemetry);
    }

    fn take(&mut self, period: u32, codes: &CurrentCodes, telemetry: &Telemetry) {
        let sequence = self.sequence;
        self.sequence = sequence.wrapping_add(1);
        // Without room the sample is missing, which the receiver sees by the sequence number.
        let sent = self.boxes.get_mut(self.next).is_some_and(|place| {
            place.send_with(|sample| {
                (sample.sequence, sample.period) = (sequence, period);
                sample.telemetry = *telemetry;
                sample.codes = *codes;
            })
        });
        if sent {
            self.next = if self.next + 1 < N { self.next + 1 } else { 0 };
        }
    }
}

impl<const N: usize> Sink<'_, N> {
    /// Asks for a sample every `divider` control periods; 0 ends it.
    pub fn ask(&mut self, divider: u16) {
        self.divider.store(divider, Ordering::Relaxed);
        while self.fetch().is_some() {}
    }

    /// The next sample.
    pub fn fetch(&mut self) -> Option<Sample> {
        let sample = self.boxes.get_mut(self.next)?.take()?;
        self.next = if self.next + 1 < N { self.next + 1 } else { 0 };
        Some(sample)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn samples_come_at_their_rate_and_every_lost_one_shows() {
        let mut queue = Queue::<7>::new(Sample::default());
        let (mut source, mut sink) = queue.split();
        let mut period = 0;
        let mut run = |source: &mut Source<7>, periods: u32| {
            for _ in 0..periods {
                source.step(period, false, &[0; 3], &Telemetry::default());
                period += 1;
            }
        };
        run(&mut source, 100);
        assert!(sink.fetch().is_none(), "nobody has asked");
        sink.ask(3);
        run(&mut source, 12);
        let taken: Vec<_> = core::iter::from_fn(|| sink.fetch()).collect();
        assert_eq!(taken.iter().map(|s| s.sequence).collect::<Vec<_>>(), [0, 1, 2, 3]);
        assert!(taken.windows(2).all(|pair| pair[1].period - pair[0].period == 3));
        // Twenty are due, the queue holds seven.
        run(&mut source, 60);
        assert_eq!(core::iter::from_fn(|| sink.fetch()).count(), 7);
        run(&mut source, 3);
        assert_eq!(sink.fetch().map(|s| s.sequence), Some(24));
        sink.ask(0);
        run(&mut source, 100);
        assert!(sink.fetch().is_none());
    }

    /// The periods of the samples in `periods` control periods, every third of which is due.
    fn taken(busy: impl Fn(u32) -> bool, periods: u32) -> Vec<u32> {
        let mut queue = Queue::<16>::new(Sample::default());
        let (mut source, mut sink) = queue.split();
        sink.ask(3);
        (0..periods)
            .for_each(|period| source.step(period, busy(period), &[0; 3], &Telemetry::default()));
        core::iter::from_fn(|| sink.fetch()).map(|sample| sample.period).collect()
    }

    #[test]
    fn a_sample_waits_for_a_period_without_other_work_and_the_rate_stays() {
        assert_eq!(taken(|_| false, 10), [0, 3, 6, 9]);
        assert_eq!(taken(|period| period == 3, 13), [0, 4, 6, 9, 12]);
        assert_eq!(taken(|period| period % 2 == 0, 14), [1, 3, 7, 9, 13]);
        // Where there is none, it does not wait for ever.
        assert_eq!(taken(|_| true, 15), [2, 5, 8, 11, 14]);
    }
}
