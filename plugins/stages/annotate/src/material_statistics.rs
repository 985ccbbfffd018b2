//! Mean materials of bodies.

use crate::materials::material_names;
use syntable_model::prelude::*;
use syntable_model::product::standard::MATERIAL_STATISTICS;
use syntable_model::scene::{Body, Mesh};
use syntable_prepare::{PreparedScene, SceneCache, SurfacePoint};

/// Number of points at which the materials of one slot of a mesh are sampled.
const SAMPLES: usize = 4096;

/// A pair of numbers whose multiples fill the unit square evenly (Roberts' sequence): powers of the reciprocal of the
/// plastic number.
const EVEN: [f64; 2] = [0.754_877_666_246_693, 0.569_840_290_998_053];

/// Mean surface of every body, weighted by area over its whole mesh, visible or not: `base_color` (linear
/// Rec. 709, with textures and changes of color), perceptual `roughness`, `metallic` and `transmission`, the fraction of
/// the entering light that passes the surface, each in [0, 1]; with the body's `id` and its area, `area_m2`.
///
/// `materials` has the same values for each material slot of the mesh with faces, with the material's `name` and its
/// `area_m2`. The values of untextured materials are exact. Textures are sampled at 4096 points spread evenly over the
/// slot, at the mip level of the distance between points.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct MaterialStatistics {}

impl Config for MaterialStatistics {
    type Stage = dyn SceneAnnotator;
    const KIND: &'static str = "material_statistics";
    const EXAMPLE: &'static str = "";
    fn build(self) -> Result<Box<dyn SceneAnnotator>, ConfigError> {
        Ok(Box::new(Look { cache: SceneCache::default() }))
    }
}

register!(MaterialStatistics);

/// The annotator of the kind `material_statistics`.
struct Look {
    cache: SceneCache,
}

impl SceneAnnotator for Look {
    fn reads(&self) -> Vec<KeyId> {
        keys![]
    }

    fn provides(&self) -> Vec<KeyId> {
        keys![MATERIAL_STATISTICS]
    }

    fn annotate(&self, cx: &SceneContext, _: &[ViewProducts], products: &mut Products) -> Result<()> {
        let prepared = PreparedScene::new(cx.scene, &self.cache, cx.workers);
        let record = |(index, body): (usize, &Body)| Value::of(&MaterialStatisticsRecord::new(body, index, &prepared));
        let records = cx.scene.bodies().iter().enumerate().map(record).collect::<Result<_>>()?;
        products.put(MATERIAL_STATISTICS, Value::List(records))
    }
}

/// An entry of the product `material_statistics`.
#[derive(Serialize)]
struct MaterialStatisticsRecord<'a> {
    id: u16,
    #[serde(flatten)]
    whole: Surface,
    materials: Vec<Slot<'a>>,
}

/// A material slot of a mesh.
#[derive(Serialize)]
struct Slot<'a> {
    name: &'a str,
    #[serde(flatten)]
    surface: Surface,
}

/// The mean of a surface.
#[derive(Debug, Clone, Copy, Default, Serialize)]
struct Surface {
    area_m2: f64,
    base_color: [f64; 3],
    roughness: f64,
    metallic: f64,
    transmission: f64,
}

impl Surface {
    /// The mean with another surface that has an area.
    fn joined(self, other: Self) -> Self {
        let area_m2 = self.area_m2 + other.area_m2;
        let share = if area_m2 > 0.0 { other.area_m2 / area_m2 } else { 1.0 };
        let mean = |a: f64, b: f64| a + (b - a) * share;
        Self {
            area_m2,
            base_color: std::array::from_fn(|i| mean(self.base_color[i], other.base_color[i])),
            roughness: mean(self.roughness, other.roughness),
            metallic: mean(self.metallic, other.metallic),
            transmission: mean(self.transmission, other.transmission),
        }
    }
}

