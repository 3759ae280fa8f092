//! The classes of faults: each with its injection, and the longest time of wrong control with the outputs on. One table, which makes
//! the file long.

use rand::{Rng, RngExt};

use super::faults::{
    bad_code, current, flip, flip_register, losing, name, noise, set_clocks, slow_sensor,
};
use super::scene::{Source, Target};
use super::strip::Fault;
use crate::{board::Board, chip::TICKS_PER_S, cpu::Register, memory::Region, periph::iwdg::LSI_HZ};
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
    /// Wires of the terminal strip, with the drive off and while it turns.
    Strip(Fault),
}

/// Longest that outputs may be on with wrong control, ms, and the reason. Infinite: for the angle nothing is promised, and
/// only the currents are judged.
pub type Bound = (f64, &'static str);

/// A class of faults.
#[derive(Clone, Copy)]
pub struct Class {
    /// Its name.
    pub name: &'static str,
    /// Its bound.
    pub bound: Bound,
    /// Its bound in a campaign at speed; none where it is not part of one.
    at_speed: Option<Bound>,
    /// The angle sources that it is tried with.
    pub sources: &'static [Source],
    /// The procedure of its runs.
    pub run: Run,
    /// Whether the outputs must be off after the bound, correct control or not.
    pub ends: bool,
}

/// A class of faults, tried with either angle source.
const fn class(name: &'static str, bound: Bound, run: Run) -> Class {
    Class { name, bound, at_speed: Some(bound), sources: BOTH, run, ends: false }
}

/// A class of faults that are injected while the drive regulates.
const fn regulating(name: &'static str, bound: Bound, inject: Inject) -> Class {
    class(name, bound, Run::Regulating(inject))
}

/// A class of faults with the drive off, or that only its outputs are judged by.
const fn off(name: &'static str, why: &'static str, run: Run) -> Class {
    class(name, (0.0, why), run).with(&[Source::Sensorless]).not_at_speed()
}

impl Class {
    /// The same with these angle sources.
    const fn with(self, sources: &'static [Source]) -> Self {
        Self { sources, ..self }
    }

    /// This class with another bound at speed.
    const fn at_speed(self, bound: Bound) -> Self {
        Self { at_speed: Some(bound), ..self }
    }

    /// The same, after which the outputs must be off.
    const fn ends(self) -> Self {
        Self { ends: true, ..self }
    }

    /// The same, but no part of a campaign at speed.
    const fn not_at_speed(self) -> Self {
        Self { at_speed: None, ..self }
    }

    /// The classes of a campaign with their bounds, at speed or not.
    pub fn all(at_speed: bool) -> Vec<Self> {
        let fast = |class: &Self| class.at_speed.map(|bound| Self { bound, ..*class });
        CLASSES
            .iter()
            .filter_map(|class| if at_speed { fast(class) } else { Some(*class) })
            .collect()
    }
}

const BOTH: &[Source] = &[Source::Sensorless, Source::Encoder];
const ENCODER: &[Source] = &[Source::Encoder];

/// A PWM period, and the time in which the software sees a sample and switches off, ms.
const PERIOD_MS: f64 = 1.0 / 6.0;
const STEP_MS: f64 = 2.0 * PERIOD_MS;

/// All classes.
const CLASSES: &[Class] = &[
    regulating("nothing (for comparison)", THROUGHOUT, |_, _, _| String::new()),
    regulating("current sensor stuck", SILENT, |board, target, rng| {
        let (which, now) = (target.any_current(rng), board.sample());
        let value = *current(which, &mut { now });
        board.disturb = Some(Box::new(move |s| *current(which, s) = value));
        format!("{} at {value}", name(which))
    })
    .at_speed(SILENT_AT_SPEED),
    regulating("current sensor open", SILENT, |board, target, rng| {
        let which = target.any_current(rng);
        let line = target.line(which);
        let zero = (-line.offset / line.gain).round() as u16;
        board.disturb = Some(Box::new(move |s| *current(which, s) = zero));
        name(which).into()
    })
    .at_speed(SILENT_AT_SPEED),
    regulating("current sensor saturated", SAMPLE, |board, target, rng| {
        let (which, high) = (target.any_current(rng), rng.random::<bool>());
        let code = if high { firmware_board::ADC_FULL_SCALE } else { 0 };
        board.disturb = Some(Box::new(move |s| *current(which, s) = code));
        format!("{} at {code}", name(which))
    }),
    regulating("current sensor noisy", NOISE, |board, target, rng| {
        let which = target.any_current(rng);
        // 5 mA to 2 A rms on the dissertation's motor.
        let amperes = target.relative_current * 0.005 * 400_f64.powf(rng.random::<f64>());
        let codes = amperes / f64::from(target.line(which).gain.abs());
        let mut noise = noise(rng, codes);
        board.disturb = Some(Box::new(move |s| noise(current(which, s))));
        format!("{}, {:.1} mA", name(which), 1e3 * amperes)
    }),
    regulating("dc-link sensor stuck, open, saturated, noisy", SAMPLE, |board, _, rng| {
        slow_sensor(board, rng, |s| &mut s.dc_link)
    }),
    regulating("heat-sink sensor stuck, open, saturated, noisy", SAMPLE, |board, _, rng| {
        slow_sensor(board, rng, |s| &mut s.heat_sink)
    }),
    regulating("not-a-number in the drive's state", NOT_A_NUMBER, |board, target, rng| {
        let Region { address: base, size } = target.addresses.state;
        // A word that holds a plausible number; angles and counts are another class.
        for _ in 0..1000 {
            let address = base + 4 * rng.random_range(0..size / 4);
            let value = f32::from_bits(board.cpu.word(address).unwrap_or(0)).abs();
            if (1e-5..1e5).contains(&value) {
                board.cpu.write(address, &f32::NAN.to_le_bytes());
                return format!("word {} of the control's state", (address - base) / 4);
            }
        }
        "no such word".into()
    }),
    regulating("dc-link step", VOLTAGE, |board, target, rng| {
        // On a dc link of 311 V.
        let volts = target.relative_voltage * rng.random_range(100.0..600.0);
        board.plant.set_dc_link(volts).ok();
        format!("to {volts:.0} V")
    }),
    regulating("encoder stands still", STANDS_STILL, |board, _, _| {
        board.plant.set_encoder_fault(EncoderFault::Stuck);
        String::new()
    })
    .with(ENCODER),
    regulating("encoder loses counts of up to 6 rpm", SLIP, |board, target, rng| {
        losing(board, rng.random_range(0.0..6.0) / target.encoder_rpm)
    })
    .with(ENCODER),
    regulating(
        "encoder loses 5 to 90 % of its counts at 900 rpm and more",
        LOST_COUNTS,
        |board, _, rng| losing(board, rng.random_range(0.05..0.9)),
    )
    .with(&[Source::FastEncoder]),
    regulating("encoder loses 2 to 90 % of its counts at 300 rpm", LOST_SLOWLY, |board, _, rng| {
        losing(board, rng.random_range(0.02..0.9))
    })
    .with(ENCODER)
    .not_at_speed(),
    regulating("break pin", BREAK, |board, _, _| {
        board.set_fault_pin(false);
        String::new()
    }),
    regulating("clock failure", (0.01, "the clock security system; no software"), |board, _, _| {
        board.set_crystal(false);
        String::new()
    }),
    regulating("flash ECC in code", (0.01, "the break; no software"), |board, _, rng| {
        bad_code(board, rng)
    })
    .ends(),
    regulating("bit flip in the coefficients", CHECK, |board, target, rng| {
        flip(board, rng, target.addresses.coefficients)
    }),
    regulating("bit flip in a register", REGISTERS, |board, _, rng| flip_register(board, rng))
        .ends(),
    regulating("bit flip in the drive's state", LOCK, |board, target, rng| {
        flip(board, rng, target.addresses.state)
    })
    .at_speed(LOCK_AT_SPEED),
    regulating("bit flip in the control's code", CHECK, |board, target, rng| {
        flip(board, rng, target.code)
    }),
    regulating("bit flip anywhere in the control's data", LOCK, |board, target, rng| {
        flip(board, rng, target.addresses.control)
    })
    .at_speed(LOCK_AT_SPEED),
    regulating("bit flip in RAM, stack included", LOCK, |board, target, rng| {
        let area = if rng.random() {
            target.data
        } else {
            Region { address: target.stack.end() - 1024, size: 1024 }
        };
        flip(board, rng, area)
    })
    .at_speed(LOCK_AT_SPEED),
    regulating("timer update dropped", UPDATES, |board, _, rng| {
        let count = rng.random_range(1..6);
        board.chip().tim1.drop_update = count;
        format!("{count} of them")
    }),
    regulating("timer update duplicated", (STEP_MS, "seen in its own period"), |board, _, _| {
        board.chip().tim1.extra_update();
        String::new()
    }),
    regulating("conversion trigger lost", TRIGGERS, |board, _, rng| {
        let which = rng.random_range(0..3_usize);
        // For good, or for a while: up to longer than the watchdog waits.
        let count = if rng.random_range(0..4) == 0 { u32::MAX } else { rng.random_range(1..40) };
        board.chip().adc.lose_triggers = [[count, 0], [0, count], [count, count]][which];
        format!("{} of them, {}", count, ["one", "two", "both"][which])
    }),
    regulating("console garbage and floods", THROUGHOUT, |board, _, rng| {
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
    regulating("interrupt overrun", OVERRUN, |board, _, rng| {
        let ms = rng.random_range(0.005..OVERRUN_MS);
        board.stall((ms * 1e-3 * TICKS_PER_S as f64) as u64);
        format!("{ms:.3} ms")
    }),
    regulating("LSI off its frequency", SOURCES, |board, _, rng| {
        let hz = [0.0, rng.random_range(8e3..28e3), rng.random_range(36e3..60e3)];
        set_clocks(board, 0.0, hz[rng.random_range(0..3_usize)])
    })
    .ends(),
    regulating("crystal off its frequency", SOURCES, |board, _, rng| {
        let error = rng.random_range(0.12..0.3);
        set_clocks(board, if rng.random() { error } else { -error }, LSI_HZ)
    })
    .ends(),
    regulating("reference voltage off", SOURCES, |board, _, rng| {
        let error = rng.random_range(0.035..0.1);
        let error = if rng.random() { error } else { -error };
        board.chip().set_reference(error);
        format!("{:.1} %", 100.0 * error)
    })
    .ends(),
    regulating("TIM1 stops", WINDOW, |board, _, _| {
        let cr1 = board.chip().read(TIM1_CR1, 4);
        board.chip().write(TIM1_CR1, 4, cr1 & !1);
        String::new()
    })
    .ends(),
    regulating("core hangs", WINDOW, |board, _, _| {
        board.hang();
        String::new()
    })
    .ends(),
    regulating("stack overflow", STACK, |board, target, rng| {
        let room = 8 * rng.random_range(0..13);
        board.cpu.set(Register::SP, target.stack.address + room);
        format!("room for {room} bytes")
    }),
    off("damaged page of the settings", "outputs are off; the other page holds", Run::DamagedPage),
    off(
        "power lost in an operation of save",
        "outputs are off; the old or the new set holds",
        Run::Saving,
    ),
    class("reset pin at any time", RESET, Run::Reset),
    off("strip wire open", STRIP, Run::Strip(Fault::Open)),
    off("strip wire shorted", STRIP, Run::Strip(Fault::Shorted)),
    off("strip input chatters", STRIP, Run::Strip(Fault::Chatters)),
    off("strip reference jumps", STRIP, Run::Strip(Fault::Reference)),
    off("motor sensor open or shorted", STRIP, Run::Strip(Fault::Sensor)),
];

/// What is judged at the terminal strip, instead of the control.
const STRIP: &str =
    "no start and no restart; off after 150 ms by ENABLE or sensor, 600 ms by a ramp from 300 rpm";

/// A carrier period, ms.
const CARRIER_MS: f64 = 10.0 * PERIOD_MS;
/// The window watchdog bites 482 us after it was fed at the latest; the truth is compared once in a period.
const WINDOW_MS: f64 = 0.7;
const TIM1_CR1: u32 = 0x4001_2c00;
const OVERRUN_MS: f64 = 2.0;

/// The bounds, a row each: time, ms, and reason. The names become constants.
macro_rules! bounds {
    ($($(#[$about:meta])* $name:ident = $ms:expr, $why:literal;)*) => {
        $($(#[$about])* const $name: Bound = ($ms, $why);)*
    };
}

bounds! {
    RESET = 0.001, "the reset of the timer; no software";
    THROUGHOUT = 0.0, "control is correct throughout";
    SAMPLE = STEP_MS, "the sample after it, and the step that sees it";
    /// Noise that turns the angle.
    NOISE = 100.0, "the mean over 67 ms passes the limit; noise below the limit turns the angle by less than 15 degrees";
    /// A sensor across the injection axis sees no carrier, and cannot be judged: a quarter of half a turn of
    /// the flux, which is 60 ms with the shaft locked.
    SILENT = 70.0, "up to 60 ms until the axis has turned to the sensor, then three carrier periods of silence";
    /// At speed there is no carrier: the voltage shows it, by more than half of the back-emf at once, or in the mean.
    SILENT_AT_SPEED = 70.0, "without a carrier the voltage shows it, at the latest by its mean over 50 ms in the frame of the flux";
    /// From any wrong angle to the right one or to the lock monitor's fault. The longest is 180 degrees, which
    /// looks right until the flux has decayed with the rotor time constant.
    LOCK = 400.0, "a wrong angle: right again, or off by the lock monitor (measured there for 90, 120 and 180 degrees)";
    LOCK_AT_SPEED = 400.0, "a wrong angle: right again by the observer, or off as the voltage misses the flux where it is believed to be";
    /// Compared and hashed by the main loop, 64 words of 5300 a pass, a pass a control period: 14 ms for all.
    CHECK = 20.0, "the main loop has looked at all of it after 14 ms, later if the console is busy";
    REGISTERS = 5.0, "the main loop has looked at all of them after 1.9 ms, later if the console is busy";
    WINDOW = WINDOW_MS, "the window watchdog, 0.48 ms after it was last fed at the latest";
    TRIGGERS = WINDOW_MS, "one converter: its own period; both: no interrupt, the window watchdog is not fed";
    SOURCES = 1200.0, "compared once a second, and once more when it is wrong; until then off by that share";
    NOT_A_NUMBER = 2.0 * CARRIER_MS + STEP_MS, "quantities that are used once in a carrier period show in the next one";
    VOLTAGE = STEP_MS, "voltage limits: the sample after it, and the step that sees it";
    STANDS_STILL = 5.0, "1.4 degrees of a turn that did not come: 0.8 ms at 300 rpm, 2.4 ms at 100 rpm; and the step";
    SLIP = 0.0, "as a slip that is wrong by as much: control is correct throughout";
    /// From the first lost count of 5 % of them to the fault: 210 ms measured.
    LOST_COUNTS = 300.0, "the back-emf of the flux that is turned away, once it is there: with the rotor time constant";
    LOST_SLOWLY = f64::INFINITY, "15 degrees leave 4.7 V unexplained of a back-emf of 6.7 V, a motor 30 % warmer 4.2 V at the right angle: only the currents are judged";
    BREAK = firmware_board::BREAK_REACTION_NS as f64 * 1e-6, "the timer's filter; no software";
    UPDATES = 2.0 * STEP_MS, "five updates at most, each seen in its own period";
    OVERRUN = OVERRUN_MS + 2.0 * STEP_MS, "the core stands still for up to 2 ms; then the first interrupt sees that it is late";
    STACK = 2.0 * STEP_MS, "the next interrupt does not find room for its frame";
}
