//! Copies of a scene as people edit them, and the scene in levels of detail: what a mark has to stand.
//!
//! `cargo run --release --example edited_copies -- IN.ply FOLDER`
use guardsplat_scene::alter::{Motion, crop, halved, moved, shuffled, without_floaters};
use guardsplat_scene::convert::convert_to;
use guardsplat_scene::testing::write_streamed_sog;
use guardsplat_scene::{Format, Gaussians, Result, Scene};
use std::path::Path;

fn main() -> Result<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [input, folder] = arguments.as_slice() else {
        eprintln!("give a scene, and a folder that is there for its copies");
        std::process::exit(1);
    };
    let folder = Path::new(folder);
    let scene = Scene::read(Path::new(input))?.into_gaussians();
    let (least, largest) = middle(&scene, 0.15);
    let turned = Motion {
        rotation: [0.8, 0.3, -0.4, 0.34],
        scale: 2.5,
        shift: [3.0, -1.0, 7.0],
    };
    // z is where y was, as between programs whose axes differ.
    let quarter_turn = Motion {
        rotation: [1.0, 1.0, 0.0, 0.0],
        ..turned
    };
    let half = halved(&scene)?;
    for (name, copy) in [
        ("cropped", crop(&scene, least, largest)?),
        ("no-floaters", without_floaters(&scene, 3)?),
        ("shuffled", shuffled(&scene, 1)?),
        ("turned", moved(&scene, turned)?),
        ("quarter-turn", moved(&scene, quarter_turn)?),
        ("halved", half.clone()),
    ] {
        println!("{name}: {} of {} Gaussians", copy.len(), scene.len());
        convert_to(&copy, Format::Ply, &folder.join(format!("{name}.ply")))?;
    }
    let quarter = halved(&half)?;
    write_streamed_sog(&folder.join("levels"), &[scene, half, quarter], 4)
}

/// A box without `share` of the Gaussians at each end of the first and the last axis.
fn middle(scene: &Gaussians, share: f64) -> ([f32; 3], [f32; 3]) {
    let (mut least, mut largest) = ([f32::MIN; 3], [f32::MAX; 3]);
    for axis in [0, 2] {
        let mut all: Vec<f32> = scene.positions.iter().map(|p| p[axis]).collect();
        all.sort_by(f32::total_cmp);
        let place = (share * all.len() as f64) as usize;
        if let (Some(first), Some(last)) = (all.get(place), all.iter().rev().nth(place)) {
            (least[axis], largest[axis]) = (*first, *last);
        }
    }
    (least, largest)
}
