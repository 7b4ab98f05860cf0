//! The splats of one primitive among those of the scene: from colours of the world to what its file stores, and back.
use super::harmonics::Turn;
use super::splats::{Splats, turn_row};
use crate::container::Container;
use crate::gaussians::Sh;
use std::ops::Range;
use std::sync::Arc;

/// The splats of a primitive.
#[derive(Debug)]
pub(super) struct Part {
    /// The first of its rows among those of the scene, bad ones included.
    pub first: usize,
    pub count: usize,
    /// From its node's space to the world, where that is a turn.
    pub turn: Option<Turn>,
    pub colours: Colours,
}

/// Where colours are stored.
#[derive(Debug)]
pub(super) enum Colours {
    Attributes(Box<Splats>),
    Spz(Box<Stream>),
}

/// An SPZ in a buffer view.
#[derive(Debug)]
pub(super) struct Stream {
    pub view: usize,
    pub buffer: usize,
    /// Its bytes in the buffer.
    pub range: Range<usize>,
    pub file: Arc<dyn Container>,
    /// The colours that it has, in its node's space.
    pub sh: Sh,
    /// Degree that it has room for.
    pub degree: usize,
}

impl Stream {
    /// Whether these are the colours that it has; bands of zeros may be there or not.
    pub fn is(&self, sh: &Sh) -> bool {
        let rows = self.sh.coefficients.chunks_exact(self.sh.per_gaussian());
        let mut pairs = rows.zip(sh.coefficients.chunks_exact(sh.per_gaussian()));
        pairs.all(|(own, other)| {
            let both = own.len().min(other.len());
            own[..both] == other[..both] && own[both..].iter().chain(&other[both..]).all(|v| *v == 0.0)
        })
    }
}

impl Part {
    /// Degree of the spherical harmonics that there is room for.
    pub fn degree(&self) -> usize {
        match &self.colours {
            Colours::Attributes(splats) => splats.degree(),
            Colours::Spz(stream) => stream.degree,
        }
    }

    /// Whether every finite colour of a scene of `degree` is kept as it is.
    pub fn exact(&self, degree: usize) -> bool {
        let floats = matches!(self.colours, Colours::Attributes(_));
        floats && self.degree() >= degree && (self.turn.is_none() || degree == 0)
    }

    /// The coefficients of a row in the file, in the space of the node, of as many bands as `colour` has room for.
    fn stored<'b>(&self, buffer: impl Fn(usize) -> &'b [u8], row: usize, length: usize) -> Vec<f32> {
        let mut stored = Vec::new();
        match &self.colours {
            Colours::Attributes(splats) => splats.colour(buffer, row, (length / 3).isqrt() - 1, &mut stored),
            Colours::Spz(stream) => {
                let each = stream.sh.per_gaussian();
                stored.extend(stream.sh.coefficients[row * each..(row + 1) * each].iter().take(length));
                stored.resize(length, 0.0);
            }
        }
        stored
    }

    /// What is stored for colours of the world of a row, in the space of its node: bands that are as they were read, as
    /// they are stored, the others turned back. Bands that there is no room for are left out.
    pub fn to_node<'b>(&self, buffer: impl Fn(usize) -> &'b [u8], row: usize, world: &[f32]) -> Vec<f32> {
        let degree = (world.len() / 3).isqrt() - 1;
        let mut node = world.to_vec();
        if let Some(turn) = &self.turn {
            let stored = self.stored(buffer, row, world.len());
            let mut read = stored.clone();
            turn_row(turn, &mut read);
            for l in 1..=degree {
                let band = 3 * l * l..3 * (l + 1) * (l + 1);
                if same(&world[band.clone()], &read[band.clone()]) {
                    node[band.clone()].copy_from_slice(&stored[band]);
                } else {
                    turn.to_node(l, &mut node[band]);
                }
            }
        }
        let room = self.degree().min(degree);
        node.truncate(3 * (room + 1) * (room + 1));
        node
    }

    /// Replaces colours of the world of a row by those that are read once they are stored.
    pub fn quantize<'b>(&self, buffer: impl Fn(usize) -> &'b [u8], row: usize, world: &mut [f32]) {
        let mut node = self.to_node(buffer, row, world);
        if let Colours::Spz(stream) = &self.colours {
            stream.file.quantize_colors(row, &mut node);
        }
        if let Some(turn) = &self.turn {
            turn_row(turn, &mut node);
        }
        let (kept, beyond) = world.split_at_mut(node.len());
        kept.copy_from_slice(&node);
        beyond.fill(0.0);
    }
}

/// Whether all bits are the same.
fn same(a: &[f32], b: &[f32]) -> bool {
    a.iter().map(|v| v.to_bits()).eq(b.iter().map(|v| v.to_bits()))
}
