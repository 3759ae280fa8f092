//! The stream: samples of the drive from the control interrupt to the main loop, while it runs.

use core::sync::atomic::{AtomicU16, Ordering};

use drive_core::Telemetry;
use heapless::spsc::{Consumer, Producer};

/// Signals of the drive in one control period.
#[derive(Clone, Copy, Debug, Default)]
pub struct Sample {
    /// One more for each sample that was due, taken or not; wraps.
    pub sequence: u16,
    /// Control periods since the start, wrapping.
    pub period: u32,
    /// The signals.
    pub telemetry: Telemetry,
}

/// The control interrupt's end, over a queue that holds `N - 1` samples.
pub struct Source<'a, const N: usize> {
    samples: Producer<'a, Sample, N>,
    /// Control periods from one sample to the next; 0: none.
    divider: &'a AtomicU16,
    wait: u16,
    sequence: u16,
}

/// The main loop's end.
pub struct Sink<'a, const N: usize> {
    samples: Consumer<'a, Sample, N>,
    divider: &'a AtomicU16,
}

/// The two ends over a queue and the divider, which begins with 0.
pub fn split<'a, const N: usize>(
    (samples, received): (Producer<'a, Sample, N>, Consumer<'a, Sample, N>),
    divider: &'a AtomicU16,
) -> (Source<'a, N>, Sink<'a, N>) {
    (Source { samples, divider, wait: 0, sequence: 0 }, Sink { samples: received, divider })
}

impl<const N: usize> Source<'_, N> {
    /// Takes a sample of the present control period, if one is due. In a `busy` period, which does other work, it waits for
    /// the next: the longest control period gets no longer.
    pub fn step(&mut self, period: u32, busy: bool, telemetry: impl FnOnce() -> Telemetry) {
        let divider = self.divider.load(Ordering::Relaxed);
        if divider != 0 {
            self.wait = self.wait.saturating_sub(1);
            if self.wait == 0 && !busy {
                self.take(period, divider, telemetry());
            }
        }
    }

    fn take(&mut self, period: u32, divider: u16, telemetry: Telemetry) {
        self.wait = divider;
        // Without room the sample is missing, which the receiver sees by the sequence number.
        let _ = self.samples.enqueue(Sample { sequence: self.sequence, period, telemetry });
        self.sequence = self.sequence.wrapping_add(1);
    }
}

impl<const N: usize> Sink<'_, N> {
    /// Asks for a sample every `divider` control periods; 0 ends it.
    pub fn ask(&mut self, divider: u16) {
        self.divider.store(divider, Ordering::Relaxed);
        while self.samples.dequeue().is_some() {}
    }

    /// The next sample.
    pub fn next(&mut self) -> Option<Sample> {
        self.samples.dequeue()
    }
}

#[cfg(test)]
mod tests {
    use heapless::spsc::Queue;

    use super::*;

    #[test]
    fn samples_come_at_their_rate_and_every_lost_one_shows() {
        let mut queue = Queue::<Sample, 8>::new();
        let divider = AtomicU16::new(0);
        let (mut source, mut sink) = split(queue.split(), &divider);
        let mut period = 0;
        let mut run = |source: &mut Source<8>, periods: u32| {
            for _ in 0..periods {
                source.step(period, false, Telemetry::default);
                period += 1;
            }
        };
        run(&mut source, 100);
        assert!(sink.next().is_none(), "nobody has asked");
        sink.ask(3);
        run(&mut source, 12);
        let taken: Vec<_> = core::iter::from_fn(|| sink.next()).collect();
        assert_eq!(taken.iter().map(|s| s.sequence).collect::<Vec<_>>(), [0, 1, 2, 3]);
        assert!(taken.windows(2).all(|pair| pair[1].period - pair[0].period == 3));
        // Twenty are due, the queue holds seven.
        run(&mut source, 60);
        assert_eq!(core::iter::from_fn(|| sink.next()).count(), 7);
        run(&mut source, 3);
        assert_eq!(sink.next().map(|s| s.sequence), Some(24));
        sink.ask(0);
        run(&mut source, 100);
        assert!(sink.next().is_none());
    }

    #[test]
    fn a_busy_period_delays_a_sample_by_one() {
        let mut queue = Queue::<Sample, 8>::new();
        let divider = AtomicU16::new(2);
        let (mut source, mut sink) = split(queue.split(), &divider);
        for period in 0..6 {
            source.step(period, period == 2, Telemetry::default);
        }
        let periods: Vec<_> = core::iter::from_fn(|| sink.next()).map(|s| s.period).collect();
        assert_eq!(periods, [0, 3, 5]);
    }
}
