//! The graphics adapters of a machine, and which of them render.

use crate::layout::STORAGE_BUFFERS;
use std::cmp::Reverse;
use std::fmt;
use std::sync::LazyLock;
use syntable_model::error::{Error, Result};
use syntable_model::stage::{DeviceClass, RenderDevice};

/// Environment variable with a part of the name of the adapter to use, in upper or lower case; other programs that use
/// wgpu read it, too.
const WANTED: &str = "WGPU_ADAPTER_NAME";

/// Environment variable that turns ray queries on if it is `1`; otherwise the shaders walk trees. Off by default, as
/// wgpu calls this interface experimental, and queries occasionally round differently.
pub(crate) const SWITCH: &str = "SYNTABLE_RAY_QUERIES";

/// Whether a device traces rays by queries.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RayQueries {
    /// The device has no ray queries, or not through Vulkan.
    Absent,
    /// The device has ray queries, but the environment variable `SYNTABLE_RAY_QUERIES` does not turn them on.
    Off,
    /// The device traces rays by queries.
    Used,
}

impl RayQueries {
    /// Whether an adapter traces rays by queries; `are_wanted` turns them on.
    pub fn of(adapter: &wgpu::Adapter, are_wanted: bool) -> Self {
        // Only on Vulkan: ray queries of Metal and DirectX are untested.
        let is_there = adapter.get_info().backend == wgpu::Backend::Vulkan
            && adapter.features().contains(wgpu::Features::EXPERIMENTAL_RAY_QUERY)
            && adapter.limits().max_acceleration_structures_per_shader_stage > 0;
        match (is_there, are_wanted) {
            (false, _) => Self::Absent,
            (true, false) => Self::Off,
            (true, true) => Self::Used,
        }
    }

    /// The reason why available ray queries are not used.
    pub fn excuse(self) -> Option<String> {
        match self {
            Self::Absent | Self::Used => None,
            Self::Off => Some(format!("its ray queries are off; {SWITCH}=1 turns them on")),
        }
    }
}

/// Properties of a graphics adapter.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct AdapterInfo {
    /// Name of the card.
    pub name: String,
    /// Driver and its version.
    pub driver: String,
    /// Vulkan, Metal or DirectX 12.
    pub backend: String,
    /// Class of the adapter: discrete, integrated, virtual, or a software renderer.
    pub class: wgpu::DeviceType,
    /// Vendor and device ids.
    pub model: [u32; 2],
    /// Bytes of the largest buffer that kernels can read.
    pub max_buffer: u64,
    /// Whether the adapter traces rays by queries. Queries occasionally round differently.
    pub ray_queries: RayQueries,
}

impl fmt::Display for AdapterInfo {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { name, driver, backend, .. } = self;
        let kind = if self.is_hardware() { "" } else { ", a program that runs on the processor" };
        let rays = if self.ray_queries == RayQueries::Used { ", ray queries" } else { "" };
        write!(f, "{name} ({driver}, {backend}{rays}{kind})")
    }
}

impl AdapterInfo {
    fn of(adapter: &wgpu::Adapter, queries: bool) -> Self {
        let (info, limits) = (adapter.get_info(), adapter.limits());
        Self {
            name: info.name,
            driver: format!("{} {}", info.driver, info.driver_info).trim().into(),
            backend: info.backend.to_string(),
            class: info.device_type,
            model: [info.vendor, info.device],
            max_buffer: limits.max_buffer_size.min(limits.max_storage_buffer_binding_size).min(ADDRESSED) / 256 * 256,
            ray_queries: RayQueries::of(adapter, queries),
        }
    }

    /// Whether the adapter is a card and not a software renderer.
    pub fn is_hardware(&self) -> bool {
        self.class != wgpu::DeviceType::Cpu
    }

    /// Maximum paths of a pass; the number does not change images. The last bounces of a pass leave most of a card
    /// idle, so fewer passes are faster: a discrete card renders 640 × 480 pixels with 32 samples in one pass. On
    /// slower adapters, a dispatch of so many rays would reach the time limit of drivers.
    pub fn most_paths(&self) -> u64 {
        match self.class {
            wgpu::DeviceType::DiscreteGpu | wgpu::DeviceType::VirtualGpu => 1 << 24,
            wgpu::DeviceType::Cpu => 1 << 18,
            _ => 1 << 21,
        }
    }

