//! The RS-485 port of the field bus: USART3 and a pin that switches the driver on, an interrupt per byte.
//!
//! Only the interrupt accesses the registers, at the same priority as the console's. A frame ends when the receiver has heard nothing for
//! the silent interval of the line (its time-out counter); then the whole frame goes to the main loop. While the driver is on nothing is
//! received.

use core::cell::UnsafeCell;
use core::sync::atomic::{AtomicBool, AtomicU32, Ordering};

use cortex_m::peripheral::NVIC;
use drive_settings::value::Words as _;
use stm32g4xx_hal::pac::{self, Interrupt};
use stm32g4xx_hal::rcc::Rcc;
use stm32g4xx_hal::stm32::interrupt;

use crate::boards::pin::Pin;
use crate::boards::{Level, Rs485, pin};
use crate::chip::{LOWEST_PRIORITY, pins};
use crate::link::mailbox::{Mailbox, Receiver, Sender};
use crate::modbus::settings::{Baud, Format, Settings};
use crate::modbus::slave::{self, Written};
use crate::modbus::{Frame, Port, bus};

/// The main loop's end of the port.
pub struct Usart {
    received: Receiver<'static, Frame>,
    to_send: Sender<'static, Frame>,
}

/// The interrupt's end of the port.
struct PortInterrupt {
    port: pac::USART3,
    driver: Pin,
    received: Sender<'static, Frame>,
    to_send: Receiver<'static, Frame>,
    /// The frame that is being received or sent.
    frame: Frame,
    /// Whether the frame that is being received is damaged.
    damaged: bool,
    /// The next byte of the frame that is being sent; `None` while nothing is sent.
    next: Option<usize>,
    /// The line in force, as in [`LINE`].
    line: u32,
}

/// The interrupt's own memory.
struct Owned(UnsafeCell<Option<PortInterrupt>>);

// SAFETY: `Usart::new` writes it before it unmasks the interrupt, once, because it takes the port;
// after that only the interrupt touches it.
unsafe impl Sync for Owned {}

static INTERRUPT_END: Owned = Owned(UnsafeCell::new(None));

/// The requested line parameters: address, rate and format, see [`line`].
static LINE: AtomicU32 = AtomicU32::new(NO_LINE);
/// The port is off.
const NO_LINE: u32 = u32::MAX;

/// Whether the slave is busy.
static BUSY: AtomicBool = AtomicBool::new(false);
/// A stop that the main loop could not take: register and word. 0: none.
static STOP: AtomicU32 = AtomicU32::new(0);

/// Address, rate and format as a word.
fn line(settings: &Settings) -> u32 {
    u32::from_be_bytes([
        0,
        settings.own(),
        settings.baud.place() as u8,
        settings.format.place() as u8,
    ])
}

impl Usart {
    /// Sets the port up, without a line yet; `None` on a second call.
    pub fn new(port: pac::USART3, wires: &Rs485, nvic: &mut NVIC, rcc: &mut Rcc) -> Option<Self> {
        let received = cortex_m::singleton!(: Mailbox<Frame> = Mailbox::new(Frame::new()))?;
        let to_send = cortex_m::singleton!(: Mailbox<Frame> = Mailbox::new(Frame::new()))?;
        let (send_received, received) = received.split();
        let (to_send, receive_to_send) = to_send.split();

        rcc.apb1enr1().modify(|_, w| w.usart3en().enabled());
        pins::output(wires.driver, Level::Low);
        let (transmit, receive) = (wires.transmit, wires.receive);
        pins::alternate(transmit, transmit.function(pin::USART3_TX), None);
        // Pulled up: an open input stays idle.
        pins::alternate(receive, receive.function(pin::USART3_RX), Some(Level::High));

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
            nvic.set_priority(Interrupt::USART3, LOWEST_PRIORITY);
            NVIC::unmask(Interrupt::USART3);
        }
        Some(Self { received, to_send })
    }
}

impl Port for Usart {
    fn set_line(&mut self, settings: &Settings) {
        let wanted = line(settings);
        if LINE.swap(wanted, Ordering::Relaxed) != wanted {
            NVIC::pend(Interrupt::USART3);
        }
    }

    fn receive(&mut self, is_due: impl FnOnce() -> bool) -> Option<Frame> {
        self.received.take_if(|_| is_due(), |frame| frame.clone())
    }

    fn send(&mut self, frame: &Frame) {
        // There is room: a master sends its next request after the answer, or gives the answer up.
        self.to_send.send_with(|place| place.clone_from(frame));
        NVIC::pend(Interrupt::USART3);
    }

    fn set_busy(&mut self, busy: bool) {
        BUSY.store(busy, Ordering::Relaxed);
    }

    fn take_stop(&mut self) -> Option<Written> {
        let stop = STOP.swap(0, Ordering::Relaxed);
        (stop != 0).then_some(((stop >> 16) as u16, stop as u16))
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

    /// Ends a received frame: it goes to the main loop. While the main loop designs controllers for seconds, or has not taken the frame
    /// before, the frame is answered here.
    fn end_frame(&mut self) {
        let whole = !self.damaged && !self.frame.is_empty();
        let busy = BUSY.load(Ordering::Relaxed);
        if whole && (busy || !self.received.send_with(|place| place.clone_from(&self.frame))) {
            let [_, own, ..] = self.line.to_be_bytes();
            let (answer, stop) = slave::busy(&self.frame, own, bus::is_stop);
            if let Some((at, word)) = stop {
                // If two stops come, the one that is kept is a stop as well.
                STOP.fetch_max(u32::from(at) << 16 | u32::from(word), Ordering::Relaxed);
            }
            if let Some(answer) = answer {
                self.frame = answer;
                self.transmit();
                return;
            }
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
            let [.., baud, format] = wanted.to_be_bytes();
            self.set_line(Baud::at(baud.into()), Format::at(format.into()));
        }
    }

    /// Gives the next byte to the transmitter; switches the driver off after the last stop bit.
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
        // The interrupt is raised by damaged bytes, too.
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
