//! NumPy files of any array.

use crate::files::array::Array;
use crate::files::{products, view, view_name};
use std::any::TypeId;
use syntable_model::prelude::*;
use syntable_model::product::BBox;

/// NumPy files: `{id}/{product}/{scene:06}_{view:04}.npy`, with the values as they are.
///
/// A product of every instance is one array stacked along the first axis, with the instance ids (u16, same order) in
/// `{id}/{product}/{scene:06}_{view:04}_ids.npy`; masks are `[N, height, width]` of bool. `occlusion_order` is
/// `[N, N]` of bool over the annotated instances in id order, row occludes column.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Npy {
    /// The products to write.
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
    fn build(self) -> Result<Box<dyn Writer>, Invalid> {
        products::check(&self.include)?;
        Ok(Box::new(self))
    }
}

impl Writer for Npy {
    fn reads(&self) -> Vec<String> {
        products::names(&self.include)
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
    fn view(&mut self, site: &Site, frame: &Frame) -> Result<()> {
        let view = view(site)?;
        let name_of_view = view_name(site.scene.id, view.id);
        for name in &self.include {
            let stem = format!("{}/{name}/{name_of_view}", self.output.id());
            let save = |array: Array, end: &str| self.output.write(&format!("{stem}{end}.npy"), &array.encode());
            let explain = |error: Error| {
                error
                    .context(format!("product `{name}`"))
                    .help("npy writes numbers of one shape; jsonl writes all else")
            };
            match frame.value(name)? {
                Value::PerInstance(values) => {
                    let k = &view.camera.intrinsics;
                    let array = if values.is_empty() {
                        empty_stack(frame, name, [k.height as usize, k.width as usize])
                    } else {
                        Array::stack(values.values().map(Array::of)).map_err(explain)?
                    };
                    save(array, "")?;
                    save(Array::ids(values.into_keys()), "_ids")?;
                }
                value => save(Array::of(&value).map_err(explain)?, "")?,
            }
        }
        Ok(())
    }

    fn close(self: Box<Self>) -> Result<()> {
        Ok(())
    }
}

/// The array of no instance: its first axis has length 0, the others are those of the product's type.
fn empty_stack(frame: &Frame, name: &str, [height, width]: [usize; 2]) -> Array {
    let of = products::key(frame, name).map(|key| key.type_id());
    let (descr, rest) = if of == Some(TypeId::of::<PerInstance<Mask>>()) {
        ("|b1", vec![height, width])
    } else if of == Some(TypeId::of::<PerInstance<BBox>>()) {
        ("<i8", vec![4])
    } else {
        ("<f8", vec![])
    };
    Array { descr, shape: [vec![0], rest].concat(), bytes: Vec::new() }
}

register!(Npy);
