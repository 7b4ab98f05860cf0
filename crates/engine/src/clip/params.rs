//! Parameters that cost nothing until they are given a value: a model is laid out first, then loaded or initialised.
use burn::module::{Param, ParamId};
use burn::tensor::{Device, Shape, Tensor};

/// A trainable parameter of `shape` on `device`; zeros if it is used before anything was loaded.
pub(super) fn param<const D: usize>(shape: [usize; D], device: &Device) -> Param<Tensor<D>> {
    let init = move |device: &Device, grad: bool| Tensor::zeros(shape, device).set_require_grad(grad);
    Param::uninitialized(ParamId::new(), init, device.clone(), true, Shape::from(shape))
}
