//! Points of two trades, little on one axis for much on the other, with the front of those that nothing beats.
use super::Axes;
use super::canvas::{Area, HEIGHT, INK, WIDTH, axes, draw, failed, ink, range};
use crate::error::Result;
use plotters::element::{Circle, PathElement, Rectangle, Text};
use plotters::prelude::RGBColor;
use plotters::style::Color;
use plotters::style::text_anchor::{HPos, Pos, VPos};

/// A point.
#[derive(Debug, Clone, PartialEq)]
pub struct Dot {
    /// What it is of.
    pub label: String,
    /// What it costs, less is better.
    pub x: f64,
    /// What it gives, more is better.
    pub y: f64,
    /// What its colour tells, if it is known.
    pub shade: Option<f64>,
}

/// Places of the points that no other beats, from left to right: none costs no more and gives no less, and is not the
/// same. Points that are not finite are on no front.
pub fn front(points: &[(f64, f64)]) -> Vec<usize> {
    let finite = |place: &usize| points.get(*place).is_some_and(|(x, y)| x.is_finite() && y.is_finite());
    let mut order: Vec<(f64, f64, usize)> = (0..points.len())
        .filter(finite)
        .filter_map(|place| points.get(place).map(|(x, y)| (*x, *y, place)))
        .collect();
    order.sort_by(|a, b| a.0.total_cmp(&b.0).then(b.1.total_cmp(&a.1)).then(a.2.cmp(&b.2)));
    let mut best: Option<(f64, f64)> = None;
    let mut places = Vec::new();
    for (x, y, place) in order {
        if best.is_none_or(|best| y > best.1 || best == (x, y)) {
            best = Some((x, y));
            places.push(place);
        }
    }
    places
}

/// Draws points with their names, coloured by their shades, and their front as a line.
///
/// # Errors
/// [`crate::Error::Codec`] if plotters cannot draw it.
pub fn scatter(names: Axes<'_>, shade_name: &str, dots: &[Dot]) -> Result<String> {
    let finite = || dots.iter().filter(|dot| dot.x.is_finite() && dot.y.is_finite());
    let x = range(finite().map(|dot| dot.x));
    let y = range(finite().map(|dot| dot.y));
    let middle = (x.start + x.end) / 2.0;
    let shades = || finite().filter_map(|dot| dot.shade).filter(|shade| shade.is_finite());
    let low = shades().fold(f64::INFINITY, f64::min);
    let high = shades().fold(f64::NEG_INFINITY, f64::max);
    draw(HEIGHT + 30, |area| {
        let (plot, legend) = area.split_vertically(HEIGHT as i32);
        let mut chart = axes(&plot, names, x, y)?;
        let places: Vec<(f64, f64)> = dots.iter().map(|dot| (dot.x, dot.y)).collect();
        let on_front: Vec<(f64, f64)> = front(&places)
            .into_iter()
            .filter_map(|k| places.get(k).copied())
            .collect();
        let line = PathElement::new(on_front, INK.mix(0.6).stroke_width(1));
        chart.draw_series([line]).map_err(failed)?;
        for dot in finite() {
            let colour = match dot.shade.filter(|shade| shade.is_finite()) {
                Some(shade) if high > low => shaded((shade - low) / (high - low)),
                Some(_) => shaded(1.0),
                None => RGBColor(128, 128, 128),
            };
            let circle = Circle::new((dot.x, dot.y), 5, colour.filled());
            chart.draw_series([circle]).map_err(failed)?;
            let (px, py) = chart.backend_coord(&(dot.x, dot.y));
            // Names go to where there is room.
            let to_the_left = dot.x > middle;
            let side = if to_the_left { HPos::Right } else { HPos::Left };
            let style = ink(11).pos(Pos::new(side, VPos::Center));
            let at = (px + if to_the_left { -8 } else { 8 }, py);
            area.draw(&Text::new(dot.label.as_str(), at, style)).map_err(failed)?;
        }
        if low <= high {
            shade_legend(&legend, shade_name, low, high)?;
        }
        if finite().next().is_none() {
            plot.draw(&Text::new("not measured", (260, 160), ink(16)))
                .map_err(failed)?;
        }
        Ok(())
    })
}

pub(super) fn shade_legend(area: &Area<'_>, name: &str, low: f64, high: f64) -> Result<()> {
    const STEPS: i32 = 32;
    let left = WIDTH as i32 / 2;
    for step in 0..STEPS {
        let colour = shaded(f64::from(step) / f64::from(STEPS - 1));
        let corners = [(left + 4 * step, 6), (left + 4 * step + 4, 18)];
        area.draw(&Rectangle::new(corners, colour.filled())).map_err(failed)?;
    }
    let before = ink(12).pos(Pos::new(HPos::Right, VPos::Center));
    let after = ink(12).pos(Pos::new(HPos::Left, VPos::Center));
    let text = Text::new(format!("{name}: {low:.2}"), (left - 6, 12), before);
    area.draw(&text).map_err(failed)?;
    let text = Text::new(format!("{high:.2}"), (left + 4 * STEPS + 6, 12), after);
    area.draw(&text).map_err(failed)
}

/// From violet over green to yellow, by lightness (viridis, without its ends that vanish on black and white).
pub(super) fn shaded(share: f64) -> RGBColor {
    const STOPS: [(f64, f64, f64); 4] = [
        (94.0, 60.0, 153.0),
        (49.0, 104.0, 142.0),
        (53.0, 165.0, 122.0),
        (220.0, 180.0, 30.0),
    ];
    let at = share.clamp(0.0, 1.0) * (STOPS.len() - 1) as f64;
    let place = (at as usize).min(STOPS.len() - 2);
    let (a, b, part) = (STOPS[place], STOPS[place + 1], at - place as f64);
    let mix = |a: f64, b: f64| (a + (b - a) * part).round() as u8;
    RGBColor(mix(a.0, b.0), mix(a.1, b.1), mix(a.2, b.2))
}
