//! Plots hold what they are given, in their places, and nothing that a page could run.
use super::*;

const AXES: Axes<'_> = Axes {
    title: "a <script>alert(1)</script>",
    x: "bits",
    y: "accuracy (%)",
};

fn point(x: f64, y: f64) -> Point {
    Point {
        x,
        y,
        interval: Some([y - 1.0, y + 1.0]),
    }
}

fn dot(label: &str, x: f64, y: f64, shade: Option<f64>) -> Dot {
    Dot {
        label: label.into(),
        x,
        y,
        shade,
    }
}

/// Values of an attribute, in order.
fn attributes(svg: &str, tag: &str, name: &str) -> Vec<f64> {
    let of_tag = svg.split('<').filter(|part| part.starts_with(&format!("{tag} ")));
    let value = |part: &str| {
        part.split(&format!(" {name}=\""))
            .nth(1)?
            .split('"')
            .next()?
            .parse()
            .ok()
    };
    of_tag.filter_map(value).collect()
}

#[test]
fn lines_go_where_their_points_are() {
    let line = Line {
        name: "standard & <b>".into(),
        points: vec![
            point(16.0, 99.0),
            point(32.0, 98.0),
            point(72.0, 90.0),
            point(f64::NAN, 1.0),
        ],
        dots: true,
    };
    let svg = lines(AXES, std::slice::from_ref(&line)).unwrap();
    let (x, y) = (attributes(&svg, "circle", "cx"), attributes(&svg, "circle", "cy"));
    assert_eq!((x.len(), y.len()), (3, 3));
    assert!(
        x.is_sorted() && y.is_sorted(),
        "right is more, and down is less: {x:?} {y:?}"
    );
    // 16, 32 and 72 are 16 and 40 apart.
    assert!(((x[2] - x[1]) / (x[1] - x[0]) - 2.5).abs() < 0.05);
    assert!(!svg.contains("<script") && !svg.contains("<b>"));
    assert!(svg.contains("standard &amp; &lt;b&gt;"));
    assert!(svg.contains("currentColor") && !svg.contains("#010203"));
    assert_eq!(svg, lines(AXES, &[line]).unwrap());
}

#[test]
fn bars_are_as_long_as_their_values() {
    let bar = |label: &str, value: Option<f64>| Bar {
        label: label.into(),
        value,
        interval: None,
        reference: Some(10.0),
    };
    let svg = bars(AXES, &[bar("a", Some(10.0)), bar("b", Some(20.0)), bar("c", None)]).unwrap();
    let widths = attributes(&svg, "rect", "width");
    assert_eq!(widths.len(), 2);
    // The axis starts 0.6 before 10.
    assert!((widths[1] / widths[0] - 10.6 / 0.6).abs() < 1.5, "{widths:?}");
    assert!(svg.contains("not measured"));
}

#[test]
fn a_hand_computed_front() {
    let points = [
        (3.0, 90.0),
        (1.0, 50.0),
        (2.0, 90.0),
        (2.0, 80.0),
        (9.0, 99.0),
        (f64::NAN, 100.0),
        (1.0, 50.0),
        (5.0, 60.0),
    ];
    assert_eq!(front(&points), [1, 6, 2, 4]);
    assert!(front(&[]).is_empty());
}

#[test]
fn scatters_have_a_dot_each_and_the_ends_of_their_shades() {
    let dots = [
        dot("fast", 1.0, 50.0, Some(31.5)),
        dot("slow", 9.0, 99.0, Some(41.25)),
        dot("grey", 5.0, 60.0, None),
    ];
    let svg = scatter(AXES, "PSNR (dB)", &dots).unwrap();
    assert_eq!(attributes(&svg, "circle", "cx").len(), 3);
    for text in ["fast", "slow", "grey", "PSNR (dB): 31.50", "41.25"] {
        assert!(svg.contains(text), "{text}");
    }
}

#[test]
fn nothing_and_single_values_can_be_drawn() {
    for svg in [lines(AXES, &[]), scatter(AXES, "", &[]), bars(AXES, &[])] {
        svg.unwrap();
    }
    assert!(lines(AXES, &[]).unwrap().contains("not measured"));
    for y in [0.0, 1e-12, -1e9, 1e300, f64::INFINITY] {
        let points = vec![Point {
            x: y,
            y,
            interval: None,
        }];
        let line = Line {
            name: String::new(),
            points,
            dots: true,
        };
        lines(AXES, &[line]).unwrap();
        scatter(AXES, "", &[dot("", y, y, Some(y))]).unwrap();
        let bar = Bar {
            label: String::new(),
            value: Some(y),
            interval: None,
            reference: None,
        };
        bars(AXES, &[bar]).unwrap();
    }
}
