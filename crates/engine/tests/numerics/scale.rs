//! Scenes of 1 to ten million Gaussians: what they take is known before the work, and what does not fit is refused.
use std::fs::File;
use std::path::Path;

use guardsplat_engine::embed::{Preset, predict_memory};
use guardsplat_engine::error::Error;
use guardsplat_engine::memory::admission::admit_marking;
use guardsplat_engine::memory::{Bytes, Limits, MemoryRequirements, ModelBytes, SceneSize, ViewSize};
use guardsplat_engine::sample::sample;
use guardsplat_engine::scene::{HEAD, Scene, Summary, summary};
use guardsplat_engine::splat::{MAX_PAIRS, WeightCache, prepare, sh};

use super::machine::Machine;
use super::scenes::{BACKGROUND, camera, full_screen, ordinary};

const SIZES: [u64; 5] = [1, 1_000, 100_000, 1_000_000, 10_000_000];
/// Numbers of a Gaussian of degree 3 without its normal: 3 + 4 + 3 + 1 and 48.
const NUMBERS: u64 = 59;

fn up_to(memory: u64) -> Limits {
    Limits {
        memory,
        budget: true,
        buffer: None,
    }
}

/// What a marking of degree 3 takes by the preset of the paper, by arithmetic: the file and 59 numbers a Gaussian; 48
/// learned changes and their gradient, and nine bytes that say which; two moments and a clock.
pub fn memory_is_predicted() {
    let view = ViewSize {
        visible: 0.0,
        pixel: 0.0,
    };
    let settings = Preset::Paper.settings();
    for n in SIZES {
        let size = SceneSize {
            gaussians: n,
            degree: 3,
            learned_degree: 3,
            exact: true,
            file: 4 * NUMBERS * n,
        };
        let needed = predict_memory(size, view, &settings, ModelBytes::default(), 1, true);
        assert_eq!(needed.scene, 2 * 4 * NUMBERS * n);
        assert_eq!(needed.offsets, (2 * 4 * 48 + 9) * n);
        assert_eq!(needed.optimiser, (2 * 4 * 48 + 4) * n);
        let total = needed.total();
        println!("{n} Gaussians: {needed}");
        up_to(total).admit(&needed).unwrap();
        let refused = up_to(total - 1).admit(&needed).unwrap_err().to_string();
        let numbers = [
            format!("it needs {}", Bytes(total)),
            format!("its budget is {}", Bytes(total - 1)),
        ];
        assert!(numbers.iter().all(|number| refused.contains(number)), "{refused}");
    }
    // What is predicted of a scene is what its arrays are.
    let scene = sample(1000, 3, 1).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scene.ply");
    scene.write(&path, &scene.gaussians.sh).unwrap();
    let scene = Scene::read(&path).unwrap();
    let g = &scene.gaussians;
    let arrays = size_of_val(&g.positions[..])
        + size_of_val(&g.rotations[..])
        + size_of_val(&g.log_scales[..])
        + size_of_val(&g.opacity_logits[..])
        + size_of_val(&g.sh.coefficients[..]);
    assert_eq!(SceneSize::of(&scene).bytes(), (scene.file_bytes() + arrays) as u64);
}

/// A scene of degree 3 whose file is there to its full length, though nothing but its header is on the disk.
fn sparse_file(path: &Path, gaussians: u64) -> Summary {
    let mut names: Vec<String> = ["x", "y", "z", "f_dc_0", "f_dc_1", "f_dc_2"].map(String::from).into();
    names.extend((0..45).map(|i| format!("f_rest_{i}")));
    names.push("opacity".into());
    names.extend((0..3).map(|i| format!("scale_{i}")));
    names.extend((0..4).map(|i| format!("rot_{i}")));
    let properties: String = names.iter().map(|name| format!("property float {name}\n")).collect();
    let header = format!("ply\nformat binary_little_endian 1.0\nelement vertex {gaussians}\n{properties}end_header\n");
    assert!(header.len() < HEAD);
    std::fs::write(path, &header).unwrap();
    let size = header.len() as u64 + 4 * NUMBERS * gaussians;
    File::options().write(true).open(path).unwrap().set_len(size).unwrap();
    summary(path, header.as_bytes(), size).unwrap().unwrap()
}

