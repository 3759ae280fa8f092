//! Bytes between an interrupt and the main loop: one writes, one reads, nobody waits.

use core::cell::UnsafeCell;
use core::sync::atomic::{AtomicUsize, Ordering};

/// Holds up to `N` bytes; `N` is a power of two.
pub struct Ring<const N: usize> {
    /// Bytes written so far, wrapping; only the writer changes it.
    written: AtomicUsize,
    /// Bytes read so far, wrapping; only the reader changes it.
    read: AtomicUsize,
    bytes: UnsafeCell<[u8; N]>,
}

// SAFETY: a byte belongs to the writer or to the reader, as the two counts say; there is one of
// each, because `split` borrows the ring mutably.
unsafe impl<const N: usize> Sync for Ring<N> {}

/// The end that fills the ring.
pub struct Writer<'a, const N: usize>(&'a Ring<N>);

/// The end that empties the ring.
pub struct Reader<'a, const N: usize>(&'a Ring<N>);

impl<const N: usize> Ring<N> {
    /// An empty ring.
    pub const fn new() -> Self {
        assert!(N.is_power_of_two());
        Self {
            written: AtomicUsize::new(0),
            read: AtomicUsize::new(0),
            bytes: UnsafeCell::new([0; N]),
        }
    }

    /// Its two ends.
    pub fn split(&mut self) -> (Writer<'_, N>, Reader<'_, N>) {
        (Writer(self), Reader(self))
    }

    fn place(&self, count: usize) -> *mut u8 {
        // Inside for every count, because `N` is a power of two.
        self.bytes.get().cast::<u8>().wrapping_add(count & (N - 1))
    }
}

impl<const N: usize> Writer<'_, N> {
    /// Bytes that still fit.
    pub fn room(&self) -> usize {
        let used = self
            .0
            .written
            .load(Ordering::Relaxed)
            .wrapping_sub(self.0.read.load(Ordering::Acquire));
        N.saturating_sub(used)
    }

    /// Writes a byte, if there is room; says whether there was.
    pub fn push(&mut self, byte: u8) -> bool {
        if self.room() == 0 {
            return false;
        }
        let written = self.0.written.load(Ordering::Relaxed);
        // SAFETY: inside the array; with room left, the reader does not touch this byte before
        // `written` says so.
        unsafe { *self.0.place(written) = byte };
        self.0.written.store(written.wrapping_add(1), Ordering::Release);
        true
    }
}

impl<const N: usize> Reader<'_, N> {
    /// The oldest byte, if there is one.
    pub fn pop(&mut self) -> Option<u8> {
        let read = self.0.read.load(Ordering::Relaxed);
        if self.0.written.load(Ordering::Acquire) == read {
            return None;
        }
        // SAFETY: inside the array; written, and the writer leaves it alone until `read` says so.
        let byte = unsafe { *self.0.place(read) };
        self.0.read.store(read.wrapping_add(1), Ordering::Release);
        Some(byte)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_full_ring_takes_no_more_and_keeps_the_order() {
        let mut ring = Ring::<4>::new();
        let (mut writer, mut reader) = ring.split();
        for round in 0..10_u8 {
            for byte in 0..4 {
                assert_eq!(writer.room(), usize::from(4 - byte));
                assert!(writer.push(round + byte));
            }
            assert!(!writer.push(99));
            for byte in 0..4 {
                assert_eq!(reader.pop(), Some(round + byte));
            }
            assert_eq!(reader.pop(), None);
        }
    }

    #[test]
    fn bytes_arrive_in_order_across_threads() {
        let mut ring = Ring::<8>::new();
        let (mut writer, mut reader) = ring.split();
        let bytes = || (0..100_000_u32).map(|i| (i % 251) as u8);
        std::thread::scope(|scope| {
            scope.spawn(move || {
                for byte in bytes() {
                    while !writer.push(byte) {
                        std::thread::yield_now();
                    }
                }
            });
            for byte in bytes() {
                let got = loop {
                    match reader.pop() {
                        Some(got) => break got,
                        None => std::thread::yield_now(),
                    }
                };
                assert_eq!(got, byte);
            }
        });
    }
}
