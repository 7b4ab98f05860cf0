//! Seeded random weights for a model that is to be trained, as OpenAI and OpenCLIP initialise theirs.
use super::config::ClipConfig;
use super::model::{ClipModel, Parts};
use super::names::Walk;
use super::weights::set;
use burn::module::{Module, ModuleMapper, Param};
use burn::tensor::{Device, Tensor};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

impl ClipModel {
    /// A model with random weights on `device`: the same seed gives the same weights on every device.
    pub fn init(config: &ClipConfig, parts: Parts, device: &Device, seed: u64) -> Self {
        let mut init = Init {
            walk: Walk::default(),
            rng: ChaCha8Rng::seed_from_u64(seed),
            vision_width: config.vision.width,
            text_width: config.text.width,
            layers: config.text.blocks.layers,
        };
        Self::new(config, parts, device).map(&mut init)
    }
}

struct Init {
    walk: Walk,
    rng: ChaCha8Rng,
    vision_width: usize,
    text_width: usize,
    layers: usize,
}

/// How a parameter starts.
enum Start {
    Constant(f32),
    Normal(f32),
    Uniform(f32),
}

impl Init {
    /// `shape` is the parameter's in the module: `[in, out]` for linear maps, `[out, in, k, k]` for convolutions.
    fn start(&self, shape: &[usize]) -> Start {
        let name = self.walk.name();
        let width = if name.starts_with("visual.") {
            self.vision_width
        } else {
            self.text_width
        };
        let power = |n: usize| Start::Normal((n as f32).powf(-0.5));
        match name.rsplit('.').next().unwrap_or_default() {
            "bias" | "in_proj_bias" | "running_mean" => Start::Constant(0.0),
            "running_var" => Start::Constant(1.0),
            // exp of this is 1 / 0.07
            "logit_scale" => Start::Constant(2.659_26),
            // A residual block starts as the identity.
            "weight" if name.starts_with("visual.layer") && name.ends_with("bn3.weight") => Start::Constant(0.0),
            "weight" if self.walk.is_norm() => Start::Constant(1.0),
            "weight" if name == "token_embedding.weight" => Start::Normal(0.02),
            "positional_embedding" if name == "positional_embedding" => Start::Normal(0.01),
            "positional_embedding" if name.contains("attnpool") => power(shape[1]),
            "class_embedding" | "positional_embedding" | "proj" | "text_projection" => power(width),
            "in_proj_weight" => power(width),
            "weight" if name.ends_with("c_fc.weight") => power(2 * width),
            // Both write into the residual stream, which `2 * layers` of them share.
            "weight" if name.contains("resblocks") => power(width * 2 * self.layers),
            "weight" if shape.len() == 4 => {
                let fan_in = shape[1..].iter().product::<usize>();
                Start::Uniform((fan_in as f32).powf(-0.5))
            }
            _ => power(shape[0]),
        }
    }

    /// One value of the standard normal distribution (Box and Muller 1958).
    fn normal(&mut self) -> f32 {
        let radius = (-2.0 * (1.0 - self.rng.random::<f64>()).ln()).sqrt();
        (radius * (std::f64::consts::TAU * self.rng.random::<f64>()).cos()) as f32
    }
}

impl ModuleMapper for Init {
    fn enter_module(&mut self, name: &str, container: &str) {
        self.walk.enter(name, container);
    }
    fn exit_module(&mut self, _: &str, _: &str) {
        self.walk.exit();
    }
    fn map_float<const D: usize>(&mut self, param: Param<Tensor<D>>) -> Param<Tensor<D>> {
        let shape = param.lazy_shape().to_vec();
        let count = shape.iter().product();
        let values = match self.start(&shape) {
            Start::Constant(value) => vec![value; count],
            Start::Normal(std) => (0..count).map(|_| std * self.normal()).collect(),
            Start::Uniform(bound) => (0..count)
                .map(|_| bound * (2.0 * self.rng.random::<f32>() - 1.0))
                .collect(),
        };
        set(param, values)
    }
}
