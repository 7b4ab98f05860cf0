//! Loads the weights of [`super::lpips`] from safetensors, bounded and checked.
use std::fs::File;
use std::io::Read;
use std::path::Path;

use safetensors::tensor::{Dtype, SafeTensors};

use crate::clip::check_header;
use crate::error::{Error, Result};

/// One convolution of AlexNet.
#[derive(Clone, Copy)]
pub(super) struct Convolution {
    pub inputs: usize,
    pub outputs: usize,
    pub kernel: usize,
    pub stride: usize,
    pub padding: usize,
}

const fn convolution(inputs: usize, outputs: usize, kernel: usize, stride: usize, padding: usize) -> Convolution {
    Convolution {
        inputs,
        outputs,
        kernel,
        stride,
        padding,
    }
}

/// AlexNet's feature layers as torchvision has them.
pub(super) const CONVOLUTIONS: [Convolution; 5] = [
    convolution(3, 64, 11, 4, 2),
    convolution(64, 192, 5, 1, 2),
    convolution(192, 384, 3, 1, 1),
    convolution(384, 256, 3, 1, 1),
    convolution(256, 256, 3, 1, 1),
];

/// The file has 9.9 MB; anything much larger is something else.
const MAX_BYTES: u64 = 32 << 20;

/// Weights of one stage.
pub(super) struct StageWeights {
    /// `[outputs][inputs][kernel][kernel]`.
    pub weight: Vec<f32>,
    pub bias: Vec<f32>,
    pub head: Vec<f32>,
}

/// Reads all five stages.
pub(super) fn read(path: &Path) -> Result<Vec<StageWeights>> {
    let mut bytes = Vec::new();
    let file = File::open(path).map_err(Error::io(path))?;
    file.take(MAX_BYTES + 1)
        .read_to_end(&mut bytes)
        .map_err(Error::io(path))?;
    parse(&bytes).map_err(|reason| Error::BadModel {
        name: path.display().to_string(),
        reason,
    })
}

/// The five stages from a file's bytes.
pub(super) fn parse(bytes: &[u8]) -> Result<Vec<StageWeights>, String> {
    if bytes.len() as u64 > MAX_BYTES {
        return Err(format!("it is larger than {MAX_BYTES} bytes"));
    }
    check_header(bytes)?;
    let file = SafeTensors::deserialize(bytes).map_err(|e| format!("not a safetensors file ({e})"))?;
    let stage = |(i, c): (usize, Convolution)| {
        Ok(StageWeights {
            weight: tensor(
                &file,
                &format!("features.conv{i}.weight"),
                &[c.outputs, c.inputs, c.kernel, c.kernel],
            )?,
            bias: tensor(&file, &format!("features.conv{i}.bias"), &[c.outputs])?,
            head: tensor(&file, &format!("lin{i}.weight"), &[1, c.outputs, 1, 1])?,
        })
    };
    CONVOLUTIONS.into_iter().enumerate().map(stage).collect()
}

fn tensor(file: &SafeTensors<'_>, name: &str, shape: &[usize]) -> Result<Vec<f32>, String> {
    let view = file.tensor(name).map_err(|_| format!("{name} is missing"))?;
    if view.dtype() != Dtype::F32 || view.shape() != shape {
        return Err(format!(
            "{name} is {:?} {:?}, not F32 {shape:?}",
            view.dtype(),
            view.shape()
        ));
    }
    let values: Vec<f32> = view
        .data()
        .as_chunks::<4>()
        .0
        .iter()
        .map(|bytes| f32::from_le_bytes(*bytes))
        .collect();
    match values.iter().find(|v| !v.is_finite()) {
        Some(v) => Err(format!("{name} holds {v}")),
        None => Ok(values),
    }
}

#[cfg(test)]
mod tests {
    use safetensors::tensor::TensorView;

    use super::*;

    /// A file of all tensors, the first one's values set to `value` and the last one's channels to `last`.
    fn file(value: f32, last: usize, skip: &str) -> Vec<u8> {
        let mut parts = Vec::new();
        for (i, c) in CONVOLUTIONS.into_iter().enumerate() {
            let head = if i == 4 { last } else { c.outputs };
            parts.push((
                format!("features.conv{i}.weight"),
                vec![c.outputs, c.inputs, c.kernel, c.kernel],
            ));
            parts.push((format!("features.conv{i}.bias"), vec![c.outputs]));
            parts.push((format!("lin{i}.weight"), vec![1, head, 1, 1]));
        }
        parts.retain(|(name, _)| name != skip);
        let data: Vec<Vec<u8>> = parts
            .iter()
            .map(|(_, shape)| value.to_le_bytes().repeat(shape.iter().product()))
            .collect();
        let views = parts
            .iter()
            .zip(&data)
            .map(|((name, shape), data)| (name.as_str(), TensorView::new(Dtype::F32, shape.clone(), data).unwrap()));
        safetensors::serialize(views, None).unwrap()
    }

    #[test]
    fn whole_files_load_and_others_say_what_is_wrong() {
        let whole = file(0.5, 256, "");
        assert_eq!(parse(&whole).unwrap().len(), 5);
        let reason = |bytes: &[u8]| parse(bytes).err().unwrap();
        assert!(reason(&whole[..whole.len() - 1]).contains("not a safetensors file"));
        assert!(reason(b"PK").contains("not a safetensors file"));
        assert!(reason(&file(f32::NAN, 256, "")).contains("features.conv0.weight holds NaN"));
        assert!(reason(&file(0.5, 255, "")).contains("lin4.weight is F32 [1, 255, 1, 1], not F32 [1, 256, 1, 1]"));
        assert!(reason(&file(0.5, 256, "lin2.weight")).contains("lin2.weight is missing"));
        assert!(reason(&vec![0; MAX_BYTES as usize + 1]).contains("larger than"));
    }
}
