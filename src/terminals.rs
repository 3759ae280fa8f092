//! The terminals: wires to a panel or a PLC as an interface of the command arbiter, beside console and field bus.
//!
//! Data flow: [`Port`] reads the pins. `Debounce` turns them into closed [`Contacts`], once a millisecond.
//! [`settings::Settings::interlock`] says whether they let the drive run. The [`Sequence`] turns START into starts and stops. A
//! [reference](mod@reference) gives a speed. Nothing here waits.

mod contacts;
mod interlock;
#[cfg(target_os = "none")]
mod port;
pub mod reference;
pub mod sequence;
pub mod settings;
#[cfg(test)]
mod tests;

use drive_core::io::PERIOD_S;
use drive_core::{Command, Mode, State, Stop};

use crate::boards::ANALOG;
use crate::desk::Desk;
use crate::desk::handle::DriveHandle;
use crate::desk::order::{Order, Refusal};
use crate::link::Status;
use crate::settings::Commander;
use crate::settings::FirmwareSettings;
pub use contacts::Contacts;
use contacts::Debounce;
pub use interlock::Interlock;
#[cfg(target_os = "none")]
pub use port::Pins;
use reference::Lost;
use sequence::{Act, Seen, Sequence};
use settings::Reference;
pub use settings::{ROWS, Settings};

/// The pins of the terminals. Without a pin a contact counts as open.
pub trait Port {
    /// The contacts that are closed now. Called once a millisecond.
    fn look(&mut self) -> Contacts;
    /// The last ADC counts of reference, second reference, and the sensor in the motor's winding; `None` if the board has no such input,
    /// or its ADC gives no result.
    fn codes(&self) -> [Option<u16>; ANALOG] {
        [None; ANALOG]
    }
    /// Sets the outputs RUN, FAULT and BRAKE.
    fn show(&mut self, _: [bool; 3]) {}
}

/// Speed at and below which the brake closes during a stop by ramp, rpm.
pub const BRAKE_RPM: f32 = 30.0;
/// Time between two set-points to the drive, ms: each costs the main loop up to two.
const REFERENCE_MS: u32 = 8;
/// Time between two readings of the motor's temperature sensor, ms.
const MOTOR_MS: u16 = 100;

/// The terminals, see the head of the module.
#[derive(Default)]
pub struct Terminals {
    debounce: Debounce,
    /// Time of the last reading, ms, wrapping.
    looked: u8,
    sequence: Sequence,
    reverse: bool,
    /// Whether RESET was open at the last reading.
    reset_open: bool,
    /// Consecutive readings of a lost reference.
    lost: u8,
    /// The speed that the drive was given last since its start, rpm.
    given: Option<i16>,
    /// Time of the last reading of the motor's temperature sensor, ms, wrapping.
    motor_ms: u16,
}

impl Terminals {
    /// Tells the drive the reading of the motor's temperature sensor. `now_ms` wraps.
    pub fn read_motor(
        &mut self,
        port: &impl Port,
        desk: &mut Desk,
        drive: &mut impl DriveHandle,
        now_ms: u32,
    ) {
        if (now_ms as u16).wrapping_sub(self.motor_ms) < MOTOR_MS {
            return;
        }
        self.motor_ms = now_ms as u16;
        let [.., code] = port.codes();
        let reading = desk.settings().in_force().drive.motor_sensor.celsius(code);
        desk.modules.motor_c = reading;
        if let Some(reading) = reading {
            // The command is accepted in every state; if there is no answer, the control does not run.
            let _ = drive.command(Command::MotorTemperature(reading));
        }
    }

