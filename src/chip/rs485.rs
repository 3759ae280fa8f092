//! The RS-485 port of the field bus: USART3 and a pin that switches the driver on, an interrupt per byte.
//!
//! Only the interrupt accesses the registers, at the priority of the console's. A frame ends when the receiver has heard
//! nothing for the silence of the line (its time-out counter); then it goes to the main loop whole. While the
//! driver is on nothing is received.

use core::cell::UnsafeCell;
use core::sync::atomic::{AtomicU8, AtomicU32, Ordering};

use cortex_m::peripheral::NVIC;
use drive_settings::value::Words as _;
use stm32g4xx_hal::pac::{self, Interrupt};
use stm32g4xx_hal::rcc::Rcc;
use stm32g4xx_hal::stm32::interrupt;

use crate::chip::pins;
use crate::chip::serial::PRIORITY;
use induction_drive::boards::pin::{Pin, USART3_RX, USART3_TX};
use induction_drive::boards::{Level, Rs485};
use induction_drive::link::mailbox::{Mailbox, Receiver, Sender};
use induction_drive::modbus::{self, Frame, slave};
use induction_drive::settings::bus::{Baud, Format};

/// The main loop's end of the port.
pub struct Port {
    received: Receiver<'static, Frame>,
    to_send: Sender<'static, Frame>,
}

/// The interrupt's end of the port.
struct PortInterrupt {
    port: pac::USART3,
    driver: Pin,
    received: Sender<'static, Frame>,
    to_send: Receiver<'static, Frame>,
    /// The frame that comes in, or goes out.
    frame: Frame,
    /// Whether the frame that comes in is damaged.
    damaged: bool,
    /// The next byte of the frame that goes out; `None` while nothing is sent.
    next: Option<usize>,
    /// The line in force, as in [`LINE`].
    line: u32,
}

/// The interrupt's own memory.
struct Owned(UnsafeCell<Option<PortInterrupt>>);

// SAFETY: `Port::new` writes it before it unmasks the interrupt, once, because it takes the port;
// after that only the interrupt touches it.
unsafe impl Sync for Owned {}

static INTERRUPT_END: Owned = Owned(UnsafeCell::new(None));

/// The line that is wanted: rate and format, see [`line`].
static LINE: AtomicU32 = AtomicU32::new(NO_LINE);
/// The port is off.
const NO_LINE: u32 = u32::MAX;

/// Address of a slave that is busy; 0 while it is not.
static BUSY: AtomicU8 = AtomicU8::new(0);

/// Rate and format as a word.
fn line(baud: Baud, format: Format) -> u32 {
    (baud.place() as u32) << 8 | format.place() as u32
}

impl Port {
    /// Sets the port up, without a line yet; `None` on a second call.
    pub fn new(port: pac::USART3, wires: &Rs485, nvic: &mut NVIC, rcc: &mut Rcc) -> Option<Self> {
        let received = cortex_m::singleton!(: Mailbox<Frame> = Mailbox::new(Frame::new()))?;
        let to_send = cortex_m::singleton!(: Mailbox<Frame> = Mailbox::new(Frame::new()))?;
        let (send_received, received) = received.split();
        let (to_send, receive_to_send) = to_send.split();

        rcc.apb1enr1().modify(|_, w| w.usart3en().enabled());
        pins::output(wires.driver, Level::Low);
        let (transmit, receive) = (wires.transmit, wires.receive);
        pins::alternate(transmit, transmit.function(&USART3_TX), None);
        // Pulled up: an open input stays idle.
        pins::alternate(receive, receive.function(&USART3_RX), Some(Level::High));

        let end = PortInterrupt {
            port,
            driver: wires.driver,
            received: send_received,
            to_send: receive_to_send,
            frame: Frame::new(),
            damaged: false,
            next: None,
            line: NO_LINE,
        };
        // SAFETY: see `Owned`.
        unsafe { *INTERRUPT_END.0.get() = Some(end) };
        // SAFETY: no critical section relies on the priority or the mask of this interrupt.
        unsafe {
            nvic.set_priority(Interrupt::USART3, PRIORITY);
            NVIC::unmask(Interrupt::USART3);
        }
        Some(Self { received, to_send })
    }
}

impl modbus::Port for Port {
    fn set_line(&mut self, baud: Baud, format: Format) {
        let wanted = line(baud, format);
        if LINE.swap(wanted, Ordering::Relaxed) != wanted {
            NVIC::pend(Interrupt::USART3);
        }
    }

    fn receive(&mut self) -> Option<Frame> {
        self.received.take_with(Frame::clone)
    }

