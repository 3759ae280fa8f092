//! Items between an interrupt and the main loop: one writes, one reads, nobody waits.
//!
//! (No queue of `heapless`, for the reason that `mailbox.rs` gives.)

use core::cell::UnsafeCell;
use core::mem::MaybeUninit;
use core::sync::atomic::{AtomicUsize, Ordering};

/// Holds up to `N` items; `N` is a power of two.
pub struct Ring<T, const N: usize> {
    /// Items written so far, wrapping; only the writer changes it.
    written: AtomicUsize,
    /// Items read so far, wrapping; only the reader changes it.
    read: AtomicUsize,
    items: UnsafeCell<[MaybeUninit<T>; N]>,
}

// SAFETY: an item belongs to the writer or to the reader, as the two counts say; there is one of
// each, because `split` borrows the ring mutably.
unsafe impl<T: Copy + Send, const N: usize> Sync for Ring<T, N> {}

/// The end that fills the ring.
pub struct Writer<'a, T, const N: usize>(&'a Ring<T, N>);

/// The end that empties the ring.
pub struct Reader<'a, T, const N: usize>(&'a Ring<T, N>);

impl<T: Copy, const N: usize> Ring<T, N> {
    /// An empty ring.
    #[inline(always)]
    pub const fn new() -> Self {
        assert!(N.is_power_of_two());
        Self {
            written: AtomicUsize::new(0),
            read: AtomicUsize::new(0),
            items: UnsafeCell::new([MaybeUninit::uninit(); N]),
        }
    }

    /// Its two ends.
    #[inline(always)]
    pub fn split(&mut self) -> (Writer<'_, T, N>, Reader<'_, T, N>) {
        (Writer(self), Reader(self))
    }

    fn place(&self, count: usize) -> *mut T {
        // Inside for every count, because `N` is a power of two.
        self.items.get().cast::<T>().wrapping_add(count & (N - 1))
    }
}

impl<T: Copy, const N: usize> Writer<'_, T, N> {
    /// Items that still fit.
    pub fn room(&self) -> usize {
        let used = self
            .0
            .written
            .load(Ordering::Relaxed)
            .wrapping_sub(self.0.read.load(Ordering::Acquire));
        N.saturating_sub(used)
    }

    /// Writes an item, if there is room; says whether there was.
    #[inline]
    pub fn push(&mut self, item: T) -> bool {
        let ring = self.0;
        let written = ring.written.load(Ordering::Relaxed);
        if written.wrapping_sub(ring.read.load(Ordering::Acquire)) >= N {
            return false;
        }
        // SAFETY: inside the array; with room left, the reader does not touch this item before
        // `written` says so.
        unsafe { ring.place(written).write(item) };
        ring.written.store(written.wrapping_add(1), Ordering::Release);
        true
    }
}

impl<T: Copy, const N: usize> Reader<'_, T, N> {
    /// The oldest item, if there is one.
    pub fn pop(&mut self) -> Option<T> {
        let read = self.0.read.load(Ordering::Relaxed);
        if self.0.written.load(Ordering::Acquire) == read {
            return None;
        }
        // SAFETY: inside the array; written, and the writer leaves it alone until `read` says so.
        let item = unsafe { self.0.place(read).read() };
        self.0.read.store(read.wrapping_add(1), Ordering::Release);
        Some(item)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_full_ring_takes_no_more_and_keeps_the_order() {
        let mut ring = Ring::<u8, 4>::new();
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
    fn items_arrive_whole_and_in_order_across_threads() {
        let mut ring = Ring::<[u32; 8], 8>::new();
        let (mut writer, mut reader) = ring.split();
        let items = || (0..100_000_u32).map(|i| [i; 8]);
        std::thread::scope(|scope| {
            scope.spawn(move || {
                for item in items() {
                    while !writer.push(item) {
                        std::thread::yield_now();
                    }
                }
            });
            for item in items() {
                let got = loop {
                    match reader.pop() {
                        Some(got) => break got,
                        None => std::thread::yield_now(),
                    }
                };
                assert_eq!(got, item);
            }
        });
    }
}
