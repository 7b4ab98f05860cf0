//! Times the steps of an embedding on the CPU device, or tells what they compute: `tools/step_bench.py` runs it in turns with
//! the same steps in PyTorch.
//!
//!     cargo run --release --example bench_step -- SCENE KEY MESSAGE STEPS [TRACE]
//!
//! Preset `standard`, seed 1, without looks at held-out views. Prints mean milliseconds a step, in wall time and by stage. With
//! TRACE it writes that file (safetensors) instead: the scene, and each step's views and loss.
use std::collections::HashMap;
use std::path::Path;
use std::time::Instant;

use guardsplat_codeword::Message;
use guardsplat_engine::clip::{Parts, ShippedClip};
use guardsplat_engine::device::{DeviceChoice, open};
use guardsplat_engine::embed::{Optimizer, Preset, Progress, Settings, StepTimes, Trace, optimise, trace};
use guardsplat_engine::extract::Engine;
use guardsplat_engine::message::Key;
use guardsplat_engine::scene::Scene;
use safetensors::tensor::{Dtype, TensorView};

type Failure = Box<dyn std::error::Error>;

/// Steps before those that are timed: the first have views to prepare that later ones find prepared.
const WARM_UP: usize = 5;

fn main() -> Result<(), Failure> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [scene, key, message, steps, out @ ..] = &arguments[..] else {
        return Err("usage: bench_step SCENE KEY MESSAGE STEPS [TRACE]".into());
    };
    let (scene, key) = (Scene::read(scene.as_ref())?, Key::read(key.as_ref())?);
    let (message, steps) = (key.message(message)?, steps.parse()?);
    let compute = open(DeviceChoice::Cpu)?;
    let shipped = ShippedClip::named(&key.clip.name).ok_or("the key is not of a CLIP of this repository")?;
    let clip = shipped.load(&compute.device, Parts::Image)?;
    let engine = Engine::new(compute, clip, &key, None)?;
    let settings = Settings {
        seed: 1,
        early_stop: None,
        extension: None,
        ..Preset::Standard.settings()
    };
    match out.first() {
        Some(path) => write(
            path.as_ref(),
            &scene,
            &trace(&engine, &scene, &message, &settings, steps)?,
        ),
        None => time(&engine, &scene, &message, settings, steps),
    }
}

