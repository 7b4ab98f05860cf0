//! Adam (Kingma and Ba 2015, arXiv 1412.6980) over the parameters of a module.
//!
//! Its own few lines: they spare this crate, which is for CPUs, the build of burn with its optimisers.
use std::collections::HashMap;

use burn::module::{Module, ModuleMapper, Param, ParamId};
use burn::tensor::{Gradients, Tensor};

const BETA_1: f64 = 0.9;
const BETA_2: f64 = 0.999;
const EPSILON: f64 = 1e-8;

/// Running means of the gradients and of their squares, flat, by parameter.
#[derive(Default)]
pub(crate) struct Adam {
    steps: i32,
    moments: HashMap<ParamId, [Tensor<1>; 2]>,
}

impl Adam {
    /// Takes one step at `rate`; parameters without a gradient stay.
    pub fn step<M: Module>(&mut self, rate: f64, module: M, gradients: &Gradients) -> M {
        self.steps = self.steps.saturating_add(1);
        let unbias = (1.0 - BETA_2.powi(self.steps)).sqrt();
        let mut mapper = Step {
            rate: rate * unbias / (1.0 - BETA_1.powi(self.steps)),
            epsilon: EPSILON * unbias,
            gradients,
            moments: &mut self.moments,
        };
        module.map(&mut mapper)
    }
}

struct Step<'a> {
    rate: f64,
    epsilon: f64,
    gradients: &'a Gradients,
    moments: &'a mut HashMap<ParamId, [Tensor<1>; 2]>,
}

impl ModuleMapper for Step<'_> {
    fn map_float<const D: usize>(&mut self, param: Param<Tensor<D>>) -> Param<Tensor<D>> {
        let (id, tensor, mapper) = param.consume();
        let Some(gradient) = tensor.grad(self.gradients) else {
            return Param::from_mapped_value(id, tensor, mapper);
        };
        let shape = tensor.dims();
        let count: usize = shape.iter().product();
        let gradient: Tensor<1> = gradient.reshape([count]);
        let [mean, square] = match self.moments.remove(&id) {
            Some([mean, square]) => [
                mean * BETA_1 + gradient.clone() * (1.0 - BETA_1),
                square * BETA_2 + gradient.square() * (1.0 - BETA_2),
            ],
            None => [gradient.clone() * (1.0 - BETA_1), gradient.square() * (1.0 - BETA_2)],
        };
        let change = mean.clone() / (square.clone().sqrt() + self.epsilon) * self.rate;
        self.moments.insert(id, [mean, square]);
        let stepped = (tensor.inner() - change.reshape(shape)).autodiff().require_grad();
        Param::from_mapped_value(id, stepped, mapper)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::host;
    use crate::parameter::parameter;
    use burn::tensor::Device;

    #[derive(Module, Debug)]
    struct Point {
        at: Param<Tensor<1>>,
    }

    #[test]
    fn agrees_with_the_formula_written_out() {
        let device = Device::flex().autodiff();
        let mut point = Point {
            at: parameter(&[1.0, -2.0], [2], &device),
        };
        let mut adam = Adam::default();
        let mut expected = [1.0_f64, -2.0];
        let mut moments = [[0.0_f64; 2]; 2];
        for step in 1..=5 {
            let gradients = point.at.val().powi_scalar(2).sum().backward();
            point = adam.step(0.1, point, &gradients);
            for (x, [m, v]) in expected.iter_mut().zip(&mut moments) {
                let g = 2.0 * *x;
                *m = 0.9 * *m + 0.1 * g;
                *v = 0.999 * *v + 0.001 * g * g;
                let (m, v) = (*m / (1.0 - 0.9_f64.powi(step)), *v / (1.0 - 0.999_f64.powi(step)));
                *x -= 0.1 * m / (v.sqrt() + 1e-8);
            }
        }
        let found = host(point.at.val().inner()).unwrap();
        for (f, e) in found.iter().zip(expected) {
            assert!((f64::from(*f) - e).abs() < 1e-5, "{found:?} {expected:?}");
        }
    }
}