/// By the first bytes of the file, to the byte, and unread: the largest has 2.2 GiB.
pub fn refused_at_admission() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scene.ply");
    for n in SIZES {
        let least = sparse_file(&path, n).least_to_mark();
        assert!(least >= 2 * n * 4 * (NUMBERS + 14));
        let rest = MemoryRequirements::of_program();
        admit_marking(&path, &up_to(least + rest.total()), rest).unwrap();
        let limit = least + rest.total() - 1;
        let error = admit_marking(&path, &up_to(limit), rest).unwrap_err();
        assert!(matches!(error, Error::DoesNotFit { .. }));
        let words = error.to_string();
        println!("{words}");
        for number in [
            format!("{n} Gaussians"),
            Bytes(limit + 1).to_string(),
            Bytes(limit).to_string(),
        ] {
            assert!(words.contains(&number), "{words}");
        }
    }
}

/// From one Gaussian to a million, and on wgpu to a hundred thousand: a software driver takes its time.
pub fn drawn(machine: &Machine) {
    let most = if machine.compute.name == "cpu" {
        1_000_000
    } else {
        100_000
    };
    for n in SIZES.into_iter().filter(|n| *n <= most) {
        let mut g = ordinary(n as usize, 0);
        // Smaller where there are more, or those in front hide all others.
        let smaller = (n as f32).ln() / 3.0;
        g.log_scales.iter_mut().flatten().for_each(|s| *s -= smaller);
        for cache in machine.caches {
            let view = prepare(&g, &camera(48), *cache).unwrap();
            let colours = sh::colours(&g.sh, None, &view);
            let picture = machine.rasterizer.render(&view, &colours, BACKGROUND).unwrap();
            assert!(picture.pixels.iter().all(|v| (0.0..10.0).contains(v)));
            let gradient = machine.rasterizer.backward(&view, &picture.pixels).unwrap();
            assert!(gradient.iter().all(|v| v.is_finite()));
            assert_eq!(gradient.len(), 3 * view.visible.len());
        }
    }
}

/// Tiles of a view of 800 x 800 pixels.
const TILES: u64 = 2500;

/// 1,720,000 full-screen splats have 4.3 thousand million pairs, which 32 bits would take for five million.
pub fn pairs() {
    // What kernels index is three numbers a pair.
    assert!(3 * MAX_PAIRS <= u64::from(u32::MAX));
    let view = prepare(&full_screen(1), &camera(800), WeightCache::None).unwrap();
    assert_eq!(view.tiles.pairs() as u64, TILES);
    for splats in [MAX_PAIRS / TILES + 1, 1_720_000] {
        let refused = prepare(&full_screen(splats as usize), &camera(800), WeightCache::None);
        let words = refused.unwrap_err().to_string();
        let (pairs, limit) = (splats * TILES, MAX_PAIRS);
        assert!(
            words.contains(&pairs.to_string()) && words.contains(&limit.to_string()),
            "{words}"
        );
    }
    assert!(1_720_000 * TILES > u64::from(u32::MAX));
    const { assert!((1_720_000 * TILES) % (1 << 32) < MAX_PAIRS) };
}

/// A view whose lists are longer than the adapter's largest buffer is refused with both numbers before anything is
/// allocated there. Where that buffer holds more than any view may have pairs, the pairs are refused before.
pub fn buffers(machine: &Machine) {
    let limit = machine.compute.max_buffer.unwrap();
    // Twelve bytes of gradient a pair.
    let splats = limit / (12 * TILES) + 1;
    let g = full_screen(splats as usize);
    let view = match prepare(&g, &camera(800), WeightCache::None) {
        Ok(view) => view,
        Err(_) if splats * TILES > MAX_PAIRS => return,
        Err(error) => panic!("{error}"),
    };
    let colours = sh::colours(&g.sh, None, &view);
    let refused = [
        machine.rasterizer.render(&view, &colours, BACKGROUND).map(|_| ()),
        machine
            .rasterizer
            .backward(&view, &vec![1.0; view.picture_len()])
            .map(|_| ()),
    ];
    for refused in refused {
        let error = refused.unwrap_err();
        assert!(matches!(error, Error::DoesNotFit { .. }), "{error}");
        let words = error.to_string();
        println!("{words}");
        let numbers = [Bytes(12 * splats * TILES).to_string(), Bytes(limit).to_string()];
        assert!(numbers.iter().all(|number| words.contains(number)), "{words}");
    }
    // And it draws what fits.
    let one = full_screen(1);
    let view = prepare(&one, &camera(48), WeightCache::None).unwrap();
    let colours = sh::colours(&one.sh, None, &view);
    machine.rasterizer.render(&view, &colours, BACKGROUND).unwrap();
}
