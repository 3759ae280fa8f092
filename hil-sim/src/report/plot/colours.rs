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

/// The colours that replace palette, ink, grey and grid in dark mode.
const DARK: [&str; 10] = [
    "#3d9be0", "#ff7f32", "#2fc79a", "#e39bc4", "#ffbf3f", "#a6dcff", "#ffffff", "#e6e6e6",
    "#9a9fa6", "#33373d",
];

/// Returns the style sheet of a figure: in dark mode it replaces the colours, which are attributes.
pub fn style() -> String {
    let light = PALETTE.into_iter().chain([INK, GREY, GRID]);
    let rules = light.zip(DARK).map(|(RGBColor(r, g, b), dark)| {
        let light = format!("#{r:02X}{g:02X}{b:02X}");
        format!("[stroke=\"{light}\"]{{stroke:{dark}}} [fill=\"{light}\"]{{fill:{dark}}}\n")
    });
    format!(
        ".plot{{background:#fff}}\n@media screen and (prefers-color-scheme:dark){{\n\
         .plot{{background:#16181c}}\n{}}}\n",
        rules.collect::<String>()
    )
}

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
