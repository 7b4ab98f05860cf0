//! What the decoder does to CLIP features before its MLP: centre them and turn them into a space both towers share.
use burn::tensor::{Device, Tensor, TensorData};

use crate::card::{affine, on_card};

/// Widest CLIP feature that is accepted; published models reach 1024.
pub const MAX_WIDTH: usize = 4096;

/// Centring and projection of both towers' features, and the natural variation that remains afterwards.
///
/// An image feature x (length `width`, L2-normalised) becomes `(x - mean_image) * matrix_image`, a text feature t
/// `(t - mean_text) * matrix_text`; both have `rank` numbers of comparable spread. Plain data: what a key file holds.
#[derive(Clone, Debug, PartialEq)]
pub struct Projection {
    /// Length d of a CLIP feature.
    pub width: usize,
    /// Length k <= d of a projected feature.
    pub rank: usize,
    /// d numbers.
    pub mean_image: Vec<f32>,
    /// d numbers.
    pub mean_text: Vec<f32>,
    /// d x k, row-major.
    pub matrix_image: Vec<f32>,
    /// d x k, row-major.
    pub matrix_text: Vec<f32>,
    /// k x k, row-major, lower triangular: the factor F of the covariance `F F^T` that projected image features of
    /// unmarked pictures have. Noise for training the decoder is `F g` with g standard normal.
    pub noise: Vec<f32>,
}

impl Projection {
    /// The projection that changes nothing and adds no noise: the published method as it is.
    pub fn identity(width: usize) -> Self {
        let mut eye = vec![0.0; width * width];
        (0..width).for_each(|i| eye[i * width + i] = 1.0);
        Self {
            width,
            rank: width,
            mean_image: vec![0.0; width],
            mean_text: vec![0.0; width],
            matrix_image: eye.clone(),
            matrix_text: eye,
            noise: vec![0.0; width * width],
        }
    }

    /// The parts with their names and shapes, in the order in which a file holds them.
    pub fn parts(&self) -> [(&'static str, Vec<usize>, &Vec<f32>); 5] {
        let (d, k) = (self.width, self.rank);
        [
            ("projection.matrix_image", vec![d, k], &self.matrix_image),
            ("projection.matrix_text", vec![d, k], &self.matrix_text),
            ("projection.mean_image", vec![d], &self.mean_image),
            ("projection.mean_text", vec![d], &self.mean_text),
            ("projection.noise", vec![k, k], &self.noise),
        ]
    }

    /// Checks sizes and that every number is finite; the error says which part is wrong.
    pub fn check(&self) -> Result<(), String> {
        if self.width == 0 || self.width > MAX_WIDTH || self.rank == 0 || self.rank > self.width {
            return Err(format!(
                "a projection from {} to {} dimensions is outside 1 <= rank <= width <= {MAX_WIDTH}",
                self.width, self.rank
            ));
        }
        for (name, shape, values) in self.parts() {
            if values.len() != shape.iter().product::<usize>() {
                return Err(format!("{name} has {} values, not {shape:?}", values.len()));
            }
            if let Some(at) = values.iter().position(|v| !v.is_finite()) {
                return Err(format!("{name} holds {} at {at}", values[at]));
            }
        }
        Ok(())
    }

    /// Projects text features `[n][width]` on the host; gives `[n][rank]`.
    pub fn project_text(&self, features: &[f32]) -> Vec<f32> {
        project(features, &self.mean_text, &self.matrix_text, self.rank)
    }

    /// Projects image features `[n][width]` on the host; gives `[n][rank]`.
    #[cfg(test)]
    pub(crate) fn project_image(&self, features: &[f32]) -> Vec<f32> {
        project(features, &self.mean_image, &self.matrix_image, self.rank)
    }

    /// The image side as an affine map on a device.
    pub fn image_map(&self, device: &Device) -> AffineMap {
        AffineMap::new(&self.mean_image, &self.matrix_image, self.rank, device)
    }

    /// The text side as an affine map on a device.
    pub fn text_map(&self, device: &Device) -> AffineMap {
        AffineMap::new(&self.mean_text, &self.matrix_text, self.rank, device)
    }
}

fn project(features: &[f32], mean: &[f32], matrix: &[f32], rank: usize) -> Vec<f32> {
    let mut projected = Vec::with_capacity(features.len() / mean.len() * rank);
    for row in features.chunks_exact(mean.len()) {
        let mut sum = vec![0.0_f32; rank];
        for ((x, m), weights) in row.iter().zip(mean).zip(matrix.chunks_exact(rank)) {
            let centred = x - m;
            sum.iter_mut().zip(weights).for_each(|(s, w)| *s += centred * w);
        }
        projected.append(&mut sum);
    }
    projected
}

/// `(x - mean) * matrix` on a device, differentiable in x; its constants track no gradient.
#[derive(Clone, Debug)]
pub struct AffineMap {
    mean: Tensor<2>,
    matrix: Tensor<2>,
}

impl AffineMap {
    fn new(mean: &[f32], matrix: &[f32], rank: usize, device: &Device) -> Self {
        let width = mean.len();
        Self {
            mean: Tensor::from_data(TensorData::new(mean.to_vec(), [1, width]), device),
            matrix: Tensor::from_data(TensorData::new(matrix.to_vec(), [width, rank]), device),
        }
    }

