//! The presets: named choices of all settings of an embedding.
use guardsplat_distortion::{DistortionKind, JpegRange, Ranges, RobustTo};

use super::adam::AdamOptions;
use super::augment::Augmentation;
use super::loss_weight_controller::{LossWeightControl, TargetRelaxation};
use super::optimizer::Optimizer;
use super::preconditioned_sgd::PreconditionedSgdOptions;
use super::settings::{EarlyStop, Extension, LossWeights, Settings, Verify};
use super::target::Target;
use crate::error::{Error, Result};

/// What marks are trained to stand unless asked for something else: viewers and formats that keep fewer bands of
/// spherical harmonics, or none, are what scenes meet first. Where nothing is dropped it costs up to 0.6
/// points of accuracy and 0.5 dB (docs/evaluation.md).
const EVERYDAY: [DistortionKind; 1] = [DistortionKind::ShTruncation];

/// Qualities of JPEG that marks are trained against where that is asked for. At the paper's 10 the chroma of a picture of
/// 800 pixels keeps steps of 0.04, four times what a mark at 40 dB changes: trained against that, marks stand nothing.
const JPEG_QUALITY: [u8; 2] = [40, 90];

/// A named choice of all settings.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Preset {
    /// Half a minute on two CPU cores; a weaker mark.
    Draft,
    /// What the figures in the documentation were made with.
    #[default]
    Standard,
    /// For messages of 16 bits: a third more steps, and a mark that shows as much as it may.
    Robust,
    /// Twice the steps of standard, for more bits that are right at the same likeness.
    Thorough,
    /// Steps, views, sizes and weights as the GuardSplat paper has them.
    Paper,
}

impl std::str::FromStr for Preset {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        match text {
            "draft" => Ok(Self::Draft),
            "standard" => Ok(Self::Standard),
            "robust" => Ok(Self::Robust),
            "thorough" => Ok(Self::Thorough),
            "paper" => Ok(Self::Paper),
            other => Err(Error::BadOption {
                field: "preset",
                reason: format!("{other:?} is not a preset, must be draft, standard, robust, thorough or paper"),
            }),
        }
    }
}

impl Preset {
    /// All of them.
    pub const ALL: [Self; 5] = [Self::Draft, Self::Standard, Self::Robust, Self::Thorough, Self::Paper];

