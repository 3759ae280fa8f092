//! Figures as SVG, drawn by plotters.

mod above;
mod colours;

use std::ops::Range;

use plotters::coord::Shift;
use plotters::coord::ranged1d::{AsRangedCoord, Ranged, ValueFormatter};
use plotters::element::DashedPathElement;
use plotters::prelude::*;

use super::envelope::envelope;
use super::prose::{escape, signs};
use crate::error::Error;
use crate::outcome::{Figure, Panel, Series, Style};
use above::{Entry, Label, draw_labels, draw_legend, labels, labels_height, legend, legend_height};
pub use colours::STYLE;
use colours::{GREY, GRID, INK, MARKER, dash, pen, pen_of};

/// Drawing units per pixel of the page. plotters draws in whole units, so finer ones keep curves smooth.
const SCALE: i32 = 4;
/// Width of a figure; plotters' areas are measured in drawing units.
const WIDE: i32 = 760 * SCALE;
/// Width of a figure for a narrow page.
const NARROW: i32 = 380 * SCALE;
/// Height of a plot area; twice this if both axes have the same scale.
const HEIGHT: i32 = 190 * SCALE;
/// Space left of a plot area, for the labels of the vertical axis, and right of it.
const LEFT: i32 = 72 * SCALE;
const RIGHT: i32 = 20 * SCALE;
/// Space below a plot area: with the labels of the horizontal axis, and without.
const LABELS: i32 = 43 * SCALE;
const GAP: i32 = 6 * SCALE;
/// Size of texts.
const TEXT_PX: f64 = 12.0;
/// Space above a plot area.
const ABOVE: i32 = 8 * SCALE;

type Failure = Box<dyn std::error::Error>;
type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;

/// Draws the figure as one `<svg>` element, which can be a file: white, or dark if the reader prefers that.
///
/// # Errors
/// [`Error::Internal`] with the figure's name if plotters fails.
pub fn svg(figure: &Figure) -> Result<String, Error> {
    let mut text = String::new();
    let (mut height, width) = (0, WIDE);
    for part in parts(figure, width)? {
        text.push_str(&format!("<g transform=\"translate(0 {height})\">\n{}</g>\n", part.text));
        height += part.height;
    }
    let style = format!("<style>\n{STYLE}</style>\n");
    Ok(Part { text: style + &text, height, width }.element("plot"))
}

/// Draws the panels of the figure as `<svg>` elements that lie below each other, so that a printed page can end between
/// them. Each is drawn twice, for a wide and for a narrow page. [`style`] belongs in the style of the page.
///
/// # Errors
/// As [`svg`].
pub fn panels(figure: &Figure) -> Result<Vec<String>, Error> {
    let mut all = Vec::new();
    for (width, class) in [(WIDE, "plot wide"), (NARROW, "plot narrow")] {
        all.extend(parts(figure, width)?.iter().map(|part| part.element(class)));
    }
    Ok(all)
}

/// Content of an `<svg>` element.
struct Part {
    text: String,
    height: i32,
    width: i32,
}

impl Part {
    /// Returns the element; the page sets its size, and the view box keeps its shape.
    fn element(&self, class: &str) -> String {
        let Self { text, height, width } = self;
        format!(
            "<svg class=\"{class}\" viewBox=\"0 0 {width} {height}\" xmlns=\"http://www.w3.org/2000/svg\">\n\
             {text}</svg>\n"
        )
    }
}

fn parts(figure: &Figure, width: i32) -> Result<Vec<Part>, Error> {
    draw(figure, width).map_err(|e| Error::Internal(format!("figure `{}`: {e}", figure.name)))
}

fn draw(figure: &Figure, width: i32) -> Result<Vec<Part>, Failure> {
    let panels: Vec<&Panel> = figure.panels.iter().collect();
    let alike = |a: &Panel, b: &Panel| {
        (&a.x_label, a.log_x) == (&b.x_label, b.log_x) && !a.equal_axes && !b.equal_axes
    };
    let shared = panels.windows(2).all(|pair| alike(pair[0], pair[1]));
    let has_events = shared && panels.iter().all(|panel| !panel.log_x);
    let events = if has_events { figure.events.as_slice() } else { &[] };
    let mut parts = Vec::new();
    for (k, panel) in panels.iter().enumerate() {
        let (x, y) = ranges(panel, if shared { &panels[..] } else { &panels[k..=k] }, width);
        // A legend is not repeated below an equal one.
        let repeats = shared && k > 0 && legend(panel) == legend(panels[k - 1]);
        let frame = Frame {
            width,
            legend: if repeats { Vec::new() } else { legend(panel) },
            labels: if k == 0 { labels(events, &x, width) } else { Vec::new() },
            events: events.iter().map(|event| event.0).filter(|at| x.contains(at)).collect(),
            has_x_labels: !shared || k + 1 == panels.len(),
            x,
            y,
        };
        parts.push(draw_part(panel, &frame)?);
    }
    Ok(parts)
}

