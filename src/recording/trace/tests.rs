use drive_core::{Dq, Fault, Limiting, Sample, State, Telemetry};
use drive_settings::{CurrentSensors, Settings};

use super::*;
use crate::generated;

fn plan(records: u16, divider: u16, trigger: Trigger) -> Plan {
    Plan { records, divider, choice: SignalChoice::usual(), trigger }
}

const RUNNING: Sampled = Sampled { currents: [13, 14, 15], heat_sink: 17, state: 2, limit: 3 };
const FAILED: Sampled = Sampled { state: 101, ..RUNNING };

fn at(turns: f32) -> Telemetry {
    Telemetry { turns, ..Telemetry::default() }
}

/// Number relative to the trigger, and turns, of all records.
fn all<const N: usize>(reader: &Reader<'_, N>) -> Vec<(i16, f32)> {
    (0..).map_while(|i| reader.get(i)).map(|(n, record)| (n, record[7])).collect()
}

#[test]
fn records_every_nth_period_and_gives_them_back_when_done() {
    let trace = Trace::<4>::new();
    let (mut recorder, mut reader) = trace.take().unwrap();
    assert_eq!(reader.get(0), None);
    assert!(reader.begin(&plan(3, 2, Trigger::Now)));
    assert!(!reader.begin(&plan(1, 1, Trigger::Now)));
    for period in 0..5 {
        assert!(reader.recording());
        assert_eq!(reader.get(0), None);
        recorder.step(&RUNNING, &at(period as f32));
    }
    recorder.step(&RUNNING, &Telemetry::default());
    assert_eq!(all(&reader), [(0, 0.0), (1, 2.0), (2, 4.0)]);
}

#[test]
fn asks_for_no_more_than_there_is_room() {
    let trace = Trace::<4>::new();
    let (mut recorder, mut reader) = trace.take().unwrap();
    assert!(reader.begin(&plan(100, 1, Trigger::Now)));
    for _ in 0..4 {
        recorder.step(&RUNNING, &Telemetry::default());
    }
    assert!(!reader.recording());
    assert!(reader.get(3).is_some() && reader.get(4).is_none());
}

#[test]
fn a_trace_of_a_fault_ends_with_it() {
    let trace = Trace::<8>::new();
    let (mut recorder, mut reader) = trace.take().unwrap();
    assert!(reader.begin(&plan(4, 2, Trigger::Fault)));
    for period in 0..10 {
        recorder.step(&RUNNING, &at(period as f32));
    }
    assert!(reader.recording());
    // The fault comes in a period that would not be due.
    recorder.step(&RUNNING, &at(10.0));
    recorder.step(&FAILED, &at(11.0));
    assert_eq!(all(&reader), [(-3, 6.0), (-2, 8.0), (-1, 10.0), (0, 11.0)]);
    // The fault comes before the ring is full.
    assert!(reader.begin(&plan(4, 1, Trigger::Fault)));
    recorder.step(&RUNNING, &at(1.0));
    recorder.step(&FAILED, &at(2.0));
    assert_eq!(all(&reader), [(-1, 1.0), (0, 2.0)]);
}

#[test]
fn a_level_keeps_a_quarter_from_before_it() {
    let trace = Trace::<8>::new();
    let (mut recorder, mut reader) = trace.take().unwrap();
    let signal = find("turns").unwrap();
    let record = |recorder: &mut Recorder<'_, 8>, reader: &mut Reader<'_, 8>, above, from: i32| {
        assert!(reader.begin(&plan(8, 1, Trigger::Level { signal, level: 19.5, above })));
        for n in from.. {
            if !reader.recording() {
                break;
            }
            let turns = if above { n } else { 40 - n };
            recorder.step(&RUNNING, &at(turns as f32));
        }
        all(reader)
    };
    let rising: Vec<(i16, f32)> = (-2..6).map(|n| (n, 20.0 + f32::from(n))).collect();
    assert_eq!(record(&mut recorder, &mut reader, true, 0), rising);
    // There are fewer records before it if it comes early.
    let early: Vec<(i16, f32)> = (-1..7).map(|n| (n, 20.0 + f32::from(n))).collect();
    assert_eq!(record(&mut recorder, &mut reader, true, 19), early);
    let falling: Vec<(i16, f32)> = (-2..6).map(|n| (n, 19.0 - f32::from(n))).collect();
    assert_eq!(record(&mut recorder, &mut reader, false, 0), falling);
}

