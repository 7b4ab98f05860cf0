//! Generalised divisive normalisation (Ballé, Laparra and Simoncelli 2016, arXiv 1511.06281) and its inverse.
use burn::tensor::{Device, Tensor, TensorData};

/// `y_i = x_i / sqrt(beta_i + sum_j gamma_ij x_j^2)` over the channels of a pixel; the inverse multiplies instead.
#[derive(Clone, Debug)]
pub(super) struct Gdn {
    /// `[1, c, 1]`.
    beta: Tensor<3>,
    /// `[1, c, c]`.
    gamma: Tensor<3>,
    inverse: bool,
}

impl Gdn {
    /// With `beta`, one a channel and positive, and `gamma`, row by row and not negative.
    pub fn new(beta: Vec<f32>, gamma: Vec<f32>, inverse: bool, device: &Device) -> Self {
        let c = beta.len();
        Self {
            beta: Tensor::from_data(TensorData::new(beta, [1, c, 1]), device),
            gamma: Tensor::from_data(TensorData::new(gamma, [1, c, c]), device),
            inverse,
        }
    }

    /// `[b, c, h, w]`, of the same shape.
    pub fn forward(&self, x: Tensor<4>) -> Tensor<4> {
        let [b, c, h, w] = x.dims();
        let x = x.reshape([b, c, h * w]);
        let norm = (self.gamma.clone().matmul(x.clone().square()) + self.beta.clone()).sqrt();
        let y = if self.inverse { x * norm } else { x / norm };
        y.reshape([b, c, h, w])
    }
}
