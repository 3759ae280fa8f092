//! Figures as SVG.

use plotters::coord::Shift;
use plotters::element::{DashedPathElement, Drawable, PointCollection};
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};
use plotters::style::{FontTransform, IntoTextStyle};

use super::layout::{self, Frame, LEFT, LEGEND, RIGHT, WIDTH};
use super::line::{clip, envelope};
use crate::error::Error;
use crate::outcome::{Figure, Series, Style};

/// The drawing library works in whole pixels: drawing this much larger keeps curves smooth.
const SCALE: f64 = 4.0;

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
type Pixel = (i32, i32);

/// The figure as one `<svg>` element, which grows and shrinks with the page.
pub fn svg(figure: &Figure) -> Result<String, Error> {
    draw(figure).map_err(|e| Error::Internal(format!("figure `{}`: {e}", figure.name)))
}

fn draw(figure: &Figure) -> Result<String, Failure> {
    let (frames, height) = layout::frames(figure);
    let (width, height) = (scaled(WIDTH), scaled(height));
    let mut text = String::new();
    {
        let size = (width as u32, height as u32);
        let canvas = Canvas(SVGBackend::with_string(&mut text, size).into_drawing_area());
        for frame in &frames {
            canvas.axes(frame)?;
            canvas.series(frame)?;
            canvas.legend(frame)?;
        }
        canvas.0.present()?;
    }
    // The page decides how large the figure is; the view box keeps its shape. White behind it, so
    // that the file can be shown alone on a dark page.
    let size = format!("width=\"{width}\" height=\"{height}\" ");
    Ok(text.replacen(&size, "style=\"background:#fff\" ", 1))
}

fn scaled(pixels: f64) -> i32 {
    (pixels * SCALE).round() as i32
}

fn at(point: (f64, f64)) -> Pixel {
    (scaled(point.0), scaled(point.1))
}

fn pen(colour: RGBColor, width: f64) -> ShapeStyle {
    colour.stroke_width(scaled(width) as u32)
}

fn pen_of(series: &Series, place: usize) -> ShapeStyle {
    match series.style {
        Style::Line | Style::Points => pen(PALETTE[place % PALETTE.len()], 2.0),
        Style::Reference => pen(INK, 1.1),
        Style::Limit => pen(GREY, 1.0),
    }
}

struct Canvas<'a>(DrawingArea<SVGBackend<'a>, Shift>);

impl Canvas<'_> {
    fn draw<E>(&self, element: &E) -> Result<(), Failure>
    where
        for<'b> &'b E: PointCollection<'b, Pixel>,
        for<'b> E: Drawable<SVGBackend<'b>>,
    {
        Ok(self.0.draw(element)?)
    }

    fn text(&self, text: &str, size: f64, place: Pos, at: Pixel) -> Result<(), Failure> {
        let style = ("sans-serif", size * SCALE).into_text_style(&self.0).color(&INK).pos(place);
        Ok(self.0.draw_text(text, &style, at)?)
    }

    fn axes(&self, frame: &Frame<'_>) -> Result<(), Failure> {
        let (top, bottom) = (frame.top, frame.bottom);
        for (x, text) in &frame.x.ticks {
            let x = frame.pixel((*x, 0.0)).0;
            self.draw(&PathElement::new([at((x, top)), at((x, bottom))], pen(GRID, 1.0)))?;
            if frame.labelled {
                let below = Pos::new(HPos::Center, VPos::Top);
                self.text(text, 12.0, below, at((x, bottom + 7.0)))?;
            }
        }
        for (y, text) in &frame.y.ticks {
            let y = frame.pixel((0.0, *y)).1;
            self.draw(&PathElement::new([at((LEFT, y)), at((RIGHT, y))], pen(GRID, 1.0)))?;
            self.text(text, 12.0, Pos::new(HPos::Right, VPos::Center), at((LEFT - 7.0, y)))?;
        }
        let corners = [at((LEFT, top)), at((RIGHT, bottom))];
        self.draw(&Rectangle::new(corners, pen(GREY, 1.0)))?;

        let upwards = ("sans-serif", 13.0 * SCALE)
            .into_text_style(&self.0)
            .color(&INK)
            .transform(FontTransform::Rotate270)
            .pos(Pos::new(HPos::Center, VPos::Center));
        self.0.draw_text(&frame.panel.y_label, &upwards, at((16.0, 0.5 * (top + bottom))))?;
        if frame.labelled {
            let middle = at((0.5 * (LEFT + RIGHT), bottom + 26.0));
            self.text(&frame.panel.x_label, 13.0, Pos::new(HPos::Center, VPos::Top), middle)?;
        }
        Ok(())
    }

    fn series(&self, frame: &Frame<'_>) -> Result<(), Failure> {
        for (place, series) in layout::places(frame.panel) {
            let pen = pen_of(series, place);
            let mut points = series.points.clone();
            if frame.panel.log_x {
                points.retain(|p| p.0 > 0.0);
                points.iter_mut().for_each(|p| p.0 = p.0.log10());
            }
            if series.style == Style::Points {
                for &point in points.iter().filter(|p| (frame.y.low..=frame.y.high).contains(&p.1))
                {
                    self.draw(&Circle::new(at(frame.pixel(point)), scaled(3.5), pen))?;
                }
                continue;
            }
            for part in clip(&points, frame.y.low, frame.y.high) {
                let part = envelope(&part, (RIGHT - LEFT) as usize);
                let pixels = part.into_iter().map(|point| at(frame.pixel(point))).collect();
                self.line(pixels, series.style, pen)?;
            }
        }
        Ok(())
    }

    fn line(&self, pixels: Vec<Pixel>, style: Style, pen: ShapeStyle) -> Result<(), Failure> {
        let dash = match style {
            Style::Line | Style::Points => return self.draw(&PathElement::new(pixels, pen)),
            Style::Reference => 7.0,
            Style::Limit => 3.0,
        };
        let (dash, space) = (scaled(dash), scaled(4.0));
        self.draw(&DashedPathElement::new(pixels, dash, space, pen))
    }

    fn legend(&self, frame: &Frame<'_>) -> Result<(), Failure> {
        for (row, entries) in frame.legend.iter().enumerate() {
            let middle = frame.legend_top + LEGEND * (row as f64 + 0.45);
            let mut left = LEFT;
            for &(place, series) in entries {
                let pen = pen_of(series, place);
                if series.style == Style::Points {
                    self.draw(&Circle::new(at((left + 13.0, middle)), scaled(3.5), pen))?;
                } else {
                    let sample = vec![at((left, middle)), at((left + 26.0, middle))];
                    self.line(sample, series.style, pen)?;
                }
                let beside = Pos::new(HPos::Left, VPos::Center);
                self.text(&series.name, 12.5, beside, at((left + 32.0, middle)))?;
                left += layout::legend_width(series);
            }
        }
        Ok(())
    }
}