    /// Numbers that it holds.
    pub(super) fn parameters(&self) -> usize {
        self.mean.shape().num_elements() + self.matrix.shape().num_elements()
    }

    /// Maps `[b, width]` to `[b, rank]`.
    pub fn apply(&self, features: Tensor<2>) -> Tensor<2> {
        if on_card(&features) {
            return affine(
                features,
                Some(self.mean.clone().flatten(0, 1)),
                self.matrix.clone(),
                None,
            );
        }
        (features - self.mean.clone()).matmul(self.matrix.clone())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn host_and_device_agree() {
        let projection = Projection {
            width: 3,
            rank: 2,
            mean_image: vec![1.0, 2.0, 3.0],
            mean_text: vec![0.5, 0.0, -0.5],
            matrix_image: vec![1.0, 2.0, 3.0, 4.0, 5.0, 6.0],
            matrix_text: vec![-1.0, 0.5, 0.0, 2.0, 1.0, -3.0],
            noise: vec![1.0, 0.0, 0.0, 1.0],
        };
        projection.check().unwrap();
        let x = [2.0, 2.0, 2.0, 0.0, 0.0, 0.0];
        assert_eq!(projection.project_image(&x), [-4.0, -4.0, -22.0, -28.0]);
        let device = Device::flex();
        let tensor = Tensor::<2>::from_data(TensorData::new(x.to_vec(), [2, 3]), &device);
        let image = projection.image_map(&device).apply(tensor.clone());
        assert_eq!(image.try_to_vec_as::<f32>().unwrap(), projection.project_image(&x));
        let text = projection.text_map(&device).apply(tensor);
        assert_eq!(text.try_to_vec_as::<f32>().unwrap(), projection.project_text(&x));
    }

    #[test]
    fn identity_changes_nothing() {
        let identity = Projection::identity(4);
        identity.check().unwrap();
        let x = [0.5, -0.5, 0.5, 0.5];
        assert_eq!(identity.project_image(&x), x);
        assert_eq!(identity.project_text(&x), x);
    }

    #[test]
    fn damage_is_named() {
        let mut p = Projection::identity(4);
        p.noise[3] = f32::NAN;
        assert!(p.check().unwrap_err().contains("projection.noise holds NaN at 3"));
        let mut p = Projection::identity(4);
        p.mean_text.pop();
        assert!(p.check().unwrap_err().contains("projection.mean_text has 3 values"));
        let p = Projection {
            rank: 5,
            ..Projection::identity(4)
        };
        assert!(p.check().unwrap_err().contains("from 4 to 5"));
    }
}
