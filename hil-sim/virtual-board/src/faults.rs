//! Faults of a board that a row of a table describes: what is disturbed, how much, when, for how long and how often.

use std::cell::Cell;
use std::rc::Rc;

use anyhow::{Context, Result, bail};
use drive_core::{Line, Sample};
use hil_sim::plant::{DcLinkSettings, EncoderFault};
use rand::{Rng, RngExt, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;
use serde::Deserialize;

use crate::board::Board;
use stm32g4_unicorn::chip::{TICKS_PER_S, kept_registers};
use stm32g4_unicorn::{memory::Region, periph::iwdg::LSI_HZ};

/// Number of steps of a fault that grows.
const STEPS: u32 = 50;
/// Capacitor of the dc link, F, and the resistor of precharge and chopper, ohm.
const CAPACITOR: f64 = 235e-6;
const OHM: f64 = 200.0;

/// A fault, with ranges from which each run draws; positive ranges by their logarithm.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Fault {
    /// The place that is disturbed, see [`effect`]; behind a colon the value that the effect needs.
    at: String,
    /// Its size.
    #[serde(default = "whole")]
    to: [f64; 2],
    /// Time until it begins, its duration, and the time until it begins again, ms.
    #[serde(default)]
    after_ms: [f64; 2],
    for_ms: Option<[f64; 2]>,
    #[serde(default)]
    every_ms: [f64; 2],
    /// How often it begins.
    #[serde(default = "once")]
    times: u32,
    /// Time in which it grows to its size, ms.
    #[serde(default)]
    over_ms: f64,
}

fn whole() -> [f64; 2] {
    [1.0; 2]
}

fn once() -> u32 {
    1
}

/// The parts of board and motor that the faults act on.
#[derive(Clone, Debug)]
pub struct Places {
    /// Scales of the current sensors, and how many of them there are.
    pub lines: [Line; 3],
    /// See `lines`.
    pub sensors: usize,
    /// Scale of voltages relative to a dc link of 311 V.
    pub relative_voltage: f64,
    /// Memory in which bits flip: one of these areas, each as often as another.
    pub areas: Vec<Region>,
}

/// An effect on a board: 0 is healthy, 1 is the whole fault.
type Effect = Box<dyn FnMut(&mut Board, f64)>;

/// Relative errors of the three currents, the dc link and the heat sink as the chip sees them, and counts added to the encoder.
type Seen = Rc<Cell<([f64; 5], f64)>>;

/// The faults of a run.
#[derive(Default)]
pub struct Script {
    /// Times, ticks, each with an effect and its level from then on, in order.
    events: Vec<(u64, usize, f64)>,
    effects: Vec<Effect>,
    done: usize,
    /// Time at which the last of the faults begins for the first time, ticks.
    pub began: u64,
    /// Time of the last event, ticks.
    pub ends: u64,
    /// Whether a fault comes and goes, or grows.
    pub repeats: bool,
}

/// Draws from a range.
fn pick(rng: &mut dyn Rng, [low, high]: [f64; 2]) -> f64 {
    let share = rng.random::<f64>();
    if low > 0.0 { low * (high / low).powf(share) } else { low + (high - low) * share }
}

