//! Legend and names of events, above the plot where they hide nothing; plotters' own legend lies in the plot.

use std::ops::Range;

use plotters::element::DashedPathElement;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

use super::colours::{self, MARKER, dash, pen, pen_of};
use super::{Area, Failure, LEFT, RIGHT, SCALE, TEXT_PX, font};
use crate::outcome::{Panel, Series, Style};
use crate::report::prose::signs;

/// Height of a row of the legend.
const LEGEND_ROW: i32 = 20 * SCALE;
/// Height of a row of events.
const EVENT_ROW: i32 = 15 * SCALE;

/// Returns the series with their places in the palette.
pub fn places(panel: &Panel) -> impl Iterator<Item = (usize, &Series)> {
    let mut next = 0;
    panel.series.iter().map(move |series| {
        next += usize::from(dash(series.style).is_none() && !series.like_previous);
        (usize::saturating_sub(next, 1), series)
    })
}

/// An entry of a legend: name, style and place in the palette.
pub type Entry<'a> = (&'a str, Style, usize);

/// Returns the named series.
pub fn legend(panel: &Panel) -> Vec<Entry<'_>> {
    let named = places(panel).filter(|(_, series)| !series.name.is_empty());
    named.map(|(place, series)| (series.name.as_str(), series.style, place)).collect()
}

/// Number of columns of a legend; it is cautious, because the reader's fonts are not known.
fn legend_columns(entries: &[Entry<'_>], width: i32) -> usize {
    let longest = entries.iter().map(|entry| entry.0.chars().count()).max().unwrap_or(0) as i32;
    ((width - LEFT - RIGHT) / ((50 + 7 * longest) * SCALE)).max(1) as usize
}

pub fn legend_height(entries: &[Entry<'_>], width: i32) -> i32 {
    LEGEND_ROW * entries.len().div_ceil(legend_columns(entries, width)) as i32
}

/// Draws the legend in rows.
pub fn draw_legend(area: &Area<'_>, entries: &[Entry<'_>], width: i32) -> Result<(), Failure> {
    let columns = legend_columns(entries, width);
    let cells =
        area.margin(0, 0, LEFT, RIGHT).split_evenly((entries.len().div_ceil(columns), columns));
    for (cell, &(name, style, place)) in cells.iter().zip(entries) {
        let (pen, middle) = (pen_of(style, place), LEGEND_ROW / 2);
        let sample = vec![(0, middle), (26 * SCALE, middle)];
        match (style, dash(style)) {
            (Style::Points, _) => cell.draw(&Circle::new((13 * SCALE, middle), MARKER, pen))?,
            (_, None) => cell.draw(&PathElement::new(sample, pen))?,
            (_, Some(dash)) => {
                cell.draw(&DashedPathElement::new(sample, dash, dash, pen))?;
            }
        }
        cell.draw(&Text::new(signs(name), (32 * SCALE, middle - 6 * SCALE), font(TEXT_PX)))?;
    }
    Ok(())
}

/// The name of an event and its place above the plot.
pub struct Label<'a> {
    text: &'a str,
    x: i32,
    row: i32,
    /// Whether the text ends at its x, because there is no space to its right.
    ends: bool,
}

/// Places the events within a range of the horizontal axis, each in the first row where it hides no other name.
pub fn labels<'a>(events: &'a [(f64, String)], range: &Range<f64>, page: i32) -> Vec<Label<'a>> {
    let mut events: Vec<_> =
        events.iter().filter(|(x, _)| (range.start..=range.end).contains(x)).collect();
    events.sort_by(|a, b| a.0.total_cmp(&b.0));
    // Right end of the last name of each row.
    let mut rows: Vec<i32> = Vec::new();
    let mut labels = Vec::new();
    for (x, text) in events {
        let share = (x - range.start) / (range.end - range.start);
        let x = LEFT + (share * f64::from(page - LEFT - RIGHT)) as i32;
        let width = (7 * text.chars().count() as i32 + 8) * SCALE;
        let ends = x + width > page;
        let (from, to) = if ends { (x - width, x) } else { (x, x + width) };
        let row = rows.iter().position(|end| *end <= from).unwrap_or(rows.len());
        if row == rows.len() {
            rows.push(to);
        }
        rows[row] = to;
        labels.push(Label { text, x, row: row as i32, ends });
    }
    labels
}

pub fn labels_height(labels: &[Label<'_>]) -> i32 {
    EVENT_ROW * labels.iter().map(|label| label.row + 1).max().unwrap_or(0)
}

/// Draws the names of the events, each with a line down to the plot.
pub fn draw_labels(area: &Area<'_>, labels: &[Label<'_>]) -> Result<(), Failure> {
    let bottom = labels_height(labels);
    for Label { text, x, row, ends } in labels {
        let top = row * EVENT_ROW + 2 * SCALE;
        area.draw(&PathElement::new([(*x, top), (*x, bottom)], pen(colours::GREY, SCALE)))?;
        let (side, gap) = if *ends { (HPos::Right, -3 * SCALE) } else { (HPos::Left, 3 * SCALE) };
        let font = font(TEXT_PX - 1.0).pos(Pos::new(side, VPos::Top));
        area.draw(&Text::new(signs(text), (x + gap, top), font))?;
    }
    Ok(())
}