#[test]
fn a_trace_that_waits_for_its_trigger_can_be_ended() {
    let trace = Trace::<4>::new();
    let (mut recorder, mut reader) = trace.take().unwrap();
    assert!(reader.begin(&plan(4, 1, Trigger::Fault)));
    recorder.step(&RUNNING, &Telemetry::default());
    reader.cancel();
    recorder.step(&FAILED, &Telemetry::default());
    assert!(!reader.recording() && reader.get(0).is_none());
    assert!(reader.begin(&plan(1, 1, Trigger::Now)));
}

/// Every signal is recorded under its own name.
#[test]
fn signals_are_recorded_as_they_were_chosen() {
    let telemetry = Telemetry {
        phi: drive_core::Angle::QUARTER,
        flux_freq: 1.0,
        rotor_freq: 2.0,
        reference: drive_core::Dq::new(3.0, 4.0),
        current: drive_core::Dq::new(5.0, 6.0),
        voltage: drive_core::Dq::new(7.0, 8.0),
        delta_i: 9.0,
        saliency: 10.0,
        dc_link: 11.0,
        turns: 12.0,
        ..Telemetry::default()
    };
    // Torque is recorded as the product of the currents.
    let expected = [
        ("phi_deg", 90.0),
        ("flux_hz", 1.0),
        ("speed_rpm", 2.0),
        ("i_d_ref_a", 3.0),
        ("i_q_ref_a", 4.0),
        ("i_d_a", 5.0),
        ("i_q_a", 6.0),
        ("v_d_v", 7.0),
        ("v_q_v", 8.0),
        ("delta_i_a", 9.0),
        ("saliency", 10.0),
        ("dc_link_v", 11.0),
        ("turns", 12.0),
        ("i_a_a", 13.0),
        ("i_b_a", 14.0),
        ("i_c_a", 15.0),
        ("torque_nm", 30.0),
        ("heat_sink_c", 17.0),
        ("state", 2.0),
        ("limit", 3.0),
    ];
    let names = SIGNALS.iter().map(|signal| signal.name);
    assert!(names.eq(expected.iter().map(|(name, _)| *name)));
    let record = |name: &str, sampled: &Sampled| {
        let mut choice = SignalChoice::none();
        assert!(choice.add(find(name).unwrap()) && choice.add(find("turns").unwrap()));
        let names: Vec<&str> = choice.signals().map(|signal| signal.name).collect();
        assert_eq!(names, [name, "turns"]);
        let mut record = Record::default();
        choice.record(&mut record, &values(&telemetry, sampled));
        assert_eq!(record[1], 12.0);
        record[0]
    };
    for (name, value) in expected {
        assert_eq!(record(name, &RUNNING), value, "{name}");
    }
    let mut full = SignalChoice::usual();
    assert!(!full.add(0) && find("speed").is_none() && find("").is_none());
}

/// The numbers of state and limit, which programs rely on.
#[test]
fn state_and_limit_are_numbers() {
    let read =
        Sample { current_a: 13, current_b: 14, current_c: 15, heat_sink: 17, ..Sample::default() };
    let sampled = |state, limiting| Sampled::new(&read, state, limiting);
    assert_eq!(sampled(State::Torque, Limiting::Motor), RUNNING);
    let failed = State::Fault(Fault::OverCurrentA);
    for (state, number) in
        [(State::Off, 0), (State::Magnetising, 1), (State::Braking, 3), (failed, 101)]
    {
        assert_eq!(sampled(state, Limiting::None).state, number, "{state}");
    }
    for (limiting, number) in [
        (Limiting::None, 0),
        (Limiting::Voltage, 1),
        (Limiting::HeatSink, 2),
        (Limiting::Motor, 3),
        (Limiting::Inverter, 4),
        (Limiting::DcLinkHigh, 5),
        (Limiting::ResistorHot, 6),
        (Limiting::DcLinkLow, 7),
        (Limiting::RideThrough, 8),
        (Limiting::Power, 9),
    ] {
        assert_eq!(sampled(State::Torque, limiting).limit, number, "{limiting}");
    }
}

/// 1/4 revolution per second of a four-pole shaft is 1/2 electrical turn per second, 15 rpm.
#[test]
fn speeds_are_shown_in_the_unit_of_their_name() {
    let settings = Settings::default();
    assert_eq!(settings.motor.pole_pairs, 2);
    let factor = |name: &str| SIGNALS[usize::from(find(name).unwrap())].shown(1.0, &settings);
    let per_period = 0.5 * drive_core::io::PERIOD_S;
    assert!((factor("speed_rpm") * per_period - 15.0).abs() < 1e-4);
    assert!((factor("flux_hz") * per_period - 0.5).abs() < 1e-6);
    assert_eq!(factor("i_q_a"), 1.0);
    // 1 A^2 of the currents is the torque of 1 A at 1 A.
    assert_eq!(factor("torque_nm"), settings.motor.torque_per_ampere(1.0));
}