/// The surroundings of a plot.
struct Frame<'a> {
    width: i32,
    legend: Vec<Entry<'a>>,
    labels: Vec<Label<'a>>,
    events: Vec<f64>,
    has_x_labels: bool,
    /// Ranges of the axes.
    x: Range<f64>,
    y: Range<f64>,
}

/// Draws a panel with its legend and the names of the events.
fn draw_part(panel: &Panel, frame: &Frame<'_>) -> Result<Part, Failure> {
    let plot = if panel.equal_axes { 2 * HEIGHT } else { HEIGHT };
    let below = if frame.has_x_labels { LABELS } else { GAP };
    let width = frame.width;
    let (legend, labels) = (legend_height(&frame.legend, width), labels_height(&frame.labels));
    // The lines of the events continue into the plot.
    let above = if frame.labels.is_empty() { ABOVE } else { 0 };
    let height = legend + labels + above + plot + below;
    let mut text = String::new();
    {
        let size = (width as u32, height as u32);
        let area = SVGBackend::with_string(&mut text, size).into_drawing_area();
        let (top, rest) = area.split_vertically(legend);
        draw_legend(&top, &frame.legend, width)?;
        let (top, rest) = rest.split_vertically(labels);
        draw_labels(&top, &frame.labels)?;
        let mut chart = ChartBuilder::on(&rest);
        chart
            .margin_top(above)
            .margin_left(GAP)
            .margin_right(RIGHT)
            .set_label_area_size(LabelAreaPosition::Left, LEFT - GAP)
            .set_label_area_size(LabelAreaPosition::Bottom, below);
        if panel.log_x {
            draw_plot(&mut chart, panel, frame, frame.x.clone().log_scale())?;
        } else {
            draw_plot(&mut chart, panel, frame, frame.x.clone())?;
        }
        area.present()?;
    }
    // Only the content of plotters' element.
    let inside = text.split_once(">\n").and_then(|(_, text)| text.rsplit_once("</svg>"));
    Ok(Part { text: titled(inside.map_or("", |(text, _)| text), panel, frame), height, width })
}

/// Adds the value of each mark to the drawing as its title.
fn titled(drawing: &str, panel: &Panel, frame: &Frame<'_>) -> String {
    let marks = || panel.series.iter().filter(|series| series.style == Style::Points);
    let keys = frame.legend.iter().filter(|entry| entry.1 == Style::Points);
    let of = |series: &Series| -> Vec<String> {
        let drawn = series.points.iter().filter(|point| is_drawn(panel, **point));
        drawn.map(|(x, y)| format!("{}: {}, {}", series.name, number(x), number(y))).collect()
    };
    let mut titles = keys.map(|entry| entry.0.to_owned()).chain(marks().flat_map(of));
    let mut parts = drawing.split("<circle ");
    let mut text = parts.next().unwrap_or_default().to_owned();
    for part in parts {
        let title = escape(&titles.next().unwrap_or_default());
        let titled = part.replacen("/>", &format!("><title>{title}</title></circle>"), 1);
        text += &format!("<circle {titled}");
    }
    text
}

/// Returns the ranges of the two axes of a panel; the horizontal one covers all panels that share it.
fn ranges(panel: &Panel, sharing: &[&Panel], width: i32) -> (Range<f64>, Range<f64>) {
    let range = |panels: &[&Panel], coordinate: fn((f64, f64)) -> f64, air: f64| {
        let points = panels.iter().flat_map(|panel| &panel.series).flat_map(|s| &s.points);
        let (low, high) = points
            .filter(|p| is_on_axes(panel, **p))
            .map(|p| coordinate(*p))
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| (low.min(v), high.max(v)));
        match high - low {
            none if none < 0.0 => 0.0..1.0,
            little if little < 1e-9 * high.abs().max(1e-6) => {
                low - 0.5 * low.abs().max(1e-3)..high + 0.5 * high.abs().max(1e-3)
            }
            extent => low - air * extent..high + air * extent,
        }
    };
    let x = range(sharing, |p| p.0, 0.0);
    let y = panel.y_range.map_or_else(|| range(&[panel], |p| p.1, 0.04), |(low, high)| low..high);
    if panel.equal_axes {
        let half =
            0.5 * (y.end - y.start) * f64::from(width - LEFT - RIGHT) / f64::from(2 * HEIGHT);
        let middle = 0.5 * (x.start + x.end);
        return (middle - half..middle + half, y);
    }
    (x, y)
}

