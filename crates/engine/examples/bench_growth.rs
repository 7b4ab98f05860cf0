//! How the cost of every stage grows with Gaussians and pixels, as a table and a plot, on an otherwise idle machine:
//! `cargo run --release --example bench_growth -- [--gaussians 1000,10000] [--sizes 112,400] [--wgpu] [--plot FILE.svg]`.
//!
//! Scenes are samples of degree 3. Exponents are between neighbouring rows: 1 is linear, below 1 is better. Those in
//! Gaussians are of all of them for what looks at all (load, project), and of those seen for the rest.
use std::path::PathBuf;
use std::time::Instant;

use burn::tensor::{Tensor, TensorData};
use guardsplat_engine::clip::{Clip, Parts};
use guardsplat_engine::device::{Compute, DeviceChoice, open};
use guardsplat_engine::embed::{Adam, AdamOptions, Penalty};
use guardsplat_engine::extract::rasterizer;
use guardsplat_engine::sample::sample;
use guardsplat_engine::scene::{Gaussians, Scene};
use guardsplat_engine::splat::{Geometry, Learnable, Rasterizer, WeightCache, sh};
use guardsplat_engine::view::{Split, ViewSampler};
use plotters::prelude::*;

type Failure = Box<dyn std::error::Error>;

/// Of so many rounds the fastest counts: whatever else runs can only add time.
const ROUNDS: usize = 5;
const STAGES: [&str; 8] = [
    "load",
    "project",
    "sort",
    "weights",
    "forward",
    "backward",
    "CLIP",
    "optimiser",
];
/// Sides at which growth with Gaussians is measured, and Gaussians at which growth with pixels is.
const SIDE: u32 = 224;
const GAUSSIANS: usize = 100_000;

/// Milliseconds of a view (load and optimiser: of a scene), with what they are to be held against.
struct Row {
    gaussians: usize,
    side: u32,
    seen: usize,
    ms: [f64; STAGES.len()],
}

struct Options {
    gaussians: Vec<usize>,
    sides: Vec<u32>,
    device: DeviceChoice,
    plot: Option<PathBuf>,
}

fn main() -> Result<(), Failure> {
    let options = options()?;
    let compute = open(options.device)?;
    println!(
        "{}, {} threads, milliseconds, best of {ROUNDS}\n",
        compute.name,
        rayon::current_num_threads()
    );
    let by_gaussians = measure(&compute, options.gaussians.iter().map(|n| (*n, SIDE)))?;
    table("Gaussians", &by_gaussians, |row, stage| {
        let looks_at_all = stage.is_some_and(|k| ["load", "project"].contains(&STAGES[k]));
        (if looks_at_all { row.gaussians } else { row.seen }) as f64
    });
    let by_pixels = measure(&compute, options.sides.iter().map(|side| (GAUSSIANS, *side)))?;
    table("pixels", &by_pixels, |row, _| f64::from(row.side).powi(2));
    if let Some(path) = options.plot {
        plot(&path, &by_gaussians, &by_pixels)?;
        println!("plot written to {}", path.display());
    }
    Ok(())
}

fn options() -> Result<Options, Failure> {
    let mut options = Options {
        gaussians: vec![1_000, 10_000, 100_000, 1_000_000],
        sides: vec![112, 224, 400, 800],
        device: DeviceChoice::Cpu,
        plot: None,
    };
    let mut arguments = std::env::args().skip(1);
    while let Some(argument) = arguments.next() {
        let mut value = || arguments.next().ok_or(format!("{argument} needs a value"));
        match argument.as_str() {
            "--gaussians" => options.gaussians = value()?.split(',').map(str::parse).collect::<Result<_, _>>()?,
            "--sizes" => options.sides = value()?.split(',').map(str::parse).collect::<Result<_, _>>()?,
            "--wgpu" => options.device = DeviceChoice::Wgpu,
            "--plot" => options.plot = Some(value()?.into()),
            other => return Err(format!("{other}: see the first lines of this example").into()),
        }
    }
    Ok(options)
}

