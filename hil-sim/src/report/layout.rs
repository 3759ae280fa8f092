//! Where the parts of a figure go.

use super::axis::Axis;
use crate::outcome::{Figure, Panel, Series, Style};

/// Width of a figure as it is meant to be seen, in pixels.
pub const WIDTH: f64 = 760.0;
/// Left end of the plot areas; tick labels and y labels are left of it.
pub const LEFT: f64 = 76.0;
/// Right end of the plot areas.
pub const RIGHT: f64 = 742.0;
/// Height of one row of a legend, above the plot area.
pub const LEGEND: f64 = 24.0;
/// Height of a plot area.
const HEIGHT: f64 = 190.0;
/// Tick labels and x label below a plot area.
const BELOW: f64 = 50.0;
/// Between panels that share the x axis.
const GAP: f64 = 10.0;

/// A panel with everything that has to be known before it is drawn.
pub struct Frame<'a> {
    /// What is drawn.
    pub panel: &'a Panel,
    /// Horizontal axis.
    pub x: Axis,
    /// Vertical axis.
    pub y: Axis,
    /// Top of the legend.
    pub legend_top: f64,
    /// Top of the plot area.
    pub top: f64,
    /// Bottom of the plot area.
    pub bottom: f64,
    /// Rows of the legend: the series and their places in the palette.
    pub legend: Vec<Vec<(usize, &'a Series)>>,
    /// Whether the x axis is labelled here, not by a panel below.
    pub labelled: bool,
}

impl Frame<'_> {
    /// From the units of the panel to pixels. The vertical ends stay inside the plot area.
    pub fn pixel(&self, point: (f64, f64)) -> (f64, f64) {
        let x = (point.0 - self.x.low) / (self.x.high - self.x.low);
        let y = (point.1 - self.y.low) / (self.y.high - self.y.low);
        (LEFT + x * (RIGHT - LEFT), self.bottom + y * (self.top - self.bottom))
    }
}

/// The panels of a figure with their places, and the height of the whole.
pub fn frames(figure: &Figure) -> (Vec<Frame<'_>>, f64) {
    let panels: Vec<&Panel> = figure.panels.iter().collect();
    let shared = panels.windows(2).all(|pair| {
        pair[0].x_label == pair[1].x_label
            && pair[0].log_x == pair[1].log_x
            && !pair[0].equal_axes
            && !pair[1].equal_axes
    });
    let mut top = 6.0;
    let mut frames = Vec::new();
    for (i, &panel) in panels.iter().enumerate() {
        let alone = &panels[i..=i];
        let (x, y) = axes(panel, if shared { &panels } else { alone });
        // A legend is not repeated below one that says the same.
        let repeated = i > 0 && shared && names(panel).eq(names(panels[i - 1]));
        let legend = if repeated { Vec::new() } else { legend(panel) };
        let labelled = !shared || i + 1 == panels.len();
        let legend_top = top;
        let plot_top = legend_top + LEGEND * legend.len() as f64;
        let bottom = plot_top + if panel.equal_axes { 2.0 * HEIGHT } else { HEIGHT };
        top = bottom + if labelled { BELOW } else { GAP };
        frames.push(Frame { panel, x, y, legend_top, top: plot_top, bottom, legend, labelled });
    }
    (frames, top)
}

fn axes(panel: &Panel, sharing: &[&Panel]) -> (Axis, Axis) {
    let (x_low, x_high) = range(sharing, panel.log_x, |p| p.0);
    let (y_low, y_high) = panel.y_range.unwrap_or_else(|| range(&[panel], panel.log_x, |p| p.1));
    if panel.equal_axes {
        let y = Axis::linear(y_low, y_high, 8, panel.y_range.is_some());
        let unit = (y.high - y.low) / (2.0 * HEIGHT);
        let (middle, half) = (0.5 * (x_low + x_high), 0.5 * unit * (RIGHT - LEFT));
        return (Axis::linear(middle - half, middle + half, 14, true), y);
    }
    let x = if panel.log_x {
        Axis::logarithmic(x_low, x_high)
    } else {
        linear(&panel.x_label)(x_low, x_high, 9, true)
    };
    (x, linear(&panel.y_label)(y_low, y_high, 5, panel.y_range.is_some()))
}

/// The linear axis for a quantity with this label.
fn linear(label: &str) -> fn(f64, f64, usize, bool) -> Axis {
    if label.contains("(°") { Axis::degrees } else { Axis::linear }
}

/// Smallest and largest coordinate of the points that can be drawn.
fn range(panels: &[&Panel], log_x: bool, coordinate: impl Fn(&(f64, f64)) -> f64) -> (f64, f64) {
    let points = panels.iter().flat_map(|panel| &panel.series).flat_map(|series| &series.points);
    points
        .filter(|p| p.0.is_finite() && p.1.is_finite() && (!log_x || p.0 > 0.0))
        .map(coordinate)
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)))
}

/// Width of a legend entry; generous, for the fonts of the reader are not known.
pub fn legend_width(series: &Series) -> f64 {
    50.0 + 7.2 * series.name.chars().count() as f64
}

/// The series with their places in the palette.
pub fn places(panel: &Panel) -> impl Iterator<Item = (usize, &Series)> {
    let mut next = 0;
    panel.series.iter().map(move |series| {
        let coloured = matches!(series.style, Style::Line | Style::Points);
        next += usize::from(coloured && !series.like_previous);
        (usize::saturating_sub(next, 1), series)
    })
}

/// What a legend says.
fn names(panel: &Panel) -> impl Iterator<Item = (&str, Style, usize)> {
    let named = places(panel).filter(|(_, series)| !series.name.is_empty());
    named.map(|(place, series)| (series.name.as_str(), series.style, place))
}

/// The named series, with their place in the palette, broken into rows.
fn legend(panel: &Panel) -> Vec<Vec<(usize, &Series)>> {
    let mut rows: Vec<Vec<(usize, &Series)>> = Vec::new();
    let mut left = f64::INFINITY;
    for (place, series) in places(panel) {
        if series.name.is_empty() {
            continue;
        }
        if left + legend_width(series) > RIGHT - LEFT {
            rows.push(Vec::new());
            left = 0.0;
        }
        left += legend_width(series);
        if let Some(row) = rows.last_mut() {
            row.push((place, series));
        }
    }
    rows
}
