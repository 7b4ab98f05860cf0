//! Prepares training views of a scene as embeddings do, on one thread, and prints processor time a view:
//! `cargo run --release --example bench_views -- SCENE [VIEWS] [hash]`.
//!
//! With `hash` it also prints a hash of all that a view is, of its picture and of a gradient: versions that print the same
//! draw the same bytes. Processor time is Linux's, and counts well on a machine that does other things.
use std::hash::{DefaultHasher, Hash, Hasher};

use guardsplat_engine::scene::Scene;
use guardsplat_engine::splat::{CpuRasterizer, Geometry, Rasterizer, WeightCache, sh};
use guardsplat_engine::view::{Split, ViewSampler};

type Failure = Box<dyn std::error::Error>;

/// Processor time of all threads so far.
fn processor_ms() -> Result<f64, Failure> {
    let mut nanoseconds = 0.0;
    for task in std::fs::read_dir("/proc/self/task")? {
        let text = std::fs::read_to_string(task?.path().join("schedstat"))?;
        nanoseconds += text.split(' ').next().unwrap_or_default().parse::<f64>()?;
    }
    Ok(nanoseconds * 1e-6)
}

fn main() -> Result<(), Failure> {
    let mut arguments = std::env::args().skip(1);
    let path = arguments.next().ok_or("usage: bench_views SCENE [VIEWS] [hash]")?;
    let views: u64 = arguments.next().map_or(Ok(18), |v| v.parse())?;
    let hashed = arguments.next().is_some();
    rayon::ThreadPoolBuilder::new().num_threads(1).build_global()?;
    let gaussians = Scene::read(path.as_ref())?.gaussians;
    let geometry = Geometry::new(&gaussians);
    let sampler = ViewSampler::new(&gaussians, 1)?;
    // As a CPU, a card, and who reads a scene prepare them.
    let kinds = [
        (160, WeightCache::Weights),
        (160, WeightCache::None),
        (224, WeightCache::None),
    ];
    for (size, cache) in kinds {
        let (mut ms, mut hash) = (0.0, DefaultHasher::new());
        let (mut visible, mut pairs, mut weights) = (0, 0, 0);
        for index in 0..views {
            let camera = sampler.camera(Split::Training, index, size);
            // As those of `standard` stand for pictures of one to nine times their side.
            let times = 1.0 + (index % 9) as f32;
            let before = processor_ms()?;
            let view = geometry.prepare_averaged(&camera, times, cache)?;
            ms += processor_ms()? - before;
            visible += view.visible.len();
            pairs += view.tiles.pairs();
            weights += view.weight_count().unwrap_or(0);
            if !hashed {
                continue;
            }
            let colours = sh::colours(&gaussians.sh, None, &view);
            let picture = CpuRasterizer.render(&view, &colours, [1.0, 0.5, 0.2])?;
            let gradient = CpuRasterizer.backward(&view, &picture.pixels)?;
            let tiles = &view.tiles;
            (
                &view.visible,
                &tiles.start,
                &tiles.splats,
                &tiles.slots,
                &tiles.slot_start,
            )
                .hash(&mut hash);
            bytemuck::cast_slice::<_, u32>(&view.splats).hash(&mut hash);
            bytemuck::cast_slice::<_, u32>(&view.directions).hash(&mut hash);
            for numbers in [&colours, &picture.pixels, &gradient] {
                bytemuck::cast_slice::<_, u32>(numbers).hash(&mut hash);
            }
        }
        let mean = |sum: usize| sum / views.max(1) as usize;
        println!(
            "{size} px, {cache:?}: {:.2} ms a view, {} visible, {} pairs, {} weights{}",
            ms / views.max(1) as f64,
            mean(visible),
            mean(pairs),
            mean(weights),
            if hashed {
                format!(", hash {:016x}", hash.finish())
            } else {
                String::new()
            }
        );
    }
    Ok(())
}
