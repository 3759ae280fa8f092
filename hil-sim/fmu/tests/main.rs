//! Drive and motor as FMUs, called as a tool calls them, beside the rig of the simulator.

use std::ffi::{CStr, CString, c_char, c_int, c_void};
use std::ptr::null;
use std::time::Instant;

use drive_core::{Command, Hardware, Mode, Sample};
use induction_drive_fmu::interface::*;
use induction_drive_fmu::model::{Kind, SETTING, Variable};
use induction_drive_fmu::{drive, motor};
use sim_bench::config::{Config, plant_settings};
use sim_bench::plant::Load;
use sim_bench::rig::{RATE_HZ, Rig};

/// An instance, with the messages of its logger.
struct Fmu {
    kind: &'static Kind,
    pointer: *mut Instance,
    #[expect(clippy::box_collection, reason = "the logger knows its address")]
    messages: Box<Vec<String>>,
    now: f64,
}

/// A logger without further arguments.
type Named = unsafe extern "C" fn(*mut c_void, *const c_char, c_int, *const c_char, *const c_char);

unsafe extern "C" fn log(
    to: *mut c_void,
    _: *const c_char,
    _: c_int,
    _: *const c_char,
    text: *const c_char,
) {
    // SAFETY: `to` is the messages of an instance, and the text ends with a zero.
    unsafe { (*to.cast::<Vec<String>>()).push(CStr::from_ptr(text).to_str().unwrap().to_owned()) }
}

impl Fmu {
    fn new(kind: &'static Kind) -> Self {
        let mut messages = Box::<Vec<String>>::default();
        let guid = CString::new(kind.identifier()).unwrap();
        // SAFETY: the logger has no arguments beside the named ones; the messages are as old as the instance.
        let pointer = unsafe {
            let logger: Named = log;
            let logger = Some(std::mem::transmute::<Named, Logger>(logger));
            let environment = (&raw mut *messages).cast();
            let callbacks = Callbacks { logger, others: [null(); 3], environment };
            fmi2Instantiate(c"one".as_ptr(), 1, guid.as_ptr(), null(), &callbacks, 0, 0)
        };
        assert!(!pointer.is_null());
        Self { kind, pointer, messages, now: 0.0 }
    }

    fn begin(self) -> Self {
        // SAFETY: the instance exists.
        let status = unsafe {
            fmi2SetupExperiment(self.pointer, 0, 0.0, 0.0, 0, 0.0);
            fmi2EnterInitializationMode(self.pointer) | fmi2ExitInitializationMode(self.pointer)
        };
        assert_eq!(status, 0, "{:?}", self.messages);
        self
    }

    fn references<const N: usize>(&self, names: [&str; N]) -> [u32; N] {
        let variables = self.kind.variables();
        names.map(|name| variables.iter().find(|it| it.name == name).expect(name).reference)
    }

    fn get<const N: usize>(&self, references: &[u32; N]) -> [f64; N] {
        let mut values = [0.0; N];
        // SAFETY: both arrays have N elements.
        let status =
            unsafe { fmi2GetReal(self.pointer, references.as_ptr(), N, values.as_mut_ptr()) };
        assert_eq!(status, 0);
        values
    }

    fn set<const N: usize>(&self, references: &[u32; N], values: [f64; N]) -> c_int {
        // SAFETY: as above.
        unsafe { fmi2SetReal(self.pointer, references.as_ptr(), N, values.as_ptr()) }
    }

    fn named(&self, name: &str) -> f64 {
        self.get(&self.references([name]))[0]
    }

    fn name(&self, name: &str, value: f64) -> c_int {
        self.set(&self.references([name]), [value])
    }

    fn step(&mut self) {
        // SAFETY: the instance exists.
        unsafe { fmi2DoStep(self.pointer, self.now, 1.0 / RATE_HZ, 1) };
        self.now += 1.0 / RATE_HZ;
    }
}

impl Drop for Fmu {
    fn drop(&mut self) {
        // SAFETY: the instance exists.
        unsafe { fmi2FreeInstance(self.pointer) }
    }
}

/// Both FMUs, connected.
struct Pair {
    drive: Fmu,
    motor: Fmu,
    /// Value references of the outputs of motor and drive, and of the inputs that these outputs go to.
    sent: ([u32; 5], [u32; 6]),
    received: ([u32; 5], [u32; 6]),
    in_turn: bool,
}

impl Pair {
    fn new(in_turn: bool) -> Self {
        let (drive, motor) = (Fmu::new(&drive::KIND).begin(), Fmu::new(&motor::KIND).begin());
        motor.name("in_turn", in_turn.into());
        let sensors =
            motor.references(["sensor_a", "sensor_b", "sensor_dc_link", "heat_sink", "encoder"]);
        let timer = ["duty_a", "duty_b", "duty_c", "enabled", "chopper", "relay"];
        let sent = (sensors, drive.references(timer));
        let received = (
            drive.references(["i_a", "i_b", "dc_link", "heat_sink", "encoder"]),
            motor.references(timer),
        );
        Self { drive, motor, sent, received, in_turn }
    }

