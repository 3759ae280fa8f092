//! Figures as SVG, drawn by plotters.

use std::ops::Range;

use plotters::coord::Shift;
use plotters::coord::ranged1d::{AsRangedCoord, Ranged, ValueFormatter};
use plotters::element::DashedPathElement;
use plotters::prelude::*;

use super::envelope::envelope;
use crate::error::Error;
use crate::outcome::{Figure, Panel, Series, Style};

/// Drawing units per pixel of the page. plotters draws in whole units: finer ones keep curves smooth.
const SCALE: i32 = 4;
/// Width of a figure; plotters' areas are measured in drawing units.
const WIDTH: i32 = 760 * SCALE;
/// Height of a plot area; twice that where both axes have the same scale.
const HEIGHT: i32 = 190 * SCALE;
/// Space left of a plot area, for the labels of the vertical axis, and right of it.
const LEFT: i32 = 72 * SCALE;
const RIGHT: i32 = 20 * SCALE;
/// Space below a plot area: with the labels of the horizontal axis, and without.
const LABELS: i32 = 46 * SCALE;
const GAP: i32 = 6 * SCALE;
/// Space above a plot area, and the height of a row of the legend above it.
const ABOVE: i32 = 8 * SCALE;
const LEGEND_ROW: i32 = 20 * SCALE;

/// Colours that can be told apart with any colour vision (Okabe and Ito).
const PALETTE: [RGBColor; 7] = [
    RGBColor(0, 114, 178),
    RGBColor(213, 94, 0),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(230, 159, 0),
    RGBColor(86, 180, 233),
    RGBColor(0, 0, 0),
];
const INK: RGBColor = RGBColor(51, 51, 51);
const GREY: RGBColor = RGBColor(120, 120, 120);
const GRID: RGBColor = RGBColor(230, 230, 230);

type Failure = Box<dyn std::error::Error>;
type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;

/// The figure as one `<svg>` element, which grows and shrinks with the page.
///
/// # Errors
/// [`Error::Internal`] with the figure's name when plotters fails.
pub fn svg(figure: &Figure) -> Result<String, Error> {
    draw(figure).map_err(|e| Error::Internal(format!("figure `{}`: {e}", figure.name)))
}

fn draw(figure: &Figure) -> Result<String, Failure> {
    let panels: Vec<&Panel> = figure.panels.iter().collect();
    let alike = |a: &Panel, b: &Panel| {
        (&a.x_label, a.log_x) == (&b.x_label, b.log_x) && !a.equal_axes && !b.equal_axes
    };
    let shared = panels.windows(2).all(|pair| alike(pair[0], pair[1]));
    let labelled = |k: usize| !shared || k + 1 == panels.len();
    // A legend is not repeated below one that says the same.
    let legend = |k: usize| match legend(panels[k]) {
        same if shared && k > 0 && same == self::legend(panels[k - 1]) => Vec::new(),
        entries => entries,
    };
    let parts: Vec<[i32; 2]> = (0..panels.len())
        .map(|k| {
            let plot = if panels[k].equal_axes { 2 * HEIGHT } else { HEIGHT };
            let below = if labelled(k) { LABELS } else { GAP };
            [legend_height(&legend(k)), ABOVE + plot + below]
        })
        .collect();
    let height: i32 = parts.iter().flatten().sum();
    let mut text = String::new();
    {
        let size = (WIDTH as u32, height as u32);
        let mut rest = SVGBackend::with_string(&mut text, size).into_drawing_area();
        for (k, [above, below]) in parts.into_iter().enumerate() {
            let (area, remaining) = rest.split_vertically(above);
            draw_legend(&area, &legend(k))?;
            let (area, remaining) = remaining.split_vertically(below);
            rest = remaining;
            let sharing = if shared { &panels[..] } else { &panels[k..=k] };
            let (x, y) = ranges(panels[k], sharing);
            if panels[k].log_x {
                draw_panel(&area, panels[k], x.log_scale(), y, labelled(k))?;
            } else {
                draw_panel(&area, panels[k], x, y, labelled(k))?;
            }
        }
        rest.present()?;
    }
    // The page decides how large the figure is; the view box keeps its shape. White behind it, so
    // that the file can be shown alone on a dark page.
    let size = format!("width=\"{WIDTH}\" height=\"{height}\" ");
    Ok(text.replacen(&size, "style=\"background:#fff\" ", 1))
}