    /// Reads the contacts, once a millisecond, and makes the requests that they stand for. `now_ms` wraps.
    #[inline(never)] // its stack does not add to that of a design
    pub fn serve(
        &mut self,
        port: &mut impl Port,
        desk: &mut Desk,
        drive: &mut impl DriveHandle,
        now_ms: u32,
    ) {
        let status = drive.status();
        port.show(outputs(desk, status.as_ref()));
        if core::mem::replace(&mut self.looked, now_ms as u8) == now_ms as u8 {
            return;
        }
        let contacts = port.look();
        let closed = self.debounce.look(contacts);
        let state = &mut desk.modules;
        (state.closed, state.contacts) = (closed, contacts);
        desk.note_activity(Commander::Terminals, now_ms);
        let settings = desk.settings().in_force();
        let (own, speed) = (settings.modules.terminals, self.speed(settings, port, closed));
        let state = status.map_or(State::Off, |status| status.state);
        let (off, stopping, hold) = (drive.is_off(), drive.is_stopping(), own.interlock(closed));
        let commands = desk.commander() == Commander::Terminals;
        // The arbiter shows a refusal at the console.
        let mut give =
            |desk: &mut Desk, order| drop(desk.order(Commander::Terminals, order, drive));
        let reset = core::mem::replace(&mut self.reset_open, !closed.has(Contacts::RESET));
        if commands && own.reset && reset && closed.has(Contacts::RESET) {
            give(desk, Order::Clear);
        }
        let harder =
            hold == Some(Stop::Now) || (hold == Some(Stop::Coast) && state != State::Stopping);
        if let Some(stop) = hold
            && !off
            && (harder || !stopping)
        {
            give(desk, Order::Stop(stop));
        }
        let (held, busy) = (hold.is_some(), desk.is_busy());
        let seen = Seen { commands, held, busy, ended: off || stopping };
        let [contact, start] = [contacts, closed].map(|contacts| contacts.has(Contacts::START));
        match (self.sequence.step(own.start, contact, start, seen), speed) {
            (Act::Stop, _) => give(desk, Order::Stop(Stop::Ramp)),
            (Act::Start, speed) => match desk.modules.lost.or(speed.err()) {
                Some(lost) => lose_reference(desk, lost),
                None => {
                    self.reverse = own.reverse && closed.has(Contacts::REVERSE);
                    self.given = None;
                    give(desk, Order::Start(Mode::Speed));
                }
            },
            (Act::Go, Err(lost)) => {
                lose_reference(desk, lost);
                give(desk, Order::Stop(Stop::Ramp));
            }
            (Act::Go, Ok(rpm)) => {
                let rpm = if self.reverse { -rpm } else { rpm };
                let due = self.given.is_none() || now_ms.is_multiple_of(REFERENCE_MS);
                if due && self.given != Some(rpm) {
                    self.given = Some(rpm);
                    give(desk, Order::Speed(rpm.into()));
                }
            }
            (Act::Nothing, _) => {}
        }
    }

    /// The requested speed, rpm; the last one while a lost reference may come back.
    fn speed(
        &mut self,
        settings: &FirmwareSettings,
        port: &impl Port,
        closed: Contacts,
    ) -> Result<i16, Lost> {
        let own = &settings.modules.terminals;
        let preset = if own.presets { closed.preset() } else { 0 };
        if preset > 0 || own.reference == Reference::Off {
            self.lost = 0;
            return Ok([0, own.preset_1_rpm, own.preset_2_rpm, own.preset_3_rpm][preset] as i16);
        }
        let share = reference::share(own.reference, &settings.board.terminals, port.codes());
        self.lost = if share.is_ok() { 0 } else { self.lost.saturating_add(1) };
        match share {
            // The range of the setting is within the type.
            Ok(share) => Ok(libm::roundf(share * f32::from(own.reference_rpm)) as i16),
            Err(_) if self.lost < reference::LOOKS => Ok(self.given.unwrap_or(0).abs()),
            Err(lost) => Err(lost),
        }
    }
}

/// Latches that the reference was lost, and announces it.
fn lose_reference(desk: &mut Desk, why: Lost) {
    desk.modules.lost = Some(why);
    desk.note_refusal(Commander::Terminals, Refusal::Reference(why.text()));
}

/// RUN, FAULT and BRAKE for a report of the drive.
fn outputs(desk: &Desk, status: Option<&Status>) -> [bool; 3] {
    let settings = desk.settings().in_force();
    let own = &settings.modules.terminals;
    let Some(Status { state, telemetry, .. }) = status else { return [false, own.outputs, false] };
    let pole_pairs = f32::from(settings.drive.motor.pole_pairs);
    let rpm = telemetry.rotor_freq * (60.0 / PERIOD_S) / pole_pairs;
    let turns = *state == State::Braking && rpm.abs() > BRAKE_RPM;
    let fault = state.fault().is_some() || desk.modules.lost.is_some();
    [
        own.outputs && !state.is_off(),
        own.outputs && fault,
        own.brake && (state.regulates() || turns),
    ]
}
