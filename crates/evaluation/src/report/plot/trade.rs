//! Time on a logarithmic axis against what it buys: dots coloured by a third figure, with rings around those that nothing
//! beats in all respects.
use super::Axes;
use super::canvas::{Area, Chart, HEIGHT, INK, WIDTH, draw, failed, ink, range, short};
use super::scatter::{front, shade_legend, shaded};
use crate::error::Result;
use plotters::chart::ChartBuilder;
use plotters::element::{Circle, PathElement, Text};
use plotters::prelude::RGBColor;
use plotters::style::Color;
use plotters::style::text_anchor::{HPos, Pos, VPos};
use std::ops::Range;

/// A dot of the plot.
#[derive(Debug, Clone, PartialEq)]
pub struct TradeOff {
    /// What it is of.
    pub label: String,
    /// Whether its label must be there; that of others is where there is room.
    pub named: bool,
    /// What it costs, above 0; less is better.
    pub x: f64,
    /// What it gives, more is better.
    pub y: f64,
    /// What its colour tells, if it is known.
    pub shade: Option<f64>,
    /// Whether it has a ring.
    pub on_front: bool,
}

/// Height of the legend.
const LEGEND: u32 = 52;
/// Sizes of labels that must be there, and of others.
const SIZES: [u32; 2] = [14, 12];

/// Draws them; a thin line joins those that nothing beats in the two axes alone.
///
/// # Errors
/// [`crate::Error::Codec`] if plotters cannot draw it.
pub fn trade(names: Axes<'_>, shade_name: &str, dots: &[TradeOff]) -> Result<String> {
    let drawn: Vec<&TradeOff> = dots.iter().filter(|dot| drawable(dot)).collect();
    let x = range(drawn.iter().map(|dot| dot.x.log10()));
    let y = range(drawn.iter().map(|dot| dot.y));
    let shades = || {
        drawn
            .iter()
            .filter_map(|dot| dot.shade)
            .filter(|shade| shade.is_finite())
    };
    let low = shades().fold(f64::INFINITY, f64::min);
    let high = shades().fold(f64::NEG_INFINITY, f64::max);
    draw(HEIGHT + LEGEND, |area| {
        let (plot, legend) = area.split_vertically(HEIGHT as i32);
        let mut chart = log_axes(&plot, names, x, y)?;
        let places: Vec<(f64, f64)> = drawn.iter().map(|dot| (dot.x.log10(), dot.y)).collect();
        let best: Vec<(f64, f64)> = front(&places)
            .into_iter()
            .filter_map(|k| places.get(k).copied())
            .collect();
        let line = PathElement::new(best, INK.mix(0.35).stroke_width(1));
        chart.draw_series([line]).map_err(failed)?;
        let mut taken: Vec<Patch> = Vec::new();
        for (dot, place) in drawn.iter().zip(&places) {
            let colour = match dot.shade.filter(|shade| shade.is_finite()) {
                Some(shade) if high > low => shaded((shade - low) / (high - low)),
                Some(_) => shaded(1.0),
                None => RGBColor(128, 128, 128),
            };
            chart
                .draw_series([Circle::new(*place, 5, colour.filled())])
                .map_err(failed)?;
            if dot.on_front {
                let ring = Circle::new(*place, 8, INK.stroke_width(2));
                chart.draw_series([ring]).map_err(failed)?;
            }
            taken.push(Patch::around(chart.backend_coord(place), 9));
        }
        labels(area, &chart, &drawn, &mut taken)?;
        if low <= high {
            shade_legend(&legend, shade_name, low, high)?;
        }
        let text = "rings: no other is as good in all that is told here; line: the best in time and accuracy";
        let middle = ink(12).pos(Pos::new(HPos::Center, VPos::Center));
        legend
            .draw(&Text::new(text, (WIDTH as i32 / 2, 36), middle))
            .map_err(failed)?;
        if drawn.is_empty() {
            plot.draw(&Text::new("not measured", (260, 160), ink(16)))
                .map_err(failed)?;
        }
        Ok(())
    })
}