    /// Sessions that share the adapter: some load scenes, record views and read images back while another renders.
    pub fn sessions(&self) -> usize {
        match self.class {
            wgpu::DeviceType::DiscreteGpu | wgpu::DeviceType::VirtualGpu => 4,
            _ => 2,
        }
    }

    /// Order of preference: discrete cards, then virtual and integrated ones, software renderers last.
    fn rank(&self) -> u8 {
        match self.class {
            wgpu::DeviceType::DiscreteGpu => 0,
            wgpu::DeviceType::VirtualGpu => 1,
            wgpu::DeviceType::IntegratedGpu => 2,
            wgpu::DeviceType::Other => 3,
            wgpu::DeviceType::Cpu => 4,
        }
    }

    /// Whether both round alike: cards of one model, with the same driver and interface.
    fn is_like(&self, other: &Self) -> bool {
        let what = |info: &Self| (info.model, info.name.clone(), info.driver.clone(), info.backend.clone());
        what(self) == what(other) && self.ray_queries == other.ray_queries
    }
}

/// Indices of the adapters that render. Images must not depend on which adapter has a free session, so all of them are
/// alike: the best or the requested adapter, and all others of its model. A software renderer is used only once.
fn chosen(all: &[AdapterInfo], wanted: Option<&str>) -> Result<Vec<usize>> {
    let is_wanted =
        |info: &AdapterInfo| wanted.is_none_or(|wanted| info.name.to_lowercase().contains(&wanted.to_lowercase()));
    let alike = |info: &AdapterInfo| all.iter().filter(|other| other.is_like(info)).count();
    let worth = |info: &&AdapterInfo| (info.rank(), Reverse(info.max_buffer), Reverse(alike(info)));
    // The first of the best.
    let Some(best) = all.iter().filter(|info| is_wanted(info)).min_by_key(worth) else {
        let wanted = wanted.unwrap_or_default();
        let names = all.iter().map(|info| info.name.as_str()).collect::<Vec<_>>().join(", ");
        return Err(Error::new(format!("no graphics adapter has `{wanted}` in its name, as {WANTED} says"))
            .help(format!("the machine has {names}: set {WANTED} to a part of a name, or unset it")));
    };
    let alike = (0..all.len()).filter(|&number| all[number].is_like(best));
    Ok(alike.take(if best.is_hardware() { all.len() } else { 1 }).collect())
}

/// The error of a machine without an adapter that can run the kernels. It lists the unsuitable adapters, each with the
/// reason.
fn none(unable: &[String]) -> Error {
    let found = match unable {
        [] => "no graphics adapter was found".into(),
        _ => format!("no graphics adapter that was found can render: {}", unable.join("; ")),
    };
    Error::new(found)
        .help(
            "install the driver of the card, with Vulkan (Linux: the loader `libvulkan1`, too), or set `render.kind = \"cpu_path\"`; \
             `mesa-vulkan-drivers` emulates a card, for tests",
        )
}

/// Bytes of the largest buffer that the shaders can address.
const ADDRESSED: u64 = 1 << 32;

/// Limits that an adapter must offer.
pub fn required_limits() -> wgpu::Limits {
    wgpu::Limits { max_storage_buffers_per_shader_stage: STORAGE_BUFFERS, ..wgpu::Limits::downlevel_defaults() }
}

/// The wgpu instance, one for the process: drivers crash when several instances are created and dropped on different
/// threads.
static INSTANCE: LazyLock<wgpu::Instance> = LazyLock::new(|| {
    // The shaders count the numbers of groups, so wgpu need not validate them.
    let flags = wgpu::InstanceFlags::default() - wgpu::InstanceFlags::VALIDATION_INDIRECT_CALL;
    wgpu::Instance::new(wgpu::InstanceDescriptor { flags, ..wgpu::InstanceDescriptor::new_without_display_handle() })
});

/// The first limit of an adapter that is too low for the kernels.
fn lack(limits: &wgpu::Limits) -> Option<String> {
    let mut lack = None;
    required_limits().check_limits_with_fail_fn(limits, true, |name, needed, offered| {
        lack = Some(format!("its limit `{name}` is {offered}, and the kernels need {needed}"));
    });
    lack
}

