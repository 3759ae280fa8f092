//! The serial port of the console: LPUART1, 8N1, with its FIFOs of eight bytes.
//!
//! Only the interrupt accesses the registers. Its priority is below the control interrupt's, during which the FIFOs go on: at 2 Mbaud
//! eight bytes take 40 us.

use core::cell::UnsafeCell;
use core::sync::atomic::{AtomicBool, AtomicU32, Ordering};

use cortex_m::peripheral::NVIC;
use heapless::spsc::{Consumer, Producer, Queue};
use stm32g4xx_hal::pac::{self, Interrupt};
use stm32g4xx_hal::rcc::Rcc;
use stm32g4xx_hal::stm32::interrupt;

use super::{baud, handle};
use crate::boards::{Level, SELECTED, pin};
use crate::chip::{LOWEST_PRIORITY, pins};

/// Size of the receive queue, bytes; it holds one byte less, 22 ms at full rate. The main loop reads it a thousand times as often.
const RECEIVE: usize = 256;
/// Size of the transmit queue, bytes; it holds one byte less. The longest line waits 39 ms at most.
const TRANSMIT: usize = 448;
type ReceiveQueue = Queue<u8, RECEIVE>;
type TransmitQueue = Queue<u8, TRANSMIT>;

/// Bytes that each FIFO holds (RM0440, LPUART implementation).
const FIFO: u32 = 8;

/// The main loop's end of the port.
pub struct Lpuart {
    received: Consumer<'static, u8>,
    to_send: Producer<'static, u8>,
    /// Clock of the port, Hz.
    clock_hz: u32,
}

/// The interrupt's end of the port.
struct PortInterrupt {
    port: pac::LPUART1,
    received: Producer<'static, u8>,
    to_send: Consumer<'static, u8>,
    /// The BRR register in force.
    divider: u32,
}

/// The interrupt's own memory.
struct Owned(UnsafeCell<Option<PortInterrupt>>);

// SAFETY: `Lpuart::new` writes it before it unmasks the interrupt, once, because it takes the port;
// after that only the interrupt touches it.
unsafe impl Sync for Owned {}

static INTERRUPT_END: Owned = Owned(UnsafeCell::new(None));

/// Bytes were damaged on the wire, or came faster than they were read.
static DAMAGED: AtomicBool = AtomicBool::new(false);
/// The requested BRR register, and the one in force.
static DIVIDER: AtomicU32 = AtomicU32::new(0);
static IN_FORCE: AtomicU32 = AtomicU32::new(0);

impl Lpuart {
    /// Sets the port up, with its clock in Hz; `None` on a second call.
    pub fn new(port: pac::LPUART1, nvic: &mut NVIC, rcc: &mut Rcc, clock_hz: u32) -> Option<Self> {
        let received = cortex_m::singleton!(: ReceiveQueue = Queue::new())?;
        let to_send = cortex_m::singleton!(: TransmitQueue = Queue::new())?;
        let (write_received, received) = received.split();
        let (to_send, read_to_send) = to_send.split();

        rcc.apb1enr2().modify(|_, w| w.lpuart1en().enabled());
        let [transmit, receive] = SELECTED.wiring.console;
        pins::alternate(transmit, transmit.function(pin::LPUART1_TX), None);
        // Pulled up: an open input stays idle.
        pins::alternate(receive, receive.function(pin::LPUART1_RX), Some(Level::High));

        // The interrupt is raised by damaged bytes, too.
        port.cr3().write(|w| w.eie().enabled());
        let divider = baud::divider(clock_hz, baud::USUAL);
        DIVIDER.store(divider, Ordering::Relaxed);
        IN_FORCE.store(divider, Ordering::Relaxed);
        let end = PortInterrupt { port, received: write_received, to_send: read_to_send, divider };
        end.enable();
        // SAFETY: see `Owned`.
        unsafe { *INTERRUPT_END.0.get() = Some(end) };
        // SAFETY: no critical section relies on the priority or the mask of this interrupt.
        unsafe {
            nvic.set_priority(Interrupt::LPUART, LOWEST_PRIORITY);
            NVIC::unmask(Interrupt::LPUART);
        }
        Some(Self { received, to_send, clock_hz })
    }
}

impl handle::Port for Lpuart {
    fn read(&mut self) -> Option<u8> {
        self.received.dequeue()
    }

    fn take_damage(&mut self) -> bool {
        DAMAGED.swap(false, Ordering::Relaxed)
    }

    fn write(&mut self, bytes: &[u8]) -> bool {
        if self.to_send.capacity() - self.to_send.len() < bytes.len() {
            return false;
        }
        for byte in bytes {
            // There is room.
            let _ = self.to_send.enqueue(*byte);
        }
        // Lets the interrupt fetch the bytes.
        NVIC::pend(Interrupt::LPUART);
        true
    }

    fn change_rate(&mut self, rate: u32) -> bool {
        let divider = baud::divider(self.clock_hz, rate);
        DIVIDER.store(divider, Ordering::Relaxed);
        NVIC::pend(Interrupt::LPUART);
        IN_FORCE.load(Ordering::Relaxed) == divider
    }
}

#[interrupt]
fn LPUART() {
    // SAFETY: see `Owned`; the reference ends with this function, which does not interrupt itself.
    if let Some(end) = unsafe { &mut *INTERRUPT_END.0.get() } {
        end.serve();
    }
}

impl PortInterrupt {
    /// Sets the rate and switches the port on: 8 bits, no parity, one stop bit, as after reset; FIFOs, and an interrupt when
    /// a byte is received.
    fn enable(&self) {
        // BRR and the FIFOs can be changed only while the port is off (RM0440, LPUART_CR1).
        self.port.cr1().reset();
        // SAFETY: the register takes 20 bits; `board` keeps the value inside.
        self.port.brr().write(|w| unsafe { w.bits(self.divider) });
        self.port.cr1().write(|w| w.fifoen().set_bit());
        self.port
            .cr1()
            .modify(|_, w| w.ue().enabled().re().enabled().te().enabled().rxneie().enabled());
    }

    fn serve(&mut self) {
        let port = &self.port;
        let status = port.isr().read();
        if status.ore().bit() || status.fe().bit() || status.nf().bit() || status.pe().bit() {
            port.icr().write(|w| w.orecf().clear().fecf().clear().ncf().clear().pecf().clear());
            DAMAGED.store(true, Ordering::Relaxed);
        }
        // At most as many bytes as the FIFO holds, so that the main loop goes on.
        for _ in 0..FIFO {
            if !port.isr().read().rxne().bit() {
                break;
            }
            // The lower eight of nine bits.
            let byte = port.rdr().read().rdr().bits() as u8;
            if self.received.enqueue(byte).is_err() {
                DAMAGED.store(true, Ordering::Relaxed);
            }
        }
        for _ in 0..FIFO {
            if !port.isr().read().txe().bit() {
                break;
            }
            let Some(byte) = self.to_send.dequeue() else { break };
            port.tdr().write(|w| w.tdr().set(u16::from(byte)));
        }
        // Enabled only while bytes wait: the FIFO is empty most of the time.
        let more = self.to_send.ready();
        port.cr1().modify(|_, w| w.txfeie().bit(more));
        let wanted = DIVIDER.load(Ordering::Relaxed);
        // Changed at the end of the last byte; the main loop asks again until then.
        if wanted != self.divider && !more && port.isr().read().tc().bit() {
            self.divider = wanted;
            self.enable();
            IN_FORCE.store(wanted, Ordering::Relaxed);
        }
    }
}
