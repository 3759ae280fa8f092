//! The serial port of the console: LPUART1, 8N1, an interrupt per byte.
//!
//! Only the interrupt accesses the registers. Its priority is below that of the control interrupt; at 115 200 bits
//! a second a byte takes 87 us, half a control period.

use core::cell::UnsafeCell;
use core::sync::atomic::{AtomicBool, Ordering};

use cortex_m::peripheral::NVIC;
use heapless::spsc::{Consumer, Producer, Queue};
use stm32g4xx_hal::gpio::{Analog, PA2, PA3, Pull};
use stm32g4xx_hal::pac::{self, Interrupt};
use stm32g4xx_hal::rcc::Rcc;
use stm32g4xx_hal::stm32::interrupt;

use induction_drive::board;
use induction_drive::console::handle;

type ReceiveQueue = Queue<u8, { board::SERIAL_RECEIVE }>;
type TransmitQueue = Queue<u8, { board::SERIAL_TRANSMIT }>;

/// Priority of the interrupt: the lowest. Only the four upper bits are implemented (datasheet).
pub const PRIORITY: u8 = 0xf0;

/// The main loop's end of the port.
pub struct Port {
    received: Consumer<'static, u8, { board::SERIAL_RECEIVE }>,
    to_send: Producer<'static, u8, { board::SERIAL_TRANSMIT }>,
}

/// The interrupt's end of the port.
struct PortInterrupt {
    port: pac::LPUART1,
    received: Producer<'static, u8, { board::SERIAL_RECEIVE }>,
    to_send: Consumer<'static, u8, { board::SERIAL_TRANSMIT }>,
    /// A byte that waits for the transmitter.
    next: Option<u8>,
}

/// The interrupt's own memory.
struct Owned(UnsafeCell<Option<PortInterrupt>>);

// SAFETY: `Port::new` writes it before it unmasks the interrupt, once, because it takes the port;
// after that only the interrupt touches it.
unsafe impl Sync for Owned {}

static INTERRUPT_END: Owned = Owned(UnsafeCell::new(None));

/// Bytes were damaged on the wire, or came faster than they were read.
static DAMAGED: AtomicBool = AtomicBool::new(false);

impl Port {
    /// Sets the port up; `None` on a second call.
    pub fn new(
        port: pac::LPUART1,
        (transmit, receive): (PA2<Analog>, PA3<Analog>),
        nvic: &mut NVIC,
        rcc: &mut Rcc,
    ) -> Option<Self> {
        let received = cortex_m::singleton!(: ReceiveQueue = Queue::new())?;
        let to_send = cortex_m::singleton!(: TransmitQueue = Queue::new())?;
        let (write_received, received) = received.split();
        let (to_send, read_to_send) = to_send.split();

        rcc.apb1enr2().modify(|_, w| w.lpuart1en().enabled());
        transmit.into_alternate::<{ board::SERIAL_AF }>();
        // Pulled up: an open input stays idle.
        receive.into_alternate::<{ board::SERIAL_AF }>().set_internal_resistor(Pull::Up);

        // SAFETY: the register takes 20 bits; `board` keeps the value inside.
        port.brr().write(|w| unsafe { w.bits(board::SERIAL_DIVIDER) });
        // 8 bits, no parity, one stop bit, as after reset. An interrupt per received byte.
        port.cr1().write(|w| w.ue().enabled().re().enabled().te().enabled().rxneie().enabled());
        // The interrupt also at damaged bytes.
        port.cr3().write(|w| w.eie().enabled());

        let end =
            PortInterrupt { port, received: write_received, to_send: read_to_send, next: None };
        // SAFETY: see `Owned`.
        unsafe { *INTERRUPT_END.0.get() = Some(end) };
        // SAFETY: no critical section relies on the priority or the mask of this interrupt.
        unsafe {
            nvic.set_priority(Interrupt::LPUART, PRIORITY);
            NVIC::unmask(Interrupt::LPUART);
        }
        Some(Self { received, to_send })
    }
}

impl handle::Port for Port {
    fn read(&mut self) -> Option<u8> {
        self.received.dequeue()
    }

    fn take_damage(&mut self) -> bool {
        DAMAGED.swap(false, Ordering::Relaxed)
    }

    fn write(&mut self, text: &str) -> bool {
        if self.to_send.capacity() - self.to_send.len() < text.len() {
            return false;
        }
        for byte in text.bytes() {
            // There is room.
            let _ = self.to_send.enqueue(byte);
        }
        // Lets the interrupt fetch the bytes.
        NVIC::pend(Interrupt::LPUART);
        true
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
    fn serve(&mut self) {
        let port = &self.port;
        let status = port.isr().read();
        if status.ore().bit() || status.fe().bit() || status.nf().bit() || status.pe().bit() {
            port.icr().write(|w| w.orecf().clear().fecf().clear().ncf().clear().pecf().clear());
            DAMAGED.store(true, Ordering::Relaxed);
        }
        if status.rxne().bit() {
            // The lower eight of nine bits.
            let byte = port.rdr().read().rdr().bits() as u8;
            if self.received.enqueue(byte).is_err() {
                DAMAGED.store(true, Ordering::Relaxed);
            }
        }
        if self.next.is_none() {
            self.next = self.to_send.dequeue();
        }
        if status.txe().bit()
            && let Some(byte) = self.next.take()
        {
            port.tdr().write(|w| w.tdr().set(u16::from(byte)));
            self.next = self.to_send.dequeue();
        }
        // Enabled only while a byte waits: the register is empty most of the time.
        if self.next.is_some() {
            port.cr1().modify(|_, w| w.txeie().enabled());
        } else {
            port.cr1().modify(|_, w| w.txeie().disabled());
        }
    }
}
