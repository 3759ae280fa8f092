//! Figures, independent of how they are drawn.

use super::name;

/// A figure: panels above each other.
#[derive(Clone, Debug, Default)]
pub struct Figure {
    /// Short name, unique in the experiment, used in JSON: `step`, `bode`.
    pub name: String,
    /// Title.
    pub title: String,
    /// The part of the source that it reproduces: `Figure 38`.
    pub source: String,
    /// Panels from top to bottom; those with the same x label share the x axis.
    pub panels: Vec<Panel>,
    /// Events, each at its x and with a short text; shown where all panels share the x axis.
    pub events: Vec<(f64, String)>,
}

/// A series of a figure and its name for programs.
pub struct Curve<'a> {
    /// Unique in the figure, `snake_case` with the unit at the end: `torque_motor_nm`.
    pub name: String,
    /// The panel that it belongs to.
    pub panel: &'a Panel,
    /// Points of the series.
    pub series: &'a Series,
}

impl Figure {
    /// A figure without panels.
    pub fn new(
        name: impl Into<String>,
        title: impl Into<String>,
        source: impl Into<String>,
    ) -> Self {
        let (name, title, source) = (name.into(), title.into(), source.into());
        Self { name, title, source, ..Self::default() }
    }

    /// Adds a panel below.
    pub fn panel(mut self, panel: Panel) -> Self {
        self.panels.push(panel);
        self
    }

    /// Adds events.
    pub fn events(mut self, events: impl IntoIterator<Item = (f64, String)>) -> Self {
        self.events.extend(events);
        self
    }

    /// Returns all series of all panels, with their names.
    pub fn curves(&self) -> Vec<Curve<'_>> {
        let (mut taken, mut curves) = (Vec::new(), Vec::new());
        for panel in &self.panels {
            for series in &panel.series {
                let name = name::of_curve(&panel.y_label, &series.name);
                curves.push(Curve { name: name::unique(name, &mut taken), panel, series });
            }
        }
        curves
    }
}

/// One pair of axes.
#[derive(Clone, Debug, Default)]
pub struct Panel {
    /// Horizontal quantity and unit.
    pub x_label: String,
    /// Vertical quantity and unit.
    pub y_label: String,
    /// The series to draw.
    pub series: Vec<Series>,
    /// Logarithmic horizontal axis.
    pub log_x: bool,
    /// Range of the vertical axis; unset: the range of the data.
    pub y_range: Option<(f64, f64)>,
    /// Whether one unit has the same length on both axes.
    pub equal_axes: bool,
    /// Whether the values are 0 for off and 1 for on.
    pub switch: bool,
}

impl Panel {
    /// Makes empty axes.
    pub fn new(x_label: impl Into<String>, y_label: impl Into<String>) -> Self {
        Self { x_label: x_label.into(), y_label: y_label.into(), ..Self::default() }
    }

    /// Adds a series.
    pub fn with(mut self, series: Series) -> Self {
        self.series.push(series);
        self
    }

    /// Sets the range of the vertical axis.
    pub fn y_range(mut self, low: f64, high: f64) -> Self {
        self.y_range = Some((low, high));
        self
    }
}

/// How a series is drawn.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Style {
    /// A line in a colour of its own.
    #[default]
    Line,
    /// A thin dashed line in the colour of the text, above the others: a reference value or a prediction.
    Reference,
    /// A thin dashed grey line: a limit or a level to compare with.
    Limit,
    /// Markers in a colour of their own.
    Points,
}

/// Points that belong together.
#[derive(Clone, Debug, Default)]
pub struct Series {
    /// Name in the legend; unnamed series are not listed.
    pub name: String,
    /// Points; a point that is not finite interrupts the line.
    pub points: Vec<(f64, f64)>,
    /// How it is drawn.
    pub style: Style,
    /// Whether it has the colour of the previous series.
    pub like_previous: bool,
}

impl Series {
    fn new(name: impl Into<String>, points: Vec<(f64, f64)>, style: Style) -> Self {
        let name = name.into();
        Self { name, points, style, like_previous: false }
    }

    /// Makes a line.
    pub fn line(name: impl Into<String>, points: Vec<(f64, f64)>) -> Self {
        Self::new(name, points, Style::Line)
    }

    /// Makes a reference line.
    pub fn reference(name: impl Into<String>, points: Vec<(f64, f64)>) -> Self {
        Self::new(name, points, Style::Reference)
    }

    /// Makes a limit line.
    pub fn limit(name: impl Into<String>, points: Vec<(f64, f64)>) -> Self {
        Self::new(name, points, Style::Limit)
    }

    /// Makes markers.
    pub fn points(name: impl Into<String>, points: Vec<(f64, f64)>) -> Self {
        Self::new(name, points, Style::Points)
    }
}
