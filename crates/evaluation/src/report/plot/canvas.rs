//! What all plots share: ranges, colours, and the canvas that they are drawn on.
use super::Axes;
use crate::error::{Error, Result};
use plotters::chart::{ChartBuilder, ChartContext};
use plotters::coord::types::RangedCoordf64;
use plotters::prelude::{Cartesian2d, DrawingArea, IntoDrawingArea, RGBColor, SVGBackend, TextStyle};
use plotters::style::{Color, IntoFont};
use std::ops::Range;

/// Width of plots in pixels, where they are as wide as they may be.
pub const WIDTH: u32 = 640;
/// Height of plots that need no other.
pub const HEIGHT: u32 = 360;

/// Stands for the colour of the page's text, which plotters has no name for; [`draw`] puts that in its place.
pub const INK: RGBColor = RGBColor(1, 2, 3);
const INK_IN_SVG: &str = "\"#010203\"";

/// Colours of series, in shades that can be seen on white and on black, and told apart without red and green
/// (after Okabe and Ito).
const COLOURS: [RGBColor; 6] = [
    RGBColor(0, 114, 178),
    RGBColor(213, 94, 0),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(210, 150, 0),
    RGBColor(110, 110, 200),
];

/// The drawing area of a plot.
pub type Area<'a> = DrawingArea<SVGBackend<'a>, plotters::coord::Shift>;
/// A chart with two linear axes.
pub type Chart<'a, 'b> = ChartContext<'a, SVGBackend<'b>, Cartesian2d<RangedCoordf64, RangedCoordf64>>;

/// The colour of a series.
pub fn colour(series: usize) -> RGBColor {
    COLOURS.get(series % COLOURS.len()).copied().unwrap_or(INK)
}

/// How text is written.
pub fn ink(size: u32) -> TextStyle<'static> {
    ("sans-serif", size).into_font().color(&INK)
}

/// Draws a plot.
pub fn draw(height: u32, paint: impl FnOnce(&Area<'_>) -> Result<()>) -> Result<String> {
    let mut svg = String::new();
    {
        let area = SVGBackend::with_string(&mut svg, (WIDTH, height)).into_drawing_area();
        paint(&area)?;
        area.present().map_err(failed)?;
    }
    Ok(svg.replace(INK_IN_SVG, "\"currentColor\""))
}

/// What drawing can say: only that a plot is too small for its parts.
pub fn failed(e: impl std::fmt::Display) -> Error {
    Error::Codec {
        codec: "SVG",
        reason: e.to_string(),
    }
}

/// The range of some values with a margin; from 0 to 1 without any.
pub fn range(values: impl Iterator<Item = f64>) -> Range<f64> {
    let finite = values.filter(|value| value.is_finite());
    let (low, high) = finite.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| {
        (low.min(value), high.max(value))
    });
    if low > high {
        return 0.0..1.0;
    }
    let margin = match 0.06 * (high - low) {
        margin if margin > 0.0 => margin,
        // All the same: any width will do that the numbers can still resolve.
        _ => (0.01 * low.abs()).max(1e-6),
    };
    low - margin..high + margin
}

/// Axes with a grid and their names.
pub fn axes<'a, 'b>(area: &'a Area<'b>, names: Axes<'_>, x: Range<f64>, y: Range<f64>) -> Result<Chart<'a, 'b>> {
    let mut chart = ChartBuilder::on(area)
        .caption(names.title, ink(17))
        .margin(10)
        .x_label_area_size(42)
        .y_label_area_size(58)
        .build_cartesian_2d(x, y)
        .map_err(failed)?;
    chart
        .configure_mesh()
        .x_labels(8)
        .y_labels(6)
        .x_desc(names.x)
        .y_desc(names.y)
        .axis_desc_style(ink(14))
        .label_style(ink(13))
        .axis_style(INK.mix(0.5))
        .bold_line_style(INK.mix(0.12))
        .light_line_style(INK.mix(0.0))
        .x_label_formatter(&short)
        .y_label_formatter(&short)
        .draw()
        .map_err(failed)?;
    Ok(chart)
}

/// A number on an axis, without digits that only come from arithmetic.
pub fn short(value: &f64) -> String {
    let text = format!("{value:.4}");
    let text = text.trim_end_matches('0').trim_end_matches('.');
    match text {
        "-0" | "" => "0".into(),
        text => text.into(),
    }
}

/// Axes for bars that go to the right, one for each of some rows; their names are not part of them.
pub fn axes_of_bars<'a, 'b>(area: &'a Area<'b>, names: Axes<'_>, x: Range<f64>, rows: usize) -> Result<Chart<'a, 'b>> {
    let mut chart = ChartBuilder::on(area)
        .caption(names.title, ink(17))
        .margin(10)
        .x_label_area_size(42)
        .y_label_area_size(WIDTH / 3 - 10)
        .build_cartesian_2d(x, 0.0..rows as f64)
        .map_err(failed)?;
    chart
        .configure_mesh()
        .disable_y_mesh()
        .disable_y_axis()
        .x_labels(6)
        .x_desc(names.x)
        .axis_desc_style(ink(14))
        .label_style(ink(13))
        .axis_style(INK.mix(0.5))
        .bold_line_style(INK.mix(0.12))
        .light_line_style(INK.mix(0.0))
        .x_label_formatter(&short)
        .draw()
        .map_err(failed)?;
    Ok(chart)
}