impl Script {
    /// Draws faults that begin now, and returns their description.
    ///
    /// # Errors
    /// There is no such fault.
    pub fn new(
        faults: &[Fault],
        board: &mut Board,
        places: &Places,
        rng: &mut dyn Rng,
    ) -> Result<(Self, String)> {
        let (now, seen) = (board.chip().now, Seen::default());
        let mut script = Self { began: now, ends: now, ..Self::default() };
        let mut what = Vec::new();
        for (n, fault) in faults.iter().enumerate() {
            let (size, mut ms) = (pick(rng, fault.to), pick(rng, fault.after_ms));
            let (effect, place) = effect(&fault.at, size, board, places, &seen, rng)?;
            script.effects.push(effect);
            what.push(format!("{} {place}{size:.4} after {ms:.2} ms", fault.at));
            let ticks = |ms: f64| now + (ms * 1e-3 * TICKS_PER_S as f64) as u64;
            script.began = script.began.max(ticks(ms));
            script.repeats |= fault.times > 1 || fault.over_ms > 0.0;
            let steps = if fault.over_ms > 0.0 { STEPS } else { 1 };
            for _ in 0..fault.times {
                for step in 0..steps {
                    let share = f64::from(step) / f64::from(steps);
                    let level = share + 1.0 / f64::from(steps);
                    script.events.push((ticks(ms + share * fault.over_ms), n, level));
                }
                if let Some(duration) = fault.for_ms {
                    ms += pick(rng, duration);
                    script.events.push((ticks(ms), n, 0.0));
                }
                ms += pick(rng, fault.every_ms);
            }
        }
        script.events.sort_by_key(|event| event.0);
        script.ends = script.events.last().map_or(now, |event| event.0);
        let lines = places.lines;
        board.disturb = Some(Box::new(move |s| {
            let (errors, counts) = seen.get();
            for which in (0..3).filter(|which| errors[*which] != 0.0) {
                let zero = f64::from(-lines[which].offset / lines[which].gain);
                let code = current(which, s);
                *code = (zero + (f64::from(*code) - zero) * (1.0 + errors[which])) as u16;
            }
            for (code, error) in [(&mut s.dc_link, errors[3]), (&mut s.heat_sink, errors[4])] {
                *code = (f64::from(*code) * (1.0 + error)) as u16;
            }
            s.encoder = s.encoder.wrapping_add_signed(counts as i32);
        }));
        Ok((script, what.join("; ")))
    }

    /// Runs the board until a time, ticks, with the faults that begin and end until then.
    ///
    /// # Errors
    /// As [`Board::run_ticks`].
    pub fn run_until(&mut self, board: &mut Board, end: u64) -> Result<()> {
        while let Some(&(at, which, level)) = self.events.get(self.done).filter(|e| e.0 < end) {
            let now = board.chip().now;
            board.run_ticks(at.saturating_sub(now))?;
            (self.effects[which])(board, level);
            self.done += 1;
        }
        let now = board.chip().now;
        board.run_ticks(end.saturating_sub(now))
    }
}

/// Returns an effect by its name, with its size, and the place that it has drawn.
fn effect(
    name: &str,
    size: f64,
    board: &mut Board,
    places: &Places,
    seen: &Seen,
    rng: &mut dyn Rng,
) -> Result<(Effect, String)> {
    let (name, more) = name.split_once(':').map_or((name, ""), |(name, more)| (name, more));
    let (mut which, mut sides, mut place) =
        (rng.random_range(0..3_usize), [true; 2], String::new());
    let error = |which: usize| -> Effect {
        let seen = seen.clone();
        Box::new(move |_, level| {
            let mut now = seen.get();
            now.0[which] = size * level;
            seen.set(now);
        })
    };
    let supply = |more: &str| {
        let mut link = DcLinkSettings { capacitor: CAPACITOR * size, ..DcLinkSettings::DEFAULT };
        (link.precharge, link.chopper) = (OHM, OHM);
        link.pulses = more.parse().context("the number of pulses")?;
        anyhow::Ok(link)
    };
    let effect: Effect = match name {
        "line" => {
            let line = more.replace("{}", &size.to_string());
            Box::new(move |board, level| {
                if level > 0.0 {
                    board.type_line(&line)
                }
            })
        }
        "phase" => Box::new(move |board, level| {
            board.plant.set_open_phase((level > 0.0).then_some(which)).expect("a phase");
        }),
        "gate" | "leg" => {
            if name == "gate" {
                sides[rng.random_range(0..2_usize)] = false;
            }
            place = format!("{which} {sides:?} ");
            Box::new(move |board, level| {
                board.plant.set_dead_gates((level > 0.0).then_some((which, sides)));
            })
        }
        "current" => {
            which = rng.random_range(0..places.sensors);
            error(which)
        }
        "link" => error(3),
        "heat sink" => error(4),
        "thermistor" => {
            let code = board.chip().circuit.stage.ntc.code(size as f32);
            Box::new(move |board, _| board.plant.set_heat_sink(code))
        }
        "encoder" => Box::new(move |board, level| {
            board.plant.set_encoder_fault(EncoderFault::Losing(size * level));
        }),
        "edges" => {
            let (seen, size) = (seen.clone(), size.round());
            Box::new(move |_, _| seen.set((seen.get().0, seen.get().1 + size)))
        }
        "break" => Box::new(move |board, level| board.set_fault_pin(level == 0.0)),
        "chip supply" => Box::new(move |board, level| {
            board.chip().set_supply(3.3 + (size - 3.3) * level);
        }),
        "crystal" => Box::new(move |board, level| board.chip().set_clocks(size * level, LSI_HZ)),
        "LSI" => Box::new(move |board, level| {
            board.chip().set_clocks(0.0, LSI_HZ * (1.0 + size * level));
        }),
        "mains" => {
            let volts = places.relative_voltage * size;
            Box::new(move |board, _| board.plant.set_dc_link(volts).expect("a voltage"))
        }
        "rectifier" => {
            let link = supply(more)?;
            Box::new(move |board, _| {
                board.plant.set_supply(&link).expect("a supply");
                board.plant.set_relay(true);
            })
        }
        "relay" => Box::new(move |board, _| board.plant.set_relay(size > 0.0)),
        "chopper" => Box::new(move |board, _| board.plant.set_chopper(size)),
        "flip" => {
            let area = places.areas[rng.random_range(0..places.areas.len())];
            let mut rng = own(rng);
            Box::new(move |board, _| drop(flip(board, &mut rng, area)))
        }
        "register" => {
            let (mut rng, registers) = (own(rng), kept_registers().collect::<Vec<_>>());
            Box::new(move |board, _| drop(flip_one(board, &mut rng, &registers)))
        }
        other => bail!("{other}: no such fault"),
    };
    if matches!(name, "phase" | "current") {
        place = format!("{which} ");
    }
    Ok((effect, place))
}