fn drawable(dot: &TradeOff) -> bool {
    dot.x.is_finite() && dot.x > 0.0 && dot.y.is_finite()
}

/// Pixels that something takes.
#[derive(Clone, Copy)]
struct Patch {
    left: i32,
    top: i32,
    right: i32,
    bottom: i32,
}

impl Patch {
    fn around((x, y): (i32, i32), half: i32) -> Self {
        Self {
            left: x - half,
            top: y - half,
            right: x + half,
            bottom: y + half,
        }
    }

    fn meets(&self, other: &Self) -> bool {
        self.left < other.right && other.left < self.right && self.top < other.bottom && other.top < self.bottom
    }
}

/// Names of dots beside them, those that must be there first.
fn labels(area: &Area<'_>, chart: &Chart<'_, '_>, drawn: &[&TradeOff], taken: &mut Vec<Patch>) -> Result<()> {
    for (must, size) in [true, false].into_iter().zip(SIZES) {
        for dot in drawn.iter().filter(|dot| dot.named == must) {
            let (x, y) = chart.backend_coord(&(dot.x.log10(), dot.y));
            // Letters of sans-serif fonts are about half as wide as they are high.
            let width = dot.label.chars().count() as i32 * size as i32 * 11 / 20;
            let at = |left: i32, top: i32| Patch {
                left,
                top,
                right: left + width,
                bottom: top + size as i32,
            };
            let half = size as i32 / 2;
            let centred = (x - width / 2).min(WIDTH as i32 - width - 2);
            let places = [
                at(x + 11, y - half),
                at(x - 11 - width, y - half),
                at(centred, y - 11 - 2 * half),
                at(centred, y + 11),
                at(x - 11 - width, y + 9),
                at(x + 11, y + 9),
            ];
            let inside = |place: &&Patch| place.left >= 58 && place.right < WIDTH as i32 && place.top >= 30;
            let free = |place: &&Patch| inside(place) && !taken.iter().any(|other| other.meets(place));
            let Some(place) = places.iter().find(free).or(places.iter().find(inside).filter(|_| must)) else {
                continue;
            };
            taken.push(*place);
            let style = ink(size).pos(Pos::new(HPos::Left, VPos::Center));
            let text = Text::new(dot.label.as_str(), (place.left, place.top + half), style);
            area.draw(&text).map_err(failed)?;
        }
    }
    Ok(())
}

/// Axes of which the one to the right has logarithms to base 10, and is labelled with what they are of.
fn log_axes<'a, 'b>(area: &'a Area<'b>, names: Axes<'_>, x: Range<f64>, y: Range<f64>) -> Result<Chart<'a, 'b>> {
    let ticks = log_ticks(&x);
    let (bottom, top) = (y.start, y.end);
    let mut chart = ChartBuilder::on(area)
        .caption(names.title, ink(17))
        .margin(10)
        .x_label_area_size(42)
        .y_label_area_size(58)
        .build_cartesian_2d(x, y)
        .map_err(failed)?;
    chart
        .configure_mesh()
        .disable_x_mesh()
        .x_labels(0)
        .y_labels(6)
        .x_desc(names.x)
        .y_desc(names.y)
        .axis_desc_style(ink(14))
        .label_style(ink(13))
        .axis_style(INK.mix(0.5))
        .bold_line_style(INK.mix(0.12))
        .light_line_style(INK.mix(0.0))
        .y_label_formatter(&short)
        .draw()
        .map_err(failed)?;
    for tick in ticks {
        let place = tick.log10();
        let line = PathElement::new([(place, bottom), (place, top)], INK.mix(0.12).stroke_width(1));
        chart.draw_series([line]).map_err(failed)?;
        let (x, y) = chart.backend_coord(&(place, bottom));
        let style = ink(13).pos(Pos::new(HPos::Center, VPos::Top));
        area.draw(&Text::new(short(&tick), (x, y + 6), style)).map_err(failed)?;
    }
    Ok(chart)
}

