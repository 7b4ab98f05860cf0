//! Pictures to tensors and back.
use burn::tensor::{Device, Tensor, TensorData};

use crate::error::{Error, Result};
use crate::picture::Picture;

/// Stacks pictures of one size into `[b, 3, height, width]`, values as they are.
///
/// Fails without pictures, when sizes differ, and when a picture's pixels do not fit its size.
pub fn batch(pictures: &[&Picture], device: &Device) -> Result<Tensor<4>> {
    let bad = |reason| {
        Err(Error::BadOption {
            field: "pictures",
            reason,
        })
    };
    let Some(first) = pictures.first() else {
        return bad("there are none".into());
    };
    let (width, height) = (first.width as usize, first.height as usize);
    let area = width * height;
    if area == 0 {
        return bad(format!("a picture of {width} x {height} pixels has none"));
    }
    let mut values: Vec<f32> = Vec::with_capacity(pictures.len() * 3 * area);
    for picture in pictures {
        if (picture.width, picture.height) != (first.width, first.height) {
            return bad(format!(
                "sizes differ: {width} x {height} and {} x {}",
                picture.width, picture.height
            ));
        }
        if picture.pixels.len() != 3 * area {
            return bad(format!(
                "{} values are not {width} x {height} pixels",
                picture.pixels.len()
            ));
        }
        for channel in 0..3 {
            values.extend(picture.pixels.iter().skip(channel).step_by(3));
        }
    }
    Ok(Tensor::from_data(
        TensorData::new(values, [pictures.len(), 3, height, width]),
        device,
    ))
}

/// Splits `[b, 3, height, width]` into pictures, values as they are. Fails when the device does.
pub fn unbatch(tensor: Tensor<4>) -> Result<Vec<Picture>> {
    let [_, channels, height, width] = tensor.dims();
    if channels != 3 {
        return Err(Error::BadOption {
            field: "pictures",
            reason: format!("{channels} channels instead of 3"),
        });
    }
    let pixels = tensor
        .permute([0, 2, 3, 1])
        .try_into_vec_as::<f32>()
        .map_err(|e| Error::Device {
            device: "pictures".into(),
            reason: e.to_string(),
        })?;
    let picture = |chunk: &[f32]| Picture {
        width: width as u32,
        height: height as u32,
        pixels: chunk.to_vec(),
    };
    Ok(pixels.chunks_exact((3 * height * width).max(1)).map(picture).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn round_trip_and_layout() {
        let picture = |seed: u32| Picture {
            width: 3,
            height: 2,
            pixels: (0..18).map(|i| (i + seed) as f32).collect(),
        };
        let (a, b) = (picture(0), picture(100));
        let tensor = batch(&[&a, &b], &Device::flex()).unwrap();
        assert_eq!(tensor.dims(), [2, 3, 2, 3]);
        let green = tensor.clone().slice([0..1, 1..2]).try_into_vec_as::<f32>().unwrap();
        assert_eq!(green, [1.0, 4.0, 7.0, 10.0, 13.0, 16.0]);
        assert_eq!(unbatch(tensor).unwrap(), [a, b]);
    }

    #[test]
    fn bad_input_is_refused() {
        let device = Device::flex();
        let picture = |width, n| Picture {
            width,
            height: 1,
            pixels: vec![0.0; n],
        };
        let reason = |pictures: &[&Picture]| batch(pictures, &device).unwrap_err().to_string();
        assert!(reason(&[]).contains("none"));
        assert!(reason(&[&picture(0, 0)]).contains("0 x 1"));
        assert!(reason(&[&picture(1, 3), &picture(2, 6)]).contains("1 x 1 and 2 x 1"));
        assert!(reason(&[&picture(2, 3)]).contains("3 values are not 2 x 1"));
    }
}
