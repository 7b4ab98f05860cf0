//! Lines through measured points, with their intervals.
use super::Axes;
use super::canvas::{HEIGHT, axes, colour, draw, failed, ink, range};
use crate::error::Result;
use plotters::element::{Circle, PathElement, Text};
use plotters::style::Color;

/// A point of a line.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Point {
    /// Where.
    pub x: f64,
    /// How much.
    pub y: f64,
    /// Interval of that.
    pub interval: Option<[f64; 2]>,
}

/// A line.
#[derive(Debug, Clone, PartialEq)]
pub struct Line {
    /// What it is of.
    pub name: String,
    /// Its points, from left to right; those that are not finite are left out.
    pub points: Vec<Point>,
    /// Whether each point is marked; not, where there are many.
    pub dots: bool,
}

/// Draws lines with a legend.
///
/// # Errors
/// [`crate::Error::Codec`] if plotters cannot draw it.
pub fn lines(names: Axes<'_>, lines: &[Line]) -> Result<String> {
    let all = || {
        lines
            .iter()
            .flat_map(|line| &line.points)
            .filter(|point| drawable(point))
    };
    let x = range(all().map(|point| point.x));
    let y = range(all().flat_map(|point| [point.y].into_iter().chain(point.interval.into_iter().flatten())));
    // The legend is below the plot, where no line can run through it.
    let height = HEIGHT + 20 * lines.len() as u32;
    draw(height, |area| {
        let (plot, legend) = area.split_vertically(HEIGHT as i32);
        let mut chart = axes(&plot, names, x, y)?;
        for (k, line) in lines.iter().enumerate() {
            let colour = colour(k);
            let points: Vec<&Point> = line.points.iter().filter(|point| drawable(point)).collect();
            let places: Vec<(f64, f64)> = points.iter().map(|point| (point.x, point.y)).collect();
            if line.dots {
                let circles = places.iter().map(|place| Circle::new(*place, 4, colour.filled()));
                chart.draw_series(circles).map_err(failed)?;
                let intervals = points
                    .iter()
                    .filter_map(|point| point.interval.map(|ends| (point.x, ends)));
                let whiskers =
                    intervals.map(|(x, [low, high])| PathElement::new([(x, low), (x, high)], colour.stroke_width(1)));
                chart.draw_series(whiskers).map_err(failed)?;
            }
            let path = PathElement::new(places, colour.stroke_width(2));
            chart.draw_series([path]).map_err(failed)?;
            let y = 20 * k as i32 + 4;
            let sample = [(68, y + 6), (92, y + 6)];
            legend
                .draw(&PathElement::new(sample, colour.stroke_width(2)))
                .map_err(failed)?;
            legend
                .draw(&Text::new(line.name.as_str(), (100, y), ink(13)))
                .map_err(failed)?;
        }
        if all().next().is_none() {
            plot.draw(&Text::new("not measured", (260, 160), ink(16)))
                .map_err(failed)?;
        }
        Ok(())
    })
}

fn drawable(point: &Point) -> bool {
    let ends = point.interval.into_iter().flatten();
    point.x.is_finite() && point.y.is_finite() && ends.into_iter().all(f64::is_finite)
}