impl<'a> MaterialStatisticsRecord<'a> {
    fn new(body: &'a Body, index: usize, scene: &PreparedScene) -> Self {
        let mesh = &body.object.mesh;
        let mut names = material_names(body);
        if names.is_empty() {
            names.push("none");
        }
        let last = names.len() - 1;
        let mut faces: Vec<Vec<usize>> = vec![Vec::new(); names.len()];
        (0..mesh.data().triangles.len()).for_each(|triangle| faces[mesh.slot(triangle).min(last)].push(triangle));
        let slots = faces.into_iter().zip(names).filter(|(faces, _)| !faces.is_empty());
        let slots = slots.map(|(faces, name)| Slot { name, surface: Faces::new(mesh, faces).look(body, index, scene) });
        let materials: Vec<Slot> = slots.collect();
        let whole = materials.iter().fold(Surface::default(), |sum, slot| sum.joined(slot.surface));
        Self { id: body.id.0, whole, materials }
    }
}

/// Faces of a mesh, with the total area up to each one.
struct Faces {
    faces: Vec<usize>,
    ends: Vec<f64>,
}

impl Faces {
    fn new(mesh: &Mesh, faces: Vec<usize>) -> Self {
        let area = |&face: &usize| {
            let [a, b, c] = mesh.corners(face);
            (b - a).cross(&(c - a)).norm() / 2.0
        };
        let mut sum = 0.0;
        let ends = faces.iter().map(area).map(|area| {
            sum += area;
            sum
        });
        Self { ends: ends.collect(), faces }
    }

    fn look(&self, body: &Body, index: usize, scene: &PreparedScene) -> Surface {
        let area_m2 = self.ends.last().copied().unwrap_or_default();
        let width = (area_m2 / SAMPLES as f64).sqrt() as f32;
        let samples = (0..SAMPLES).map(|number| {
            let (face, [u, v]) = self.sample(number, area_m2);
            surface_at(body, scene, index, face, [u, v], width)
        });
        // Each sample has the same area, so the result is their mean.
        let one = |surface| Surface { area_m2: 1.0, ..surface };
        Surface { area_m2, ..samples.map(one).fold(Surface::default(), Surface::joined) }
    }

    /// A face, chosen in proportion to its area, and weights of its second and third corner.
    fn sample(&self, number: usize, area_m2: f64) -> (usize, [f64; 2]) {
        let at = (number as f64 + 0.5) / SAMPLES as f64 * area_m2;
        let place = self.ends.partition_point(|end| *end <= at).min(self.faces.len() - 1);
        let [u, v] = EVEN.map(|step| (0.5 + number as f64 * step).fract());
        (self.faces[place], if u + v > 1.0 { [1.0 - u, 1.0 - v] } else { [u, v] })
    }
}

/// The surface at a point of a face.
fn surface_at(body: &Body, scene: &PreparedScene, index: usize, face: usize, [u, v]: [f64; 2], width: f32) -> Surface {
    let [a, b, c] = body.object.mesh.corners(face).map(|corner| (body.world_from_body * corner).coords);
    let position: [f64; 3] = (a + (b - a) * u + (c - a) * v).into();
    let point = SurfacePoint { instance: index as u32, primitive: face as u32, u: u as f32, v: v as f32 };
    let (prepared, triangle) = scene.at(&point);
    let (material, table) = (scene.material(prepared, triangle), &scene.materials);
    let at = scene.texture_coordinates(material, &point, position.map(|x| x as f32).into(), width);
    let color = material.base_color_at(&table.textures, at, scene.vertex_color(&point));
    let metallic = material.metallic.at(&table.textures, at);
    let layers = table.layers(material);
    let transmission = layers.map_or(0.0, |layers| layers.transmitted_fraction(&table.textures, at, metallic));
    Surface {
        area_m2: 0.0,
        base_color: color.array().map(f64::from),
        roughness: material.roughness.at(&table.textures, at).into(),
        metallic: metallic.into(),
        transmission: transmission.into(),
    }
}
