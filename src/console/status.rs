//! The status line.

use core::f32::consts::TAU;
use core::fmt;

use drive_core::current::VoltageLimit;
use drive_core::io::PERIOD_S;
use drive_core::{Fault, Hardware, Limiting, State};
use drive_settings::value::Value;
use drive_settings::{CurrentSensors, Settings};

use super::Console;
use super::handle::Firmware;
use crate::board::CYCLES_PER_US;
use crate::desk::Desk;
use crate::desk::shaft::Shaft;
use crate::link::Status;
use crate::settings::FirmwareSettings;
use crate::settings::keys::Key;
use crate::settings::staging::guarded;

impl Console {
    /// Answers with the status line.
    pub(super) fn status(&mut self, desk: &Desk, drive: &impl Firmware) {
        let Some(status) = drive.status() else { return self.error(&drive.no_control()) };
        let tracking = drive.tracking().filter(|_| status.state.regulates());
        let (staged, loose) = (desk.settings().count(), looser(desk.settings().in_force()));
        let line = fmt::from_fn(|f| {
            line(f, &status, desk.settings().in_force(), desk.shaft(), drive.stack())?;
            let mut separator = "; looser than by default: ";
            for (_, key) in guarded().enumerate().filter(|(n, _)| loose >> n & 1 == 1) {
                write!(f, "{separator}{} {}", key.name(), key.get(desk.settings().in_force()))?;
                separator = ", ";
            }
            if staged > 0 {
                write!(f, "; {staged} staged")?;
            }
            desk.modules.status(desk.settings().in_force(), f)?;
            let rotor = tracking.and_then(|report| report.estimate.ok()).map(|found| found.tau_r);
            let settings = &desk.settings().in_force().drive;
            temperatures(f, status.stator_resistance, rotor, desk.modules.motor_c(), settings)?;
            tracking.map_or(Ok(()), |report| write!(f, "; {report}"))
        });
        self.out.answer(format_args!("{line}"));
    }
}

/// Writes the status line: `stack` is the most bytes used and the size. Torque by 3/2 P L_m/L_r psi i_q (Eq. 2.7) with psi = L_m i_d;
/// power at the shaft is torque times speed, electrical power 3/2 (v_d i_d + v_q i_q), without the injected voltage.
///
/// # Errors
/// Those of the formatter.
fn line(
    f: &mut fmt::Formatter<'_>,
    s: &Status,
    settings: &FirmwareSettings,
    shaft: &Shaft,
    (used, size): (usize, usize),
) -> fmt::Result {
    let rpm = shaft.rpm(settings);
    let settings = &settings.drive;
    let (t, motor, scales) = (&s.telemetry, &settings.motor, &settings.scales);
    write!(f, "{}; ", s.state)?;
    if s.hardware.contains(Hardware::BREAK) {
        write!(f, "fault input trips; ")?;
    }
    if s.limiting != Limiting::None {
        write!(f, "limiting now, because: {}; ", s.limiting)?;
    }
    // While the drive is off, its signals are those of the last run.
    if !s.state.is_off() {
        let (i, reference) = (t.current, t.reference);
        let rpm = t.rotor_freq * (60.0 / PERIOD_S) / f32::from(motor.pole_pairs);
        let torque = motor.torque_per_ampere(i.d) * i.q;
        let shaft_w = torque * rpm * (TAU / 60.0);
        let electrical_w = 1.5 * (t.voltage.d * i.d + t.voltage.q * i.q);
        write!(f, "i_d {:.2} A, i_q {:.2} of {:.2} A, ", i.d, i.q, reference.q)?;
        write!(f, "torque {torque:.2} Nm, speed {rpm:.1} rpm, position {:.3} turns, ", t.turns)?;
        write!(f, "shaft {shaft_w:.1} W, electrical {electrical_w:.1} W, ")?;
    }
    if s.state.is_off() {
        let assumed = if shaft.is_assumed() { " assumed: nothing measures it" } else { "" };
        write!(f, "speed {rpm:.1} rpm{assumed}, ")?;
        let [a, b] =
            [(scales.current_a, s.sample.current_a), (scales.current_b, s.sample.current_b)]
                .map(|(line, code)| scales.of_code(line).at(code));
        write!(f, "sensors a {a:.2} A, b {b:.2} A, ")?;
        if scales.sensors == CurrentSensors::LowSide {
            write!(f, "c {:.2} A, ", scales.current_c.at(s.sample.current_c))?;
        }
    }
    if s.state == State::Off || s.state.regulates() {
        torque_range(f, s, settings)?;
    }
    // Dc link and heat sink come from the sample: the drive's own values are not updated while it is off.
    let dc_link = scales.dc_link.at(s.sample.dc_link);
    let latency_us = s.worst_latency as f32 / CYCLES_PER_US as f32;
    write!(f, "dc link {dc_link:.1} V, ")?;
    write!(f, "heat sink {:.0} degC; ", scales.ntc.celsius(s.sample.heat_sink))?;
    let [without, with] = s.worst_cycles;
    write!(f, "{} of {without} cycles, {with} with a command, ", s.last_cycles)?;
    write!(f, "latest start {latency_us:.1} us, ")?;
    write!(f, "stack {used} of {size}")
}

