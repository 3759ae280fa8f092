//! The bus left out of an image: the same names, without values and without work.

use crate::desk::Desk;
use crate::settings::own::settings;

settings! { [modules.bus] }

/// No port: there are no values of this type.
pub enum Usart {}

impl Usart {
    /// Leaves USART3 alone.
    pub fn new<U, W, N, R>(_: U, _: &W, _: &mut N, _: &mut R) -> Option<Self> {
        None
    }
}

/// Any port, since none is used.
pub trait Port {
    /// Does nothing.
    fn set_busy(&mut self, _: bool) {}
}
impl<T> Port for T {}

/// No bus.
#[derive(Default)]
pub struct Bus {}

impl Bus {
    /// Does nothing.
    pub fn serve<P, D>(&mut self, _: &mut P, _: &mut Desk, _: &mut D, _: u32) {}
    /// Does nothing.
    pub fn end_design(&mut self, _: &Desk) {}
}
