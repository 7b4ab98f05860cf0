//! How much memory an embedding will need, by its settings.
use super::pooled_view::PooledView;
use super::preparing::steps_ahead;
use super::settings::Settings;
use crate::error::Result;
use crate::extract::{Engine, cpu_weight_cache};
use crate::memory::{EmbeddingWorkload, MemoryRequirements, ModelBytes, SceneSize, ViewSize, embedding_requirements};
use crate::scene::Gaussians;
use crate::splat::{Geometry, PreparedView};
use crate::view::{Camera, Split, ViewSampler};

/// Predicts the most memory that an embedding of so many `marks` at once, with these settings, has in use at a time, where
/// steps are computed on the CPU or on a card.
pub fn predict_memory(
    scene: SceneSize,
    view: ViewSize,
    settings: &Settings,
    models: ModelBytes,
    marks: usize,
    on_cpu: bool,
) -> MemoryRequirements {
    let distorts_pictures = settings.robust_to.of_pictures().next().is_some();
    let work = EmbeddingWorkload {
        marks: marks as u64,
        size: settings.size,
        distorted_size: distorts_pictures.then_some(settings.distorted_size),
        views_per_step: settings.views_per_step,
        fresh_per_step: settings.fresh_per_step,
        steps_ahead: steps_ahead(on_cpu, scene.gaussians as usize),
        pool_views: settings.pool_views,
        pool_bytes: settings.pool_mebibytes << 20,
        early_stop_views: settings.early_stop.map_or(0, |stop| stop.views),
        verification_views: settings.verify.views,
    };
    embedding_requirements(scene, view, &work, models)
}

/// Training views that are measured: views differ, and so does what they take with the size of the picture that they stand
/// for. Fine splats hide less of what is behind.
const MEASURED_VIEWS: u64 = 3;

/// Measures some training views, which stand for pictures of their own size up to the largest.
///
/// # Errors
/// An empty scene, a failing device.
pub fn measure_view(
    engine: &Engine,
    gaussians: &Gaussians,
    settings: &Settings,
    cameras: &[Camera],
) -> Result<ViewSize> {
    let geometry = Geometry::new(gaussians);
    measured(gaussians, settings, cameras, |camera, times| {
        let camera = std::slice::from_ref(camera);
        let views = PooledView::of_cameras(engine, &geometry, camera, times, settings.half_weights, [1.0; 3])?;
        Ok(view_size(&views[0].view))
    })
}

/// Measures the same views as the CPU keeps them, without an engine.
///
/// # Errors
/// An empty scene.
pub fn measure_view_on_cpu(gaussians: &Gaussians, settings: &Settings, cameras: &[Camera]) -> Result<ViewSize> {
    let geometry = Geometry::new(gaussians);
    let cache = cpu_weight_cache(settings.size, settings.half_weights);
    measured(gaussians, settings, cameras, |camera, times| {
        Ok(view_size(&geometry.prepare_averaged(camera, times, cache)?))
    })
}

/// The mean size of views that stand for pictures so many times as large.
fn measured(
    gaussians: &Gaussians,
    settings: &Settings,
    cameras: &[Camera],
    size: impl Fn(&Camera, f32) -> Result<ViewSize>,
) -> Result<ViewSize> {
    let sampler = ViewSampler::seen_from(gaussians, settings.seed, settings.viewpoints(cameras))?;
    let mut mean = ViewSize {
        visible: 0.0,
        pixel: 0.0,
    };
    for view in 0..MEASURED_VIEWS {
        let share = view as f32 / (MEASURED_VIEWS - 1) as f32;
        let camera = sampler.camera(Split::Training, view, settings.size);
        let found = size(&camera, 1.0 + share * (settings.enlarged - 1.0))?;
        mean.visible += found.visible / MEASURED_VIEWS as f64;
        mean.pixel += found.pixel / MEASURED_VIEWS as f64;
    }
    Ok(mean)
}

fn view_size(view: &PreparedView) -> ViewSize {
    let weights = view.weight_bytes() as f64;
    let side = f64::from(view.camera.width);
    ViewSize {
        visible: view.bytes() as f64 - weights,
        pixel: weights / (side * side),
    }
}

/// Bytes of an engine's models with these settings.
pub(super) fn model_bytes(engine: &Engine, settings: &Settings) -> ModelBytes {
    ModelBytes {
        learning: engine.model_bytes(settings.lambda.lpips > 0.0),
        verifying: engine.model_bytes(true),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::embed::Preset;
    use crate::memory::Limits;
    use crate::memory::admission::{admit_marking, admit_reading};
    use crate::sample::sample;
    use crate::scene::Scene;

    fn up_to(memory: u64) -> Limits {
        Limits {
            memory,
            budget: true,
            buffer: None,
        }
    }

    /// What is foreseen is never more than what is predicted once the scene is read.
    #[test]
    fn what_is_foreseen_is_less_than_what_is_predicted() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("in.ply");
        let view = ViewSize {
            visible: 0.0,
            pixel: 0.0,
        };
        for degree in 0..=3 {
            let scene = sample(2000, degree, 1).unwrap();
            scene.write(&path, &scene.gaussians.sh).unwrap();
            let scene = Scene::read(&path).unwrap();
            let needed = predict_memory(
                SceneSize::of(&scene),
                view,
                &Preset::Draft.settings(),
                ModelBytes::default(),
                1,
                true,
            );
            admit_marking(&path, &up_to(needed.total()), MemoryRequirements::of_program()).unwrap();
            admit_reading(
                &path,
                &up_to(needed.program + needed.scene),
                MemoryRequirements::of_program(),
            )
            .unwrap();
        }
    }
}
