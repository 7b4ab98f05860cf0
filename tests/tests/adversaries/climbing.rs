//! Whoever may verify asks again and again, and keeps each change that makes the answer weaker.
use std::f32::consts::PI;

use guardsplat_engine::scene::Gaussians;

use crate::attacked::{Attacked, Left};

/// Waves that a change of colours is made of: a mark is something of this kind.
const WAVES: usize = 64;
/// Turns of a wave for a change of a coefficient by 1, at most: 110 radians for a change of a colour by 1.
const RADIANS: f32 = 30.0;
/// Calls at most.
const CALLS: usize = 400;
/// How far each strength moves in a step: together 0.01 of a coefficient, 0.003 of a colour.
const STEP: f32 = 0.003;
/// What a match is.
const RATE: f64 = 1e-6;

/// Numbers that look random, the same in every run.
struct Random(u64);

impl Random {
    /// Evenly between -1 and 1.
    fn next(&mut self) -> f32 {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        ((self.0 >> 40) as f32 / (1 << 23) as f32) - 1.0
    }
}

/// Directions of colour and phases.
struct Waves(Vec<([f32; 3], f32)>);

impl Waves {
    fn new(random: &mut Random) -> Self {
        let wave = |_| {
            let direction = std::array::from_fn(|_| RADIANS * random.next());
            (direction, PI * random.next())
        };
        Self((0..WAVES).map(wave).collect())
    }

    /// The scene with its colours changed by their own value, with `strength` (`[WAVES][3]`).
    fn added(&self, scene: &Gaussians, strength: &[f32]) -> Gaussians {
        let mut out = scene.clone();
        let stride = scene.sh.per_gaussian();
        for (own, changed) in scene
            .sh
            .coefficients
            .chunks_exact(stride)
            .zip(out.sh.coefficients.chunks_exact_mut(stride))
        {
            for ((direction, phase), strength) in self.0.iter().zip(strength.chunks_exact(3)) {
                let angle: f32 = direction.iter().zip(own).map(|(d, c)| d * c).sum::<f32>() + phase;
                for (value, strength) in changed.iter_mut().zip(strength) {
                    *value += strength * angle.sin();
                }
            }
        }
        out
    }
}

/// Climbs down what is told of an answer, more being a better match.
fn climb(it: &Attacked, name: &str, told: impl Fn(&Left) -> f64) {
    let mut random = Random(7);
    let waves = Waves::new(&mut random);
    let mut strength = vec![0.0_f32; 3 * WAVES];
    let mut best = told(&it.left(&it.marked));
    for call in 1..=CALLS {
        let tried: Vec<f32> = strength.iter().map(|s| s + STEP * random.next()).collect();
        let left = it.left(&waves.added(&it.marked, &tried));
        if told(&left) <= best {
            (best, strength) = (told(&left), tried);
        }
        if left.p_value > RATE {
            println!("figure: {name}: no match after {call} calls: {left}");
            return;
        }
        if call % 50 == 0 {
            println!("figure: {name}: after {call} calls: {left}");
        }
    }
    println!("figure: {name}: still a match after {CALLS} calls");
}

/// Looks for the least change along random directions that is no match, knowing nothing but the verdict.
fn search(it: &Attacked) {
    let mut random = Random(9);
    let mut least: Option<(f32, Left)> = None;
    let mut calls = 0;
    while calls < CALLS {
        let waves = Waves::new(&mut random);
        let direction: Vec<f32> = (0..3 * WAVES).map(|_| STEP * random.next()).collect();
        let mut ask = |times: f32| {
            calls += 1;
            let strength: Vec<f32> = direction.iter().map(|s| times * s).collect();
            it.left(&waves.added(&it.marked, &strength))
        };
        // Only a direction that is better than the best is looked at more closely.
        let (mut low, mut high) = (0.0, least.as_ref().map_or(64.0, |(times, _)| 0.95 * times));
        let mut found = ask(high);
        if found.p_value <= RATE {
            continue;
        }
        for _ in 0..5 {
            let middle = (low + high) / 2.0;
            let left = ask(middle);
            match left.p_value > RATE {
                true => (high, found) = (middle, left),
                false => low = middle,
            }
        }
        println!("figure: by the verdict: no match after {calls} calls: {found}");
        least = Some((high, found));
    }
}

#[test]
#[ignore = "many minutes; run by people: docs/security.md"]
fn a_climb_down_what_the_service_tells() {
    let Some(it) = Attacked::new() else { return };
    println!("figure: marked: {}", it.left(&it.marked));
    // All of it; whole powers of ten; and a match or none.
    climb(&it, "by the p-value", |left| -left.p_value.max(1e-300).log10());
    climb(&it, "by its power of ten, in steps of 4", |left| {
        (-left.p_value.max(1e-300).log10() / 4.0).round()
    });
    search(&it);
}
