//! Figures of the paper, to compare with: GuardSplat (CVPR 2025), Blender and LLFF scenes, 200 test views.
use super::names::{
    ALL_ATTRIBUTES, DC, FIXED_WEIGHTS, MESSAGE_ONLY, NONE, PAPER_ATTACKS, PRUNE_LOWEST, PRUNE_RANDOM, REST, STANDARD,
};
use serde::{Deserialize, Serialize};

/// A table of the paper.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Source {
    /// Table 1: accuracy and quality by bits.
    Capacity,
    /// Table 2: accuracy of 16 bits under distortions.
    Robustness,
    /// Table 3: which attributes are learned, 32 bits.
    Trained,
    /// Table 4: which losses count, 32 bits.
    Losses,
    /// Table S1: pruning a quarter of the Gaussians, 32 bits.
    Pruning,
}

/// What can be compared.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Metric {
    /// Bit accuracy in percent.
    Accuracy,
    /// PSNR of marked against unmarked views in dB.
    Psnr,
    /// Their SSIM.
    Ssim,
    /// Their LPIPS, of which less is better.
    Lpips,
}

impl Metric {
    /// By how much a value is short of a bar; 0 if it reaches it.
    pub fn missed_by(self, value: f64, bar: f64) -> f64 {
        let short = match self {
            Metric::Lpips => value - bar,
            _ => bar - value,
        };
        short.max(0.0)
    }
}

/// What the paper says about one case.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Figure {
    /// Bit accuracy in percent.
    pub accuracy: Option<f64>,
    /// PSNR in dB; in [`Source::Pruning`] of pruned marked views, so not that of the mark alone.
    pub psnr_db: Option<f64>,
    /// SSIM.
    pub ssim: Option<f64>,
    /// LPIPS.
    pub lpips: Option<f64>,
}

/// Lengths of messages in Table 1.
pub const BITS: [u32; 5] = [16, 32, 48, 64, 72];
/// Bits of Table 2.
pub const ROBUSTNESS_BITS: u32 = 16;
/// Bits of Tables 3, 4 and S1.
pub const ABLATION_BITS: u32 = 32;

/// What a table of the paper says about a case, if anything.
pub fn figure(source: Source, bits: u32, variant: &str, attack: &str) -> Option<Figure> {
    match source {
        Source::Capacity if variant == STANDARD && attack == NONE => capacity(bits),
        Source::Robustness if variant == STANDARD && bits == ROBUSTNESS_BITS => robustness(attack),
        Source::Trained if bits == ABLATION_BITS && attack == NONE => trained(variant),
        Source::Losses if bits == ABLATION_BITS && attack == NONE => losses(variant),
        Source::Pruning if variant == STANDARD && bits == ABLATION_BITS => pruning(attack),
        _ => None,
    }
}

fn capacity(bits: u32) -> Option<Figure> {
    let (accuracy, psnr, ssim, lpips) = match bits {
        16 => (99.64, 41.55, 0.9957, 0.0017),
        32 => (99.04, 39.40, 0.9939, 0.0022),
        48 => (98.29, 38.90, 0.9923, 0.0028),
        64 => (97.41, 37.76, 0.9899, 0.0040),
        72 => (96.64, 36.47, 0.9866, 0.0053),
        _ => return None,
    };
    Some(Figure {
        accuracy: Some(accuracy),
        psnr_db: Some(psnr),
        ssim: Some(ssim),
        lpips: Some(lpips),
    })
}

fn robustness(attack: &str) -> Option<Figure> {
    const ACCURACY: [f64; 10] = [99.64, 99.60, 94.56, 98.75, 99.27, 98.71, 97.46, 94.70, 82.35, 93.38];
    let known = PAPER_ATTACKS.iter().zip(ACCURACY).find(|(name, _)| **name == attack);
    known.map(|(_, accuracy)| Figure {
        accuracy: Some(accuracy),
        ..Figure::default()
    })
}

fn two(accuracy: f64, psnr: f64) -> Option<Figure> {
    Some(Figure {
        accuracy: Some(accuracy),
        psnr_db: Some(psnr),
        ..Figure::default()
    })
}

fn trained(variant: &str) -> Option<Figure> {
    match variant {
        ALL_ATTRIBUTES => two(98.79, 36.56),
        DC => two(74.59, 36.98),
        REST => two(98.25, 38.70),
        STANDARD => two(99.04, 39.40),
        _ => None,
    }
}

fn losses(variant: &str) -> Option<Figure> {
    match variant {
        MESSAGE_ONLY => two(100.0, 31.79),
        FIXED_WEIGHTS => two(99.26, 36.88),
        STANDARD => two(99.04, 39.40),
        _ => None,
    }
}

fn pruning(attack: &str) -> Option<Figure> {
    match attack {
        PRUNE_LOWEST => two(98.74, 37.87),
        PRUNE_RANDOM => two(88.59, 31.50),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn figures_are_found_where_they_belong() {
        let accuracy = |source, bits, variant, attack| figure(source, bits, variant, attack)?.accuracy;
        assert_eq!(accuracy(Source::Robustness, 16, STANDARD, "jpeg:10"), Some(94.70));
        assert_eq!(
            accuracy(Source::Robustness, 16, STANDARD, "crop:0.4+brightness:0.5..1.5+jpeg:10"),
            Some(93.38)
        );
        assert_eq!(accuracy(Source::Robustness, 32, STANDARD, "jpeg:10"), None);
        assert_eq!(accuracy(Source::Trained, 32, DC, NONE), Some(74.59));
        assert_eq!(accuracy(Source::Losses, 32, DC, NONE), None);
        // The tables agree where they tell the same case.
        for source in [Source::Capacity, Source::Trained, Source::Losses] {
            assert_eq!(figure(source, 32, STANDARD, NONE).unwrap().psnr_db, Some(39.40));
        }
        assert!(BITS.iter().all(|bits| capacity(*bits).is_some()));
    }

    #[test]
    fn less_lpips_is_better() {
        assert_eq!(Metric::Lpips.missed_by(0.001, 0.002), 0.0);
        assert_eq!(Metric::Lpips.missed_by(3.0, 2.0), 1.0);
        assert_eq!(Metric::Psnr.missed_by(3.0, 2.0), 0.0);
        assert_eq!(Metric::Psnr.missed_by(2.0, 3.0), 1.0);
    }
}
