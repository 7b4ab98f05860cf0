//! All quality figures of marked against original views at once.
use burn::tensor::Device;
use serde::Serialize;

use super::batch::batch;
use super::lpips::Lpips;
use super::psnr::{MeanPsnr, mean_psnr, psnr};
use super::ssim::ssim;
use crate::error::{Error, Result};
use crate::picture::Picture;
use crate::stop::Stop;

/// Means over views; the names are those of the program's JSON.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Quality {
    /// PSNR and whether views are identical.
    #[serde(flatten)]
    pub psnr: MeanPsnr,
    /// Mean SSIM.
    pub ssim: f64,
    /// Mean LPIPS; `None` (null) without its weights.
    pub lpips: Option<f64>,
}

/// Compares pairs of original and marked views, each pair of one size.
///
/// Fails without pairs, when the sizes of a pair differ, on pictures too small for LPIPS when it is given, and when it is
/// asked to stop.
pub fn measure(pairs: &[(Picture, Picture)], lpips: Option<&Lpips>, device: &Device, stop: &Stop) -> Result<Quality> {
    let device = &device.clone().without_autodiff();
    let views = pairs.iter().map(|(a, b)| psnr(a, b)).collect::<Result<Vec<_>>>()?;
    let psnr = mean_psnr(&views)?;
    let mean = |values: Vec<f64>| values.iter().sum::<f64>() / values.len() as f64;
    let similarity = |(a, b): &(Picture, Picture)| -> Result<f64> {
        stop.check()?;
        ssim(a, b)
    };
    let ssim = mean(pairs.iter().map(similarity).collect::<Result<_>>()?);
    let distance = |lpips: &Lpips, (a, b): &(Picture, Picture)| -> Result<f64> {
        stop.check()?;
        let distance = lpips
            .per_view(batch(&[a], device)?, batch(&[b], device)?)?
            .try_into_scalar::<f32>();
        distance.map(f64::from).map_err(|e| Error::Device {
            device: "lpips".into(),
            reason: e.to_string(),
        })
    };
    let lpips = match lpips {
        None => None,
        Some(lpips) => Some(mean(
            pairs.iter().map(|pair| distance(lpips, pair)).collect::<Result<_>>()?,
        )),
    };
    Ok(Quality { psnr, ssim, lpips })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::model_path;

    fn gradient(slope: f32) -> Picture {
        Picture {
            width: 32,
            height: 32,
            pixels: (0..32 * 32 * 3).map(|i| slope * (i % 96) as f32 / 96.0).collect(),
        }
    }

    #[test]
    fn json_has_the_promised_fields() {
        let pair = (gradient(0.5), gradient(0.5));
        let json = serde_json::to_value(measure(&[pair], None, &Device::flex(), &Stop::default()).unwrap()).unwrap();
        assert!(json["psnr_db"].is_null() && json["lpips"].is_null());
        assert_eq!(json["identical"], true);
        assert!((json["ssim"].as_f64().unwrap() - 1.0).abs() < 1e-6);
    }

    #[test]
    fn means_are_over_views() {
        let (a, b, c) = (gradient(0.5), gradient(0.55), gradient(0.6));
        let device = Device::flex();
        let lpips = model_path("lpips_alex_v0.1.safetensors").map(|path| Lpips::load(&path, &device).unwrap());
        let run = |pairs: &[(Picture, Picture)]| measure(pairs, lpips.as_ref(), &device, &Stop::default()).unwrap();
        let (first, second) = (run(&[(a.clone(), b.clone())]), run(&[(a.clone(), c.clone())]));
        let both = run(&[(a.clone(), b), (a, c)]);
        assert!((both.ssim - (first.ssim + second.ssim) / 2.0).abs() < 1e-9);
        let db = |q: &Quality| q.psnr.psnr_db.unwrap();
        assert!((db(&both) - (db(&first) + db(&second)) / 2.0).abs() < 1e-9);
        assert!(db(&first) > db(&second) && first.ssim > second.ssim);
        if lpips.is_some() {
            let value = |q: &Quality| q.lpips.unwrap();
            assert!((value(&both) - (value(&first) + value(&second)) / 2.0).abs() < 1e-9);
        }
        assert!(measure(&[], None, &device, &Stop::default()).is_err());
    }
}
