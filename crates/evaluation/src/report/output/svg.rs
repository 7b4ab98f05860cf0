//! Plots as a file of their own, which a README can show on light and dark pages.
use super::atomic_write::write_whole;
use crate::error::Result;
use crate::report::named::Plot;
use std::fmt::Write;
use std::path::Path;

/// A file has no page to take the colour of its text from, but may ask whether that is dark.
const STYLE: &str =
    "<style>svg { color: #1f2328; } @media (prefers-color-scheme: dark) { svg { color: #e6edf3; } }</style>";

/// Plots, one below the other, as one SVG document.
pub fn to_svg(plots: &[Plot]) -> String {
    let mut inner = String::new();
    let (mut width, mut height) = (0, 0);
    for plot in plots {
        // Writing to a string cannot fail.
        let _ = writeln!(
            inner,
            "{}",
            plot.svg.replacen("<svg ", &format!("<svg y=\"{height}\" "), 1)
        );
        width = width.max(attribute(&plot.svg, "width"));
        height += attribute(&plot.svg, "height");
    }
    format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}\" height=\"{height}\" \
         viewBox=\"0 0 {width} {height}\">\n{STYLE}\n{inner}</svg>\n"
    )
}

/// Writes [`to_svg`] to a file, whole or not at all.
///
/// # Errors
/// [`crate::Error::Io`].
pub fn write_svg(plots: &[Plot], path: &Path) -> Result<()> {
    write_whole(path, to_svg(plots).as_bytes())
}

/// The first number of this name in a drawing.
fn attribute(svg: &str, name: &str) -> u32 {
    let value = svg.split(&format!(" {name}=\"")).nth(1);
    value.and_then(|rest| rest.split('"').next()?.parse().ok()).unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::plot::{Axes, lines};

    #[test]
    fn plots_stand_below_each_other() {
        let axes = Axes {
            title: "a",
            x: "x",
            y: "y",
        };
        let plot = |caption: &str| Plot {
            caption: caption.into(),
            svg: lines(axes, &[]).unwrap(),
        };
        let svg = to_svg(&[plot("one"), plot("two")]);
        assert!(svg.starts_with("<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"640\" height=\"720\""));
        assert!(svg.contains("<svg y=\"0\" ") && svg.contains("<svg y=\"360\" "));
        assert_eq!((svg.matches("<svg ").count(), svg.matches("</svg>").count()), (3, 3));
        assert!(svg.contains("prefers-color-scheme: dark") && svg.contains("currentColor"));
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.svg");
        write_svg(&[plot("one")], &path).unwrap();
        assert_eq!(std::fs::read_to_string(&path).unwrap(), to_svg(&[plot("two")]));
    }
}
