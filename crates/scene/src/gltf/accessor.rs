//! Accessors: where the numbers of an attribute are in a buffer, and what they are.
use super::document::{Document, Kind};

/// Most bytes from one element to the next, by the specification.
const MOST_STRIDE: u64 = 252;
/// `componentType` of single precision.
pub(super) const FLOAT: u32 = 5126;

/// What an attribute may be.
#[derive(Clone, Copy)]
pub(super) struct Allowed {
    pub kind: Kind,
    /// `componentType` and whether it is normalised.
    pub components: &'static [(u32, bool)],
}

pub(super) const POSITION: Allowed = Allowed {
    kind: Kind::Vec3,
    // All but the first by KHR_mesh_quantization.
    components: &[
        (FLOAT, false),
        (5120, false),
        (5120, true),
        (5121, false),
        (5121, true),
        (5122, false),
        (5122, true),
        (5123, false),
        (5123, true),
    ],
};
pub(super) const ROTATION: Allowed = Allowed {
    kind: Kind::Vec4,
    components: &[(FLOAT, false), (5120, true), (5122, true)],
};
pub(super) const SCALE: Allowed = Allowed {
    kind: Kind::Vec3,
    components: &[(FLOAT, false), (5121, false), (5121, true), (5123, false), (5123, true)],
};
pub(super) const OPACITY: Allowed = Allowed {
    kind: Kind::Scalar,
    components: &[(FLOAT, false), (5121, true), (5123, true)],
};
pub(super) const HARMONIC: Allowed = Allowed {
    kind: Kind::Vec3,
    components: &[(FLOAT, false)],
};

/// Where the elements of an accessor are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Elements {
    pub buffer: usize,
    /// First byte of the first one.
    pub start: usize,
    /// Bytes from one to the next, at least as many as one has.
    pub stride: usize,
    pub count: usize,
    /// Bytes of one.
    pub size: usize,
    component: u32,
    normalized: bool,
}

impl Elements {
    /// Finds the elements of accessor `index`, which must be such as are `allowed`, within what the file says of its
    /// buffers; `Err` names accessor, field and limit.
    pub fn locate(document: &Document<'_>, index: usize, allowed: Allowed) -> Result<Elements, String> {
        let accessor = document.accessors.get(index).ok_or_else(|| {
            let count = document.accessors.len();
            format!("accessor {index} of {count}")
        })?;
        let of = |reason: String| format!("accessor {index}: {reason}");
        if accessor.sparse.is_some() {
            return Err(of("sparse: such accessors are not read".into()));
        }
        let (component, normalized) = (accessor.component_type, accessor.normalized);
        // Normalised floats are no different.
        let kind = (component, normalized && component != FLOAT);
        if accessor.kind != allowed.kind || !allowed.components.contains(&kind) {
            let (found, needed, normalized) = (accessor.kind, allowed.kind, if kind.1 { ", normalized" } else { "" });
            return Err(of(format!(
                "{found:?} of componentType {component}{normalized}; must be {needed:?} of {}",
                components(allowed)
            )));
        }
        let Some(view) = accessor.buffer_view else {
            return Err(of("no bufferView".into()));
        };
        let (view, range) = view_range(document, view).map_err(of)?;
        let size = bytes(component) * components_of(allowed.kind);
        let stride = view.byte_stride.unwrap_or(size as u64);
        if stride < size as u64 || stride > MOST_STRIDE {
            return Err(of(format!(
                "byteStride {stride} of its bufferView; must be {size} to {MOST_STRIDE}"
            )));
        }
        let count = accessor.count;
        let end = (count.max(1) - 1)
            .checked_mul(stride)
            .and_then(|last| last.checked_add(if count == 0 { 0 } else { size as u64 }))
            .and_then(|bytes| bytes.checked_add(accessor.byte_offset))
            .filter(|end| *end <= view.byte_length);
        let (Some(_), Ok(count)) = (end, usize::try_from(count)) else {
            let (there, offset) = (view.byte_length, accessor.byte_offset);
            return Err(of(format!(
                "{count} elements of {stride} bytes from byteOffset {offset}; its bufferView has {there} bytes"
            )));
        };
        Ok(Elements {
            buffer: view.buffer,
            start: range.start + accessor.byte_offset as usize,
            stride: stride as usize,
            count,
            size,
            component,
            normalized: kind.1,
        })
    }

