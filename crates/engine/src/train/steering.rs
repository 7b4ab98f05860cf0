//! How far a scene can move the tower's averages in all its views at once.
//!
//! With `J_v` the gradient of the averages in view v to the Gaussians' constant colours, and M the diagonal of how much
//! squared change of the picture a squared change of a Gaussian's colour makes, the change `M^-1 J_v^T a` is the
//! cheapest that moves view v along a; what it does in another view w is `J_w M^-1 J_v^T a`. So the mean of
//! `J_w M^-1 J_v^T` over pairs of *different* views is what a mark can do in views that it was not fitted to. Pairs of
//! a view with itself would count what is merely memorised.
use super::scenes::ViewedScene;
use super::{IMAGE_SIZE, host};
use crate::clip::{ClipConfig, RandomFourierEncoder, preprocess};
use crate::device::Compute;
use crate::error::{Error, Result};
use crate::quality::{batch, unbatch};
use crate::splat::{PreparedView, Rasterizer};
use burn::tensor::{Tensor, TensorData};
use rayon::prelude::*;

/// Averages whose gradients are computed at once.
const BATCH: usize = 16;
/// Gaussians that change the picture less than this are left alone.
const UNSEEN: f32 = 1e-6;

/// Mean over pairs of different views of `J_w M^-1 J_v^T`, `[n][n]`, for a scene over white.
pub(super) fn across_views(
    scene: &ViewedScene,
    tower: &RandomFourierEncoder,
    config: &ClipConfig,
    rasterizer: &dyn Rasterizer,
    compute: &Compute,
    n: usize,
) -> Result<Vec<f64>> {
    let root = inverse_root_energy(scene, rasterizer)?;
    let size = 3 * root.len();
    let mut total = vec![0.0_f32; n * size];
    let mut alone = vec![0.0_f64; n * n];
    for view in &scene.views {
        let mut scaled = gradients(scene, view, tower, config, rasterizer, compute, n)?;
        for row in scaled.chunks_exact_mut(3 * view.visible.len()) {
            for (colour, &gaussian) in row.chunks_exact_mut(3).zip(&view.visible) {
                colour.iter_mut().for_each(|c| *c *= root[gaussian as usize]);
            }
        }
        let own = gram(&scaled, n, compute)?;
        alone.iter_mut().zip(own).for_each(|(a, o)| *a += o);
        let rows = scaled.chunks_exact(3 * view.visible.len());
        for (row, total) in rows.zip(total.chunks_exact_mut(size)) {
            for (colour, &gaussian) in row.chunks_exact(3).zip(&view.visible) {
                let at = 3 * gaussian as usize;
                total[at..at + 3].iter_mut().zip(colour).for_each(|(t, c)| *t += c);
            }
        }
    }
    let views = scene.views.len() as f64;
    let pairs = views * (views - 1.0);
    let all = gram(&total, n, compute)?;
    Ok(all
        .iter()
        .zip(alone)
        .map(|(all, alone)| (all - alone) / pairs)
        .collect())
}

/// `M^-1/2` of every Gaussian: M is the mean over views of the sum of its weights times all weights of the pixel, which
/// is what neighbours that change together cost.
fn inverse_root_energy(scene: &ViewedScene, rasterizer: &dyn Rasterizer) -> Result<Vec<f32>> {
    let mut energy = vec![0.0_f32; scene.gaussians.len()];
    for view in &scene.views {
        let ones = vec![1.0; 3 * view.visible.len()];
        let cover = rasterizer.render(view, &ones, [0.0; 3])?;
        let weight = rasterizer.backward(view, &cover.pixels)?;
        for (weight, &gaussian) in weight.chunks_exact(3).zip(&view.visible) {
            energy[gaussian as usize] += weight[0] / scene.views.len() as f32;
        }
    }
    let root = |e: f32| if e > UNSEEN { e.sqrt().recip() } else { 0.0 };
    Ok(energy.into_iter().map(root).collect())
}

/// Gradients of all averages to the colours of a view's visible Gaussians, `[n][visible][3]`.
fn gradients(
    scene: &ViewedScene,
    view: &PreparedView,
    tower: &RandomFourierEncoder,
    config: &ClipConfig,
    rasterizer: &dyn Rasterizer,
    compute: &Compute,
    n: usize,
) -> Result<Vec<f32>> {
    let tracking = compute.device.clone().autodiff();
    let picture = scene.picture(rasterizer, view, 1.0)?;
    let mut rows = Vec::with_capacity(n * 3 * view.visible.len());
    // Picture i is asked for the gradient of the i-th of a few filters, and none is computed for more than these.
    let few = tower.counts().enumerate().flat_map(|(scale, filters)| {
        (0..filters)
            .step_by(BATCH)
            .map(move |first| (scale, first..filters.min(first + BATCH)))
    });
    for (scale, filters) in few {
        let count = filters.len();
        let pictures = batch(&vec![&picture; count], &tracking)?.require_grad();
        let input = preprocess(pictures.clone(), IMAGE_SIZE, &config.normalization);
        let averages = tower.statistics_of(scale, filters, &input);
        let chosen = Tensor::<2>::eye(count, &tracking);
        let all = (averages * chosen).sum().backward();
        let gradient = pictures.grad(&all).ok_or_else(|| Error::Device {
            device: compute.name.clone(),
            reason: "the pictures have no gradient".into(),
        })?;
        let found: Vec<Vec<f32>> = unbatch(gradient)?
            .par_iter()
            .map(|gradient| rasterizer.backward(view, &gradient.pixels))
            .collect::<Result<_>>()?;
        rows.extend(found.into_iter().flatten());
    }
    Ok(rows)
}

/// Products of rows `[n][..]` with each other, `[n][n]`.
fn gram(rows: &[f32], n: usize, compute: &Compute) -> Result<Vec<f64>> {
    let rows = TensorData::new(rows.to_vec(), [n, rows.len() / n]);
    let rows = Tensor::<2>::from_data(rows, &compute.device);
    let products = host(rows.clone().matmul(rows.transpose()), compute)?;
    Ok(products.into_iter().map(f64::from).collect())
}
