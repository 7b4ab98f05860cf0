//! How alike a scene's views of 160 px are to finer ones, which says how large views are, as CSV:
//! `cargo run --release --example view_sizes -- SCENE...`.
use guardsplat_engine::extract::likeness_to_finer;
use guardsplat_engine::scene::Scene;
use guardsplat_engine::splat::Geometry;
use guardsplat_engine::view::ViewSampler;

/// Side of views in pixels.
const SIDE: u32 = 160;
/// Seeds of the views.
const SEEDS: u64 = 5;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    println!("scene,seed,side_px,likeness_to_finer_db");
    for path in std::env::args().skip(1).map(std::path::PathBuf::from) {
        let scene = Scene::read(&path)?.gaussians;
        let geometry = Geometry::new(&scene);
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        for seed in 0..SEEDS {
            let sampler = ViewSampler::new(&scene, seed)?;
            let likeness = likeness_to_finer(&geometry, &sampler, SIDE)?;
            println!("{name},{seed},{SIDE},{likeness:.2}");
        }
    }
    Ok(())
}