/// ADC counts of a sensor are shown by the calibration of that sensor, also while the drive is off.
#[test]
fn sensors_are_shown_in_amperes() {
    let mut settings = Settings::default();
    let shown = |name: &str, settings: &Settings| {
        SIGNALS[usize::from(find(name).unwrap())].shown(2500.0, settings)
    };
    let scales = settings.scales;
    assert_eq!(shown("i_a_a", &settings), scales.current_a.at(2500));
    assert_eq!(shown("i_b_a", &settings), scales.current_b.at(2500));
    assert_eq!(shown("i_c_a", &settings), 0.0);
    assert_eq!(shown("heat_sink_c", &settings), scales.ntc.celsius(2500));
    settings.scales.sensors = CurrentSensors::LowSide;
    settings.scales.current_c.gain *= 2.0;
    assert_eq!(shown("i_c_a", &settings), settings.scales.current_c.at(2500));
}

/// Meanings of the signals, for the page.
const MEANINGS: [(&str, &str); 20] = [
    ("phi_deg", "estimated flux angle, electrical degrees"),
    ("flux_hz", "frequency of the flux, electrical"),
    ("speed_rpm", "speed of the shaft, mechanical"),
    ("i_d_ref_a", "filtered reference of the d-axis current"),
    ("i_q_ref_a", "filtered reference of the q-axis current"),
    ("i_d_a", "filtered d-axis current in the estimated flux frame"),
    ("i_q_a", "filtered q-axis current in the estimated flux frame"),
    ("v_d_v", "d-axis voltage without the injection"),
    ("v_q_v", "q-axis voltage without the injection"),
    ("delta_i_a", "current difference of the demodulators that the dissertation prints"),
    ("saliency", "`q` of the synchronous demodulation"),
    ("dc_link_v", "voltage of the dc link"),
    ("turns", "mechanical turns from the start"),
    (
        "i_a_a",
        "current of sensor a, by its scale in the settings (the offset that a start measures is not subtracted); also while off",
    ),
    ("i_b_a", "the same for sensor b"),
    ("i_c_a", "the same for sensor c; 0 without a third sensor"),
    ("torque_nm", "3/2 P L_m²/L_r i_d i_q, with the motor of the settings in force"),
    ("heat_sink_c", "temperature of the heat sink; also while off. It triggers no trace"),
    ("state", "0 off, 1 starting, 2 running, 3 stopping, 100 + N in fault N"),
    (
        "limit",
        "why the torque is smaller than asked for: 0 it is not, 1 voltage of the dc link at this speed, 2 hot heat sink, 3 motor, \
         4 inverter at its thermal limit, 5 dc link high, 6 the same with a hot brake resistor, 7 dc link low, 8 the shaft feeds the \
         dc link, 9 dc current or power at its limit",
    ),
];

#[test]
fn the_manual_lists_the_signals() {
    let mut table = "| number | signal | meaning |\n|---|---|---|\n".to_owned();
    assert_eq!(SIGNALS.len(), MEANINGS.len());
    for (signal, (name, meaning)) in SIGNALS.iter().zip(MEANINGS) {
        assert_eq!(signal.name, name);
        table += &format!("| {} | `{name}` | {meaning} |\n", signal.id);
    }
    generated::check("console.md", "signals", &table);
}

/// A drive that is off shows neither current nor voltage nor torque, and shows the given speed; a drive that runs shows all signals.
#[test]
fn a_drive_that_is_off_shows_no_current() {
    let d_q = Dq::new(1.0, 1.0);
    let running = Telemetry {
        flux_freq: 1.0,
        rotor_freq: 1.0,
        reference: d_q,
        current: d_q,
        voltage: d_q,
        delta_i: 1.0,
        ..Telemetry::default()
    };
    for (state, off) in [(0, true), (1, false), (2, false), (3, false), (signals::FAULT + 1, true)]
    {
        let sampled = Sampled { state, ..Sampled::default() };
        for (signal, value) in SIGNALS.iter().zip(shown(&running, &sampled, 7.0)) {
            let expected = match signal.name {
                "speed_rpm" => [1.0, 7.0],
                "flux_hz" | "i_d_ref_a" | "i_q_ref_a" | "i_d_a" | "i_q_a" => [1.0, 0.0],
                "v_d_v" | "v_q_v" | "delta_i_a" | "torque_nm" => [1.0, 0.0],
                _ => continue,
            };
            assert_eq!(value, expected[usize::from(off)], "{} {state}", signal.name);
        }
    }
}