/// The adapters of this machine.
pub struct Adapters {
    /// Adapters that can run the kernels.
    all: Vec<wgpu::Adapter>,
    /// All other adapters, each with the reason.
    unable: Vec<String>,
    /// Whether ray queries are turned on.
    queries: bool,
    /// Indices of the adapters that render, or the reason why none can.
    used: Result<Vec<usize>>,
}

impl Adapters {
    /// Looks for adapters. They trace rays by queries if they can and `SYNTABLE_RAY_QUERIES` is 1.
    pub fn find() -> Self {
        Self::with_ray_queries(std::env::var_os(SWITCH).is_some_and(|value| value == "1"))
    }

    /// Like [`Self::find`], but ignores the environment variable for ray queries.
    pub fn with_ray_queries(queries: bool) -> Self {
        let (mut all, mut unable) = (Vec::new(), Vec::new());
        for adapter in pollster::block_on(INSTANCE.enumerate_adapters(wgpu::Backends::PRIMARY)) {
            match lack(&adapter.limits()) {
                None => all.push(adapter),
                Some(lack) => unable.push(format!("{}: {lack}", AdapterInfo::of(&adapter, queries))),
            }
        }
        let infos: Vec<AdapterInfo> = all.iter().map(|adapter| AdapterInfo::of(adapter, queries)).collect();
        let wanted = std::env::var(WANTED).ok().filter(|name| !name.is_empty());
        let used = if infos.is_empty() { Err(none(&unable)) } else { chosen(&infos, wanted.as_deref()) };
        Self { all, unable, queries, used }
    }

    /// Adapters that render.
    ///
    /// # Errors
    /// If the machine has no suitable adapter, or not the requested one.
    pub fn used(&self) -> Result<Vec<AdapterInfo>> {
        let used = self.used.as_ref().map_err(Error::clone)?;
        Ok(used.iter().map(|&number| self.info(number)).collect())
    }

    /// An adapter that renders, by its index among the adapters that render.
    pub(crate) fn get(&self, number: usize) -> Result<(&wgpu::Adapter, AdapterInfo)> {
        let used = self.used.as_ref().map_err(Error::clone)?;
        let number = *used.get(number).ok_or_else(|| none(&self.unable))?;
        Ok((&self.all[number], self.info(number)))
    }

    /// Properties of an adapter, by its index among all adapters.
    fn info(&self, number: usize) -> AdapterInfo {
        AdapterInfo::of(&self.all[number], self.queries)
    }

    /// Adapters that render, as devices of a renderer.
    ///
    /// # Errors
    /// If the machine has no suitable adapter, or not the requested one.
    pub fn devices(&self) -> Result<Vec<RenderDevice>> {
        let device = |info: AdapterInfo| RenderDevice {
            name: info.to_string(),
            class: if info.is_hardware() { DeviceClass::Card } else { DeviceClass::Emulated },
            limits: limits_of(&info),
        };
        Ok(self.used()?.into_iter().map(device).collect())
    }

    /// Adapters that do not render, each with the reason.
    pub fn unused(&self) -> Vec<String> {
        let used = self.used.as_deref().unwrap_or_default();
        let best = used.first().map(|&number| self.info(number));
        let others = (0..self.all.len()).filter(|number| !used.contains(number));
        let why = |info: AdapterInfo| match &best {
            Some(best) if info.is_like(best) => format!("{info}: one software renderer is enough"),
            Some(best) => format!("{info}: unlike {}; {WANTED} chooses a card", best.name),
            None => info.to_string(),
        };
        others.map(|number| why(self.info(number))).chain(self.unable.iter().cloned()).collect()
    }
}

/// Size limit of buffers of an adapter that renders, and features that are not used.
fn limits_of(info: &AdapterInfo) -> String {
    let buffers = format!("buffers of up to {} MiB", info.max_buffer >> 20);
    [Some(buffers), info.ray_queries.excuse()].into_iter().flatten().collect::<Vec<_>>().join("; ")
}

#[cfg(test)]
mod tests {
    use super::*;
    use wgpu::DeviceType::{Cpu, DiscreteGpu, IntegratedGpu};

