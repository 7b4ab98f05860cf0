//! The few operations on vectors of three that cameras need.

/// `a - b`.
pub(crate) fn sub(a: [f32; 3], b: [f32; 3]) -> [f32; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

/// Scalar product.
pub(crate) fn dot(a: [f32; 3], b: [f32; 3]) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// Vector product.
pub(crate) fn cross(a: [f32; 3], b: [f32; 3]) -> [f32; 3] {
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}

/// `v` at length one, or `None` where it has no direction.
pub(crate) fn unit(v: [f32; 3]) -> Option<[f32; 3]> {
    // Dividing by the largest component first keeps squares of huge and tiny vectors in range.
    let largest = v.iter().fold(0.0f32, |m, x| m.max(x.abs()));
    if !(largest.is_finite() && largest > 1e-30) {
        return None;
    }
    let v = v.map(|x| x / largest);
    let length = dot(v, v).sqrt();
    Some(v.map(|x| x / length))
}

/// Some unit vector at a right angle to the unit vector `v`.
pub(crate) fn perpendicular(v: [f32; 3]) -> [f32; 3] {
    let axis = if v[0].abs() < 0.7 {
        [1.0, 0.0, 0.0]
    } else {
        [0.0, 1.0, 0.0]
    };
    unit(cross(v, axis)).unwrap_or([0.0, 0.0, 1.0])
}

/// `a + t b`.
pub(crate) fn along(a: [f32; 3], t: f32, b: [f32; 3]) -> [f32; 3] {
    [a[0] + t * b[0], a[1] + t * b[1], a[2] + t * b[2]]
}

/// A right-handed frame whose last axis is the unit vector `up`.
pub(crate) fn frame(up: [f32; 3]) -> [[f32; 3]; 3] {
    let east = perpendicular(up);
    [east, cross(up, east), up]
}

/// The matrix, by rows, of a rotation by a quaternion (w, x, y, z) of length 1.
#[inline(always)]
pub(crate) fn rotation([w, x, y, z]: [f64; 4]) -> [[f64; 3]; 3] {
    [
        [
            1.0 - 2.0 * (y * y + z * z),
            2.0 * (x * y - w * z),
            2.0 * (x * z + w * y),
        ],
        [
            2.0 * (x * y + w * z),
            1.0 - 2.0 * (x * x + z * z),
            2.0 * (y * z - w * x),
        ],
        [
            2.0 * (x * z - w * y),
            2.0 * (y * z + w * x),
            1.0 - 2.0 * (x * x + y * y),
        ],
    ]
}
