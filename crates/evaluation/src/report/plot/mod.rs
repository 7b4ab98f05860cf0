//! Plots as SVG for pages of any colour: lines, bars with intervals, and scatters with their front.
mod bars;
mod canvas;
mod lines;
mod scatter;
mod trade;

pub use bars::{Bar, bars};
pub use lines::{Line, Point, lines};
pub use scatter::{Dot, front, scatter};
pub use trade::{TradeOff, trade};

/// What a plot's axes are called.
#[derive(Debug, Clone, Copy)]
pub struct Axes<'a> {
    /// What the plot shows, above it.
    pub title: &'a str,
    /// Name and unit of what goes to the right.
    pub x: &'a str,
    /// Name and unit of what goes up.
    pub y: &'a str,
}

#[cfg(test)]
mod tests;