fn measure(compute: &Compute, cases: impl Iterator<Item = (usize, u32)>) -> Result<Vec<Row>, Failure> {
    let rasterizer = rasterizer(compute)?;
    let clip = Clip::shipped(&compute.device, Parts::Image)?;
    let folder = tempfile::tempdir()?;
    let mut rows = Vec::new();
    for (gaussians, side) in cases {
        let made = sample(gaussians, 3, 5)?;
        let path = folder.path().join("scene.ply");
        made.write(&path, &made.gaussians.sh)?;
        drop(made);
        let mut best = Row {
            gaussians,
            side,
            seen: 0,
            ms: [f64::INFINITY; STAGES.len()],
        };
        for _ in 0..ROUNDS {
            let start = Instant::now();
            let scene = Scene::read(&path)?.gaussians;
            let load = milliseconds(start);
            let (seen, mut ms) = round(compute, rasterizer.as_ref(), &clip, &scene, side)?;
            ms[0] = load;
            best.seen = seen;
            best.ms = std::array::from_fn(|k| best.ms[k].min(ms[k]));
        }
        rows.push(best);
    }
    Ok(rows)
}

/// One view: prepared, drawn, read by CLIP, and back.
fn round(
    compute: &Compute,
    rasterizer: &dyn Rasterizer,
    clip: &Clip,
    scene: &Gaussians,
    side: u32,
) -> Result<(usize, [f64; STAGES.len()]), Failure> {
    let camera = ViewSampler::new(scene, 0)?.camera(Split::Training, 0, side);
    let cache = if compute.name == "cpu" {
        WeightCache::Weights
    } else {
        WeightCache::None
    };
    let (view, times) = Geometry::new(scene).prepare_timed(&camera, cache)?;
    let start = Instant::now();
    let colours = sh::colours(&scene.sh, None, &view);
    let picture = rasterizer.render(&view, &colours, [1.0; 3])?;
    let forward = milliseconds(start);
    let mut seen = vec![false; scene.len()];
    view.visible.iter().for_each(|row| seen[*row as usize] = true);
    let learnable = Learnable::new(&seen, scene.sh.degree);
    // Written to, as that of an embedding is from the first step on: the system gives memory when it is first touched.
    let mut gradient = vec![1.0; learnable.len()];
    gradient.fill(0.0);

    let shape = [1, 3, side as usize, side as usize];
    let start = Instant::now();
    let leaf = Tensor::<4>::from_data(
        TensorData::new(picture.pixels.clone(), shape),
        &compute.device.clone().autodiff(),
    )
    .require_grad();
    let gradients = clip.image_features(leaf.clone()).sum().backward();
    let of_picture: Vec<f32> = leaf.grad(&gradients).ok_or("no gradient")?.try_into_vec_as()?;
    let clip_ms = milliseconds(start);

    let start = Instant::now();
    let of_colours = rasterizer.backward(&view, &of_picture)?;
    sh::backward(
        &learnable,
        sh::ColourGradient {
            view: &view,
            colours: &colours,
            gradient: &of_colours,
        },
        &mut gradient,
    );
    let backward = milliseconds(start);

    let slots = learnable.rows().len();
    let mut adam = Adam::new(AdamOptions::default(), slots, learnable.columns(), scene.len());
    let mut offsets = vec![0.0; learnable.len()];
    let penalty = Penalty { dc: 0.0, rest: 0.0 };
    adam.step(1.0, penalty, &mut offsets, &mut gradient.clone());
    let start = Instant::now();
    adam.step(1.0, penalty, &mut offsets, &mut gradient);
    let optimiser = milliseconds(start);
    let [project, sort, weights] = [times.project, times.sort, times.weights].map(|t| t.as_secs_f64() * 1e3);
    Ok((
        slots,
        [0.0, project, sort, weights, forward, backward, clip_ms, optimiser],
    ))
}

fn milliseconds(start: Instant) -> f64 {
    start.elapsed().as_secs_f64() * 1e3
}

