//! The terminal strip: wires to a panel or a PLC as an interface of the command arbiter, beside console and field bus.
//!
//! Data flow: [`Port`] reads the pins. [`Debounce`] turns them into [`Wires`], once a millisecond. [`Desk::interlock`] says whether they
//! let the drive run. The [`Sequence`] turns START into starts and stops. A [reference](mod@reference) gives a speed. Nothing here waits.

pub mod debounce;
pub mod reference;
pub mod sequence;
#[cfg(test)]
mod tests;

use drive_core::io::PERIOD_S;
use drive_core::{Mode, State, Stop};

use crate::desk::Desk;
use crate::desk::handle::DriveHandle;
use crate::desk::order::Order;
use crate::link::Status;
use crate::settings::FirmwareSettings;
use crate::settings::bus::Commander;
use crate::settings::strip::Reference;
use crate::terminals::{ANALOG, Lost, Wires};
use debounce::Debounce;
use sequence::{Act, Seen, Sequence};

/// The pins of the strip. Without a pin a contact counts as open.
pub trait Port {
    /// The contacts that are closed now. Called once a millisecond; each call converts another analog input.
    fn look(&mut self) -> Wires;
    /// The last ADC counts of reference, second reference, and the sensor in the motor's winding; `None` if the board has no such input,
    /// or its ADC gives no result.
    fn codes(&self) -> [Option<u16>; ANALOG];
    /// Sets the outputs RUN, FAULT and BRAKE.
    fn show(&mut self, outputs: [bool; 3]);
}

/// Speed at and below which the brake closes during a stop by ramp, rpm.
pub const BRAKE_RPM: f32 = 30.0;
/// Time between two set-points to the drive, ms: each costs the main loop up to two.
const REFERENCE_MS: u32 = 8;

/// The terminal strip, see the head of the module.
#[derive(Default)]
pub struct Strip {
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
}

impl Strip {
    /// Reads the wires, once a millisecond, and makes the requests that they stand for. `now_ms` wraps.
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
        (desk.wires, desk.contacts) = (closed, contacts);
        desk.note_activity(Commander::Strip, now_ms);
        let settings = desk.settings().in_force();
        let (own, speed) = (settings.strip, self.speed(settings, port, closed));
        let state = status.map_or(State::Off, |status| status.state);
        let (off, hold) = (drive.is_off(), desk.interlock());
        let commands = desk.commander() == Commander::Strip;
        // The arbiter shows a refusal at the console.
        let mut give = |desk: &mut Desk, order| drop(desk.order(Commander::Strip, order, drive));
        let reset = core::mem::replace(&mut self.reset_open, !closed.has(Wires::RESET));
        if commands && own.reset && reset && closed.has(Wires::RESET) {
            give(desk, Order::Clear);
        }
        let stopping = state.is_stopping();
        let harder =
            hold == Some(Stop::Now) || (hold == Some(Stop::Coast) && state != State::Stopping);
        if let Some(stop) = hold
            && !off
            && (harder || !stopping)
        {
            give(desk, Order::Stop(stop));
        }
        let (held, busy) = (hold.is_some(), desk.is_busy());
        let seen = Seen { commands, held, busy, ended: off || stopping, off };
        let [contact, start] = [contacts, closed].map(|wires| wires.has(Wires::START));
        match (self.sequence.step(own.start, contact, start, seen), speed) {
            (Act::Stop, _) => give(desk, Order::Stop(Stop::Ramp)),
            (Act::Start, speed) => match desk.lost.or(speed.err()) {
                Some(lost) => desk.lose_reference(lost),
                None => {
                    self.reverse = own.reverse && closed.has(Wires::REVERSE);
                    self.given = None;
                    give(desk, Order::Start(Mode::Speed));
                }
            },
            (Act::Go, Err(lost)) => {
                desk.lose_reference(lost);
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
        closed: Wires,
    ) -> Result<i16, Lost> {
        let own = &settings.strip;
        let preset = if own.presets { closed.preset() } else { 0 };
        if preset > 0 || own.reference == Reference::Off {
            self.lost = 0;
            return Ok([0, own.preset_1_rpm, own.preset_2_rpm, own.preset_3_rpm][preset] as i16);
        }
        let share = reference::share(own.reference, &settings.board.strip, port.codes());
        self.lost = if share.is_ok() { 0 } else { self.lost.saturating_add(1) };
        match share {
            // The range of the setting is within the type.
            Ok(share) => Ok(libm::roundf(share * f32::from(own.reference_rpm)) as i16),
            Err(_) if self.lost < reference::LOOKS => Ok(self.given.unwrap_or(0).abs()),
            Err(lost) => Err(lost),
        }
    }
}

/// RUN, FAULT and BRAKE for a report of the drive.
fn outputs(desk: &Desk, status: Option<&Status>) -> [bool; 3] {
    let settings = desk.settings().in_force();
    let own = &settings.strip;
    let Some(Status { state, telemetry, .. }) = status else { return [false, own.outputs, false] };
    let pole_pairs = f32::from(settings.drive.motor.pole_pairs);
    let rpm = telemetry.rotor_freq * (60.0 / PERIOD_S) / pole_pairs;
    let turns = *state == State::Braking && rpm.abs() > BRAKE_RPM;
    let fault = state.fault().is_some() || desk.lost.is_some();
    [
        own.outputs && !state.is_off(),
        own.outputs && fault,
        own.brake && (state.regulates() || turns),
    ]
}
