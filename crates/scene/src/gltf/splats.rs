//! Splats of a primitive whose attributes are accessors: their Gaussians in the world, and their colours in the buffers.
use super::accessor::{self, Elements};
use super::document::Document;
use super::harmonics::Turn;
use super::placement::Placement;
use super::primitive::{EXTENSION, Primitive, harmonic};
use crate::gaussians::Gaussians;
use crate::ignored::RowFilter;

/// Where the attributes of a primitive's splats are.
#[derive(Debug)]
pub(super) struct Splats {
    position: Elements,
    rotation: Elements,
    scale: Elements,
    opacity: Elements,
    /// A coefficient each, bands being one after the other.
    pub harmonics: Vec<Elements>,
}

impl Splats {
    /// Finds the attributes of a primitive; `Err` names the one that is missing or cannot be read.
    pub fn locate(document: &Document<'_>, primitive: &Primitive) -> Result<Splats, String> {
        let all = &primitive.attributes;
        let find = |index: Option<usize>, name: &str, allowed| {
            let index = index.ok_or_else(|| format!("no attribute {name}"))?;
            Elements::locate(document, index, allowed).map_err(|reason| format!("attribute {name}: {reason}"))
        };
        let own = |name: &str| format!("{EXTENSION}:{name}");
        let harmonics = all.harmonics()?.into_iter().enumerate();
        let splats = Splats {
            position: find(all.position, "POSITION", accessor::POSITION)?,
            rotation: find(all.rotation, &own("ROTATION"), accessor::ROTATION)?,
            scale: find(all.scale, &own("SCALE"), accessor::SCALE)?,
            opacity: find(all.opacity, &own("OPACITY"), accessor::OPACITY)?,
            harmonics: harmonics
                .map(|(i, index)| find(Some(index), &harmonic(i), accessor::HARMONIC))
                .collect::<Result<_, _>>()?,
        };
        let count = splats.position.count;
        if let Some(other) = splats
            .all()
            .map(|elements| elements.count)
            .find(|other| *other != count)
        {
            return Err(format!("attributes of {count} and of {other} splats"));
        }
        Ok(splats)
    }

    /// Geometry first.
    pub fn all(&self) -> impl Iterator<Item = &Elements> {
        self.geometry().into_iter().chain(&self.harmonics)
    }

    pub fn geometry(&self) -> [&Elements; 4] {
        [&self.position, &self.rotation, &self.scale, &self.opacity]
    }

    pub fn count(&self) -> usize {
        self.position.count
    }

    /// Degree of the spherical harmonics that there are attributes for.
    pub fn degree(&self) -> usize {
        self.harmonics.len().isqrt() - 1
    }

    /// Adds the Gaussians to those of the world, with coefficients up to `degree`; bands that are not there are 0. `all`
    /// has as many rows as came before, bad ones included, which `sieve` is told of; `Err` is the reason where it refuses
    /// them. `buffer` gives the bytes of a buffer.
    pub fn decode<'b>(
        &self,
        buffer: impl Fn(usize) -> &'b [u8],
        (placement, turn): (&Placement, Option<&Turn>),
        degree: usize,
        all: &mut Gaussians,
        sieve: &mut RowFilter,
    ) -> Result<(), String> {
        let [positions, rotations, scales, opacities] = self.geometry().map(|elements| buffer(elements.buffer));
        let mut colour = Vec::new();
        for row in 0..self.count() {
            let position: [f32; 3] = self.position.get(positions, row);
            let [x, y, z, w] = self.rotation.get(rotations, row);
            let scale: [f32; 3] = self.scale.get(scales, row);
            let [opacity] = self.opacity.get(opacities, row);
            let position = placement.position(position);
            let rotation = placement.rotation([w, x, y, z]);
            let log_scale = scale.map(|v| placement.log_scale(f64::from(v).ln()));
            self.colour(&buffer, row, degree, &mut colour);
            let fault = first_not(&position, "POSITION", |v| v.is_finite())
                .or_else(|| first_not(&rotation, "ROTATION", |v| v.is_finite()))
                .or_else(|| first_not(&scale, "SCALE", |v| v.is_finite() && v >= 0.0))
                .or_else(|| first_not(&log_scale, "SCALE in the world", |v| v < f32::INFINITY))
                .or_else(|| first_not(&[opacity], "OPACITY", |v| (0.0..=1.0).contains(&v)))
                .or_else(|| first_not(&colour, "SH_DEGREE", |v| v.is_finite()));
            let file_row = all.len();
            if let Some((name, value)) = fault {
                sieve.reject(file_row, || format!("{name} of splat {row} is {value}"))?;
            } else if let Some(turn) = turn {
                turn_row(turn, &mut colour);
            }
            all.positions.push(position);
            all.rotations.push(rotation);
            all.log_scales.push(log_scale);
            all.opacity_logits.push(logit(opacity));
            all.sh.coefficients.extend(&colour);
        }
        Ok(())
    }

    /// The coefficients of a row up to `degree`, in the node's space.
    pub fn colour<'b>(&self, buffer: impl Fn(usize) -> &'b [u8], row: usize, degree: usize, colour: &mut Vec<f32>) {
        let all = (degree + 1) * (degree + 1);
        colour.clear();
        let there = self.harmonics.iter().take(all);
        colour.extend(there.flat_map(|elements| elements.get::<3>(buffer(elements.buffer), row)));
        colour.resize(3 * all, 0.0);
    }
}

/// The highest band in which one of the splats has something but 0, of those up to `most`.
pub(super) fn used_degree<'b>(splats: &Splats, buffer: impl Fn(usize) -> &'b [u8]) -> usize {
    let used = |i: &usize| {
        let elements = &splats.harmonics[*i];
        let bytes = buffer(elements.buffer);
        (0..elements.count).any(|row| elements.get::<3>(bytes, row) != [0.0; 3])
    };
    (0..splats.harmonics.len()).rev().find(used).unwrap_or(0).isqrt()
}

/// Turns all bands of a row into those of the world.
pub(super) fn turn_row(turn: &Turn, colour: &mut [f32]) {
    let degree = (colour.len() / 3).isqrt() - 1;
    for l in 1..=degree {
        turn.to_world(l, &mut colour[3 * l * l..3 * (l + 1) * (l + 1)]);
    }
}

fn first_not(values: &[f32], name: &'static str, legal: impl Fn(f32) -> bool) -> Option<(&'static str, f32)> {
    values.iter().find(|value| !legal(**value)).map(|value| (name, *value))
}

/// The logit of an opacity in [0, 1]; infinite at both ends.
fn logit(opacity: f32) -> f32 {
    let opacity = f64::from(opacity);
    (opacity / (1.0 - opacity)).ln() as f32
}
