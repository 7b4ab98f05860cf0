//! A pinhole camera in the convention of OpenCV, COLMAP and the reference rasteriser.
use super::vector::{cross, dot, perpendicular, sub, unit};
use serde::{Deserialize, Serialize};

/// A pinhole camera: x right, y down, z forward; pixel (0, 0) covers [0, 1) x [0, 1).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Camera {
    /// Pixels a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Focal length along x in pixels.
    pub fx: f32,
    /// Focal length along y in pixels.
    pub fy: f32,
    /// Principal point, x in pixels.
    pub cx: f32,
    /// Principal point, y in pixels.
    pub cy: f32,
    /// World to camera, rows.
    pub rotation: [[f32; 3]; 3],
    /// World to camera: `p_camera = rotation * p_world + translation`.
    pub translation: [f32; 3],
}

impl Camera {
    /// A camera at `eye` that looks at `target`, with `up` upwards in the picture.
    ///
    /// `fov_y` is the vertical field of view in radians; pixels are square and the principal point is the centre.
    /// Degenerate arguments (eye on target, up along the view) get some valid rotation instead of NaN.
    pub fn look_at(eye: [f32; 3], target: [f32; 3], up: [f32; 3], fov_y: f32, width: u32, height: u32) -> Camera {
        let forward = unit(sub(target, eye)).unwrap_or([0.0, 0.0, 1.0]);
        let right = unit(cross(forward, up)).unwrap_or_else(|| perpendicular(forward));
        let down = cross(forward, right);
        let rotation = [right, down, forward];
        let translation = rotation.map(|row| -dot(row, eye));
        let focal = 0.5 * height as f32 / (0.5 * fov_y).tan();
        Camera {
            width,
            height,
            fx: focal,
            fy: focal,
            cx: 0.5 * width as f32,
            cy: 0.5 * height as f32,
            rotation,
            translation,
        }
    }

    /// The same view at so many times the size.
    #[must_use]
    pub fn enlarged(&self, times: u32) -> Camera {
        let factor = times as f32;
        Camera {
            width: self.width * times,
            height: self.height * times,
            fx: self.fx * factor,
            fy: self.fy * factor,
            cx: self.cx * factor,
            cy: self.cy * factor,
            ..self.clone()
        }
    }

    /// What a window of the picture shows, at the size of the whole: `kept` of each side, and `at` where it is along x and y,
    /// 0 (left, top) to 1.
    #[must_use]
    pub fn window(&self, kept: f32, at: [f32; 2]) -> Camera {
        let first = |side: u32, at: f32| at * (1.0 - kept) * side as f32;
        Camera {
            fx: self.fx / kept,
            fy: self.fy / kept,
            cx: (self.cx - first(self.width, at[0])) / kept,
            cy: (self.cy - first(self.height, at[1])) / kept,
            ..self.clone()
        }
    }

    /// Where the camera is, in world units.
    pub fn centre(&self) -> [f32; 3] {
        std::array::from_fn(|k| {
            -(0..3)
                .map(|row| self.rotation[row][k] * self.translation[row])
                .sum::<f32>()
        })
    }

    /// Where a point of the world is seen, x and y in pixels; of a point behind the camera that means nothing.
    pub fn pixel(&self, p: [f32; 3]) -> [f32; 2] {
        let [x, y, z] = self.to_camera(p);
        [self.fx * x / z + self.cx, self.fy * y / z + self.cy]
    }

    /// World to camera coordinates.
    pub(crate) fn to_camera(&self, p: [f32; 3]) -> [f32; 3] {
        std::array::from_fn(|row| dot(self.rotation[row], p) + self.translation[row])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn close(a: [f32; 3], b: [f32; 3]) -> bool {
        sub(a, b).iter().all(|d| d.abs() < 1e-5)
    }

    #[test]
    fn look_at_puts_the_target_on_the_axis_and_up_upwards() {
        let eye = [1.0, -2.0, 3.0];
        let camera = Camera::look_at(eye, [0.5, 0.25, -1.0], [0.0, 1.0, 0.0], 0.8, 64, 48);
        assert!(close(camera.centre(), eye));
        let distance = dot(sub([0.5, 0.25, -1.0], eye), sub([0.5, 0.25, -1.0], eye)).sqrt();
        assert!(close(camera.to_camera([0.5, 0.25, -1.0]), [0.0, 0.0, distance]));
        // Above the target is up in the picture, which is negative y.
        assert!(camera.to_camera([0.5, 1.25, -1.0])[1] < 0.0);
        // The vertical field of view ends at the picture's edge.
        assert!((camera.fy * (0.4f32).tan() - 24.0).abs() < 1e-4);
    }

    #[test]
    fn a_window_is_that_part_of_the_picture() {
        let camera = Camera::look_at([0.0, 0.0, -3.0], [0.1, 0.2, 0.0], [0.0, -1.0, 0.0], 0.8, 64, 48);
        let window = camera.window(0.5, [1.0, 0.25]);
        for point in [[0.0; 3], [0.4, -0.3, 0.5]] {
            let [x, y] = camera.pixel(point);
            let [u, v] = window.pixel(point);
            // The right half, from an eighth of the height.
            assert!((u - 2.0 * (x - 32.0)).abs() < 1e-3 && (v - 2.0 * (y - 6.0)).abs() < 1e-3);
        }
    }

    #[test]
    fn rotation_is_right_handed_and_orthonormal_even_when_degenerate() {
        let degenerate = [
            ([0.0; 3], [0.0; 3], [0.0, 1.0, 0.0]),
            ([0.0; 3], [0.0, 5.0, 0.0], [0.0, 1.0, 0.0]),
            ([1e20, 0.0, 0.0], [0.0; 3], [0.0; 3]),
            ([0.0; 3], [3.0, -1.0, 2.0], [0.0, 0.0, -1.0]),
        ];
        for (eye, target, up) in degenerate {
            let r = Camera::look_at(eye, target, up, 0.7, 10, 10).rotation;
            assert!(close(cross(r[0], r[1]), r[2]), "{r:?}");
            for (i, j) in [(0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)] {
                let expected = if i == j { 1.0 } else { 0.0 };
                assert!((dot(r[i], r[j]) - expected).abs() < 1e-5, "{r:?}");
            }
        }
    }
}