/// `against` is asked for every stage, and for all of a view.
fn table(what: &str, rows: &[Row], against: impl Fn(&Row, Option<usize>) -> f64) {
    println!("| Gaussians | seen | side | {} | all of a view |", STAGES.join(" | "));
    println!("|{}", "---|".repeat(STAGES.len() + 4));
    let of_view = |row: &Row| row.ms[1..7].iter().sum::<f64>();
    for row in rows {
        let ms: Vec<String> = row.ms.iter().map(|ms| format!("{ms:.2}")).collect();
        println!(
            "| {} | {} | {} | {} | {:.1} |",
            row.gaussians,
            row.seen,
            row.side,
            ms.join(" | "),
            of_view(row)
        );
    }
    for pair in rows.windows(2) {
        let exponent = |stage: Option<usize>, before: f64, after: f64| {
            let ratio = against(&pair[1], stage) / against(&pair[0], stage);
            format!("{:.2}", (after / before).ln() / ratio.ln())
        };
        let all: Vec<String> = (0..STAGES.len())
            .map(|k| exponent(Some(k), pair[0].ms[k], pair[1].ms[k]))
            .collect();
        println!(
            "| exponent in {what}, {:.0} to {:.0} | | | {} | {} |",
            against(&pair[0], None),
            against(&pair[1], None),
            all.join(" | "),
            exponent(None, of_view(&pair[0]), of_view(&pair[1]))
        );
    }
    println!();
}

/// Both tables side by side, logarithmic both ways; the grey line is linear growth.
fn plot(path: &std::path::Path, by_gaussians: &[Row], by_pixels: &[Row]) -> Result<(), Failure> {
    let area = SVGBackend::new(path, (1000, 420)).into_drawing_area();
    area.fill(&WHITE)?;
    let (left, right) = area.split_horizontally(500);
    panel(
        &left,
        "milliseconds a view against Gaussians seen",
        by_gaussians,
        |row| row.seen as f64,
    )?;
    panel(&right, "milliseconds a view against pixels", by_pixels, |row| {
        f64::from(row.side).powi(2)
    })?;
    area.present()?;
    Ok(())
}

fn panel(
    area: &DrawingArea<SVGBackend<'_>, plotters::coord::Shift>,
    caption: &str,
    rows: &[Row],
    against: impl Fn(&Row) -> f64,
) -> Result<(), Failure> {
    let Some((first, last)) = rows.first().zip(rows.last()) else {
        return Ok(());
    };
    let ms = rows.iter().flat_map(|row| row.ms).filter(|ms| *ms > 0.0);
    let (low, high) = ms.fold((f64::INFINITY, 0.0f64), |(low, high), ms| (low.min(ms), high.max(ms)));
    let mut chart = ChartBuilder::on(area)
        .caption(caption, ("sans-serif", 16))
        .margin(12)
        .x_label_area_size(28)
        .y_label_area_size(44)
        .build_cartesian_2d((against(first)..against(last)).log_scale(), (low..high).log_scale())?;
    let short = |n: &f64| match *n {
        n if n < 1e3 => format!("{n}"),
        n if n < 1e6 => format!("{}k", n / 1e3),
        n => format!("{}M", n / 1e6),
    };
    let mut mesh = chart.configure_mesh();
    mesh.light_line_style(WHITE).x_labels(4).x_label_formatter(&short);
    mesh.y_label_formatter(&short).draw()?;
    let linear = [first, last].map(|row| (against(row), against(row) / against(first) * low));
    chart.draw_series(LineSeries::new(linear, &BLACK.mix(0.3)))?;
    for (k, name) in STAGES.iter().enumerate() {
        let colour = Palette99::pick(k);
        let points = rows.iter().map(|row| (against(row), row.ms[k]));
        chart
            .draw_series(LineSeries::new(points, colour.stroke_width(2)))?
            .label(*name)
            .legend(move |(x, y)| PathElement::new([(x, y), (x + 14, y)], colour.stroke_width(2)));
    }
    chart
        .configure_series_labels()
        .position(SeriesLabelPosition::UpperLeft)
        .background_style(WHITE.mix(0.8))
        .draw()?;
    Ok(())
}