    /// What it is called.
    pub fn name(self) -> &'static str {
        match self {
            Self::Draft => "draft",
            Self::Standard => "standard",
            Self::Robust => "robust",
            Self::Thorough => "thorough",
            Self::Paper => "paper",
        }
    }

    /// The table of presets.
    pub fn settings(self) -> Settings {
        let standard = Settings {
            seed: 0,
            steps: 240,
            times_of_parts: 2,
            times_of_fine: 2,
            extension: Some(Extension {
                after: 100,
                below: 0.985,
                times: 2,
                most: 2,
                temperature: 4.0,
            }),
            views_per_step: 8,
            // As many more cost a fifth of the time and bring nothing (docs/performance.md).
            fresh_per_step: 2,
            views: None,
            ring: None,
            kind: None,
            pool_views: 150,
            pool_mebibytes: 1024,
            half_weights: false,
            size: 160,
            // Pictures that people make of scenes have 800 pixels and more, and there a scene has detail that it has
            // not at CLIP's size.
            enlarged: 9.0,
            black_backgrounds: 0.1,
            windows: 0.25,
            cut_out: 0.25,
            lambda: LossWeights {
                reconstruction: 1.0,
                l1: 0.0,
                l2: 33.0,
                // At most: the balance below lowers it where there is room. Where a scene is smooth a change is seen, and
                // where it is rough it is not: this moves the mark there.
                ssim: 4.0,
                lpips: 0.0,
                message: 0.05,
                // Weak bits weigh more than at 8, and marks stand JPEG as well (docs/evaluation.md).
                temperature: 4.0,
                // The balance below holds the PSNR; a penalty besides would keep marks of large scenes from being made.
                offset_dc: 0.0,
                offset_rest: 0.0,
            },
            lpips_views: None,
            // Each costs as much as three views that nothing is done to.
            distorted_views: Some(2),
            optimizer: Optimizer::PreconditionedSgd(PreconditionedSgdOptions::default()),
            balance: Some(LossWeightControl {
                // Of enlarged views. Pictures of 800 pixels then have 38.5 to 39.5 dB.
                target_psnr_db: 39.5,
                // Beyond that a mark is changed by more turns of the shipped CLIP's sines than it gains by.
                covered_psnr_db: Some(33.7),
                target_ssim: Some(0.993),
                // Most marks of 32 bits don't need it; rooms do, and of 64 bits smooth scenes (docs/scenes-and-views.md).
                yielding: Some(TargetRelaxation {
                    below: 0.97,
                    psnr_db: 2.0,
                    ssim: 0.0045,
                }),
                ..LossWeightControl::default()
            }),
            augmentation: Augmentation::default(),
            robust_to: EVERYDAY.into_iter().collect(),
            distortions: Ranges {
                jpeg: JpegRange {
                    quality: JPEG_QUALITY,
                    ..JpegRange::default()
                },
                ..Ranges::default()
            },
            distorted_size: 640,
            early_stop: Some(EarlyStop {
                every: 25,
                views: 8,
                min_steps: 100,
                bit_accuracy: 0.998,
                margin: 8.0,
                psnr_db: 39.2,
                patience: 2,
            }),
            verify: Verify {
                views: 20,
                size: None,
                message_views: 5,
            },
            target: Target {
                bit_accuracy: 0.95,
                // Of held-out views; the same views of 800 pixels differ by 0.2 dB less to 0.4 more (docs/evaluation.md).
                psnr_db: 38.5,
                psnr_covered_db: Some(31.0),
                message: true,
            },
        };
        match self {
            Self::Standard => standard,
            Self::Draft => Settings {
                steps: 80,
                // In so few steps half as many fresh views are too few.
                fresh_per_step: 4,
                // Hard scenes would be refused otherwise, and still take less than with standard.
                extension: standard.extension.map(|extension| Extension {
                    after: 50,
                    below: 0.95,
                    most: 1,
                    ..extension
                }),
                pool_views: 100,
                balance: Some(LossWeightControl {
                    target_psnr_db: 39.4,
                    covered_psnr_db: Some(33.7),
                    target_ssim: Some(0.993),
                    ..LossWeightControl::default()
                }),
                early_stop: standard.early_stop.map(|stop| EarlyStop {
                    min_steps: 50,
                    bit_accuracy: 0.99,
                    margin: 4.0,
                    psnr_db: 38.5,
                    ..stop
                }),
                target: Target {
                    bit_accuracy: 0.9,
                    psnr_db: 37.0,
                    psnr_covered_db: Some(30.5),
                    message: true,
                },
                ..standard
            },
            // What is left over by a short message goes into what it stands. Views that are compressed or noisy in training
            // would cost four times the time for a little more against noise (docs/clip.md).
            Self::Robust => Settings {
                steps: 320,
                // Wide margins are what noise and JPEG 10 must overcome.
                lambda: LossWeights {
                    temperature: 8.0,
                    ..standard.lambda
                },
                balance: standard.balance.map(|balance| LossWeightControl {
                    target_psnr_db: 39.2,
                    target_ssim: Some(0.9925),
                    // Never: what is left over is to be used.
                    bit_accuracy: 2.0,
                    // A word may have wrong bits.
                    yielding: balance.yielding.map(|yielding| TargetRelaxation {
                        below: 0.93,
                        ..yielding
                    }),
                    ..balance
                }),
                early_stop: standard.early_stop.map(|stop| EarlyStop {
                    min_steps: 160,
                    margin: 12.0,
                    psnr_db: 38.9,
                    ..stop
                }),
                ..standard
            },
            Self::Thorough => Settings {
                steps: 480,
                // To as many steps as of standard.
                extension: standard.extension.map(|extension| Extension { most: 1, ..extension }),
                ..standard
            },
            Self::Paper => Settings {
                distortions: Ranges::default(),
                steps: 1300,
                times_of_parts: 1,
                times_of_fine: 1,
                extension: None,
                views_per_step: 16,
                fresh_per_step: 16,
                size: 224,
                enlarged: 1.0,
                black_backgrounds: 0.0,
                windows: 0.0,
                cut_out: 0.0,
                distorted_size: 224,
                distorted_views: None,
                robust_to: RobustTo::none(),
                lambda: LossWeights {
                    l1: 0.8,
                    l2: 0.0,
                    ssim: 0.2,
                    lpips: 1.0,
                    message: 0.03,
                    temperature: 1.0,
                    offset_dc: 10.0,
                    offset_rest: 10.0,
                    ..standard.lambda
                },
                optimizer: Optimizer::Adam(AdamOptions::default()),
                balance: None,
                early_stop: None,
                target: Target {
                    psnr_db: 37.5,
                    ..standard.target
                },
                ..standard
            },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::extract::stands_for;

    #[test]
    fn presets_keep_to_their_limits_and_stand_dropped_bands() {
        for preset in Preset::ALL {
            let settings = preset.settings();
            settings.check().unwrap();
            assert_eq!(preset.name().parse::<Preset>().unwrap(), preset);
            assert_eq!(
                settings.robust_to.contains(DistortionKind::ShTruncation),
                preset != Preset::Paper
            );
        }
    }

    /// Where splats are finer than a pixel, a mark of views for smaller pictures is not read in larger ones.
    #[test]
    fn marks_are_made_in_views_for_pictures_as_large_as_they_are_read_in() {
        for preset in Preset::ALL.into_iter().filter(|preset| *preset != Preset::Paper) {
            let settings = preset.settings();
            let read = stands_for(settings.size);
            assert!(
                settings.enlarged >= read,
                "{}: {} {read}",
                preset.name(),
                settings.enlarged
            );
        }
    }
}
