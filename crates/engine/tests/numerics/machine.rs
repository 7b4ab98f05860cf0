//! The devices that lines run on, and on which of them each does.
use guardsplat_engine::device::{Compute, DeviceChoice, open};
use guardsplat_engine::extract::rasterizer;
use guardsplat_engine::splat::{Rasterizer, WeightCache};
use guardsplat_engine::testing::wgpu;

/// A device with its renderer.
pub struct Machine {
    pub compute: Compute,
    pub rasterizer: Box<dyn Rasterizer>,
    /// The kinds of prepared views that it draws from, each of which must do.
    pub caches: &'static [WeightCache],
}

impl Machine {
    fn new(compute: Compute, caches: &'static [WeightCache]) -> Self {
        Self {
            rasterizer: rasterizer(&compute).unwrap(),
            compute,
            caches,
        }
    }

    pub fn cpu() -> Self {
        Self::new(
            open(DeviceChoice::Cpu).unwrap(),
            &[WeightCache::None, WeightCache::Weights],
        )
    }

    /// The Vulkan device, or `None` with a message where there is none; in CI that is a failure.
    fn wgpu() -> Option<Self> {
        wgpu().map(|compute| Self::new(compute, &[WeightCache::None]))
    }
}

/// The check of a line, by the devices that it runs on.
#[derive(Clone, Copy)]
pub enum On {
    /// One after the other.
    Both(fn(&Machine)),
    /// What the CPU only has.
    Cpu(fn(&Machine)),
    /// What wgpu only has.
    Wgpu(fn(&Machine)),
    /// What no device has a part in.
    None(fn()),
}

impl On {
    pub fn run(self) {
        match self {
            Self::None(check) => check(),
            Self::Cpu(check) => check(&Machine::cpu()),
            Self::Wgpu(check) => {
                Machine::wgpu().iter().for_each(check);
            }
            Self::Both(check) => {
                check(&Machine::cpu());
                Machine::wgpu().iter().for_each(check);
            }
        }
    }

    /// For the table of `docs/numerics.md`.
    pub fn devices(self) -> &'static str {
        match self {
            Self::Both(_) => "CPU, wgpu",
            Self::Cpu(_) => "CPU",
            Self::Wgpu(_) => "wgpu",
            Self::None(_) => "none",
        }
    }
}
