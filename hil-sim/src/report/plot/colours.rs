//! Colours of a figure on white paper and in the dark, and strokes.

use plotters::style::{Color as _, RGBColor, ShapeStyle};

use super::SCALE;
use crate::outcome::Style;

/// Colours that can be distinguished with any colour vision (Okabe and Ito).
#[rustfmt::skip] // colours, side by side
pub const PALETTE: [RGBColor; 7] = [
    RGBColor(0, 114, 178), RGBColor(213, 94, 0), RGBColor(0, 158, 115), RGBColor(204, 121, 167), RGBColor(230, 159, 0),
    RGBColor(86, 180, 233), RGBColor(0, 0, 0),
];
pub const INK: RGBColor = RGBColor(51, 51, 51);
pub const GREY: RGBColor = RGBColor(120, 120, 120);
pub const GRID: RGBColor = RGBColor(230, 230, 230);

/// Style sheet of a figure: in dark mode it replaces the colours above, which are attributes of the drawing.
pub const STYLE: &str = include_str!("../plot.css");

pub fn pen(colour: RGBColor, width: i32) -> ShapeStyle {
    colour.stroke_width(width as u32)
}

pub fn pen_of(style: Style, place: usize) -> ShapeStyle {
    match style {
        Style::Line | Style::Points => pen(PALETTE[place % PALETTE.len()], 2 * SCALE),
        Style::Reference => pen(INK, SCALE),
        Style::Limit => pen(GREY, SCALE),
    }
}

/// Returns the length of the dashes of a dashed line; a series without dashes has its own colour.
pub fn dash(style: Style) -> Option<i32> {
    match style {
        Style::Line | Style::Points => None,
        Style::Reference => Some(7 * SCALE),
        Style::Limit => Some(3 * SCALE),
    }
}

/// Radius of a marker.
pub const MARKER: i32 = 7 * SCALE / 2;
