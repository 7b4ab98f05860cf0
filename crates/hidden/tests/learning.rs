//! Training learns: after a few steps an easy message is read from pictures that were never seen.
use burn::tensor::Device;
use guardsplat_hidden::{Geometry, Options, Synthetic, train};

const SIDE: usize = 32;
const PSNR: f32 = 20.0;

#[test]
fn a_few_steps_read_more_than_chance() {
    let options = Options {
        bits: 1,
        steps: 200,
        learning_rate: 4e-3,
        start_psnr: PSNR,
        end_psnr: PSNR,
        geometry: Geometry::NONE,
        ..Options::default()
    };
    let device = Device::flex();
    let mut pictures = Synthetic::new(SIDE, 5).unwrap();
    let trained = train(&options, &device, |n| Ok(pictures.next(n, &device)), |_| {}, || false).unwrap();
    let mut unseen = Synthetic::new(SIDE, 77).unwrap();
    let next = |n| Ok(unseen.next(n, &device));
    let found = trained.measure(next, 128, PSNR, &Geometry::NONE, 3).unwrap();
    // By chance 0.66 or more of 128 bits once in 5,000.
    assert!(found.accuracy > 0.66, "{found:?}");
}