/// The ranges of the two axes of a panel; that of the horizontal one covers all panels that share it.
fn ranges(panel: &Panel, sharing: &[&Panel]) -> (Range<f64>, Range<f64>) {
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
            0.5 * (y.end - y.start) * f64::from(WIDTH - LEFT - RIGHT) / f64::from(2 * HEIGHT);
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

/// The axes of a panel and its series.
fn draw_panel<X>(
    area: &Area<'_>,
    panel: &Panel,
    x: X,
    y: Range<f64>,
    labelled: bool,
) -> Result<(), Failure>
where
    X: AsRangedCoord<Value = f64>,
    X::CoordDescType: Ranged<ValueType = f64> + ValueFormatter<f64>,
{
    let mut chart = ChartBuilder::on(area)
        .margin_top(ABOVE)
        .margin_left(GAP)
        .margin_right(RIGHT)
        .set_label_area_size(LabelAreaPosition::Left, LEFT - GAP)
        .set_label_area_size(LabelAreaPosition::Bottom, if labelled { LABELS } else { GAP })
        .build_cartesian_2d(x, y)?;
    let unlabelled = |_: &f64| String::new();
    let mut mesh = chart.configure_mesh();
    mesh.label_style(font(12)).axis_desc_style(font(13)).axis_style(pen(GREY, SCALE));
    mesh.bold_line_style(pen(GRID, SCALE)).light_line_style(TRANSPARENT);
    mesh.x_labels(10).y_labels(7).y_desc(&panel.y_label).y_label_formatter(&number);
    mesh.set_all_tick_mark_size(3 * SCALE);
    if labelled {
        mesh.x_desc(&panel.x_label).x_label_formatter(&number);
    } else {
        mesh.x_label_formatter(&unlabelled);
    }
    mesh.draw()?;
    for (place, series) in places(panel) {
        let pen = pen_of(series.style, place);
        for part in series.points.split(|p| !is_drawn(panel, *p)) {
            if series.style == Style::Points {
                chart.draw_series(part.iter().map(|p| Circle::new(*p, MARKER, pen)))?;
                continue;
            }
            let line = envelope(part, (WIDTH / SCALE) as usize);
            match dash(series.style) {
                None => chart.plotting_area().draw(&PathElement::new(line, pen))?,
                Some(dash) => chart.plotting_area().draw(&DashedPathElement::new(
                    line,
                    dash,
                    4 * SCALE,
                    pen,
                ))?,
            }
        }
    }
    Ok(())
}

/// A label of an axis, with at most six decimals.
fn number(value: &f64) -> String {
    let text = format!("{:.6}", value + 0.0);
    text.trim_end_matches('0').trim_end_matches('.').replace('-', "\u{2212}")
}

fn font(size: i32) -> TextStyle<'static> {
    ("sans-serif", size * SCALE).into_font().color(&INK)
}

fn pen(colour: RGBColor, width: i32) -> ShapeStyle {
    colour.stroke_width(width as u32)
}

fn pen_of(style: Style, place: usize) -> ShapeStyle {
    match style {
        Style::Line | Style::Points => pen(PALETTE[place % PALETTE.len()], 2 * SCALE),
        Style::Reference => pen(INK, SCALE),
        Style::Limit => pen(GREY, SCALE),
    }
}

/// Length of the dashes of a dashed line.
fn dash(style: Style) -> Option<i32> {
    match style {
        Style::Line | Style::Points => None,
        Style::Reference => Some(7 * SCALE),
        Style::Limit => Some(3 * SCALE),
    }
}

/// Radius of a marker.
const MARKER: i32 = 7 * SCALE / 2;

/// The series with their places in the palette.
fn places(panel: &Panel) -> impl Iterator<Item = (usize, &Series)> {
    let mut next = 0;
    panel.series.iter().map(move |series| {
        let coloured = matches!(series.style, Style::Line | Style::Points);
        next += usize::from(coloured && !series.like_previous);
        (usize::saturating_sub(next, 1), series)
    })
}

/// The named series: name, style and place in the palette.
fn legend(panel: &Panel) -> Vec<(&str, Style, usize)> {
    let named = places(panel).filter(|(_, series)| !series.name.is_empty());
    named.map(|(place, series)| (series.name.as_str(), series.style, place)).collect()
}

/// Columns of a legend; generous, because the reader's fonts are not known.
fn legend_columns(entries: &[(&str, Style, usize)]) -> usize {
    let longest = entries.iter().map(|entry| entry.0.chars().count()).max().unwrap_or(0) as i32;
    ((WIDTH - LEFT - RIGHT) / ((50 + 7 * longest) * SCALE)).max(1) as usize
}

fn legend_height(entries: &[(&str, Style, usize)]) -> i32 {
    LEGEND_ROW * entries.len().div_ceil(legend_columns(entries)) as i32
}

/// The legend in rows above its plot, where it hides nothing; plotters' own lies in the plot.
fn draw_legend(area: &Area<'_>, entries: &[(&str, Style, usize)]) -> Result<(), Failure> {
    let columns = legend_columns(entries);
    let cells =
        area.margin(0, 0, LEFT, RIGHT).split_evenly((entries.len().div_ceil(columns), columns));
    for (cell, &(name, style, place)) in cells.iter().zip(entries) {
        let (pen, middle) = (pen_of(style, place), LEGEND_ROW / 2);
        let sample = vec![(0, middle), (26 * SCALE, middle)];
        match (style, dash(style)) {
            (Style::Points, _) => cell.draw(&Circle::new((13 * SCALE, middle), MARKER, pen))?,
            (_, None) => cell.draw(&PathElement::new(sample, pen))?,
            (_, Some(dash)) => {
                cell.draw(&DashedPathElement::new(sample, dash, 4 * SCALE, pen))?;
            }
        }
        cell.draw(&Text::new(name.to_owned(), (32 * SCALE, middle - 6 * SCALE), font(12)))?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn svg_of(panels: impl IntoIterator<Item = Panel>) -> String {
        let figure = Figure { panels: panels.into_iter().collect(), ..Figure::new("f", "", "") };
        svg(&figure).unwrap()
    }

    /// The texts of a figure, as they are drawn.
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
        let svg = svg_of([Panel::new("frequency (Hz)", "gain").log_x().with(line)]);
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
        // The range covers the points that one of them does not show.
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
}
