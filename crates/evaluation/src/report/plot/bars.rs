//! Bars with intervals, one below the other: their names need room, on a phone as well.
use super::Axes;
use super::canvas::{INK, WIDTH, axes_of_bars, colour, draw, failed, ink, range};
use crate::error::Result;
use plotters::element::{PathElement, Rectangle, Text};
use plotters::style::Color;
use plotters::style::text_anchor::{HPos, Pos, VPos};

/// A bar.
#[derive(Debug, Clone, PartialEq)]
pub struct Bar {
    /// What it is of.
    pub label: String,
    /// How much; `None` shows "not measured".
    pub value: Option<f64>,
    /// Interval of that.
    pub interval: Option<[f64; 2]>,
    /// Something to compare with, a line across the bar.
    pub reference: Option<f64>,
}

const ROW: u32 = 26;

/// Draws bars; [`Axes::x`] is what they measure, and [`Axes::y`] is not shown.
///
/// # Errors
/// [`crate::Error::Codec`] if plotters cannot draw it.
pub fn bars(names: Axes<'_>, bars: &[Bar]) -> Result<String> {
    let values = bars.iter().flat_map(|bar| {
        let ends = bar.interval.into_iter().flatten();
        ends.chain(bar.value).chain(bar.reference)
    });
    let x = range(values);
    let left = x.start;
    let rows = bars.len().max(1);
    draw(ROW * rows as u32 + 90, |area| {
        let mut chart = axes_of_bars(area, names, x, rows)?;
        for (k, bar) in bars.iter().enumerate() {
            // From the top down.
            let middle = (rows - k) as f64 - 0.5;
            let (_, pixel) = chart.backend_coord(&(left, middle));
            let right_of_names = ink(13).pos(Pos::new(HPos::Right, VPos::Center));
            let name = Text::new(shortened(&bar.label), (WIDTH as i32 / 3 - 8, pixel), right_of_names);
            area.draw(&name).map_err(failed)?;
            let Some(value) = bar.value.filter(|value| value.is_finite()) else {
                let start = ink(12).pos(Pos::new(HPos::Left, VPos::Center));
                let text = Text::new("not measured", (WIDTH as i32 / 3 + 6, pixel), start);
                area.draw(&text).map_err(failed)?;
                continue;
            };
            let corners = [(left, middle - 0.3), (value, middle + 0.3)];
            let body = Rectangle::new(corners, colour(0).mix(0.7).filled());
            chart.draw_series([body]).map_err(failed)?;
            let stroke = INK.stroke_width(2);
            let whisker = bar
                .interval
                .map(|[low, high]| PathElement::new([(low, middle), (high, middle)], stroke));
            chart.draw_series(whisker).map_err(failed)?;
            let across = |x: f64| PathElement::new([(x, middle - 0.42), (x, middle + 0.42)], colour(1).stroke_width(3));
            chart.draw_series(bar.reference.map(across)).map_err(failed)?;
        }
        Ok(())
    })
}

/// What fits beside a bar.
fn shortened(label: &str) -> String {
    const MOST: usize = 30;
    if label.chars().count() <= MOST {
        return label.into();
    }
    let kept: String = label.chars().take(MOST - 1).collect();
    format!("{kept}…")
}
