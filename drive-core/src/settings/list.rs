//! The table of the settings: name, unit, range, help, who may change it, whether learned values depend on it, and whether
//! the power stage is at stake.
//!
//! Console, saved record, checks, keys of the simulator and documentation come from this table. To add a setting, add a
//! field with its default to the structure it belongs to, and a row here.

use super::entry::{Access, Change, Entry, auto, number, whole, word};
use super::value::Words;
use super::{AngleSource, CurrentSensors, Flux, Line, PlantSource, Settings};
use crate::carrier::DemodulatorKind;
use crate::carrier::demodulator::{MAX_RMS_SAMPLES, MIN_RMS_SAMPLES};
use crate::io::PERIOD_S;

/// The settings of the drive, in the order in which they are shown.
#[rustfmt::skip] // a row a setting
pub static SETTINGS: &[Entry<Settings>] = &[
    number!("motor.r_s", motor.r_s, "ohm", "stator resistance of a phase").from_to(0.001, 1000.0).learned(),
    number!("motor.r_r", motor.r_r, "ohm", "rotor resistance, referred to the stator").from_to(0.001, 1000.0).learned(),
    number!("motor.l_ls", motor.l_ls, "H", "leakage inductance of the stator").from_to(1e-6, 10.0).learned(),
    number!("motor.l_lr", motor.l_lr, "H", "leakage inductance of the rotor, referred to the stator").from_to(1e-6, 10.0).learned(),
    number!("motor.l_m", motor.l_m, "H", "magnetising inductance").from_to(1e-5, 100.0).learned(),
    whole!("motor.pole_pairs", motor.pole_pairs: u8, "pairs of poles").from_to(1.0, 50.0).learned(),
    number!("motor.inertia", motor.inertia, "kg m2", "inertia of rotor and load; for the speed loop").from_to(1e-7, 1000.0),

    number!("nameplate.power_w", nameplate.power_w, "W", "rated power at the shaft").from_to(1.0, 1e6),
    number!("nameplate.voltage_v", nameplate.voltage_v, "V", "rated voltage between lines, rms").from_to(5.0, 1000.0),
    number!("nameplate.current_a", nameplate.current_a, "A", "rated current of a line, rms; the rules take their currents from it").from_to(0.01, 1000.0),
    number!("nameplate.frequency_hz", nameplate.frequency_hz, "Hz", "rated frequency").from_to(5.0, 400.0),
    number!("nameplate.speed_rpm", nameplate.speed_rpm, "rpm", "rated speed of the shaft").from_to(1.0, 24_000.0),

    whole!("inverter.top", inverter.top: u16, "count at which the timer turns round").from_to(1000.0, 65_534.0).changed(Change::Board).learned(),
    number!("inverter.dead_time_s", inverter.dead_time_s, "s", "time with both switches of a leg off, at every change").from_to(0.0, 6e-6).changed(Change::FromReset).learned().hardware(),
    word!("inverter.compensate", inverter.compensate: bool, "whether the dead time is compensated").learned(),
    auto!("inverter.full_compensation_a", inverter.full_compensation_a, Settings::full_compensation_a, "A", "phase current from which on the compensation is full").from_to(1e-4, 100.0).learned(),
    auto!("inverter.drop_v", inverter.drop_v, |s| s.inverter.drop_v.unwrap_or(0.0), "V", "voltage per phase that is lost beyond the dead time, as the commissioning found it; auto: measured at every start").from_to(-50.0, 50.0).learned(),

    number!("scales.current_a.gain", scales.current_a.gain, "A", "current a per code; negative if a current into the motor lowers the code").beside(|s| either_sign(s.scales.current_a.gain, 1e-6, 1.0)).learned().hardware(),
    number!("scales.current_a.offset", scales.current_a.offset, "A", "current a at code 0").beside(|s| offset_range(s, s.scales.current_a)).learned().hardware(),
    number!("scales.current_b.gain", scales.current_b.gain, "A", "current b per code").beside(|s| either_sign(s.scales.current_b.gain, 1e-6, 1.0)).learned().hardware(),
    number!("scales.current_b.offset", scales.current_b.offset, "A", "current b at code 0").beside(|s| offset_range(s, s.scales.current_b)).learned().hardware(),
    number!("scales.current_c.gain", scales.current_c.gain, "A", "current c per code; with three shunts").beside(|s| either_sign(s.scales.current_c.gain, 1e-6, 1.0)).learned().hardware(),
    number!("scales.current_c.offset", scales.current_c.offset, "A", "current c at code 0").beside(|s| if s.scales.sensors == CurrentSensors::InLine { (-1000.0, 1000.0) } else { offset_range(s, s.scales.current_c) }).learned().hardware(),
    word!("scales.sensors", scales.sensors: CurrentSensors, "sensors of the currents: two in the lines a and b, or three shunts below the low sides").changed(Change::Board).learned(),
    number!("scales.shunt_settle_s", scales.shunt_settle_s, "s", "time from the turn-on of a low side until its shunt can be sampled").from_to(0.0, 20e-6).changed(Change::Board).learned(),
    number!("scales.dc_link.gain", scales.dc_link.gain, "V", "dc link per code").from_to(1e-4, 10.0).learned().hardware(),
    number!("scales.dc_link.offset", scales.dc_link.offset, "V", "dc link at code 0").from_to(-100.0, 100.0).learned().hardware(),
    whole!("scales.dc_link.highest", scales.dc_link_highest: u16, "code of the highest dc link that the power stage stands in operation").from_to(100.0, 4095.0).changed(Change::Board),
    // Behind its sensor, which its range depends on.
    number!("inverter.dc_link_v", inverter.dc_link_v, "V", "nominal voltage of the dc link").beside(|s| (10.0, s.dc_link_max_v())),
    whole!("scales.full_scale", scales.full_scale: u16, "largest code of the currents").from_to(100.0, 65_535.0).changed(Change::Board),
    number!("scales.current_delay_s", scales.current_delay_s, "s", "delay of the analog filters of the currents").from_to(0.0, 5.0 * PERIOD_S).learned(),
    whole!("scales.encoder_counts", scales.encoder_counts: u32, "counts of the encoder a turn, four a line").from_to(16.0, 1e7),
    number!("scales.ntc.ohm_25", scales.ntc.ohm_25, "ohm", "thermistor of the heat sink at 25 degC").from_to(10.0, 1e6).hardware(),
    number!("scales.ntc.beta_k", scales.ntc.beta_k, "K", "its B constant").from_to(1000.0, 10_000.0).hardware(),
    number!("scales.ntc.divider_ohm", scales.ntc.divider_ohm, "ohm", "resistor in series with it").from_to(10.0, 1e6).hardware(),
    word!("scales.ntc.to_ground", scales.ntc.to_ground: bool, "whether the thermistor is the one at ground").hardware(),

    word!("angle_source", angle_source: AngleSource, "source of the flux angle"),
    word!("current_plant", current_plant.source: PlantSource, "plant that the current controllers are designed for"),
    auto!("current_plant.d.k", current_plant.d.k, |s| s.identified_d().k as f32, "A/V", "identified plant k/(z - p) of the direct axis").from_to(1e-6, 10.0),
    auto!("current_plant.d.p", current_plant.d.p, |s| s.identified_d().p as f32, "", "its pole").from_to(0.0, 0.999_99),
    auto!("current_plant.q.k", current_plant.q.k, |s| s.identified_q().k as f32, "A/V", "identified plant k/(z - p) of the quadrature axis").from_to(1e-6, 10.0),
    auto!("current_plant.q.p", current_plant.q.p, |s| s.identified_q().p as f32, "", "its pole").from_to(0.0, 0.999_99),
    word!("ignore_delays", ignore_delays: bool, "whether known delays are left uncompensated, as in the dissertation").learned(),
    word!("track_rotor", track_rotor: bool, "whether the rotor time constant is tracked while running"),

    auto!("injection.amplitude_v", injection.amplitude_v, Settings::carrier_v, "V", "peak of the injected voltage; 0 for none").beside(carrier_range).learned(),
    word!("injection.demodulator", injection.demodulator: DemodulatorKind, "demodulation of the carrier current").learned(),
    number!("injection.reference_a", injection.printed.reference_a, "A", "reference of the current difference; not synchronous").from_to(-1.0, 1.0).learned(),
    auto!("injection.full_reference_iq_a", injection.printed.full_reference_iq_a, Settings::full_reference_iq_a, "A", "torque current from which on that reference is full").from_to(0.01, 1000.0).learned(),
    number!("injection.k_s", injection.printed.k_s, "rad/A", "gain of the tracker (Eq. 3.44); not synchronous").from_to(0.0, 100.0),
    number!("injection.z_s", injection.printed.z_s, "", "its zero").from_to(0.0, 1.0),
    whole!("injection.rms_samples", injection.printed.rms_samples: u8, "length of the filters of rms-impedance").from_to(MIN_RMS_SAMPLES as f32, MAX_RMS_SAMPLES as f32).learned(),
    number!("injection.bandwidth_hz", injection.synchronous.bandwidth_hz, "Hz", "natural frequency of the tracking loop").from_to(0.1, 30.0),
    // Near zero the loop would have no gain.
    number!("injection.flux_saliency", injection.synchronous.flux_saliency, "", "saliency fixed to the flux, until its slope is learned").beside(|s| either_sign(s.injection.synchronous.flux_saliency, 0.001, 0.3)),
    word!("injection.allow_unlearned", injection.synchronous.allow_unlearned: bool, "whether a drive that has not learned starts without an encoder"),
    auto!("injection.current_saliency", injection.synchronous.current_saliency, Settings::current_saliency, "1/A", "saliency per ampere of stator current").from_to(-30.0, 30.0).learned(),
    word!("injection.check", injection.synchronous.check: bool, "whether a start checks the saliency of the motor"),
    word!("injection.monitor", injection.synchronous.monitor: bool, "whether the lock is verified and watched"),
    number!("injection.allowed_loss", injection.synchronous.allowed_loss, "", "share of the flux-fixed saliency that may be missing").from_to(0.3, 0.9),
    number!("injection.loss_s", injection.synchronous.loss_s, "s", "time constant of the mean of that share").from_to(0.01, 1.0),
    auto!("injection.tracked_rpm", injection.synchronous.tracked_rpm, Settings::tracked_rpm, "rpm", "speed that trips without an encoder").from_to(1.0, 20_000.0),
    word!("injection.beside_encoder", injection.beside_encoder: bool, "whether the carrier is injected beside an encoder"),

    word!("observer.enabled", observer.enabled: bool, "whether the voltage of the motor gives the angle at speed, where the injection ends"),
    number!("observer.leakage_share", observer.leakage_share, "", "leakage inductance of the fundamental wave at no current, as a share of that of motor.*").from_to(0.5, 2.0),
    number!("observer.leakage_slope", observer.leakage_slope, "1/A", "change of that share per ampere of stator current, peak").from_to(-1.0, 1.0),

    // A trip level beyond the sensors' range would never be reached.
    auto!("limits.trip_a", limits.trip_a, Settings::trip_a, "A", "phase current that trips").beside(|s| (0.05, s.sensor_range_a())).hardware(),
    auto!("limits.current_a", limits.current_a, Settings::current_limit_a, "A", "largest current that is regulated, peak").beside(|s| (0.01, s.trip_a())),
    // Both leave room for the voltages without torque, which follow from them or are set.
    auto!("limits.dc_over_v", limits.dc_over_v, Settings::dc_over_v, "V", "dc link above which the drive trips").beside(|s| ((1.0 + MARGIN) / s.braking.high_v.map_or(Settings::HIGH_OF_TRIP, |_| 1.0) * s.inverter.dc_link_v, s.dc_over_max_v())).hardware(),
    auto!("limits.dc_under_v", limits.dc_under_v, Settings::dc_under_v, "V", "dc link below which it trips while the outputs are on").beside(|s| (5.0, f32::min((1.0 - MARGIN) / s.braking.low_v.map_or(Settings::LOW_OF_TRIP, |_| 1.0 + MARGIN) * s.inverter.dc_link_v, s.dc_over_v()))),
    auto!("limits.speed_rpm", limits.speed_rpm, Settings::speed_trip_rpm, "rpm", "speed of the shaft that trips").from_to(1.0, 20_000.0),
    auto!("limits.unexplained_v", limits.unexplained_v, Settings::unexplained_v, "V", "largest voltage that the motor model does not explain at standstill").from_to(0.01, 1000.0),
    auto!("limits.motor_a", limits.motor_a, Settings::motor_a, "A", "current that the motor carries for any time at standstill, peak").beside(|s| (0.01, 3.0 * s.rated_a())),
    number!("limits.motor_s", limits.motor_s, "s", "thermal time constant of its windings").from_to(1.0, 10_000.0),
    auto!("limits.inverter_a", limits.inverter_a, Settings::inverter_a, "A", "current that the inverter carries for any time, peak").beside(|s| (0.01, s.trip_a())),
    number!("limits.inverter_s", limits.inverter_s, "s", "thermal time constant of its switches to the heat sink").from_to(0.1, 1000.0),
    number!("limits.heat_sink_c", limits.heat_sink_c, "degC", "temperature of the heat sink that trips").from_to(0.0, 150.0).hardware(),
    auto!("limits.derate_c", limits.derate_c, Settings::derate_c, "degC", "temperature of the heat sink from which on the current limit falls, to nothing where it trips").beside(|s| (-40.0, s.limits.heat_sink_c)),

    number!("sequence.calibrate_s", sequence.calibrate_s, "s", "time of the offset calibration").from_to(0.001, 10.0),
    number!("sequence.precharge_s", sequence.precharge_s, "s", "time with the low sides on").from_to(0.0, 10.0),
    auto!("sequence.magnetise_s", sequence.magnetise_s, Settings::magnetise_s, "s", "time with direct current alone").beside(magnetise_range),
    word!("sequence.flux", sequence.flux: Flux, "flux that the rule for the direct current aims at: low as in the dissertation, or high").learned(),
    auto!("sequence.i_d", sequence.i_d, Settings::i_d, "A", "direct (magnetising) current, peak").beside(|s| (0.01, s.current_limit_a())).learned(),
    auto!("sequence.stop_a_per_s", sequence.stop_a_per_s, Settings::stop_a_per_s, "A/s", "slope of the torque current at a stop").from_to(0.1, 1e5),
    word!("sequence.catch", sequence.catch: bool, "whether a start with the observer looks for a turning shaft first"),

    auto!("speed.i_q_limit_a", speed.i_q_limit_a, Settings::i_q_limit_a, "A", "largest torque current of speed and position mode").beside(|s| (0.01, s.current_limit_a())),
    auto!("speed.limit_rpm", speed.limit_rpm, Settings::speed_limit_rpm, "rpm", "largest speed that is asked for").beside(|s| (1.0, s.speed_trip_rpm())),
    auto!("speed.ramp_rpm_per_s", speed.ramp_rpm_per_s, Settings::ramp_rpm_per_s, "rpm/s", "largest acceleration that is asked for").from_to(1.0, 1e5),
    auto!("speed.quick_rpm_per_s", speed.quick_rpm_per_s, Settings::quick_rpm_per_s, "rpm/s", "deceleration of a quick stop").beside(|s| (s.ramp_rpm_per_s(), 3e5)),
    number!("speed.s_ramp_s", speed.s_ramp_s, "s", "time in which the acceleration comes to its full value, in speed mode and in a stop by the ramp; 0 for at once").from_to(0.0, 10.0),
    // Below 45 degrees the position loop, with some 12 less, rings; the zero allows 76 at most.
    number!("speed.phase_margin_deg", speed.phase_margin_deg, "deg", "phase margin of the speed loop: more is calmer and slower").from_to(45.0, 70.0),

    auto!("braking.high_v", braking.high_v, Settings::dc_high_v, "V", "dc link without generating torque").beside(|s| (s.inverter.dc_link_v + MARGIN * s.inverter.dc_link_v, f32::min(s.dc_over_v(), s.highest_dc_link_v()))),
    auto!("braking.low_v", braking.low_v, Settings::dc_low_v, "V", "dc link without motoring torque, below which the shaft feeds it").beside(|s| (s.dc_under_v() + MARGIN * s.dc_under_v(), s.inverter.dc_link_v - MARGIN * s.inverter.dc_link_v)),
    auto!("braking.flux_a", braking.flux_a, Settings::braking_flux_a, "A", "direct current that is added while generating torque is limited; 0 for none").beside(|s| (0.0, s.current_limit_a())),
    number!("braking.ohm", braking.ohm, "ohm", "brake resistor behind the chopper; 0 for none").from_to(0.0, 1e5),
    number!("braking.energy_j", braking.energy_j, "J", "energy that the brake resistor takes from cold").from_to(1.0, 1e7),
    number!("braking.power_w", braking.power_w, "W", "power that it takes for ever").from_to(0.1, 1e5),

    number!("supply.relay_s", supply.relay_s, "s", "time that the dc link must be steady before the precharge relay closes; 0 without one").from_to(0.0, 60.0),

    auto!("vf.volts_per_hz", vf.volts_per_hz, Settings::volts_per_hz, "V/Hz", "voltage between lines, rms, per frequency, of a motor that nobody has identified").from_to(0.01, 200.0),
    auto!("vf.boost_a", vf.boost_a, Settings::boost_a, "A", "current of this motor at standstill, peak").beside(|s| (0.01, s.current_limit_a())),
    number!("vf.slip_share", vf.slip_share, "", "share of its slip that is compensated").from_to(0.0, 1.5),
];