/// Prints mean milliseconds of `steps` steps after the first few.
fn time(engine: &Engine, scene: &Scene, message: &Message, settings: Settings, steps: usize) -> Result<(), Failure> {
    let settings = Settings {
        steps: WARM_UP + steps,
        ..settings
    };
    let (mut times, mut clock) = (Vec::<StepTimes>::new(), Instant::now());
    let mut wall = 0.0;
    optimise(engine, scene, message, &settings, &[], &mut |progress| {
        if let Progress::Timed(step) = progress {
            times.push(step);
            if times.len() == WARM_UP {
                clock = Instant::now();
            }
            wall = clock.elapsed().as_secs_f64() * 1e3;
        }
    })?;
    // A scene of parts takes more steps than the settings say.
    let times = &times[WARM_UP..];
    let count = times.len() as f64;
    println!("step_ms {:.2}", wall / count);
    type Stage = (&'static str, fn(&StepTimes) -> f64);
    let stages: [Stage; 5] = [
        ("prepare_ms", |t| t.prepare),
        ("draw_ms", |t| t.colours + t.render),
        ("loss_ms", |t| t.loss),
        ("backward_ms", |t| t.backward + t.sh_backward),
        ("optimiser_ms", |t| t.optimiser),
    ];
    for (name, of) in stages {
        println!("{name} {:.2}", times.iter().map(of).sum::<f64>() / count);
    }
    Ok(())
}

/// Tensors of a file.
#[derive(Default)]
struct Tensors(Vec<(&'static str, Dtype, Vec<usize>, Vec<u8>)>);

impl Tensors {
    fn floats(&mut self, name: &'static str, shape: &[usize], values: impl IntoIterator<Item = f32>) {
        let bytes = values.into_iter().flat_map(f32::to_le_bytes).collect();
        self.0.push((name, Dtype::F32, shape.to_vec(), bytes));
    }

    fn places(&mut self, name: &'static str, shape: &[usize], values: impl IntoIterator<Item = usize>) {
        let bytes = values.into_iter().flat_map(|v| (v as i64).to_le_bytes()).collect();
        self.0.push((name, Dtype::I64, shape.to_vec(), bytes));
    }
}

fn write(path: &Path, scene: &Scene, trace: &Trace) -> Result<(), Failure> {
    let Optimizer::PreconditionedSgd(optimizer) = trace.settings.optimizer else {
        return Err("the preset has another optimiser".into());
    };
    let (g, mut tensors) = (&scene.gaussians, Tensors::default());
    let n = g.len();
    tensors.floats("scene.positions", &[n, 3], g.positions.iter().copied().flatten());
    tensors.floats("scene.log_scales", &[n, 3], g.log_scales.iter().copied().flatten());
    tensors.floats("scene.rotations", &[n, 4], g.rotations.iter().copied().flatten());
    tensors.floats("scene.opacities", &[n], (0..n).map(|row| g.opacity(row)));
    let harmonics = g.sh.coefficients.iter().copied();
    tensors.floats("scene.harmonics", &[n, g.sh.per_gaussian() / 3, 3], harmonics);
    tensors.places(
        "learned.rows",
        &[trace.rows.len()],
        trace.rows.iter().map(|row| *row as usize),
    );
    tensors.floats("learned.energies", &[trace.rows.len()], trace.energies.iter().copied());
    tensors.floats("targets", &[trace.targets.len()], trace.targets.iter().copied());

    let v = trace.views.len();
    let cameras = || trace.views.iter().map(|view| &view.camera);
    let intrinsics = cameras().flat_map(|c| [c.width as f32, c.height as f32, c.fx, c.fy, c.cx, c.cy]);
    tensors.floats("views.intrinsics", &[v, 6], intrinsics);
    tensors.floats(
        "views.rotations",
        &[v, 3, 3],
        cameras().flat_map(|c| c.rotation).flatten(),
    );
    tensors.floats("views.translations", &[v, 3], cameras().flat_map(|c| c.translation));
    tensors.floats("views.times", &[v], trace.views.iter().map(|view| view.times));
    tensors.floats(
        "views.backgrounds",
        &[v, 3],
        trace.views.iter().flat_map(|view| view.background),
    );
    tensors.places("views.degrees", &[v], trace.views.iter().map(|view| view.degree));

    let (s, steps) = (trace.steps.len(), &trace.steps);
    let a_step = trace.settings.views_per_step;
    tensors.places(
        "steps.views",
        &[s, a_step],
        steps.iter().flat_map(|step| step.views.iter().copied()),
    );
    let factors = steps
        .iter()
        .flat_map(|step| [step.factors[0], step.factors[1], step.rate]);
    tensors.floats("steps.factors", &[s, 3], factors);
    let found = steps
        .iter()
        .flat_map(|step| [step.found.terms.message, step.found.terms.ssim, step.found.terms.l1]);
    tensors.floats("steps.found", &[s, 3], found);

    let views = tensors
        .0
        .iter()
        .map(|(name, dtype, shape, bytes)| Ok((*name, TensorView::new(*dtype, shape.clone(), bytes)?)));
    let views: Vec<_> = views.collect::<Result<_, safetensors::SafeTensorError>>()?;
    let settings = serde_json::json!({
        "lambda": trace.settings.lambda,
        "optimizer": optimizer,
        "learned_degree": scene.learnable_degree(),
        "fresh_per_step": trace.settings.fresh_per_step,
    });
    let settings = HashMap::from([("settings".to_owned(), settings.to_string())]);
    std::fs::write(path, safetensors::serialize(views, Some(settings))?)?;
    Ok(())
}
