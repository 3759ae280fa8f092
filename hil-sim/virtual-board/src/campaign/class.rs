//! The classes of faults: each with its injection, and the longest time of wrong control with the outputs on.

use rand::{Rng, RngExt};

use super::faults::{current, flip, losing, name, noise, slow_sensor};
use super::scene::{Source, Target};
use crate::board::Board;
use crate::chip::TICKS_PER_S;
use crate::cpu::Register;
use crate::memory::Region;
use hil_sim::plant::EncoderFault;
use induction_drive::board as firmware_board;

/// Injects a fault, and describes it.
pub type Inject = fn(&mut Board, &Target, &mut dyn Rng) -> String;

/// The procedure of a run.
#[derive(Clone, Copy)]
pub enum Run {
    /// A fault is injected while the drive regulates.
    Regulating(Inject),
    /// The power goes in one of the operations of `save`.
    Saving,
    /// A double word of the saved settings is damaged before a start.
    DamagedPage,
    /// The reset pin is pulled: while it regulates, or while it starts.
    Reset,
}

/// A class of faults.
pub struct Class {
    /// Its name.
    pub name: &'static str,
    /// Longest that outputs may be on with wrong control, ms. Infinite: for the angle nothing is promised, and
    /// only the currents are judged.
    pub bound_ms: f64,
    /// The reason for that bound.
    pub why: &'static str,
    /// The angle sources that it is tried with.
    pub sources: &'static [Source],
    /// The procedure of its runs.
    pub run: Run,
}

const BOTH: &[Source] = &[Source::Injection, Source::Encoder];
const ENCODER: &[Source] = &[Source::Encoder];

/// From the first lost count of 5 % of them to the fault: 210 ms measured.
const LOST_COUNTS_MS: f64 = 300.0;

/// A PWM period, and the time in which the software sees a sample and switches off, ms.
const PERIOD_MS: f64 = 1.0 / 6.0;
const STEP_MS: f64 = 2.0 * PERIOD_MS;

