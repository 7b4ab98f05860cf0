//! A camera moved by nine numbers, each of which moves what is seen by about a pixel.
use crate::view::Camera;

/// Turns about x, y and z, moves along them, focal length, principal point along x and y.
pub(super) const FREEDOMS: usize = 9;

/// The camera with the scene turned about a point on its axis at `depth` and moved, then the lens changed. One in each of
/// `step` moves what is half a picture off the axis, and half as deep as wide, by a pixel.
pub(super) fn moved(camera: &Camera, depth: f64, step: &[f64; FREEDOMS]) -> Camera {
    let half = 0.5 * f64::from(camera.width.max(camera.height));
    let focal = f64::from(camera.fx);
    let turn = rotation([step[0] / half, step[1] / half, step[2] / half]);
    let pixel = depth / focal;
    let shift = [step[3] * pixel, step[4] * pixel, step[5] * depth / half];
    let of = |row: [f32; 3]| row.map(f64::from);
    let old = camera.rotation.map(of);
    let mut rotation = [[0.0; 3]; 3];
    for i in 0..3 {
        for k in 0..3 {
            rotation[i][k] = (0..3).map(|j| turn[i][j] * old[j][k]).sum();
        }
    }
    let mut place = camera.translation.map(f64::from);
    place[2] -= depth;
    let mut translation: [f64; 3] =
        std::array::from_fn(|i| (0..3).map(|j| turn[i][j] * place[j]).sum::<f64>() + shift[i]);
    translation[2] += depth;
    let zoom = (step[6] / half).exp() as f32;
    Camera {
        fx: camera.fx * zoom,
        fy: camera.fy * zoom,
        cx: camera.cx + step[7] as f32,
        cy: camera.cy + step[8] as f32,
        rotation: orthonormal(rotation).map(|row| row.map(|v| v as f32)),
        translation: translation.map(|v| v as f32),
        ..camera.clone()
    }
}

/// The camera so many times as far from what is at `depth`, with as much longer a lens: what is there stays as large.
pub(super) fn dollied(camera: &Camera, depth: f64, times: f32) -> Camera {
    let [x, y, z] = camera.translation;
    Camera {
        fx: camera.fx * times,
        fy: camera.fy * times,
        translation: [x, y, z + (times - 1.0) * depth as f32],
        ..camera.clone()
    }
}

/// The matrix of a turn by a vector in radians (Rodrigues).
fn rotation(by: [f64; 3]) -> [[f64; 3]; 3] {
    let angle = by.iter().map(|v| v * v).sum::<f64>().sqrt();
    if angle < 1e-12 {
        return [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    }
    let half = 0.5 * angle;
    let [x, y, z] = by.map(|v| v / angle * half.sin());
    crate::view::vector::rotation([half.cos(), x, y, z])
}

/// Rows made perpendicular to each other, and of length one (Gram and Schmidt).
fn orthonormal(rows: [[f64; 3]; 3]) -> [[f64; 3]; 3] {
    let dot = |a: [f64; 3], b: [f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    let unit = |v: [f64; 3]| v.map(|x| x / dot(v, v).sqrt());
    let x = unit(rows[0]);
    let along = dot(rows[1], x);
    let y = unit(std::array::from_fn(|k| rows[1][k] - along * x[k]));
    let z = [
        x[1] * y[2] - x[2] * y[1],
        x[2] * y[0] - x[0] * y[2],
        x[0] * y[1] - x[1] * y[0],
    ];
    [x, y, z]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn camera() -> Camera {
        Camera::look_at([1.0, -2.0, 4.0], [0.1, 0.2, 0.0], [0.0, -1.0, 0.0], 0.8, 200, 200)
    }

    /// A point that is this many pixels right of and below the middle of the picture, at this depth.
    fn seen(camera: &Camera, [right, below]: [f32; 2], depth: f32) -> [f32; 3] {
        let at = [right / camera.fx * depth, below / camera.fy * depth, depth];
        let from_centre: [f32; 3] = std::array::from_fn(|k| (0..3).map(|row| camera.rotation[row][k] * at[row]).sum());
        let centre = camera.centre();
        std::array::from_fn(|k| centre[k] + from_centre[k])
    }

    #[test]
    fn each_number_moves_the_picture_by_about_a_pixel() {
        let (camera, depth) = (camera(), 4.5);
        // A pixel's distance from the middle, half as deep as wide.
        let points = [[90.0, 0.0], [0.0, 90.0], [-60.0, 60.0]].map(|at| seen(&camera, at, 3.9));
        for freedom in 0..FREEDOMS {
            let mut step = [0.0; FREEDOMS];
            step[freedom] = 1.0;
            let after = moved(&camera, depth, &step);
            let distances = points.map(|point| {
                let ([x, y], [u, v]) = (camera.pixel(point), after.pixel(point));
                ((x - u).powi(2) + (y - v).powi(2)).sqrt()
            });
            let largest = distances.into_iter().fold(0.0, f32::max);
            assert!((0.1..1.6).contains(&largest), "{freedom}: {distances:?}");
        }
        assert_eq!(moved(&camera, depth, &[0.0; FREEDOMS]).fx, camera.fx);
    }

    #[test]
    fn many_turns_stay_turns() {
        let mut camera = camera();
        for i in 0..200 {
            let step = std::array::from_fn(|k| ((i + 3 * k) % 5) as f64 - 1.9);
            camera = moved(&camera, 4.5, &step);
        }
        let r = camera.rotation;
        for (i, j) in [(0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)] {
            let dot: f32 = (0..3).map(|k| r[i][k] * r[j][k]).sum();
            assert!((dot - if i == j { 1.0 } else { 0.0 }).abs() < 1e-5, "{r:?}");
        }
    }

    #[test]
    fn a_dolly_keeps_the_size_of_what_is_at_its_depth() {
        let camera = camera();
        let after = dollied(&camera, 4.5, 1.5);
        for at in [[0.0; 2], [80.0, -30.0]] {
            let point = seen(&camera, at, 4.5);
            let ([x, y], [u, v]) = (camera.pixel(point), after.pixel(point));
            assert!((x - u).abs() < 1e-2 && (y - v).abs() < 1e-2, "{x} {y}, {u} {v}");
        }
    }
}