/// Returns a generator of its own for an effect.
fn own(rng: &mut dyn Rng) -> Xoshiro256PlusPlus {
    SeedableRng::seed_from_u64(rng.random())
}

/// Returns the ADC counts of the current sensor of phase 0, 1 or 2.
pub fn current(which: usize, sample: &mut Sample) -> &mut u16 {
    match which {
        0 => &mut sample.current_a,
        1 => &mut sample.current_b,
        _ => &mut sample.current_c,
    }
}

/// Bits that affect the gates at once, before any software. TIM1: clock of the dead time (CR1), polarity (CCER). Ports:
/// the functions of PA7 to PA10, PB0 and PB1; the levels of other functions are not modelled.
const AT_THE_GATES: [(u32, u32); 5] = [
    (0x4001_2c00, 3 << 8),
    (0x4001_2c20, 0xaaa),
    (0x4800_0020, 0xf << 28),
    (0x4800_0024, 0xfff),
    (0x4800_0420, 0xff),
];

/// Flips one of these bits, given by addresses with their bits.
pub fn flip_one(board: &mut Board, rng: &mut dyn Rng, registers: &[(u32, u32)]) -> String {
    loop {
        let (address, mask) = registers[rng.random_range(0..registers.len())];
        let bit = rng.random_range(0..32);
        if mask >> bit & 1 == 0
            || AT_THE_GATES.iter().any(|g| g.0 == address && g.1 >> bit & 1 == 1)
        {
            continue;
        }
        let chip = board.chip();
        let before = chip.read(address, 4);
        chip.write(address, 4, before ^ 1 << bit);
        // The bit is neither reserved nor locked.
        if (chip.read(address, 4) ^ before) & mask != 0 {
            return format!("bit {bit} of {address:#010x}");
        }
    }
}

/// Flips a bit of a region.
pub fn flip(board: &mut Board, rng: &mut dyn Rng, region: Region) -> String {
    let offset = rng.random_range(0..region.size);
    let address = region.address + offset;
    let bit = rng.random_range(0..8);
    let byte = board.cpu.byte(address).unwrap_or(0) ^ 1 << bit;
    board.cpu.write(address, &[byte]);
    format!("bit {bit} of {address:#010x}, {offset:#x} from the beginning")
}