/// Round numbers whose logarithms are in a range: few in wide ranges, many in narrow ones.
fn log_ticks(range: &Range<f64>) -> Vec<f64> {
    const STEPS: [&[f64]; 3] = [
        &[1.0],
        &[1.0, 2.0, 5.0],
        &[
            1.0, 1.2, 1.4, 1.6, 1.8, 2.0, 2.5, 3.0, 3.5, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0,
        ],
    ];
    let decades = range.end - range.start;
    let steps = match decades {
        d if d > 4.0 => STEPS[0],
        d if d > 0.6 => STEPS[1],
        _ => STEPS[2],
    };
    let powers = range.start.floor().max(-300.0) as i32..=range.end.ceil().min(300.0) as i32;
    let all = powers.flat_map(|power| steps.iter().map(move |step| step * 10f64.powi(power)));
    all.filter(|tick| range.contains(&tick.log10())).take(40).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn dot(label: &str, x: f64, y: f64) -> TradeOff {
        TradeOff {
            label: label.into(),
            named: label == "draft",
            x,
            y,
            shade: Some(36.0 + y / 100.0),
            on_front: y > 90.0,
        }
    }

    const AXES: Axes<'_> = Axes {
        title: "a",
        x: "seconds",
        y: "accuracy (%)",
    };

    fn circles(svg: &str) -> Vec<(f64, String)> {
        let circle = |part: &str| {
            let value = |name: &str| part.split(&format!(" {name}=\"")).nth(1)?.split('"').next();
            Some((value("cx")?.parse().ok()?, value("r")?.into()))
        };
        let parts = svg.split('<').filter(|part| part.starts_with("circle "));
        parts.filter_map(circle).collect()
    }

    #[test]
    fn a_tenth_of_the_time_is_as_far_as_another_tenth() {
        let svg = trade(
            AXES,
            "PSNR (dB)",
            &[dot("draft", 10.0, 80.0), dot("b", 100.0, 95.0), dot("c", 1000.0, 99.0)],
        );
        let svg = svg.unwrap();
        let circles = circles(&svg);
        let dots: Vec<f64> = circles.iter().filter(|(_, r)| r == "5").map(|(x, _)| *x).collect();
        assert_eq!(dots.len(), 3);
        assert!(((dots[1] - dots[0]) - (dots[2] - dots[1])).abs() < 2.0, "{dots:?}");
        // Two of them are on the front.
        assert_eq!(circles.iter().filter(|(_, r)| r == "8").count(), 2);
        for text in ["draft", "\n20\n", "\n500\n", "currentColor", "PSNR (dB): 36.80"] {
            assert!(svg.contains(text), "{text}");
        }
    }

    #[test]
    fn ticks_are_round_and_in_the_range() {
        assert_eq!(log_ticks(&(0.9..2.1)), [10.0, 20.0, 50.0, 100.0]);
        assert_eq!(log_ticks(&(-2.5..2.5)).len(), 5);
        assert_eq!(log_ticks(&(1.0..1.2)).len(), 3); // 10, 12, 14; 15.8 is the end
        assert!(log_ticks(&(f64::NEG_INFINITY..f64::INFINITY)).len() <= 40);
    }

    #[test]
    fn nothing_hostile_and_many_can_be_drawn() {
        assert!(trade(AXES, "", &[]).unwrap().contains("not measured"));
        for x in [0.0, -1.0, 1e-300, 1e300, f64::NAN, f64::INFINITY] {
            trade(AXES, "", &[dot("<script>", x, 1.0), dot("draft", 1.0, x)]).unwrap();
        }
        let same = vec![dot("draft", 10.0, 50.0); 60];
        let svg = trade(AXES, "", &same).unwrap();
        assert_eq!(circles(&svg).len(), 60);
    }
}
