//! The functions of the Functional Mock-up Interface 2.0 for co-simulation. Names, types and numbers are those of the standard.
#![allow(non_snake_case)]

use std::ffi::{CStr, CString, c_char, c_int, c_uint, c_void};

use crate::unit::{KINDS, MOTOR, Unit, unknown};

/// Status of a call and of a message: done, a warning, refused.
const OK: c_int = 0;
const WARNING: c_int = 1;
const ERROR: c_int = 3;

/// Takes a message of an instance.
pub type Logger =
    unsafe extern "C" fn(*mut c_void, *const c_char, c_int, *const c_char, *const c_char, ...);

/// The functions of the tool. The memory of an instance comes from Rust.
#[repr(C)]
pub struct Callbacks {
    /// Takes messages.
    pub logger: Option<Logger>,
    /// Not used.
    pub others: [*const c_void; 3],
    /// The first argument of the logger.
    pub environment: *mut c_void,
}

/// The log of an instance at the tool.
struct Log {
    name: CString,
    logger: Option<Logger>,
    environment: *mut c_void,
}

/// An instance of an FMU.
pub struct Instance {
    unit: Unit,
    log: Log,
    /// The text that was asked for; it stays valid until the next call.
    text: CString,
}

impl Log {
    fn say(&self, status: c_int, message: &str) {
        // The message is a format without arguments.
        let (Ok(message), Some(logger)) = (CString::new(message.replace('%', "%%")), self.logger)
        else {
            return;
        };
        let category = if status == WARNING { c"logStatusWarning" } else { c"logStatusError" };
        let [name, category, text] = [&*self.name, category, &message].map(CStr::as_ptr);
        // SAFETY: the function is the tool's, and all texts end with a zero.
        unsafe { logger(self.environment, name, status, category, text) }
    }
}

/// Calls a function of the instance that a pointer of the tool points to.
///
/// # Safety
/// The pointer is null or from [`fmi2Instantiate`], and no other call of the instance runs.
unsafe fn with(
    pointer: *mut Instance,
    action: impl FnOnce(&mut Instance) -> Result<(), String>,
) -> c_int {
    // SAFETY: see above.
    let Some(instance) = (unsafe { pointer.as_mut() }) else { return ERROR };
    let Err(why) = action(instance) else { return OK };
    instance.log.say(ERROR, &why);
    ERROR
}

/// Returns the elements of an array of the tool.
///
/// # Safety
/// The array has as many elements; it may be null without any.
unsafe fn array<'a, T>(first: *const T, count: usize) -> &'a [T] {
    // SAFETY: see above.
    if count == 0 { &[] } else { unsafe { std::slice::from_raw_parts(first, count) } }
}

/// Checks that each text asked for is the name of the motor, the only one.
fn only_motor(references: &[c_uint]) -> Result<(), String> {
    let other = references.iter().find(|reference| **reference != MOTOR);
    other.map_or(Ok(()), |reference| Err(unknown(*reference)))
}

/// Declares functions of the standard. The tool calls all of them under the conditions of [`with`] and [`array`].
macro_rules! functions {
    ($($name:ident($($argument:ident: $type:ty),*) -> $result:ty $body:block)+) => {$(
        /// As in the standard.
        ///
        /// # Safety
        /// As in the standard: pointers are valid, and an instance is in one call at a time.
        #[unsafe(no_mangle)]
        #[allow(unused_unsafe)]
        pub unsafe extern "C" fn $name($($argument: $type),*) -> $result {
            // SAFETY: the conditions of the standard.
            unsafe { $body }
        }
    )+};
}

