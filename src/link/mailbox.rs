//! A place for one message between the control interrupt and the main loop.
//!
//! Own code replaces a queue of `heapless`, because the control interrupt writes its report into the message in place. The queues of
//! `heapless` (0.9.4, also `heapless::mpmc`) take items by value, which costs one more copy for every report.

use core::cell::UnsafeCell;
use core::sync::atomic::{AtomicU32, Ordering};

/// Value while there is a message. It differs from the other value in 16 bits, so a flipped bit neither sends a message again nor blocks
/// the sender.
const FULL: u32 = 0x96c3_5a3c;
const EMPTY: u32 = 0;

/// Holds at most one message; the sender and the receiver never wait for each other.
///
/// Shared by one [`Sender`] and one [`Receiver`].
pub struct Mailbox<T> {
    /// Owner of the message: the receiver if [`FULL`], else the sender.
    full: AtomicU32,
    message: UnsafeCell<T>,
}

// SAFETY: sender and receiver take turns by `full`, so they never touch the message at the same time; there is one of
// each, because `split` borrows the mailbox mutably.
unsafe impl<T: Send> Sync for Mailbox<T> {}

/// The end that fills the mailbox.
pub struct Sender<'a, T>(&'a Mailbox<T>);

/// The end that empties the mailbox.
pub struct Receiver<'a, T>(&'a Mailbox<T>);

impl<T> Mailbox<T> {
    /// Offset in a mailbox, bytes, of a byte that is not 0 while there is a message.
    pub const FULL: usize = core::mem::offset_of!(Self, full);

    /// An empty mailbox. `unread` only initialises the storage; it is never received.
    pub const fn new(unread: T) -> Self {
        Self { full: AtomicU32::new(EMPTY), message: UnsafeCell::new(unread) }
    }

    /// The two ends of the mailbox.
    pub fn split(&mut self) -> (Sender<'_, T>, Receiver<'_, T>) {
        (Sender(self), Receiver(self))
    }
}

impl<T> Sender<'_, T> {
    /// Sends `message`; `false`, and nothing sent, while the last one has not been received.
    pub fn send(&mut self, message: T) -> bool {
        self.send_with(|place| *place = message)
    }

    /// Sends a message that `write` writes in place, over an earlier one; `false` as for [`send`](Self::send).
    pub fn send_with(&mut self, write: impl FnOnce(&mut T)) -> bool {
        if self.0.full.load(Ordering::Acquire) == FULL {
            return false;
        }
        // SAFETY: the receiver leaves the message alone while the mailbox is not full, and `&mut
        // self` keeps out other senders.
        write(unsafe { &mut *self.0.message.get() });
        self.0.full.store(FULL, Ordering::Release);
        true
    }
}

impl<T> Receiver<'_, T> {
    /// Passes the message to `with`, if there is one, then empties the mailbox.
    pub fn take_with<R>(&mut self, with: impl FnOnce(&T) -> R) -> Option<R> {
        self.take_if(|_| true, |message| with(message))
    }

    /// Passes the message to `with`, which may overwrite it, if there is one that is `wanted`; then empties the mailbox.
    pub fn take_if<R>(
        &mut self,
        wanted: impl FnOnce(&T) -> bool,
        with: impl FnOnce(&mut T) -> R,
    ) -> Option<R> {
        if self.0.full.load(Ordering::Acquire) != FULL {
            return None;
        }
        // SAFETY: the sender leaves the message alone while the mailbox is full, and `&mut self`
        // keeps out other receivers.
        let message = unsafe { &mut *self.0.message.get() };
        if !wanted(message) {
            return None;
        }
        let result = with(message);
        self.0.full.store(EMPTY, Ordering::Release);
        Some(result)
    }

    /// Receives the message, if there is one.
    pub fn take(&mut self) -> Option<T>
    where
        T: Copy,
    {
        self.take_with(|message| *message)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_full_mailbox_keeps_what_it_has() {
        let mut mailbox = Mailbox::new(0);
        let (mut sender, mut receiver) = mailbox.split();
        assert_eq!(receiver.take(), None);
        assert!(sender.send(1));
        assert!(!sender.send(2));
        assert_eq!(receiver.take(), Some(1));
        assert_eq!(receiver.take(), None);
        assert!(sender.send(3));
        assert_eq!(receiver.take_with(|message| 2 * message), Some(6));
        assert_eq!(receiver.take_with(|message| 2 * message), None);
    }

    #[test]
    fn messages_arrive_whole_and_in_order_across_threads() {
        let mut mailbox = Mailbox::new([0; 8]);
        let (mut sender, mut receiver) = mailbox.split();
        std::thread::scope(|scope| {
            scope.spawn(move || {
                for i in 0..10_000_u64 {
                    while !sender.send([i; 8]) {
                        std::thread::yield_now();
                    }
                }
            });
            for i in 0..10_000_u64 {
                let message = loop {
                    match receiver.take() {
                        Some(message) => break message,
                        None => std::thread::yield_now(),
                    }
                };
                assert_eq!(message, [i; 8]);
            }
        });
    }
}