/// Whether the axes of a panel can show a point.
fn is_on_axes(panel: &Panel, (x, y): (f64, f64)) -> bool {
    x.is_finite() && y.is_finite() && (!panel.log_x || x > 0.0)
}

/// Whether a point is also within the range of the vertical axis.
fn is_drawn(panel: &Panel, point: (f64, f64)) -> bool {
    let inside = panel.y_range.is_none_or(|(low, high)| (low..=high).contains(&point.1));
    is_on_axes(panel, point) && inside
}

/// Draws the axes of a panel, the events and the series.
fn draw_plot<X>(
    chart: &mut ChartBuilder<'_, '_, SVGBackend<'_>>,
    panel: &Panel,
    frame: &Frame<'_>,
    x: X,
) -> Result<(), Failure>
where
    X: AsRangedCoord<Value = f64>,
    X::CoordDescType: Ranged<ValueType = f64> + ValueFormatter<f64>,
{
    let y = &frame.y;
    let mut chart = chart.build_cartesian_2d(x, y.clone())?;
    let unlabelled = |_: &f64| String::new();
    let mut mesh = chart.configure_mesh();
    mesh.label_style(font(TEXT_PX)).axis_style(pen(GREY, SCALE));
    mesh.bold_line_style(pen(GRID, SCALE)).light_line_style(TRANSPARENT);
    mesh.x_labels(if frame.width == WIDE { 10 } else { 5 });
    mesh.y_labels(if panel.switch { 2 } else { 7 });
    mesh.y_desc(signs(&panel.y_label)).y_label_formatter(&number);
    mesh.axis_desc_style(font_beside(&panel.y_label));
    mesh.set_all_tick_mark_size(3 * SCALE);
    if frame.has_x_labels {
        mesh.x_desc(signs(&panel.x_label)).x_label_formatter(&number);
    } else {
        mesh.x_label_formatter(&unlabelled);
    }
    mesh.draw()?;
    let area = chart.plotting_area();
    let dashed = |line, dash, pen| DashedPathElement::new(line, dash, dash, pen);
    for &x in &frame.events {
        area.draw(&dashed(vec![(x, y.start), (x, y.end)], 2 * SCALE, pen(GREY, SCALE)))?;
    }
    // References and limits lie above the curves.
    let (above, below): (Vec<_>, Vec<_>) =
        above::places(panel).partition(|(_, series)| dash(series.style).is_some());
    let has_reference = above.iter().any(|(_, series)| series.style == Style::Reference);
    for (place, series) in below.into_iter().chain(above) {
        let mut pen = pen_of(series.style, place);
        if has_reference && series.style == Style::Line {
            // The reference must stay visible on it.
            pen.color = pen.color.mix(0.6);
        }
        for part in series.points.split(|p| !is_drawn(panel, *p)) {
            if series.style == Style::Points {
                chart.draw_series(part.iter().map(|p| Circle::new(*p, MARKER, pen)))?;
                continue;
            }
            let line = envelope(part, (frame.width / SCALE) as usize);
            match dash(series.style) {
                None => chart.plotting_area().draw(&PathElement::new(line, pen))?,
                Some(dash) => chart.plotting_area().draw(&dashed(line, dash, pen))?,
            }
        }
    }
    Ok(())
}

/// Returns a label of an axis, with at most six decimals.
fn number(value: &f64) -> String {
    let text = format!("{value:.6}");
    match text.trim_end_matches('0').trim_end_matches('.') {
        "-0" => "0".to_owned(),
        number => signs(number),
    }
}

/// Returns a font of this size in pixels; plotters writes its sizes divided by 1.24.
fn font(size: f64) -> TextStyle<'static> {
    ("sans-serif", 1.24 * size * f64::from(SCALE)).into_font().color(&INK)
}

