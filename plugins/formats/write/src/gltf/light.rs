//! Lights: emissive geometry, or the point, spot and directional lights of KHR_lights_punctual.
//!
//! Emissive geometry has the light's radiance, so a path tracer computes the same illumination. It reflects nothing: it
//! is black, with an index of refraction of 1. Rectangles and disks emit to one side; black geometry behind them keeps
//! the other side dark. Spheres and disks become polyhedra of the same power: the mean projected area of a convex body
//! is a quarter of its surface (Cauchy), so spheres keep their surface area, and disks their area. Windows become
//! rectangles of uniform radiance with the same flux.

use super::document::{
    DocumentExtensions, EmissiveStrength, GltfAttributes, GltfMaterial, GltfMesh, GltfNode, GltfPrimitive, Index, Ior,
    MaterialExtensions, NodeExtensions, NodeLight, Pbr, PunctualLight, Spot,
};
use super::glb::Glb;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::{Value as Json, json};
use std::collections::BTreeMap;
use std::f64::consts::{FRAC_PI_2, PI, TAU};
use syntable_model::geometry::{Matrix3, Point3, Pose, Rotation3, Translation3, UnitQuaternion, Vector3};
use syntable_model::scene::Light;

/// Representation of lights.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum LightMode {
    /// Spheres, rectangles and disks become emissive geometry, exact in path tracers; windows become rectangles of
    /// their mean radiance, suns directional lights.
    Emissive,
    /// Spheres become point lights, rectangles and disks spot lights, suns directional lights: for rasterizing viewers.
    Punctual,
    /// No lights.
    None,
}

/// Distance of the black back side from the emissive front, m.
const BACK_M: f32 = 1e-4;
/// Corners of a disk; twice the number of rings of a sphere.
const CORNERS: u32 = 48;

/// The lights of a file.
#[derive(Debug, Clone, Default)]
pub struct GltfLights {
    shapes: BTreeMap<&'static str, (GltfAttributes, Index)>,
    materials: BTreeMap<[u64; 4], Index>,
}

impl GltfLights {
    /// Adds a light. Returns its node; none for an environment map, which glTF cannot express.
    pub fn add(&mut self, glb: &mut Glb, number: usize, light: &Light, mode: LightMode) -> Option<GltfNode> {
        let solid = mode == LightMode::Emissive;
        let at = |center: &Point3<f64>, rotation| Pose::from_parts(Translation3::from(center.coords), rotation);
        let named = |what: &str| format!("light {number} ({what})");
        let extras = json!({ "light": number });
        match light {
            Light::Sphere(sphere) if solid => {
                let mesh = self.body(glb, named("sphere"), &["sphere"], sphere.radiance);
                let pose = at(&sphere.center, UnitQuaternion::identity());
                Some(emissive(named("sphere"), &pose, [sphere.radius; 3], mesh, extras))
            }
            Light::Rect(rect) => {
                let (u, v) = (rect.half_u.norm(), rect.half_v.norm());
                let axes = Matrix3::from_columns(&[rect.half_u / u, rect.half_v / v, rect.normal()]);
                let rotation = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(axes));
                if !solid {
                    return Some(spot(
                        glb,
                        named("rectangle"),
                        &rect.center,
                        &rect.normal(),
                        rect.radiance,
                        4.0 * u * v,
                    ));
                }
                let mesh = self.body(glb, named("rectangle"), &["square", "square's back"], rect.radiance);
                Some(emissive(named("rectangle"), &at(&rect.center, rotation), [u, v, 1.0], mesh, extras))
            }
            Light::Disk(disk) => {
                let area = PI * disk.radius * disk.radius;
                if !solid {
                    return Some(spot(glb, named("disk"), &disk.center, &disk.normal, disk.radiance, area));
                }
                let mesh = self.body(glb, named("disk"), &["disk", "disk's back"], disk.radiance);
                let pose = at(&disk.center, facing(&disk.normal));
                Some(emissive(named("disk"), &pose, [disk.radius, disk.radius, 1.0], mesh, extras))
            }
            Light::Sphere(sphere) => {
                let area = PI * sphere.radius * sphere.radius;
                let pose = at(&sphere.center, UnitQuaternion::identity());
                Some(punctual(glb, named("sphere"), &pose, "point", sphere.radiance, area, None))
            }
            Light::Directional(sun) => {
                // A directional light shines along its -z.
                let pose = at(&Point3::origin(), facing(&sun.towards));
                let mut node = punctual(glb, named("sun"), &pose, "directional", sun.irradiance, 1.0, None);
                node.extras = json!({ "light": number, "half_angle": sun.half_angle });
                Some(node)
            }
            Light::Environment(_) => None,
            // Replaces the window by a rectangle of its mean radiance.
            Light::Window(window) => self.add(glb, number, &Light::Rect(window.mean()), mode),
        }
    }

    /// A mesh of an emissive shape with its black back side, if any.
    fn body(&mut self, glb: &mut Glb, name: String, shapes: &[&'static str], radiance: [f64; 3]) -> Index {
        let mut primitives = Vec::new();
        for (i, &shape) in shapes.iter().enumerate() {
            let (attributes, indices) = self.shape(glb, shape);
            let material = if i == 0 {
                self.material(glb, radiance, shapes.len() == 1)
            } else {
                self.material(glb, [0.0; 3], true)
            };
            primitives.push(GltfPrimitive { attributes, indices, material });
        }
        glb.document.meshes.push(GltfMesh { name, primitives });
        glb.document.meshes.len() - 1
    }

    fn shape(&mut self, glb: &mut Glb, shape: &'static str) -> (GltfAttributes, Index) {
        let write = || {
            let (positions, normals, triangles) = match shape {
                "sphere" => sphere(),
                "square" => flat(square(), 0.0),
                "square's back" => flat(square(), -BACK_M),
                "disk" => flat(disk(), 0.0),
                _ => flat(disk(), -BACK_M),
            };
            let attributes = GltfAttributes {
                position: glb.vectors(&positions, true),
                normal: Some(glb.vectors(&normals, false)),
                ..GltfAttributes::default()
            };
            (attributes, glb.indices(&triangles, positions.len()))
        };
        self.shapes.entry(shape).or_insert_with(write).clone()
    }

    fn material(&mut self, glb: &mut Glb, radiance: [f64; 3], double_sided: bool) -> Index {
        let [r, g, b] = radiance.map(f64::to_bits);
        let write = || {
            let brightest = radiance.into_iter().fold(0.0, f64::max);
            let lit = brightest > 0.0;
            glb.document.extensions_used.insert("KHR_materials_ior");
            if lit {
                glb.document.extensions_used.insert("KHR_materials_emissive_strength");
            }
            glb.document.materials.push(GltfMaterial {
                name: if lit { "light".into() } else { "back of a light".into() },
                pbr_metallic_roughness: Pbr {
                    base_color_factor: [0.0, 0.0, 0.0, 1.0],
                    roughness_factor: 1.0,
                    ..Pbr::default()
                },
                emissive_factor: lit.then(|| radiance.map(|x| (x / brightest) as f32)),
                double_sided,
                extensions: MaterialExtensions {
                    ior: Some(Ior { ior: 1.0 }),
                    emissive_strength: lit.then_some(EmissiveStrength { emissive_strength: brightest as f32 }),
                    ..MaterialExtensions::default()
                },
                ..GltfMaterial::default()
            });
            glb.document.materials.len() - 1
        };
        *self.materials.entry([r, g, b, double_sided.into()]).or_insert_with(write)
    }
}