/// The setting with this name.
pub fn find(name: &str) -> Option<&'static Entry<Settings>> {
    SETTINGS.iter().find(|entry| entry.name == name)
}

/// The range of a value that has either sign, but is not zero.
fn either_sign(value: f32, min: f32, max: f32) -> (f32, f32) {
    if value < 0.0 { (-max, -min) } else { (min, max) }
}

/// Currents of both signs are measured: zero current lies between 5 % and 95 % of the codes.
fn offset_range(s: &Settings, line: Line) -> (f32, f32) {
    let full = line.gain.abs() * f32::from(s.scales.full_scale);
    either_sign(-line.gain, 0.05 * full, 0.95 * full)
}

/// `braking.high_v` and `.low_v` stay this far from their neighbours.
const MARGIN: f32 = 0.05;

/// The lock monitor needs a carrier. Near V_dc / sqrt 3 no room would be left for the fundamental.
fn carrier_range(s: &Settings) -> (f32, f32) {
    (if s.watches_lock() { 0.003 * s.inverter.dc_link_v } else { 0.0 }, 0.55 * s.inverter.dc_link_v)
}

/// The lock monitor measures its baseline during magnetisation; with the saliency check also while the flux is
/// restored.
fn magnetise_range(s: &Settings) -> (f32, f32) {
    let needs_baseline = s.watches_lock() && !s.injection.synchronous.check;
    (if needs_baseline { 0.5 } else { 0.0 }, 60.0)
}