    fn adapter(name: &str, class: wgpu::DeviceType, backend: &str) -> AdapterInfo {
        let model = [1, u32::from(name.as_bytes()[0])];
        let (name, driver, backend) = (name.into(), "driver 1".into(), backend.into());
        AdapterInfo { name, driver, backend, class, model, max_buffer: 1 << 30, ray_queries: RayQueries::Absent }
    }

    #[test]
    fn what_made_a_dataset_says_whether_rays_were_queried() {
        let plain = adapter("Big", DiscreteGpu, "vulkan");
        let with = |ray_queries| AdapterInfo { ray_queries, ..plain.clone() };
        for (ray_queries, name, limits) in [
            (RayQueries::Absent, "Big (driver 1, vulkan)", "buffers of up to 1024 MiB"),
            (RayQueries::Used, "Big (driver 1, vulkan, ray queries)", "buffers of up to 1024 MiB"),
            (
                RayQueries::Off,
                "Big (driver 1, vulkan)",
                "buffers of up to 1024 MiB; its ray queries are off; SYNTABLE_RAY_QUERIES=1 turns them on",
            ),
        ] {
            let info = with(ray_queries);
            assert_eq!((info.to_string().as_str(), limits_of(&info).as_str()), (name, limits));
        }
        // Together they would not make the same bytes.
        let pair = [with(RayQueries::Used), with(RayQueries::Absent)];
        assert_eq!(chosen(&pair, None).expect("two"), [0]);
    }

    #[test]
    fn only_adapters_that_round_alike_render_together() {
        let laptop = [adapter("Inside", IntegratedGpu, "vulkan"), adapter("Big", DiscreteGpu, "vulkan")];
        let windows = [laptop.as_slice(), &[adapter("Big", DiscreteGpu, "dx12")]].concat();
        let node = [adapter("Big", DiscreteGpu, "vulkan"), adapter("lavapipe", Cpu, "vulkan")];
        let cluster = [node.as_slice(), &node].concat();
        let programs = [adapter("lavapipe", Cpu, "vulkan"), adapter("lavapipe", Cpu, "vulkan")];
        for (all, wanted, used) in [
            (&laptop[..], None, &[1][..]),
            (&laptop, Some("inside"), &[0]),
            // One card with two interfaces is one card.
            (&windows, None, &[1]),
            (&cluster, None, &[0, 2]),
            (&cluster, Some("LAVA"), &[1]),
            (&programs, None, &[0]),
        ] {
            assert_eq!(chosen(all, wanted).expect("one is there"), used, "{wanted:?} of {all:?}");
        }
        let newer = AdapterInfo { driver: "driver 2".into(), ..laptop[1].clone() };
        assert_eq!(chosen(&[laptop[1].clone(), newer], None).expect("two"), [0], "another driver rounds otherwise");
        let small = AdapterInfo { max_buffer: 1 << 20, ..adapter("Display", DiscreteGpu, "vulkan") };
        assert_eq!(chosen(&[small, laptop[1].clone()], None).expect("two"), [1], "the one that holds more");
        let pair = [adapter("One", DiscreteGpu, "vulkan"), laptop[1].clone(), laptop[1].clone()];
        assert_eq!(chosen(&pair, None).expect("three"), [1, 2], "those of which there are more");
        let error = chosen(&laptop, Some("huge")).expect_err("not there").to_string();
        assert!(error.contains("`huge`") && error.contains("Inside, Big") && error.contains(WANTED), "{error}");
    }

    #[test]
    fn an_adapter_that_cannot_render_is_told_with_the_reason() {
        assert_eq!(lack(&required_limits()), None);
        let few = wgpu::Limits { max_storage_buffers_per_shader_stage: 4, ..wgpu::Limits::default() };
        let reason = lack(&few).expect("eight are needed");
        assert_eq!(reason, "its limit `max_storage_buffers_per_shader_stage` is 4, and the kernels need 8");
        assert!(none(&[]).to_string().starts_with("no graphics adapter was found ("), "{}", none(&[]));
        let error = none(&["Old (driver 1, vulkan): it is old".into()]);
        assert!(error.to_string().contains("can render: Old (driver 1, vulkan): it is old ("), "{error}");
    }
}