fn emissive(name: String, pose: &Pose, scale: [f64; 3], mesh: Index, extras: Json) -> GltfNode {
    GltfNode { mesh: Some(mesh), scale: Some(scale), extras, ..GltfNode::at(name, pose) }
}

/// An area light as a spot light along its -z. The intensity on the axis is the same. It falls to 0 at 90°: with the
/// squared cosine in most viewers, but with the cosine for an area light.
fn spot(
    glb: &mut Glb,
    name: String,
    center: &Point3<f64>,
    normal: &Vector3<f64>,
    radiance: [f64; 3],
    area: f64,
) -> GltfNode {
    let cone = Spot { inner_cone_angle: 0.0, outer_cone_angle: FRAC_PI_2 };
    let pose = Pose::from_parts(Translation3::from(center.coords), facing(&-normal));
    punctual(glb, name, &pose, "spot", radiance, area, Some(cone))
}

/// A punctual light. Color times intensity is `each` times `factor`, in candela, or in lux for directional lights.
fn punctual(
    glb: &mut Glb,
    name: String,
    pose: &Pose,
    kind: &'static str,
    each: [f64; 3],
    factor: f64,
    spot: Option<Spot>,
) -> GltfNode {
    let brightest = each.into_iter().fold(0.0, f64::max);
    let color = each.map(|x| if brightest > 0.0 { x / brightest } else { 1.0 });
    glb.document.extensions_used.insert("KHR_lights_punctual");
    let lights = &mut glb.document.extensions.get_or_insert_with(DocumentExtensions::default).lights_punctual.lights;
    lights.push(PunctualLight { name: name.clone(), kind, color, intensity: brightest * factor, spot });
    let light = NodeLight { light: lights.len() - 1 };
    GltfNode { extensions: Some(NodeExtensions { lights_punctual: light }), ..GltfNode::at(name, pose) }
}

/// A rotation that maps z to a direction.
fn facing(direction: &Vector3<f64>) -> UnitQuaternion<f64> {
    UnitQuaternion::rotation_between(&Vector3::z(), direction)
        .unwrap_or_else(|| UnitQuaternion::from_axis_angle(&Vector3::x_axis(), PI))
}

type Shape = (Vec<[f32; 3]>, Vec<[f32; 3]>, Vec<[u32; 3]>);

fn square() -> Vec<[f64; 2]> {
    vec![[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]]
}

