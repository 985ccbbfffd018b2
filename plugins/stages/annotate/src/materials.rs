//! Materials of the scene by their ids.

use std::collections::BTreeMap;
use syntable_model::prelude::*;
use syntable_model::product::standard::MATERIALS;
use syntable_model::scene::{Body, Material, Scene};

/// Name of the material of a body without materials.
const NONE: &str = "none";

/// Materials of the scene by their ids in `material_map`: `id`, `name`, the `digest` of the material's content, which
/// is the same in all scenes, and `bodies`, the ids of the bodies with faces of this material.
///
/// Ids are 1 to M in the order of the bodies and of their material slots. Materials with the same name and content are
/// one material, on whichever bodies. A body with changed colors has materials of their own digests and the same names. Ids are
/// unique in a scene, names and digests in the dataset.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Materials {}

config!(Materials => dyn SceneAnnotator, "materials");

register!(Materials);

impl SceneAnnotator for Materials {
    fn reads(&self) -> Vec<KeyId> {
        keys![]
    }

    fn provides(&self) -> Vec<KeyId> {
        keys![MATERIALS]
    }

    fn annotate(&self, cx: &SceneContext, _: &[ViewProducts], products: &mut Products) -> Result<()> {
        let records = Numbered::new(cx.scene)?.table.iter().map(Value::of).collect::<Result<_>>()?;
        products.put(MATERIALS, Value::List(records))
    }
}

/// An entry of the product `materials`.
#[derive(Debug, Serialize)]
struct MaterialRecord<'a> {
    id: u16,
    name: &'a str,
    digest: String,
    bodies: Vec<u16>,
}

/// Ids of the materials of a scene.
pub(crate) struct Numbered<'a> {
    table: Vec<MaterialRecord<'a>>,
    pub(crate) of_bodies: Vec<OfSlots>,
}

/// Ids of the materials of a body.
pub(crate) struct OfSlots {
    /// By slot of the mesh; 0 for a slot without faces.
    pub(crate) slots: Vec<u16>,
    /// The material of all faces, if they have only one.
    pub(crate) only: Option<u16>,
}

impl<'a> Numbered<'a> {
    pub(crate) fn new(scene: &'a Scene) -> Result<Self> {
        let mut numbers: BTreeMap<(&str, String), u16> = BTreeMap::new();
        let mut table: Vec<MaterialRecord> = Vec::new();
        let mut of_bodies = Vec::new();
        for body in scene.bodies() {
            let (names, shown) = (material_names(body), body.materials());
            let mut slots = vec![0; names.len().max(1)];
            for slot in used_slots(body) {
                let name = names.get(slot).copied().unwrap_or(NONE);
                let digest = shown.get(slot).map_or_else(String::new, |material| material.digest.to_string());
                let next = table.len() + 1;
                let id = match numbers.get(&(name, digest.clone())) {
                    Some(&id) => id,
                    None => {
                        let id = u16::try_from(next).map_err(|_| {
                            Error::new(format!("the scene has more than {} materials", u16::MAX))
                                .help("leave out `material_map` and `materials`")
                        })?;
                        numbers.insert((name, digest.clone()), id);
                        table.push(MaterialRecord { id, name, digest, bodies: Vec::new() });
                        id
                    }
                };
                slots[slot] = id;
                let bodies = &mut table[usize::from(id) - 1].bodies;
                if bodies.last() != Some(&body.id.0) {
                    bodies.push(body.id.0);
                }
            }
            let mut ids = slots.iter().copied().filter(|&id| id > 0);
            let only = ids.next().filter(|first| ids.all(|id| id == *first));
            of_bodies.push(OfSlots { slots, only });
        }
        Ok(Self { table, of_bodies })
    }
}

/// Materials of a body by slot, before their colors are changed; none if the body has none.
pub(crate) fn materials(body: &Body) -> Vec<&Material> {
    match &body.material_override {
        Some(other) => vec![&other.material],
        None => body.object.materials.iter().map(|material| &**material).collect(),
    }
}

/// Names of the materials of a body by slot; none if the body has none.
pub(crate) fn material_names(body: &Body) -> Vec<&str> {
    materials(body).into_iter().map(|material| material.name.as_str()).collect()
}

/// Material slot of a triangle of a body.
pub(crate) fn slot(body: &Body, triangle: usize) -> usize {
    body.object.mesh.slot(triangle).min(materials_count(body) - 1)
}

fn materials_count(body: &Body) -> usize {
    match body.material_override {
        Some(_) => 1,
        None => body.object.materials.len().max(1),
    }
}

/// Slots that have faces, ascending.
fn used_slots(body: &Body) -> Vec<usize> {
    let mut used = vec![false; materials_count(body)];
    (0..body.object.mesh.data().triangles.len()).for_each(|triangle| used[slot(body, triangle)] = true);
    (0..used.len()).filter(|&slot| used[slot]).collect()
}