functions! {
    fmi2GetTypesPlatform() -> *const c_char { c"default".as_ptr() }
    fmi2GetVersion() -> *const c_char { c"2.0".as_ptr() }
    fmi2SetDebugLogging(_i: *mut Instance, _on: c_int, _n: usize, _categories: *const *const c_char) -> c_int { OK }

    fmi2Instantiate(
        name: *const c_char, kind: c_int, guid: *const c_char, _resources: *const c_char, callbacks: *const Callbacks,
        _visible: c_int, _logging: c_int
    ) -> *mut Instance {
        let (logger, environment) = callbacks.as_ref().map_or((None, std::ptr::null_mut()), |c| (c.logger, c.environment));
        let guid = CStr::from_ptr(guid).to_string_lossy();
        let found = KINDS.into_iter().find(|kind| kind.identifier() == guid);
        let log = Log { name: CStr::from_ptr(name).into(), logger, environment };
        // 1 is a co-simulation.
        let Some(found) = found.filter(|_| kind == 1) else {
            log.say(ERROR, &format!("this library is no co-simulation with the guid {guid}"));
            return std::ptr::null_mut();
        };
        Box::into_raw(Box::new(Instance { unit: Unit::new(found), log, text: CString::default() }))
    }
    fmi2FreeInstance(i: *mut Instance) -> () {
        if !i.is_null() {
            drop(Box::from_raw(i));
        }
    }
    fmi2SetupExperiment(i: *mut Instance, _defined: c_int, _tolerance: f64, start: f64, _ends: c_int, _stop: f64) -> c_int {
        with(i, |i| { i.unit.begin = start; Ok(()) })
    }
    fmi2EnterInitializationMode(i: *mut Instance) -> c_int { with(i, |i| i.unit.build()) }
    fmi2ExitInitializationMode(i: *mut Instance) -> c_int { with(i, |i| i.unit.build()) }
    fmi2Terminate(_i: *mut Instance) -> c_int { OK }
    fmi2Reset(i: *mut Instance) -> c_int {
        with(i, |i| { i.unit = Unit::new(i.unit.kind); Ok(()) })
    }
    fmi2DoStep(i: *mut Instance, now: f64, step: f64, _stays: c_int) -> c_int {
        with(i, |Instance { unit, log, .. }| unit.run_to(now + step, &mut |text| log.say(WARNING, text)))
    }

    fmi2GetString(i: *mut Instance, references: *const c_uint, n: usize, values: *mut *const c_char) -> c_int {
        with(i, |i| {
            only_motor(array(references, n))?;
            i.text = CString::new(&*i.unit.motor).map_err(|why| why.to_string())?;
            (0..n).for_each(|place| *values.add(place) = i.text.as_ptr());
            Ok(())
        })
    }
    fmi2SetString(i: *mut Instance, references: *const c_uint, n: usize, values: *const *const c_char) -> c_int {
        with(i, |i| {
            only_motor(array(references, n))?;
            for text in array(values, n) {
                i.unit.motor = CStr::from_ptr(*text).to_string_lossy().into();
            }
            i.unit.config().map(drop)
        })
    }

    fmi2GetFMUstate(i: *mut Instance, state: *mut *mut Unit) -> c_int {
        with(i, |i| {
            match (*state).as_mut() {
                Some(state) => *state = i.unit.clone(),
                None => *state = Box::into_raw(Box::new(i.unit.clone())),
            }
            Ok(())
        })
    }
    fmi2SetFMUstate(i: *mut Instance, state: *const Unit) -> c_int {
        with(i, |i| { i.unit = state.as_ref().ok_or("there is no state")?.clone(); Ok(()) })
    }
    fmi2FreeFMUstate(_i: *mut Instance, state: *mut *mut Unit) -> c_int {
        if !(*state).is_null() {
            drop(Box::from_raw(*state));
            *state = std::ptr::null_mut();
        }
        OK
    }
}

/// Declares the functions that read and write variables of a type: numbers, and positions of words.
macro_rules! values {
    ($($get:ident $set:ident $type:ty;)+) => {$(functions! {
        $get(i: *mut Instance, references: *const c_uint, n: usize, values: *mut $type) -> c_int {
            with(i, |i| {
                let mut places = array(references, n).iter().enumerate();
                places.try_for_each(|(place, reference)| {
                    *values.add(place) = i.unit.get(*reference)? as $type;
                    Ok(())
                })
            })
        }
        $set(i: *mut Instance, references: *const c_uint, n: usize, values: *const $type) -> c_int {
            with(i, |i| {
                let mut pairs = array(references, n).iter().zip(array(values, n));
                pairs.try_for_each(|(reference, value)| i.unit.set(*reference, f64::from(*value)))
            })
        }
    })+};
}
values! {
    fmi2GetReal fmi2SetReal f64;
    fmi2GetInteger fmi2SetInteger c_int;
}

/// Declares functions of abilities that the description does not claim.
macro_rules! absent {
    ($($name:ident)+) => {$(
        /// Refused: the description does not claim this ability.
        #[unsafe(no_mangle)]
        pub extern "C" fn $name() -> c_int { ERROR }
    )+};
}
absent! {
    fmi2GetBoolean fmi2SetBoolean fmi2SerializedFMUstateSize fmi2SerializeFMUstate fmi2DeSerializeFMUstate fmi2GetDirectionalDerivative fmi2CancelStep
    fmi2SetRealInputDerivatives fmi2GetRealOutputDerivatives
    fmi2GetStatus fmi2GetRealStatus fmi2GetIntegerStatus fmi2GetBooleanStatus fmi2GetStringStatus
}
