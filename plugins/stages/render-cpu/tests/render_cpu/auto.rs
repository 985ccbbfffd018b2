//! The kind `auto` chooses a renderer.

use syntable_model::prelude::*;
use syntable_model::registry::{Choice, Entry, Registry};
use syntable_model::stage::{DeviceClass, RenderDevice};
use syntable_render_cpu::AutoPath;

/// A renderer with the name of the kind for cards, with devices of a class; without a class, its devices are an
/// error.
macro_rules! gpu_path {
    ($name:ident, $class:expr) => {
        #[derive(Default, Serialize, Deserialize, JsonSchema)]
        #[serde(deny_unknown_fields)]
        struct $name {}

        impl Config for $name {
            type Stage = dyn Renderer;
            const KIND: &'static str = "gpu_path";
            const EXAMPLE: &'static str = "";
            fn build(self) -> Result<Box<dyn Renderer>, ConfigError> {
                Ok(Box::new(self))
            }
        }

        impl Renderer for $name {
            fn offers(&self) -> Vec<KeyId> {
                Vec::new()
            }
            fn devices(&self) -> Result<Vec<RenderDevice>> {
                let class: Option<DeviceClass> = $class;
                let none = || Error::new("no graphics adapter was found");
                Ok(vec![RenderDevice::new("X1 (driver 2)", class.ok_or_else(none)?)])
            }
            fn open(&self, _: usize) -> Result<Box<dyn RenderSession>> {
                Err(Error::new("choosing opens no session"))
            }
            fn cost(&self) -> String {
                String::new()
            }
        }
    };
}
gpu_path!(WithCard, Some(DeviceClass::Card));
gpu_path!(WithProgram, Some(DeviceClass::Emulated));
gpu_path!(Without, None);

#[test]
fn a_card_is_taken_where_there_is_one() {
    let of = |entries: &[Entry]| {
        let registry = Registry::new(entries.iter().cloned()).expect("no clash");
        let Choice { kind, reason } =
            AutoPath::CHOOSE.expect("it chooses")(&registry).expect("there is always the processor");
        (kind, reason)
    };
    assert_eq!(of(&[Entry::of::<WithCard>("a", "1")]), ("gpu_path", "X1 (driver 2)".into()));
    let only = "no graphics card, only X1 (driver 2)";
    assert_eq!(of(&[Entry::of::<WithProgram>("a", "1")]), ("cpu_path", only.into()));
    assert_eq!(of(&[Entry::of::<Without>("a", "1")]), ("cpu_path", "no graphics adapter was found".into()));
    assert_eq!(of(&[]), ("cpu_path", "this program has no `gpu_path`".into()));
}