/// All classes.
pub const CLASSES: &[Class] = &[
    Class {
        name: "nothing (for comparison)",
        bound_ms: 0.0,
        why: "control is correct throughout",
        sources: BOTH,
        run: Run::Regulating(|_, _, _| String::new()),
    },
    Class {
        name: "current sensor stuck",
        bound_ms: SILENT_MS,
        why: SILENT,
        sources: BOTH,
        run: Run::Regulating(|board, target, rng| {
            let (which, now) = (target.any_current(rng), board.sample());
            let value = *current(which, &mut { now });
            board.disturb = Some(Box::new(move |s| *current(which, s) = value));
            format!("{} at {value}", name(which))
        }),
    },
    Class {
        name: "current sensor open",
        bound_ms: SILENT_MS,
        why: SILENT,
        sources: BOTH,
        run: Run::Regulating(|board, target, rng| {
            let which = target.any_current(rng);
            let line = target.line(which);
            let zero = (-line.offset / line.gain).round() as u16;
            board.disturb = Some(Box::new(move |s| *current(which, s) = zero));
            name(which).into()
        }),
    },
    Class {
        name: "current sensor saturated",
        bound_ms: STEP_MS,
        why: "the sample after it, and the step that sees it",
        sources: BOTH,
        run: Run::Regulating(|board, target, rng| {
            let (which, high) = (target.any_current(rng), rng.random::<bool>());
            let code = if high { firmware_board::ADC_FULL_SCALE } else { 0 };
            board.disturb = Some(Box::new(move |s| *current(which, s) = code));
            format!("{} at {code}", name(which))
        }),
    },
    Class {
        name: "current sensor noisy",
        bound_ms: NOISE_MS,
        why: NOISE,
        sources: BOTH,
        run: Run::Regulating(|board, target, rng| {
            let which = target.any_current(rng);
            // 5 mA to 2 A rms on the dissertation's motor.
            let amperes = target.relative_current * 0.005 * 400_f64.powf(rng.random::<f64>());
            let codes = amperes / f64::from(target.line(which).gain.abs());
            let mut noise = noise(rng, codes);
            board.disturb = Some(Box::new(move |s| noise(current(which, s))));
            format!("{}, {:.1} mA", name(which), 1e3 * amperes)
        }),
    },
    Class {
        name: "dc-link sensor stuck, open, saturated, noisy",
        bound_ms: STEP_MS,
        why: "the sample after it, and the step that sees it",
        sources: BOTH,
        run: Run::Regulating(|board, _, rng| slow_sensor(board, rng, |s| &mut s.dc_link)),
    },
    Class {
        name: "heat-sink sensor stuck, open, saturated, noisy",
        bound_ms: STEP_MS,
        why: "the sample after it, and the step that sees it",
        sources: BOTH,
        run: Run::Regulating(|board, _, rng| slow_sensor(board, rng, |s| &mut s.heat_sink)),
    },
    Class {
        name: "not-a-number in the drive's state",
        bound_ms: 2.0 * CARRIER_MS + STEP_MS,
        why: "quantities that are used once in a carrier period show in the next one",
        sources: BOTH,
        run: Run::Regulating(|board, target, rng| {
            let Region { address: base, size } = target.state;
            // A word that holds a plausible number; angles and counts are another class.
            for _ in 0..1000 {
                let address = base + 4 * rng.random_range(0..size / 4);
                let value = f32::from_bits(board.word(address).unwrap_or(0)).abs();
                if (1e-5..1e5).contains(&value) {
                    board.cpu().write(address, &f32::NAN.to_le_bytes());
                    return format!("word {} of the control's state", (address - base) / 4);
                }
            }
            "no such word".into()
        }),
    },
    Class {
        name: "dc-link step",
        bound_ms: STEP_MS,
        why: "voltage limits: the sample after it, and the step that sees it",
        sources: BOTH,
        run: Run::Regulating(|board, target, rng| {
            // On a dc link of 311 V.
            let volts = target.relative_voltage * rng.random_range(100.0..600.0);
            board.plant.set_dc_link(volts).ok();
            format!("to {volts:.0} V")
        }),
    },
    Class {
        name: "encoder stands still",
        bound_ms: 5.0,
        why: "1.4 degrees of a turn that did not come: 0.8 ms at 300 rpm, 2.4 ms at 100 rpm; and the step",
        sources: ENCODER,
        run: Run::Regulating(|board, _, _| {
            board.plant.set_encoder_fault(EncoderFault::Stuck);
            String::new()
        }),
    },
    Class {
        name: "encoder loses up to 2 % of its counts",
        bound_ms: 0.0,
        why: "as a slip that is wrong by as much: control is correct throughout",
        sources: ENCODER,
        run: Run::Regulating(|board, _, rng| losing(board, rng.random_range(0.0..0.02))),
    },
    Class {
        name: "encoder loses 5 to 90 % of its counts at 900 rpm",
        bound_ms: LOST_COUNTS_MS,
        why: "the back-emf of the flux that is turned away, once it is there: with the rotor time constant",
        sources: &[Source::FastEncoder],
        run: Run::Regulating(|board, _, rng| losing(board, rng.random_range(0.05..0.9))),
    },
    Class {
        name: "encoder loses 2 to 90 % of its counts at 300 rpm",
        bound_ms: f64::INFINITY,
        why: "15 degrees leave 4.7 V unexplained of a back-emf of 6.7 V, a motor 30 % warmer 4.2 V at the right \
              angle: only the currents are judged",
        sources: ENCODER,
        run: Run::Regulating(|board, _, rng| losing(board, rng.random_range(0.02..0.9))),
    },
    Class {
        name: "break pin",
        bound_ms: firmware_board::BREAK_REACTION_NS as f64 * 1e-6,
        why: "the timer's filter; no software",
        sources: BOTH,
        run: Run::Regulating(|board, _, _| {
            board.set_fault_pin(false);
            String::new()
        }),
    },
    Class {
        name: "clock failure",
        bound_ms: 0.01,
        why: "the clock security system; no software",
        sources: BOTH,
        run: Run::Regulating(|board, _, _| {
            board.set_crystal(false);
            String::new()
        }),
    },
    Class {
        name: "bit flip in the coefficients",
        bound_ms: CHECK_MS,
        why: CHECK,
        sources: BOTH,
        run: Run::Regulating(|board, target, rng| flip(board, rng, target.coefficients)),
    },
    Class {
        name: "bit flip in the drive's state",
        bound_ms: LOCK_MS,
        why: LOCK,
        sources: BOTH,
        run: Run::Regulating(|board, target, rng| flip(board, rng, target.state)),
    },
    Class {
        name: "bit flip in the control's code",
        bound_ms: CHECK_MS,
        why: CHECK,
        sources: BOTH,
        run: Run::Regulating(|board, target, rng| flip(board, rng, target.code)),
    },
    Class {
        name: "bit flip anywhere in the control's data",
        bound_ms: LOCK_MS,
        why: LOCK,
        sources: BOTH,
        run: Run::Regulating(|board, target, rng| flip(board, rng, target.control)),
    },
    Class {
        name: "bit flip in RAM, stack included",
        bound_ms: LOCK_MS,
        why: LOCK,
        sources: BOTH,
        run: Run::Regulating(|board, target, rng| {
            let area = if rng.random() {
                target.data
            } else {
                Region { address: target.stack.end() - 1024, size: 1024 }
            };
            flip(board, rng, area)
        }),
    },
    Class {
        name: "timer update dropped",
        bound_ms: 2.0 * STEP_MS,
        why: "five updates at most, each seen in its own period",
        sources: BOTH,
        run: Run::Regulating(|board, _, rng| {
            let count = rng.random_range(1..6);
            board.chip().tim1.drop_update = count;
            format!("{count} of them")
        }),
    },
    Class {
        name: "timer update duplicated",
        bound_ms: STEP_MS,
        why: "seen in its own period",
        sources: BOTH,
        run: Run::Regulating(|board, _, _| {
            board.chip().tim1.extra_update();
            String::new()
        }),
    },
    Class {
        name: "conversion trigger lost",
        bound_ms: WATCHDOG_MS,
        why: "one converter: its own period; both: no interrupt, the watchdog is not fed",
        sources: BOTH,
        run: Run::Regulating(|board, _, rng| {
            let which = rng.random_range(0..3_usize);
            // For good, or for a while: up to longer than the watchdog waits.
            let count =
                if rng.random_range(0..4) == 0 { u32::MAX } else { rng.random_range(1..40) };
            board.chip().adc.lose_triggers = [[count, 0], [0, count], [count, count]][which];
            format!("{} of them, {}", count, ["one", "two", "both"][which])
        }),
    },
    Class {
        name: "console garbage and floods",
        bound_ms: 0.0,
        why: "control is correct throughout",
        sources: BOTH,
        run: Run::Regulating(|board, _, rng| {
            let mut bytes = vec![0; rng.random_range(1..3000)];
            let text = rng.random::<bool>();
            for byte in &mut bytes {
                *byte = if text {
                    b"stausorquepi \n0123.-"[rng.random_range(0..20_usize)]
                } else {
                    rng.random()
                };
            }
            board.send(&bytes);
            format!("{} bytes{}", bytes.len(), if text { " of text" } else { "" })
        }),
    },
    Class {
        name: "interrupt overrun",
        bound_ms: OVERRUN_MS + 2.0 * STEP_MS,
        why: "the core stands still for up to 2 ms; then the first interrupt sees that it is late",
        sources: BOTH,
        run: Run::Regulating(|board, _, rng| {
            let ms = rng.random_range(0.005..OVERRUN_MS);
            board.stall((ms * 1e-3 * TICKS_PER_S as f64) as u64);
            format!("{ms:.3} ms")
        }),
    },
    Class {
        name: "core hangs",
        bound_ms: WATCHDOG_MS,
        why: "the watchdog, 4.2 to 4.9 ms after it was last fed",
        sources: BOTH,
        run: Run::Regulating(|board, _, _| {
            board.hang();
            String::new()
        }),
    },
    Class {
        name: "stack overflow",
        bound_ms: 2.0 * STEP_MS,
        why: "the next interrupt does not find room for its frame",
        sources: BOTH,
        run: Run::Regulating(|board, target, rng| {
            let room = 8 * rng.random_range(0..13);
            board.cpu().set(Register::SP, target.stack.address + room);
            format!("room for {room} bytes")
        }),
    },
    Class {
        name: "damaged page of the settings",
        bound_ms: 0.0,
        why: "outputs are off; the other page holds",
        sources: &[Source::Injection],
        run: Run::DamagedPage,
    },
    Class {
        name: "power lost in an operation of save",
        bound_ms: 0.0,
        why: "outputs are off; the old or the new set holds",
        sources: &[Source::Injection],
        run: Run::Saving,
    },
    Class {
        name: "reset pin at any time",
        bound_ms: 0.001,
        why: "the reset of the timer; no software",
        sources: BOTH,
        run: Run::Reset,
    },
];

