//! CLIP's modified ResNet (Radford et al. 2021, section 2.4): three-convolution stem, anti-aliased strides (an average
//! pool before a convolution of stride 1), and attention instead of the global average pool.
use super::config::VisionConfig;
use super::conv::Conv;
use super::params::param;
use super::transformer::attention;
use burn::module::{Module, Param};
use burn::nn::{BatchNorm, BatchNormConfig, Linear, LinearConfig};
use burn::tensor::activation::relu;
use burn::tensor::module::avg_pool2d;
use burn::tensor::ops::AvgPoolOptions;
use burn::tensor::{Device, Tensor};

/// A block's output is this many times wider than its middle.
const EXPANSION: usize = 4;

/// Image tower of the ResNet kind. Fields are named as in OpenAI's checkpoints.
///
/// On an autodiff device and not frozen, batch normalisation uses the statistics of the batch and updates its
/// running averages; otherwise it uses the running averages.
#[derive(Module, Debug)]
pub struct ResNet {
    conv1: Conv,
    bn1: BatchNorm,
    conv2: Conv,
    bn2: BatchNorm,
    conv3: Conv,
    bn3: BatchNorm,
    layer1: Vec<Bottleneck>,
    layer2: Vec<Bottleneck>,
    layer3: Vec<Bottleneck>,
    layer4: Vec<Bottleneck>,
    attnpool: AttentionPool,
}

#[derive(Module, Debug)]
struct Bottleneck {
    conv1: Conv,
    bn1: BatchNorm,
    conv2: Conv,
    bn2: BatchNorm,
    conv3: Conv,
    bn3: BatchNorm,
    /// What the shortcut passes when size or width change.
    downsample: Option<(Conv, BatchNorm)>,
    stride: usize,
}

#[derive(Module, Debug)]
struct AttentionPool {
    positional_embedding: Param<Tensor<2>>,
    q_proj: Linear,
    k_proj: Linear,
    v_proj: Linear,
    c_proj: Linear,
    heads: usize,
}

impl ResNet {
    /// Lays out the tower; `embed_dim` is the width of its features.
    pub fn new(vision: &VisionConfig, layers: [usize; 4], heads: usize, embed_dim: usize, device: &Device) -> Self {
        let width = vision.width;
        let norm = |channels| BatchNormConfig::new(channels).init(device);
        let mut channels = width;
        let mut stage = |index: usize| -> Vec<Bottleneck> {
            let planes = width << index;
            (0..layers[index])
                .map(|block| {
                    let stride = if block == 0 && index > 0 { 2 } else { 1 };
                    let input = std::mem::replace(&mut channels, planes * EXPANSION);
                    Bottleneck::new(input, planes, stride, device)
                })
                .collect()
        };
        Self {
            conv1: Conv::new([3, width / 2], 3, 2, device),
            bn1: norm(width / 2),
            conv2: Conv::new([width / 2, width / 2], 3, 1, device),
            bn2: norm(width / 2),
            conv3: Conv::new([width / 2, width], 3, 1, device),
            bn3: norm(width),
            layer1: stage(0),
            layer2: stage(1),
            layer3: stage(2),
            layer4: stage(3),
            attnpool: AttentionPool::new(vision.image_size / 32, width * 32, heads, embed_dim, device),
        }
    }

    /// Features `[batch, embed_dim]` of normalised pictures `[batch, 3, image_size, image_size]`.
    pub fn forward(&self, pictures: Tensor<4>) -> Tensor<2> {
        let x = relu(self.bn1.forward(self.conv1.forward(pictures)));
        let x = relu(self.bn2.forward(self.conv2.forward(x)));
        let x = relu(self.bn3.forward(self.conv3.forward(x)));
        let stages = [&self.layer1, &self.layer2, &self.layer3, &self.layer4];
        let x = stages
            .into_iter()
            .flatten()
            .fold(average_pool(x, 2), |x, block| block.forward(x));
        self.attnpool.forward(x)
    }
}

impl Bottleneck {
    fn new(input: usize, planes: usize, stride: usize, device: &Device) -> Self {
        let output = planes * EXPANSION;
        let norm = |channels| BatchNormConfig::new(channels).init(device);
        Self {
            conv1: Conv::new([input, planes], 1, 1, device),
            bn1: norm(planes),
            conv2: Conv::new([planes, planes], 3, 1, device),
            bn2: norm(planes),
            conv3: Conv::new([planes, output], 1, 1, device),
            bn3: norm(output),
            downsample: (stride > 1 || input != output)
                .then(|| (Conv::new([input, output], 1, 1, device), norm(output))),
            stride,
        }
    }

    fn forward(&self, x: Tensor<4>) -> Tensor<4> {
        let y = relu(self.bn1.forward(self.conv1.forward(x.clone())));
        let y = relu(self.bn2.forward(self.conv2.forward(y)));
        let y = self.bn3.forward(self.conv3.forward(average_pool(y, self.stride)));
        let shortcut = match &self.downsample {
            Some((conv, norm)) => norm.forward(conv.forward(average_pool(x, self.stride))),
            None => x,
        };
        relu(y + shortcut)
    }
}

impl AttentionPool {
    fn new(side: usize, width: usize, heads: usize, embed_dim: usize, device: &Device) -> Self {
        let linear = |output| LinearConfig::new(width, output).init(device);
        Self {
            positional_embedding: param([side * side + 1, width], device),
            q_proj: linear(width),
            k_proj: linear(width),
            v_proj: linear(width),
            c_proj: linear(embed_dim),
            heads,
        }
    }

    /// One query, the mean of all positions, attends to the mean and the positions: `[b, c, h, w]` to `[b, embed_dim]`.
    fn forward(&self, x: Tensor<4>) -> Tensor<2> {
        let [batch, width, h, w] = x.dims();
        let positions = x.reshape([batch, width, h * w]).swap_dims(1, 2);
        let mean = positions.clone().mean_dim(1);
        let tokens = Tensor::cat(vec![mean, positions], 1) + self.positional_embedding.val().unsqueeze();
        let query = self.q_proj.forward(tokens.clone().slice([0..batch, 0..1]));
        let (keys, values) = (self.k_proj.forward(tokens.clone()), self.v_proj.forward(tokens));
        let pooled = attention(query, keys, values, self.heads, None);
        self.c_proj.forward(pooled.reshape([batch, width]))
    }
}

/// Mean over squares of `size`; the picture as it is for size 1.
fn average_pool(x: Tensor<4>, size: usize) -> Tensor<4> {
    if size == 1 {
        return x;
    }
    avg_pool2d(x, AvgPoolOptions::new([size; 2]).with_stride([size; 2]))
}