    /// The first byte of element `row`.
    pub fn at(&self, row: usize) -> usize {
        self.start + row * self.stride
    }

    /// The bytes from the first to the last.
    pub fn extent(&self) -> std::ops::Range<usize> {
        match self.count {
            0 => self.start..self.start,
            count => self.start..self.at(count - 1) + self.size,
        }
    }

    /// Whether no byte of an element is one of the other's: apart, or interleaved.
    pub fn is_apart_from(&self, other: &Elements) -> bool {
        let (mine, theirs) = (self.extent(), other.extent());
        if self.buffer != other.buffer || mine.end <= theirs.start || theirs.end <= mine.start {
            return true;
        }
        if self.stride != other.stride {
            return false;
        }
        let (first, second) = if self.start <= other.start {
            (self, other)
        } else {
            (other, self)
        };
        let apart = (second.start - first.start) % first.stride;
        apart >= first.size && apart + second.size <= first.stride
    }

    /// The numbers of element `row`.
    pub fn get<const N: usize>(&self, buffer: &[u8], row: usize) -> [f32; N] {
        let size = bytes(self.component);
        let first = self.at(row);
        std::array::from_fn(|i| self.number(&buffer[first + i * size..first + (i + 1) * size]))
    }

    fn number(&self, bytes: &[u8]) -> f32 {
        let (value, most) = match (self.component, bytes) {
            (5120, [a]) => (f32::from(*a as i8), 127.0),
            (5121, [a]) => (f32::from(*a), 255.0),
            (5122, [a, b]) => (f32::from(i16::from_le_bytes([*a, *b])), 32767.0),
            (5123, [a, b]) => (f32::from(u16::from_le_bytes([*a, *b])), 65535.0),
            (_, [a, b, c, d]) => (f32::from_le_bytes([*a, *b, *c, *d]), 1.0),
            _ => (0.0, 1.0),
        };
        // The most negative integer stands for -1 too.
        if self.normalized {
            (value / most).max(-1.0)
        } else {
            value
        }
    }
}

/// A buffer view and its bytes within its buffer; `Err` names what there is not, or not so many of.
pub(super) fn view_range<'d>(
    document: &'d Document<'_>,
    index: usize,
) -> Result<(&'d super::document::BufferView, std::ops::Range<usize>), String> {
    let views = &document.buffer_views;
    let view = views
        .get(index)
        .ok_or_else(|| format!("bufferView {index} of {}", views.len()))?;
    let of = |reason: String| format!("bufferView {index}: {reason}");
    if let Some(name) = view.extensions.compression() {
        return Err(of(format!("{name}: compressed buffers are not read")));
    }
    let buffers = document.buffers.len();
    let buffer = document
        .buffers
        .get(view.buffer)
        .ok_or_else(|| of(format!("buffer {} of {buffers}", view.buffer)))?;
    let end = view.byte_offset.checked_add(view.byte_length);
    let end = end
        .filter(|end| *end <= buffer.byte_length)
        .and_then(|end| usize::try_from(end).ok());
    let Some(end) = end else {
        let (length, offset, there) = (view.byte_length, view.byte_offset, buffer.byte_length);
        return Err(of(format!(
            "byteLength {length} from byteOffset {offset}; buffer {} has {there} bytes",
            view.buffer
        )));
    };
    Ok((view, view.byte_offset as usize..end))
}

/// Bytes of a component.
fn bytes(component: u32) -> usize {
    match component {
        5120 | 5121 => 1,
        5122 | 5123 => 2,
        _ => 4,
    }
}

fn components_of(kind: Kind) -> usize {
    match kind {
        Kind::Vec3 => 3,
        Kind::Vec4 => 4,
        Kind::Scalar | Kind::Other => 1,
    }
}

/// The component types that are allowed, in words.
fn components(allowed: Allowed) -> String {
    let names = allowed
        .components
        .iter()
        .map(|(component, normalized)| format!("{component}{}", if *normalized { " normalized" } else { "" }));
    names.collect::<Vec<_>>().join(", ")
}
