//! The controller on its own: what it holds, where it gives way, and what it does at first.
use super::*;

fn controller(proportional: f64, integral: f64) -> LossWeightController {
    LossWeightController::new(
        Some(LossWeightControl {
            proportional,
            integral,
            limit: 8.0,
            memory: 0.0,
            ..LossWeightControl::default()
        }),
        1.0,
    )
}

fn factors(mut b: LossWeightController, psnr_and_bits: &[(f64, f64)]) -> Vec<f64> {
    let follow = |(psnr, bits): &(f64, f64)| {
        b.update(*psnr, *bits, 1.0);
        f64::from(b.factors().reconstruction).ln()
    };
    psnr_and_bits.iter().map(follow).collect()
}

fn close(found: &[f64], expected: &[f64]) {
    let gap = found
        .iter()
        .zip(expected)
        .map(|(f, e)| (f - e).abs())
        .fold(0.0, f64::max);
    assert!(gap < 1e-6, "{found:?} {expected:?}");
}

#[test]
fn follows_the_error_and_its_sum() {
    let seen = [(35.0, 1.0), (36.0, 0.5), (37.5, 0.5), (37.0, 1.0)];
    // Room is not used once all bits are right.
    close(&factors(controller(0.5, 0.0), &seen), &[0.5, 0.0, -0.75, 0.0]);
    close(&factors(controller(0.0, 0.5), &seen), &[0.5, 0.5, -0.25, -0.25]);
    close(&factors(controller(0.5, 0.5), &seen), &[1.0, 0.5, -1.0, -0.25]);
}

#[test]
fn stays_within_its_limits_and_comes_back_at_once() {
    let limit = 8.0_f64.ln();
    close(
        &factors(controller(0.0, 1.0), &[(0.0, 0.5), (37.0, 0.5)]),
        &[limit, limit - 1.0],
    );
    close(&factors(controller(1.0, 1.0), &[(f64::INFINITY, 0.5)]), &[-limit]);
}

#[test]
fn without_a_target_nothing_changes_and_means_run() {
    let mut none = LossWeightController::new(None, 1.0);
    none.update(10.0, 0.5, 0.5);
    let untouched = LossWeightFactors {
        reconstruction: 1.0,
        ssim: 1.0,
    };
    assert_eq!(none.factors(), untouched);
    let mut slow = LossWeightController::new(Some(LossWeightControl::default()), 1.0);
    slow.update(40.0, 0.5, 0.5);
    slow.update(30.0, 0.5, 0.5); // the mean is 38
    assert!(slow.factors().reconstruction < 1.0 && slow.factors().ssim == 1.0);
}

#[test]
fn targets_give_way_where_bits_stay_wrong_and_come_back() {
    let yielding = TargetRelaxation {
        below: 0.9,
        psnr_db: 2.0,
        ssim: 0.004,
    };
    let mut b = LossWeightController::new(
        Some(LossWeightControl {
            target_psnr_db: 40.0,
            target_ssim: Some(0.994),
            proportional: 1.0,
            integral: 0.0,
            memory: 0.0,
            yielding: Some(yielding),
            ..LossWeightControl::default()
        }),
        1.0,
    );
    let mut after = |steps: usize, bits: f64| {
        for _ in 0..steps {
            b.update(40.0, bits, 0.992);
        }
        (f64::from(b.factors().reconstruction).ln(), b.factors().ssim)
    };
    // Not while they are learnt; then by a quarter of the tenth that is lacking, each step.
    assert_eq!(after(RELAXES_AFTER, 0.5), (0.0, 1.0));
    assert!((after(1, 0.8).0 + 2.0 * 0.025).abs() < 1e-6);
    // Two dB at most, and a mark that is above the lower SSIM has room.
    let (psnr, ssim) = after(100, 0.8);
    assert!((psnr + 2.0).abs() < 1e-6 && ssim < 1.0, "{psnr} {ssim}");
    assert_eq!(after(100, 1.0), (0.0, 1.0));
}

/// A tenth of the picture: 33 dB there are 43 of the whole, which targets that give way do not touch.
#[test]
fn covered_pixels_keep_their_psnr_where_the_whole_gives_way() {
    let held = |covered: f64, bits: f64| {
        let balance = LossWeightControl {
            target_psnr_db: 40.0,
            covered_psnr_db: Some(33.0),
            proportional: 1.0,
            integral: 0.0,
            memory: 0.0,
            yielding: Some(TargetRelaxation {
                below: 0.9,
                psnr_db: 2.0,
                ssim: 0.0,
            }),
            ..LossWeightControl::default()
        };
        let mut b = LossWeightController::new(Some(balance), covered);
        for _ in 0..=RELAXES_AFTER + 100 {
            b.update(40.0, bits, 1.0);
        }
        40.0 + f64::from(b.factors().reconstruction).ln()
    };
    for (covered, bits, wanted) in [
        (0.1, 0.8, 43.0),
        (0.1, 1.0, 43.0),
        (1.0, 1.0, 40.0),
        (1.0, 0.8, 38.0),
        (0.25, 0.8, 33.0 - 10.0 * 0.25_f64.log10()),
        (0.0, 0.8, 38.0),
    ] {
        let found = held(covered, bits);
        assert!((found - wanted).abs() < 1e-6, "{covered} {bits}: {found}");
    }
}

#[test]
fn what_held_out_views_lack_is_held_and_let_go() {
    let mut b = controller(1.0, 0.0);
    let mut after = |lacking: f64| {
        b.held_out(lacking);
        b.update(36.0, 0.9, 1.0);
        f64::from(b.factors().reconstruction).ln()
    };
    // Not while nothing has been learnt.
    assert_eq!(after(1.0), 0.0);
    for _ in 0..RELAXES_AFTER {
        after(0.0);
    }
    assert!((after(1.0) - RAISE_GAIN).abs() < 1e-6);
    assert!((after(1.0) - 2.0 * RAISE_GAIN).abs() < 1e-6);
    assert!((after(f64::NEG_INFINITY) - 2.0 * RAISE_GAIN).abs() < 1e-6);
    assert_eq!(after(-9.0), 0.0);
}

#[test]
fn ssim_weighs_less_where_there_is_room_and_all_where_there_is_none() {
    let mut b = LossWeightController::new(
        Some(LossWeightControl {
            target_ssim: Some(0.994),
            memory: 0.0,
            ..LossWeightControl::default()
        }),
        1.0,
    );
    let mut after = |ssim: f64| {
        b.update(36.0, 0.9, ssim);
        f64::from(b.factors().ssim)
    };
    // 0.002 of room: the proportional part and one step of the other.
    assert!((after(0.996).ln() + 0.002 * 320.0).abs() < 1e-5);
    assert_eq!(after(0.98), 1.0);
    for _ in 0..100 {
        after(1.0);
    }
    assert!((after(1.0) - SSIM_LEAST).abs() < 1e-6);
}
