//! NumPy files of numeric arrays.

use crate::encode::kind::Kind;
use crate::encode::npy::{self, Array};
use crate::encode::{view, view_name};
use crate::include;
use std::any::TypeId;
use syntable_model::prelude::*;
use syntable_model::product::BBox;

/// Writes numeric arrays as NumPy files.
///
/// # What it does
///
/// Stores values as they are: images as `[height, width]` or `[height, width, channels]`, masks as bool, numbers and
/// lists of numbers as float64 or int64. A product per instance is one array with the instances along the first axis;
/// masks become `[N, height, width]`. `occlusion_order` is `[N, N]` of bool over the annotated instances in id order:
/// the row's object occludes the column's. Text and records do not fit; `jsonl` writes them.
///
/// # Output
///
/// `{id}/{product}/{scene:06}_{view:04}.npy`. A product per instance has its instance ids, u16 in the same order, in
/// `{id}/{product}/{scene:06}_{view:04}_ids.npy`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Npy {
    /// Products to write.
    #[schemars(length(min = 1))]
    pub include: Vec<ProductName>,
}

impl Default for Npy {
    fn default() -> Self {
        Self { include: vec!["depth".into(), "instance".into(), "occlusion_order".into()] }
    }
}

impl Config for Npy {
    type Stage = dyn Writer;
    const KIND: &'static str = "npy";
    const EXAMPLE: &'static str = "include = [\"depth\", \"amodal_mask\", \"occlusion_order\"]";
    fn build(self) -> Result<Box<dyn Writer>, ConfigError> {
        include::check_unique(&self.include)?;
        Ok(Box::new(self))
    }
}

impl Writer for Npy {
    fn reads(&self) -> Vec<String> {
        include::names(&self.include)
    }

    fn scene(&self, _: &Site, output: Output) -> Result<Box<dyn SceneWriter>> {
        Ok(Box::new(NpyScene { include: self.reads(), output }))
    }
}

struct NpyScene {
    include: Vec<String>,
    output: Output,
}

impl SceneWriter for NpyScene {
    fn view(&mut self, site: &Site, frame: &Products) -> Result<()> {
        let view = view(site)?;
        let name_of_view = view_name(site.scene.id, view.id);
        for name in &self.include {
            let stem = format!("{}/{name}/{name_of_view}", self.output.id());
            let save = |array: Array, end: &str| self.output.write(&format!("{stem}{end}.npy"), &array.encode());
            let key = include::key(frame, name)?;
            let array = |value: &Value| {
                npy::check(&Kind::of(&key, value)).map_err(Error::new)?;
                Array::of(value)
            };
            let explain = |error: Error| error.context(format!("product `{name}`"));
            match frame.value(name)? {
                Value::PerInstance(values) => {
                    let k = &view.camera.intrinsics;
                    let array = if values.is_empty() {
                        empty_stack(&key, [k.height as usize, k.width as usize])
                    } else {
                        Array::stack(values.values().map(array)).map_err(explain)?
                    };
                    save(array, "")?;
                    save(Array::ids(values.into_keys()), "_ids")?;
                }
                value => save(array(&value).map_err(explain)?, "")?,
            }
        }
        Ok(())
    }

    fn close(self: Box<Self>) -> Result<()> {
        Ok(())
    }
}

/// The array of no instances: the first axis has length 0, the others follow from the product's type.
fn empty_stack(key: &KeyId, [height, width]: [usize; 2]) -> Array {
    let of = key.type_id();
    let (descr, rest) = if of == TypeId::of::<PerInstance<Mask>>() {
        ("|b1", vec![height, width])
    } else if of == TypeId::of::<PerInstance<BBox>>() {
        ("<i8", vec![4])
    } else {
        ("<f8", vec![])
    };
    Array { descr, shape: [vec![0], rest].concat(), bytes: Vec::new() }
}

register!(Npy);
