//! `auto`: the path tracer of a graphics card if the machine has one.

use crate::cpu_path::{CpuPath, CpuPathRenderer};
use syntable_model::prelude::*;
use syntable_model::registry::{Choice, Choose, Registry, Slot, Stage};
use syntable_model::stage::DeviceClass;
use syntable_transport::path_tracing_kind;

path_tracing_kind! {
    /// `gpu_path` if a graphics card can run it, else `cpu_path`. A software emulation of a card does not count.
    ///
    /// The choice is made when a dataset begins: its recipe names the kind, and a resumed run uses no other. Where the same
    /// bytes are needed everywhere, name `cpu_path`.
    AutoPath
}

/// The kind for graphics cards. It is looked up by name, since a program need not contain it.
const ON_CARDS: &str = "gpu_path";

impl Config for AutoPath {
    type Stage = dyn Renderer;
    const KIND: &'static str = "auto";
    const EXAMPLE: &'static str = CpuPath::EXAMPLE;
    const CHOOSE: Option<Choose> = Some(choose);

    fn build(self) -> Result<Box<dyn Renderer>, ConfigError> {
        // Both have the same products and costs.
        Ok(Box::new(CpuPathRenderer::new(self.0)))
    }
}

fn choose(registry: &Registry) -> Result<Choice> {
    let made = registry.find(Slot::Render, ON_CARDS).map(|entry| entry.construct_str(""));
    let Some(Ok(Stage::Render(renderer))) = made.map(|made| made.map(|made| made.stage)) else {
        return Ok(on_processor(format!("this program has no `{ON_CARDS}`")));
    };
    Ok(match renderer.devices() {
        Err(error) => on_processor(error.message().to_owned()),
        Ok(devices) => {
            let names = |class: DeviceClass| {
                let of_class = devices.iter().filter(|device| device.class == class);
                of_class.map(|device| device.name.as_str()).collect::<Vec<_>>().join(", ")
            };
            match (names(DeviceClass::Card), names(DeviceClass::Emulated)) {
                (cards, _) if !cards.is_empty() => Choice { kind: ON_CARDS, reason: cards },
                (_, emulated) => on_processor(format!("no graphics card, only {emulated}")),
            }
        }
    })
}

fn on_processor(reason: String) -> Choice {
    Choice { kind: CpuPath::KIND, reason }
}

register!(AutoPath);
