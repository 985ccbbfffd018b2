//! The graphics adapters of a machine, and which of them render.

use crate::layout::STORAGE_BUFFERS;
use std::cmp::Reverse;
use std::fmt;
use std::sync::LazyLock;
use syntable_model::error::{Error, Result};
use syntable_model::stage::{DeviceClass, RenderDevice};

/// Environment variable with a part of the name of the adapter to use, in upper or lower case; the one that other programs
/// with wgpu read.
const WANTED: &str = "WGPU_ADAPTER_NAME";

/// Environment variable that asks for ray queries by `1`; without it the shaders walk. Off by default, as wgpu calls its
/// interface experimental and queries now and then round otherwise.
pub(crate) const SWITCH: &str = "SYNTABLE_RAY_QUERIES";

/// Whether a device traces rays by queries.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RayQueries {
    /// It has none, or not by Vulkan.
    Absent,
    /// It has them, and the environment variable `SYNTABLE_RAY_QUERIES` does not ask for them.
    Off,
    /// It does.
    Used,
}

impl RayQueries {
    /// Whether an adapter traces rays by queries, if they are wanted.
    pub fn of(adapter: &wgpu::Adapter, are_wanted: bool) -> Self {
        // Of Vulkan alone: there was nothing to test those of Metal and DirectX on.
        let is_there = adapter.get_info().backend == wgpu::Backend::Vulkan
            && adapter.features().contains(wgpu::Features::EXPERIMENTAL_RAY_QUERY)
            && adapter.limits().max_acceleration_structures_per_shader_stage > 0;
        match (is_there, are_wanted) {
            (false, _) => Self::Absent,
            (true, false) => Self::Off,
            (true, true) => Self::Used,
        }
    }

    /// Why they are not used though they are there.
    pub fn excuse(self) -> Option<String> {
        match self {
            Self::Absent | Self::Used => None,
            Self::Off => Some(format!("its ray queries are off; {SWITCH}=1 turns them on")),
        }
    }
}

/// What a graphics adapter is.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct AdapterInfo {
    /// Name of the card.
    pub name: String,
    /// Driver and its version.
    pub driver: String,
    /// Vulkan, Metal or DirectX 12.
    pub backend: String,
    /// What sort of adapter it is.
    pub class: wgpu::DeviceType,
    /// Numbers of its maker and model.
    pub model: [u32; 2],
    /// Bytes of the largest buffer that kernels can read.
    pub max_buffer: u64,
    /// Whether it traces rays itself. It rounds otherwise then, now and then.
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

    /// Whether it is a card rather than a program.
    pub fn is_hardware(&self) -> bool {
        self.class != wgpu::DeviceType::Cpu
    }

    /// Paths that a pass may have; another number changes no image. The last bounces of a pass leave most of a card idle, so
    /// fewer passes are faster: a card with memory of its own gets 640 × 480 pixels with 32 samples in one. On
    /// what is slower so many rays would take as long as drivers allow a dispatch to.
    pub fn most_paths(&self) -> u64 {
        match self.class {
            wgpu::DeviceType::DiscreteGpu | wgpu::DeviceType::VirtualGpu => 1 << 24,
            wgpu::DeviceType::Cpu => 1 << 18,
            _ => 1 << 21,
        }
    }

    /// Cards of their own before those of a processor, and programs last.
    fn rank(&self) -> u8 {
        match self.class {
            wgpu::DeviceType::DiscreteGpu => 0,
            wgpu::DeviceType::VirtualGpu => 1,
            wgpu::DeviceType::IntegratedGpu => 2,
            wgpu::DeviceType::Other => 3,
            wgpu::DeviceType::Cpu => 4,
        }
    }

    /// Whether both round alike: cards of one model, with one driver and interface.
    fn is_like(&self, other: &Self) -> bool {
        let what = |info: &Self| (info.model, info.name.clone(), info.driver.clone(), info.backend.clone());
        what(self) == what(other) && self.ray_queries == other.ray_queries
    }
}

/// The numbers of the adapters that render. Images must not depend on which adapter
/// has a free session, so all that render are alike: the best one, or the one that is wanted, and those of its model. A
/// program takes the place of a card once.
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

/// The error of a machine without an adapter that can run the kernels; with those that cannot, each with the reason.
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

/// Bytes of the largest buffer of which the shaders can number the words.
const ADDRESSED: u64 = 1 << 32;

/// What an adapter has to offer.
pub fn required_limits() -> wgpu::Limits {
    wgpu::Limits { max_storage_buffers_per_shader_stage: STORAGE_BUFFERS, ..wgpu::Limits::downlevel_defaults() }
}

/// What finds adapters, one for the process: drivers crash when several come and go on different threads.
static INSTANCE: LazyLock<wgpu::Instance> = LazyLock::new(|| {
    // Numbers of groups are counted by the shaders, which need no check of them.
    let flags = wgpu::InstanceFlags::default() - wgpu::InstanceFlags::VALIDATION_INDIRECT_CALL;
    wgpu::Instance::new(wgpu::InstanceDescriptor { flags, ..wgpu::InstanceDescriptor::new_without_display_handle() })
});

/// The first thing that an adapter's limits lack of what the kernels need.
fn lack(limits: &wgpu::Limits) -> Option<String> {
    let mut lack = None;
    required_limits().check_limits_with_fail_fn(limits, true, |name, needed, offered| {
        lack = Some(format!("its limit `{name}` is {offered}, and the kernels need {needed}"));
    });
    lack
}

/// The adapters of this machine.
pub struct Adapters {
    /// Those that can run the kernels.
    all: Vec<wgpu::Adapter>,
    /// The others, each with the reason.
    unable: Vec<String>,
    /// Whether ray queries are wanted.
    queries: bool,
    /// The numbers of those that render, or why none does.
    used: Result<Vec<usize>>,
}

impl Adapters {
    /// Looks for adapters. They trace rays by queries where they can and `SYNTABLE_RAY_QUERIES` is 1.
    pub fn find() -> Self {
        Self::with_ray_queries(std::env::var_os(SWITCH).is_some_and(|value| value == "1"))
    }

    /// The same, whatever the environment says of ray queries.
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

    /// Those that render.
    ///
    /// # Errors
    /// If there is none, or not the one that is wanted.
    pub fn used(&self) -> Result<Vec<AdapterInfo>> {
        let used = self.used.as_ref().map_err(Error::clone)?;
        Ok(used.iter().map(|&number| self.info(number)).collect())
    }

    /// One of those that render, by its number among them.
    pub(crate) fn get(&self, number: usize) -> Result<(&wgpu::Adapter, AdapterInfo)> {
        let used = self.used.as_ref().map_err(Error::clone)?;
        let number = *used.get(number).ok_or_else(|| none(&self.unable))?;
        Ok((&self.all[number], self.info(number)))
    }

    /// What an adapter is, by its number among all.
    fn info(&self, number: usize) -> AdapterInfo {
        AdapterInfo::of(&self.all[number], self.queries)
    }

    /// Those that render, as devices of a renderer.
    ///
    /// # Errors
    /// If there is none.
    pub fn devices(&self) -> Result<Vec<RenderDevice>> {
        let device = |info: AdapterInfo| RenderDevice {
            name: info.to_string(),
            class: if info.is_hardware() { DeviceClass::Card } else { DeviceClass::Emulated },
            limits: limits_of(&info),
        };
        Ok(self.used()?.into_iter().map(device).collect())
    }

    /// The others, each with the reason.
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

/// What an adapter that renders holds at most, and what of it is not used.
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
        // Both would not make the same bytes.
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