/// A carrier period, ms.
const CARRIER_MS: f64 = 10.0 * PERIOD_MS;
/// Noise that turns the angle.
const NOISE_MS: f64 = 100.0;
const NOISE: &str = "the mean over 67 ms passes the limit; noise below the limit turns the angle by less than 15 degrees";
/// A sensor across the injection axis sees no carrier, and cannot be judged: a quarter of half a turn of
/// the flux, which is 60 ms with the shaft locked.
const SILENT_MS: f64 = 70.0;
const SILENT: &str =
    "up to 60 ms until the axis has turned to the sensor, then three carrier periods of silence";
/// From any wrong angle to the right one or to the lock monitor's fault. The longest is 180 degrees, which
/// looks right until the flux has decayed with the rotor time constant.
const LOCK_MS: f64 = 400.0;
const LOCK: &str = "a wrong angle: right again, or off by the lock monitor (measured there for 90, 120 and 180 degrees)";
/// Compared and hashed by the main loop, 64 words of 5300 a pass, a pass a control period: 14 ms for all.
const CHECK_MS: f64 = 20.0;
const CHECK: &str =
    "the main loop has looked at all of it after 14 ms, later if the console is busy";
const WATCHDOG_MS: f64 = 6.0;
const OVERRUN_MS: f64 = 2.0;
