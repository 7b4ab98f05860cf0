use super::*;
use crate::splat::checks::{camera, conforms, scene};
use crate::splat::{CpuRasterizer, Rasterizer, WeightCache, prepare, sh};
use crate::testing::wgpu;

#[test]
fn the_gpu_agrees_with_the_reference() {
    let Some(compute) = wgpu() else { return };
    let rasterizer = GpuRasterizer::new(&compute.device).unwrap();
    conforms(&rasterizer, WeightCache::None);
    // Lists without the pairs that turned out to be hidden give the same picture.
    let (g, camera) = (scene(2000, 1), camera(75));
    let [all, pruned] = [WeightCache::None, WeightCache::Weights].map(|cache| {
        let view = prepare(&g, &camera, cache).unwrap();
        let picture = rasterizer
            .render(&view, &sh::colours(&g.sh, None, &view), [1.0; 3])
            .unwrap();
        (view.visible.len(), picture)
    });
    assert!(pruned.0 < all.0);
    assert_eq!(pruned.1, all.1);
}

#[test]
fn the_gpu_repeats_itself_to_the_byte() {
    let Some(compute) = wgpu() else { return };
    let g = scene(1500, 0);
    let view = prepare(&g, &camera(64), WeightCache::None).unwrap();
    let colours = sh::colours(&g.sh, None, &view);
    let run = || {
        // A new rasteriser each time: the second run must not depend on buffers that the first left.
        let rasterizer = GpuRasterizer::new(&compute.device).unwrap();
        let picture = rasterizer.render(&view, &colours, [0.0; 3]).unwrap();
        let gradient = rasterizer.backward(&view, &picture.pixels).unwrap();
        (picture, gradient)
    };
    let first = run();
    assert!(first.1.iter().any(|v| *v != 0.0));
    assert_eq!(first, run());
    assert_eq!(
        first.1.len(),
        CpuRasterizer.backward(&view, &first.0.pixels).unwrap().len()
    );
}

#[test]
fn another_device_is_an_error() {
    let error = GpuRasterizer::new(&Device::flex()).err().map(|e| e.to_string());
    assert!(error.is_some_and(|e| e.contains("needs a wgpu device")));
}