    fn step(&mut self) {
        let before = (!self.in_turn).then(|| self.drive.get(&self.sent.1));
        self.drive.set(&self.received.0, self.motor.get(&self.sent.0));
        self.drive.step();
        let timer = before.unwrap_or_else(|| self.drive.get(&self.sent.1));
        self.motor.set(&self.received.1, timer);
        self.motor.step();
    }

    fn command(&mut self, name: &str, value: f64) {
        assert_eq!(self.drive.name(name, value), 0);
    }
}

fn rig() -> Rig {
    let config = Config::default();
    Rig::new(&plant_settings(&config), &config.drive, 1).unwrap()
}

/// Events with their time, s: the drive gets a command, the power stage reports an over-current, the shaft is released.
const COURSE: [(f64, &str, f64); 11] = [
    (0.1, "mode", 1.0),
    (2.5, "reference", 2.0),
    (3.0, "reference", -2.0),
    (3.5, "reference", 0.5),
    (4.0, "overcurrent", 1.0),
    (4.1, "mode", 7.0),
    (5.0, "mode", 1.0),
    (5.0, "reference", 0.5),
    (7.5, "reference", 1.5),
    (8.0, "shaft", 1.0),
    (8.2, "mode", 0.0),
];

/// Runs the course with both; returns the period after which they first differ, and the rig.
fn compare(pair: &mut Pair) -> (Option<usize>, Rig) {
    let (mut rig, mut first, mut regulated) = (rig(), None, 0);
    let overcurrent = pair.drive.references(["overcurrent"]);
    let (mut course, references) =
        (COURSE.iter().peekable(), pair.motor.references(["torque", "speed", "i_a"]));
    for period in 0..(8.5 * RATE_HZ) as usize {
        let mut hardware = Hardware::empty();
        pair.drive.set(&overcurrent, [0.0]);
        while let Some((_, name, value)) = course.next_if(|(at, ..)| period as f64 >= at * RATE_HZ)
        {
            let command = match *name {
                "mode" => [
                    Command::Stop(drive_core::Stop::Coast),
                    Command::Start(Mode::Torque),
                    Command::Clear,
                ][*value as usize % 5],
                "reference" => Command::Torque(*value as f32),
                "overcurrent" => {
                    hardware = Hardware::BREAK;
                    pair.command(name, *value);
                    continue;
                }
                _ => {
                    rig.set_load(Load::Free { torque: 0.0 }).unwrap();
                    pair.motor.name(name, *value);
                    continue;
                }
            };
            rig.command(&command).unwrap();
            pair.command(name, *value);
        }
        let sample = Sample { hardware, ..rig.plant.sample() };
        rig.step_with(&sample);
        pair.step();
        let rpm = rig.plant.mechanical_speed() * 60.0 / std::f64::consts::TAU;
        let truth = [rig.plant.torque(), rpm, rig.plant.phase_currents()[0]];
        if pair.motor.get(&references).map(f64::to_bits) != truth.map(f64::to_bits) {
            first = first.or(Some(period));
        }
        regulated += u32::from(truth[0].abs() > 0.3);
    }
    // The drive gave torque in all steps, before the fault and after the restart.
    assert!(regulated > 10_000, "{regulated}");
    (first, rig)
}

#[test]
fn the_pair_is_the_rig_to_the_bit() {
    let mut pair = Pair::new(true);
    let (first, mut rig) = compare(&mut pair);
    assert_eq!(first, None, "{:?}", pair.drive.messages);
    assert!(pair.drive.messages.is_empty() && pair.motor.named("speed") > 10.0);
    // Not a test: the time is that of the machine.
    rig.command(&Command::Start(Mode::Torque)).unwrap();
    pair.command("reference", 0.0);
    pair.command("mode", 1.0);
    let seconds = |run: &mut dyn FnMut()| {
        let began = Instant::now();
        run();
        began.elapsed().as_secs_f64()
    };
    let ratios = [(); 10].map(|()| {
        let rig = seconds(&mut || rig.wait(2.0));
        seconds(&mut || (0..2 * 6000).for_each(|_| pair.step())) / rig
    });
    println!("times of the FMUs relative to the rig: {ratios:.2?}");
}

#[test]
fn fmus_that_step_at_once_differ_only_when_the_outputs_switch_off() {
    let mut pair = Pair::new(false);
    assert_eq!(compare(&mut pair).0, Some((4.0 * RATE_HZ) as usize));
}

#[test]
fn a_setting_has_its_number_for_life_and_its_start_value_leaves_the_motor() {
    let variables = drive::KIND.variables();
    for entry in drive_settings::SETTINGS {
        let reference = SETTING + u32::from(entry.id);
        let is = |it: &Variable| it.reference == reference && it.name == entry.name;
        assert!(variables.iter().any(is), "{}", entry.name);
    }
    let motor = Fmu::new(&motor::KIND);
    let name = c"motulator-2kw2";
    // SAFETY: one reference and one text.
    assert_eq!(unsafe { fmi2SetString(motor.pointer, &0, 1, &name.as_ptr()) }, 0);
    let of_the_file = motor.named("motor.r_s");
    assert_ne!(of_the_file, 5.4);
    assert_eq!(motor.name("motor.r_s", 5.4), 0);
    assert_eq!(motor.named("motor.r_s"), of_the_file);
    assert_eq!(motor.name("motor.r_s", 4.0), 0);
    assert_eq!(motor.named("motor.r_s"), 4.0);
}