/// Protective settings that are looser than by rule and default, one bit each. Not computed in a formatter, because the defaults take
/// much stack.
#[inline(never)]
fn looser(settings: &FirmwareSettings) -> u64 {
    let usual = FirmwareSettings::of(settings.board);
    let by_rule = |key: Key| key.get(settings) == Value::Auto;
    let is_looser = |key: Key| !by_rule(key) && key.is_looser(settings, &usual);
    guarded().enumerate().fold(0, |bits, (n, key)| bits | u64::from(is_looser(key)) << n)
}

/// Writes the torque that the drive can give now, least and largest, with the d-axis current that remains at each. While the drive is
/// off, the values are those at standstill.
fn torque_range(f: &mut fmt::Formatter<'_>, s: &Status, settings: &Settings) -> fmt::Result {
    let (i_d, largest) = (settings.i_d(), settings.current_limit_a());
    let limit = VoltageLimit::new(&settings.motor, i_d, largest);
    let (least, most, voltage) = if s.state.regulates() {
        (s.torque_limits.i_q.0, s.torque_limits.i_q.1, s.torque_limits.voltage)
    } else {
        let most = limit.start().most.q.min(largest - s.torque_limits.thermal_reduction_a);
        (-most, most, 0.0)
    };
    let torque = |i_q: f32| {
        let weakened = limit.direct(voltage, s.telemetry.flux_freq, i_q);
        settings.motor.torque_per_ampere(if voltage > 0.0 { weakened } else { i_d }) * i_q
    };
    let (from, to) = (torque(least), torque(most));
    write!(f, "torque now {from:.2} to {to:.2} Nm ({least:.2} to {most:.2} A), ")
}

/// Temperature of the settings' resistances, °C.
const COLD_C: f32 = 25.0;
/// Temperatures below 0 °C at which the extrapolated resistance of copper, and of a cage's aluminium, is zero.
const COPPER_C: f32 = 235.0;
const ALUMINIUM_C: f32 = 225.0;
/// Difference between sensor and stator above which the status line reports it, K: 15 % of the resistance.
const DOUBTFUL_K: f32 = 40.0;

/// Writes the temperatures of stator and rotor that their tracked resistances mean, if the resistances in the settings are those at 25
/// °C: `R/R_25 = (c + T)/(c + 25)`. `stator` is relative to the settings, less one. After them comes the temperature of the `sensor`, °C,
/// if there is one, and whether both differ.
///
/// # Errors
/// Those of the formatter.
fn temperatures(
    f: &mut fmt::Formatter<'_>,
    stator: Option<f32>,
    tau_r: Option<f32>,
    sensor: Option<Result<f32, Fault>>,
    settings: &Settings,
) -> fmt::Result {
    let celsius = |more: f32, metal: f32| COLD_C + more * (metal + COLD_C);
    let stator = stator.map(|more| celsius(more, COPPER_C));
    if let Some(stator) = stator {
        write!(f, "; stator {stator:.0} degC")?;
    }
    match sensor {
        Some(Ok(motor)) => write!(f, "; motor {motor:.0} degC by its sensor")?,
        Some(Err(fault)) => write!(f, "; {fault}")?,
        None => {}
    }
    if let (Some(stator), Some(Ok(motor))) = (stator, sensor)
        && (stator - motor).abs() > DOUBTFUL_K
    {
        write!(f, ", which the stator resistance does not confirm")?;
    }
    tau_r.map_or(Ok(()), |tau_r| {
        let more = settings.motor.tau_r() / tau_r - 1.0;
        write!(f, "; rotor {:.0} degC", celsius(more, ALUMINIUM_C))
    })
}