/// Returns the font of a label beside a plot; it is smaller if a long text has no space otherwise.
fn font_beside(text: &str) -> TextStyle<'static> {
    const ROOM_PX: f64 = 204.0;
    const WIDTH_OF_LETTER: f64 = 0.6;
    font((ROOM_PX / (WIDTH_OF_LETTER * text.chars().count() as f64)).min(TEXT_PX))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn svg_of(panels: impl IntoIterator<Item = Panel>) -> String {
        let figure = Figure { panels: panels.into_iter().collect(), ..Figure::new("f", "", "") };
        svg(&figure).unwrap()
    }

    /// Returns the texts of a figure, as they are drawn.
    fn texts(svg: &str) -> Vec<&str> {
        svg.split("</text>").filter_map(|part| part.trim_end().rsplit('\n').next()).collect()
    }

    #[test]
    fn no_data_and_constant_data_still_give_labelled_axes() {
        for points in
            [vec![], vec![(3.0, 3.0)], vec![(0.0, 0.0), (1.0, 0.0)], vec![(f64::NAN, 1.0)]]
        {
            let svg = svg_of([Panel::new("time (s)", "y").with(Series::line("line", points))]);
            let texts = texts(&svg);
            assert!(texts.len() > 8, "{texts:?}");
            assert!(texts.contains(&"time (s)") && texts.contains(&"line"), "{texts:?}");
        }
    }

    #[test]
    fn logarithmic_axes_show_decades() {
        let line = Series::line("", vec![(0.0, 1.0), (1.0, 1.0), (1000.0, 2.0)]);
        let svg =
            svg_of([Panel { log_x: true, ..Panel::new("frequency (Hz)", "gain").with(line) }]);
        let texts = texts(&svg);
        for decade in ["1", "10", "100", "1000"] {
            assert!(texts.contains(&decade), "{texts:?}");
        }
    }

    #[test]
    fn panels_that_share_axis_and_legend_show_them_once() {
        let panel = |y: f64| {
            Panel::new("time (s)", "y").with(Series::line("a", vec![(0.0, y), (1.0, 2.0)]))
        };
        let svg = svg_of([panel(0.0), panel(1.0)]);
        let count = |wanted| texts(&svg).iter().filter(|text| **text == wanted).count();
        assert_eq!((count("time (s)"), count("a"), count("y")), (1, 1, 2));
        // The range covers the points that one of the panels does not show.
        let limited = Panel::new("time (s)", "z").y_range(0.0, 1.0);
        let limited = limited.with(Series::line("a", vec![(0.0, 0.5), (80.0, 0.5), (90.0, 3.0)]));
        let svg = svg_of([panel(0.0), limited]);
        assert!(texts(&svg).contains(&"90"), "{:?}", texts(&svg));
    }

    #[test]
    fn points_outside_the_axes_are_left_out() {
        let panel =
            |y| Panel::new("x", "y").y_range(0.0, 1.0).with(Series::points("", vec![(0.0, y)]));
        assert_eq!(svg_of([panel(0.5)]).matches("<circle").count(), 1);
        assert_eq!(svg_of([panel(1.5)]).matches("<circle").count(), 0);
        let line = vec![(0.0, 0.1), (1.0, 0.2), (2.0, 5.0), (3.0, 0.2), (4.0, 0.1)];
        let line = Panel::new("x", "y").y_range(0.0, 1.0).with(Series::line("", line));
        assert_eq!(svg_of([line]).matches("stroke-width=\"8\"").count(), 2);
    }

    #[test]
    fn events_are_named_once_and_marked_in_every_panel() {
        let line = || Series::line("", vec![(0.0, 0.0), (10.0, 1.0)]);
        let panel = || Panel::new("time (s)", "y").with(line());
        let mut figure = Figure::new("f", "", "").panel(panel()).panel(panel());
        let dashes = |figure: &Figure| {
            let parts = parts(figure, WIDE).unwrap();
            let parts = parts.iter().map(|part| &part.text);
            parts.map(|part| part.matches("stroke=\"#787878\"").count()).collect::<Vec<_>>()
        };
        let without = dashes(&figure);
        let events = [(2.0, "start"), (2.1, "load on"), (99.0, "outside")];
        figure = figure.events(events.map(|(x, text)| (x, text.into())));
        let svg = svg(&figure).unwrap();
        let texts = texts(&svg);
        assert_eq!(texts.iter().filter(|text| **text == "start").count(), 1);
        assert!(!texts.contains(&"outside"));
        assert!(dashes(&figure).iter().zip(without).all(|(with, without)| *with > without + 10));
        // Names that would hide each other are in different rows.
        let found = labels(&figure.events, &(0.0..10.0), WIDE);
        assert!(labels_height(&found) > labels_height(&found[..1]));
    }

    #[test]
    fn references_lie_above_the_curves_and_every_colour_has_one_for_the_dark() {
        let points = vec![(0.0, 0.0), (1.0, 1.0)];
        let panel = Panel::new("x", "y").with(Series::reference("", points.clone()));
        let svg = svg_of([panel.with(Series::line("", points))]);
        let curve = svg.find("stroke=\"#0072B2\" stroke-width").unwrap();
        assert!(svg.rfind("stroke=\"#333333\"").unwrap() > curve);
        for part in svg.split("=\"#").skip(1).filter(|part| part.is_char_boundary(6)) {
            assert!(STYLE.contains(&format!("stroke=\"#{}\"", &part[..6])), "{}", &part[..6]);
        }
    }
}