/// A regular polygon of area π.
fn disk() -> Vec<[f64; 2]> {
    let step = TAU / f64::from(CORNERS);
    let radius = (TAU / (f64::from(CORNERS) * libm::sin(step))).sqrt();
    (0..CORNERS)
        .map(|i| f64::from(i) * step)
        .map(|angle| [radius * libm::cos(angle), radius * libm::sin(angle)])
        .collect()
}

/// A convex polygon facing +z.
fn flat(outline: Vec<[f64; 2]>, z: f32) -> Shape {
    let positions: Vec<_> = outline.iter().map(|&[x, y]| [x as f32, y as f32, z]).collect();
    let triangles = (1..positions.len() as u32 - 1).map(|i| [0, i, i + 1]).collect();
    (positions, vec![[0.0, 0.0, 1.0]; outline.len()], triangles)
}

/// A sphere of rings and sectors with the surface area of the unit sphere, 4π.
fn sphere() -> Shape {
    let rings = CORNERS / 2;
    let mut unit = vec![Vector3::z()];
    for ring in 1..rings {
        let polar = PI * f64::from(ring) / f64::from(rings);
        for sector in 0..CORNERS {
            let around = TAU * f64::from(sector) / f64::from(CORNERS);
            unit.push(Vector3::new(
                libm::sin(polar) * libm::cos(around),
                libm::sin(polar) * libm::sin(around),
                libm::cos(polar),
            ));
        }
    }
    unit.push(-Vector3::z());
    let at = |ring: u32, sector: u32| match ring {
        0 => 0,
        ring if ring == rings => unit.len() as u32 - 1,
        ring => 1 + (ring - 1) * CORNERS + sector % CORNERS,
    };
    let mut triangles = Vec::new();
    for ring in 0..rings {
        for sector in 0..CORNERS {
            let [a, b] = [at(ring, sector), at(ring, sector + 1)];
            let [c, d] = [at(ring + 1, sector), at(ring + 1, sector + 1)];
            if ring > 0 {
                triangles.push([a, c, b]);
            }
            if ring + 1 < rings {
                triangles.push([b, c, d]);
            }
        }
    }
    let area = |&[a, b, c]: &[u32; 3]| {
        let [a, b, c] = [a, b, c].map(|i| unit[i as usize]);
        (b - a).cross(&(c - a)).norm() / 2.0
    };
    let radius = (4.0 * PI / triangles.iter().map(area).sum::<f64>()).sqrt();
    let floats = |v: Vector3<f64>| v.map(|x| x as f32).into();
    (unit.iter().map(|v| floats(v * radius)).collect(), unit.iter().map(|&v| floats(v)).collect(), triangles)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::Arc;
    use syntable_model::scene::{EnvironmentLight, EnvironmentMap, Mesh, MeshData, WindowLight};

    fn mesh((positions, normals, triangles): Shape) -> Mesh {
        Mesh::new(MeshData { positions, normals, triangles, ..Default::default() }).expect("sound")
    }

    #[test]
    fn a_window_is_a_rectangle_of_its_mean() {
        let view = EnvironmentLight {
            map: Arc::new(EnvironmentMap::constant([2.0, 1.0, 0.5])),
            scale: [100.0; 3],
            rotation: 0.0,
        };
        let window = WindowLight {
            center: Point3::new(1.0, 2.0, 3.0),
            half_u: Vector3::new(0.5, 0.0, 0.0),
            half_v: Vector3::new(0.0, 0.0, 0.5),
            view,
            panes: [1, 1],
            frame_m: 0.1,
            bar_m: 0.0,
            frame_radiance: [10.0; 3],
        };
        // Panes of 0.8 m in a window of 1 m: 64 % of the radiance behind the window and 36 % of the frame's radiance.
        let mean = window.mean();
        assert!((mean.radiance[0] / (0.64 * 200.0 + 0.36 * 10.0) - 1.0).abs() < 1e-3, "{mean:?}");
        for mode in [LightMode::Emissive, LightMode::Punctual] {
            let export = |light: Light| {
                let (mut glb, mut lights) = (Glb::default(), GltfLights::default());
                let node = lights.add(&mut glb, 3, &light, mode).expect("a node");
                (serde_json::to_value(node).expect("a node"), serde_json::to_value(&glb.document).expect("a document"))
            };
            assert_eq!(export(Light::Window(window.clone())), export(Light::Rect(mean)));
        }
    }

    #[test]
    fn shapes_have_the_area_of_what_they_approximate() {
        let ball = mesh(sphere());
        assert!((ball.area() / (4.0 * PI) - 1.0).abs() < 1e-6, "{}", ball.area());
        // Closed and facing outward: its volume is nearly the volume of the ball.
        assert!((ball.signed_volume() / (4.0 * PI / 3.0) - 1.0).abs() < 0.01, "{}", ball.signed_volume());
        assert!((mesh(flat(disk(), 0.0)).area() / PI - 1.0).abs() < 1e-6);
        assert!((mesh(flat(square(), 0.0)).area() - 4.0).abs() < 1e-6);
    }
}