    fn send(&mut self, frame: &Frame) {
        // There is room: a master sends its next request after the answer, or gives the answer up.
        self.to_send.send_with(|place| place.clone_from(frame));
        NVIC::pend(Interrupt::USART3);
    }

    fn set_busy(&mut self, own: Option<u8>) {
        BUSY.store(own.unwrap_or(0), Ordering::Relaxed);
    }
}

#[interrupt]
fn USART3() {
    // SAFETY: see `Owned`; the reference ends with this function, which does not interrupt itself.
    if let Some(end) = unsafe { &mut *INTERRUPT_END.0.get() } {
        end.serve();
    }
}

impl PortInterrupt {
    fn serve(&mut self) {
        self.hear();
        self.begin();
        self.send();
    }

    /// Takes a byte, and ends a frame.
    fn hear(&mut self) {
        let port = &self.port;
        let status = port.isr().read();
        if status.ore().bit() || status.fe().bit() || status.nf().bit() || status.pe().bit() {
            port.icr().write(|w| w.orecf().clear().fecf().clear().ncf().clear().pecf().clear());
            self.damaged = true;
        }
        if status.rxne().bit() {
            // Without the parity bit.
            let byte = port.rdr().read().rdr().bits() as u8;
            if self.next.is_none() && self.frame.push(byte).is_err() {
                self.damaged = true;
            }
        }
        if status.rtof().bit() {
            port.icr().write(|w| w.rtocf().clear());
            if self.next.is_none() {
                self.end_frame();
            }
            self.damaged = false;
        }
    }

    /// A frame has come in: to the main loop, or answered here while that designs controllers for seconds.
    fn end_frame(&mut self) {
        let whole = !self.damaged && !self.frame.is_empty();
        let own = BUSY.load(Ordering::Relaxed);
        if whole && own == 0 {
            // Lost if the main loop has not taken the one before: the master asks again.
            self.received.send_with(|place| place.clone_from(&self.frame));
        } else if whole && let Some(answer) = slave::busy(&self.frame, own) {
            self.frame = answer;
            self.transmit();
            return;
        }
        self.frame.clear();
    }

    /// Begins to send the frame.
    fn transmit(&mut self) {
        self.next = Some(0);
        pins::set(self.driver, Level::High);
    }

    /// Between two frames: begins to send, or changes the line.
    fn begin(&mut self) {
        if self.next.is_some() || !self.frame.is_empty() {
            return;
        }
        let frame = &mut self.frame;
        if self.to_send.take_with(|message| frame.clone_from(message)).is_some() {
            self.transmit();
            return;
        }
        let wanted = LINE.load(Ordering::Relaxed);
        if wanted != self.line {
            self.line = wanted;
            self.set_line(Baud::at((wanted >> 8) as usize), Format::at((wanted & 0xff) as usize));
        }
    }

    /// Gives the next byte to the transmitter; switches the driver off behind the last stop bit.
    fn send(&mut self) {
        let Some(next) = self.next else { return };
        let port = &self.port;
        let status = port.isr().read();
        match self.frame.get(next) {
            Some(byte) if status.txe().bit() => {
                port.tdr().write(|w| w.tdr().set(u16::from(*byte)));
                self.next = Some(next + 1);
            }
            None if status.tc().bit() => {
                pins::set(self.driver, Level::Low);
                self.frame.clear();
                self.next = None;
            }
            _ => {}
        }
        let (sending, waiting) =
            (self.next.is_some(), self.next.is_some_and(|n| n < self.frame.len()));
        port.cr1().modify(|_, w| w.txeie().bit(waiting).tcie().bit(sending && !waiting));
    }

    /// Switches the port off and on with another rate and format.
    fn set_line(&self, baud: Baud, format: Format) {
        let port = &self.port;
        // Rate, format and time-out can be changed only while it is off (RM0440, USART_CR1 and CR2).
        port.cr1().reset();
        // SAFETY: any 16 bits of at least 16 are a rate, see `Baud::divider`.
        port.brr().write(|w| unsafe { w.bits(u32::from(baud.divider())) });
        port.rtor().write(|w| w.rto().set(baud.silence_bits(format)));
        port.cr2().write(|w| {
            let w = w.rtoen().enabled();
            if format == Format::TwoStops { w.stop().stop2() } else { w.stop().stop1() }
        });
        // The interrupt also at damaged bytes.
        port.cr3().write(|w| w.eie().enabled());
        let parity = format == Format::Even;
        // Nine bits with parity.
        port.cr1().write(|w| w.m0().bit(parity).pce().bit(parity));
        port.cr1().modify(|_, w| {
            w.ue().enabled().re().enabled().te().enabled();
            w.rxneie().enabled().rtoie().enabled()
        });
    }
}
