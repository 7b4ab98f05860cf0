//! Chooses where tensors are computed: a GPU through Vulkan, or the CPU.
use crate::error::{Error, Result};
use burn::tensor::wgpu::{WgpuBackend, wgpu};
use burn::tensor::{Device, DeviceKind};
use std::path::Path;
use std::sync::OnceLock;

/// The user's choice of device.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum DeviceChoice {
    /// wgpu when there is a real GPU, else the CPU: a software Vulkan driver is slower than the CPU device.
    #[default]
    Auto,
    /// wgpu through Vulkan, also on a software driver.
    Wgpu,
    /// The CPU.
    Cpu,
}

impl std::str::FromStr for DeviceChoice {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        match text {
            "auto" => Ok(Self::Auto),
            "wgpu" => Ok(Self::Wgpu),
            "cpu" => Ok(Self::Cpu),
            other => Err(Error::BadOption {
                field: "device",
                reason: format!("{other:?} is not a device, must be auto, wgpu or cpu"),
            }),
        }
    }
}

/// An open compute device.
#[derive(Clone, Debug)]
pub struct Compute {
    /// For burn's tensors; without autodiff.
    pub device: Device,
    /// What to call it: `cpu`, or `wgpu` with the adapter's name and driver.
    pub name: String,
    /// Whether it is a real GPU.
    pub is_gpu: bool,
    /// Bytes of the largest buffer that a kernel can be given, where there is a limit.
    pub max_buffer: Option<u64>,
}

/// What [`open`] opened, to be asked what it holds.
static OPENED_DEVICE: OnceLock<wgpu::Device> = OnceLock::new();

/// Bytes of device memory that this process holds, used or kept for use; `None` while it has opened no wgpu device, and
/// where the driver's allocator does not tell.
pub fn memory_held() -> Option<u64> {
    let report = OPENED_DEVICE.get()?.generate_allocator_report()?;
    Some(report.total_reserved_bytes)
}

/// Opens the device that was chosen. A process opens wgpu once; later calls get the same one.
///
/// # Errors
/// [`Error::Device`] when wgpu was asked for and there is no Vulkan driver, or it cannot be opened. Other graphics
/// interfaces are never fallen back to.
pub fn open(choice: DeviceChoice) -> Result<Compute> {
    match choice {
        DeviceChoice::Cpu => Ok(cpu()),
        DeviceChoice::Wgpu => open_wgpu(),
        DeviceChoice::Auto if has_gpu() => open_wgpu(),
        DeviceChoice::Auto => Ok(cpu()),
    }
}

fn cpu() -> Compute {
    Compute {
        device: Device::flex(),
        name: "cpu".into(),
        is_gpu: false,
        max_buffer: None,
    }
}

fn open_wgpu() -> Result<Compute> {
    // burn refuses to initialise the same adapter twice.
    static OPENED: OnceLock<Result<Compute, String>> = OnceLock::new();
    let opened = OPENED.get_or_init(|| {
        if adapters().is_empty() {
            return Err("no Vulkan driver was found; install one (Debian: mesa-vulkan-drivers) or choose cpu".into());
        }
        let options = Device::wgpu_options()
            .device_kind(DeviceKind::DefaultDevice)
            .graphics_api(WgpuBackend::Vulkan);
        let (device, setup) = options.init_with_setup().map_err(|e| e.to_string())?;
        let info = setup.adapter.get_info();
        let name = format!("wgpu: {} ({})", info.name, info.driver_info);
        let limits = setup.device.limits();
        // Set here and nowhere else, and this runs once.
        let _ = OPENED_DEVICE.set(setup.device);
        Ok(Compute {
            device,
            name,
            is_gpu: is_gpu(&info),
            max_buffer: Some(limits.max_buffer_size.min(limits.max_storage_buffer_binding_size)),
        })
    });
    opened.clone().map_err(|reason| Error::Device {
        device: "wgpu".into(),
        reason,
    })
}

/// Files of which the driver of a GPU has one on Linux: Mesa's and AMD's, NVIDIA's, that of WSL, and those of small boards.
const NODES: [&str; 5] = ["/dev/dri", "/dev/nvidiactl", "/dev/dxg", "/dev/mali0", "/dev/kgsl-3d0"];

fn has_gpu() -> bool {
    // Asked on a server without a card, Mesa looks for a display, and prints an error about XDG_RUNTIME_DIR.
    let may_have = !cfg!(target_os = "linux") || NODES.iter().any(|node| Path::new(node).exists());
    may_have && adapters().iter().any(is_gpu)
}

fn is_gpu(adapter: &wgpu::AdapterInfo) -> bool {
    use wgpu::DeviceType::{DiscreteGpu, IntegratedGpu, VirtualGpu};
    matches!(adapter.device_type, DiscreteGpu | IntegratedGpu | VirtualGpu)
}

/// Every Vulkan adapter; asking opens none of them.
fn adapters() -> Vec<wgpu::AdapterInfo> {
    let mut descriptor = wgpu::InstanceDescriptor::new_without_display_handle();
    descriptor.backends = wgpu::Backends::VULKAN;
    let adapters = wgpu::Instance::new(descriptor).enumerate_adapters(wgpu::Backends::VULKAN);
    cubecl::future::block_on(adapters)
        .iter()
        .map(wgpu::Adapter::get_info)
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use burn::tensor::Tensor;

    #[test]
    fn the_cpu_is_always_there() {
        let compute = open(DeviceChoice::Cpu).unwrap();
        assert_eq!((compute.name.as_str(), compute.is_gpu), ("cpu", false));
        assert_eq!(Tensor::<1>::ones([4], &compute.device).sum().into_scalar::<f32>(), 4.0);
    }

    #[test]
    fn auto_takes_wgpu_only_for_a_real_gpu() {
        let real = adapters().iter().any(is_gpu);
        assert_eq!(has_gpu(), real);
        assert_eq!(open(DeviceChoice::Auto).unwrap().is_gpu, real);
    }

    #[test]
    fn wgpu_opens_twice_or_says_what_to_install() {
        match open(DeviceChoice::Wgpu) {
            Ok(first) => {
                assert!(first.name.starts_with("wgpu: "), "{}", first.name);
                assert_eq!(open(DeviceChoice::Wgpu).unwrap().device, first.device);
                assert_eq!(Tensor::<1>::ones([4], &first.device).sum().into_scalar::<f32>(), 4.0);
                assert!(memory_held().is_some_and(|bytes| bytes >= 4 * 4));
            }
            Err(error) => assert!(adapters().is_empty() && error.to_string().contains("Vulkan"), "{error}"),
        }
    }

    #[test]
    fn unknown_devices_are_named() {
        let error = "cuda".parse::<DeviceChoice>().unwrap_err().to_string();
        assert_eq!(error, "device: \"cuda\" is not a device, must be auto, wgpu or cpu");
    }
}
