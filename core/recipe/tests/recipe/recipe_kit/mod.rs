//! A small registry with kinds for nine of the eleven slots (none for `denoise` and `sensor`), and a loader of recipes.

use std::path::Path;
use syntable_model::prelude::*;
use syntable_model::product::Form;
use syntable_model::product::standard::{AMODAL_MASK, DEPTH, INSTANCE, OCCLUSION_RATE, RADIANCE, VISIBLE_MASK};
use syntable_model::registry::{Entry, Registry};
use syntable_model::scene::{Asset, AssetClass, Camera, Catalog, Light, Optics, SceneBuilder, SettleReport, ViewId};
use syntable_model::stage::{Accepts, Input};
use syntable_recipe::{Diagnostic, Overrides, Recipe, Report, Source};

fn nothing<T>() -> Result<T> {
    Err(syntable_model::error::Error::new("a stage for tests does nothing"))
}

macro_rules! config {
    ($name:ident => $stage:ident, $kind:literal, $example:literal $(, $renamed:expr)?) => {
        impl Config for $name {
            type Stage = dyn $stage;
            const KIND: &'static str = $kind;
            const EXAMPLE: &'static str = $example;
            $(const RENAMED: &'static [(&'static str, &'static str)] = $renamed;)?
            fn build(self) -> Result<Box<dyn $stage>, ConfigError> {
                self.validate()?;
                Ok(Box::new(self))
            }
        }
    };
}

/// Objects from folders of mesh files.
#[derive(Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MeshFolder {
    /// Folder of the meshes.
    root: AssetPath,
    /// File endings to look for.
    #[serde(default)]
    #[schemars(extend("uniqueItems" = true))]
    endings: Vec<Ending>,
}

/// A file ending.
#[derive(Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Ending {
    /// Wavefront.
    Obj,
    /// glTF binary.
    Glb,
}

impl MeshFolder {
    fn validate(&self) -> Result<(), ConfigError> {
        Ok(())
    }
}
config!(MeshFolder => AssetSource, "mesh_folder", "root = \"/data/meshes\"\nendings = [\"obj\"]");
impl AssetSource for MeshFolder {
    fn class(&self) -> AssetClass {
        AssetClass::Object
    }
    fn catalog(&self, _: &dyn Log) -> Result<Catalog> {
        nothing()
    }
    fn load(&self, _: &str, _: &dyn Log) -> Result<Asset> {
        nothing()
    }
}

/// Materials from folders of textures.
#[derive(Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PbrFolder {
    /// Folder of the materials.
    root: AssetPath,
}
impl PbrFolder {
    fn validate(&self) -> Result<(), ConfigError> {
        Ok(())
    }
}
config!(PbrFolder => AssetSource, "pbr_folder", "root = \"/data/materials\"");
impl AssetSource for PbrFolder {
    fn class(&self) -> AssetClass {
        AssetClass::Material
    }
    fn catalog(&self, _: &dyn Log) -> Result<Catalog> {
        nothing()
    }
    fn load(&self, _: &str, _: &dyn Log) -> Result<Asset> {
        nothing()
    }
}

/// A room around the table.
#[derive(Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Room {
    /// Side of the square floor, meters.
    #[schemars(range(min = 1, max = 100))]
    size_m: f64,
    /// Materials of the surfaces.
    material: Option<RoomMaterials>,
    /// Rotation of the textures, degrees.
    #[schemars(extend("minimum" = 0, "maximum" = 360))]
    texture_rotation_deg: Dist,
}

/// Pools of the materials of a room.
#[derive(Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RoomMaterials {
    /// Of the floor.
    floor: MaterialPools,
    /// Of the walls; as the floor by default.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    walls: Option<MaterialPools>,
}

impl Default for Room {
    fn default() -> Self {
        Self { size_m: 15.0, material: None, texture_rotation_deg: Dist::Constant(0.0) }
    }
}
impl Room {
    fn validate(&self) -> Result<(), ConfigError> {
        self.texture_rotation_deg.within("texture_rotation_deg", 0.0, 360.0)
    }
}
config!(Room => Placer, "room", "size_m = 12.0\ntexture_rotation_deg = { uniform = [0, 360] }");

/// Objects dropped from a box above the table.
#[derive(Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct DropBox {
    /// Pools to draw from.
    from: ObjectPools,
    /// Number of objects.
    #[schemars(extend("minimum" = 0, "maximum" = 1000))]
    count: IntDist,
    /// Height of the box above the tabletop, meters.
    #[schemars(range(min = 0, max = 5))]
    clearance_m: f64,
    /// Distribution of rotations.
    rotation: Rotation,
    /// Where objects are placed.
    area: Area,
}

/// Distribution of rotations.
#[derive(Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Rotation {
    /// Uniform on SO(3).
    #[default]
    UniformSo3,
    /// Roll, pitch and yaw.
    UniformEuler,
}

/// Where objects are placed.
#[derive(Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Area {
    /// Everywhere.
    Tabletop,
    /// This fraction of the tabletop, around its center.
    Fraction(#[schemars(range(min = 0, max = 1))] f64),
    /// In a disc.
    Disc {
        /// Its radius, meters.
        #[schemars(extend("exclusiveMinimum" = 0))]
        radius_m: f64,
    },
}

impl Default for DropBox {
    fn default() -> Self {
        Self {
            from: vec!["objects".into()].into(),
            count: IntDist::Integers(1, 40),
            clearance_m: 0.2,
            rotation: Rotation::default(),
            area: Area::Tabletop,
        }
    }
}
impl DropBox {
    fn validate(&self) -> Result<(), ConfigError> {
        self.count.within("count", 0, 1000)
    }
}
config!(
    DropBox => Placer, "drop_box", "from = [\"objects\"]\ncount = { integers = [1, 40] }",
    &[("height_m", "clearance_m"), ("pools", "from"), ("area.disc.r_m", "area.disc.radius_m")]
);

macro_rules! placer {
    ($($name:ident: $parts:expr),*) => {$(
        impl Placer for $name {
            fn place(&self, _: &mut SceneBuilder, _: &Context) -> Result<()> {
                nothing()
            }
            fn parts(&self) -> Option<Vec<PartUse>> {
                $parts
            }
        }
    )*};
}
placer!(Room: Some(vec![PartUse::Sets(Part::Floor)]), DropBox: None);

/// Rigid-body simulation.
#[derive(Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Rapier {
    /// Simulated time, seconds.
    #[schemars(range(min = 0.1, max = 60))]
    duration_s: f64,
    /// Simulation steps per second.
    #[schemars(range(min = 60, max = 1000))]
    steps_per_second: u32,
}
impl Default for Rapier {
    fn default() -> Self {
        Self { duration_s: 5.0, steps_per_second: 240 }
    }
}
impl Rapier {
    fn validate(&self) -> Result<(), ConfigError> {
        if self.duration_s > 30.0 && self.steps_per_second < 300 {
            let message = "`duration_s` beyond 30 needs `steps_per_second` of at least 300";
            return Err(ConfigError::new("duration_s", message));
        }
        Ok(())
    }
}
config!(Rapier => Settler, "rapier", "duration_s = 5.0");
impl Settler for Rapier {
    fn settle(&self, _: &mut SceneBuilder, _: &Context) -> Result<SettleReport> {
        nothing()
    }
}

/// A pinhole camera.
#[derive(Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Pinhole {
    /// Width and height of the image, px.
    resolution: [u32; 2],
    /// Focal length, millimeters.
    #[schemars(extend("exclusiveMinimum" = 0))]
    focal_length_mm: f64,
    /// Near and far clipping distance, meters.
    clip_m: [f64; 2],
    /// Name of the device.
    device: Option<String>,
    /// Whether the image is developed.
    develop: bool,
}
impl Default for Pinhole {
    fn default() -> Self {
        Self { resolution: [640, 480], focal_length_mm: 1.88, clip_m: [0.1, 10.0], device: None, develop: true }
    }
}
impl Pinhole {
    fn validate(&self) -> Result<(), ConfigError> {
        if self.clip_m[0] >= self.clip_m[1] {
            let [near, far] = self.clip_m;
            return Err(ConfigError::new(
                "clip_m[1]",
                format!("the far distance {far} is not beyond the near one {near}"),
            )
            .help("write the smaller distance first"));
        }
        Ok(())
    }
}
config!(Pinhole => CameraModel, "pinhole", "resolution = [320, 240]");
impl CameraModel for Pinhole {
    fn optics(&self, _: &Scene, _: &Pose, _: &Context) -> Result<Optics> {
        nothing()
    }
}

/// Views on a hemisphere around the table.
#[derive(Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct HemisphereShell {
    /// Distance of the camera, meters.
    #[schemars(extend("minimum" = 0.1, "maximum" = 100))]
    radius_m: Dist,
}
impl Default for HemisphereShell {
    fn default() -> Self {
        Self { radius_m: Dist::Uniform(0.7, 1.4) }
    }
}
impl HemisphereShell {
    fn validate(&self) -> Result<(), ConfigError> {
        self.radius_m.within("radius_m", 0.1, 100.0)
    }
}
config!(HemisphereShell => ViewSampler, "hemisphere_shell", "radius_m = 1.0");

/// Views from listed places.
#[derive(Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Listed {
    /// Places of the camera, meters.
    #[schemars(length(min = 1))]
    eyes_m: Vec<[f64; 3]>,
}
impl Listed {
    fn validate(&self) -> Result<(), ConfigError> {
        Ok(())
    }
}
config!(Listed => ViewSampler, "listed", "eyes_m = [[1, 0, 1], [0, 1, 1]]");

macro_rules! views {
    ($($name:ident => $count:expr),*) => {$(
        impl ViewSampler for $name {
            fn pose(&self, _: &Scene, _: ViewId, _: &Context) -> Result<Pose> {
                nothing()
            }
            fn shell(&self, _: &Scene) -> Result<Shell> {
                Ok(Shell { center: [0.0; 3].into(), radius: [1.0, 1.0] })
            }
            fn count(&self) -> Option<u32> {
                let count: fn(&Self) -> Option<u32> = $count;
                count(self)
            }
        }
    )*};
}
views!(HemisphereShell => |_| None, Listed => |listed| Some(listed.eyes_m.len() as u32));

/// Spheres of light around the table.
#[derive(Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct SphereLights {
    /// Number of lights.
    #[schemars(extend("minimum" = 0, "maximum" = 100))]
    count: IntDist,
    /// Color temperature, kelvin.
    #[schemars(extend("minimum" = 1000, "maximum" = 40_000))]
    temperature_k: Dist,
}
impl Default for SphereLights {
    fn default() -> Self {
        Self { count: IntDist::Integers(0, 2), temperature_k: Dist::Uniform(2000.0, 6500.0) }
    }
}
impl SphereLights {
    fn validate(&self) -> Result<(), ConfigError> {
        self.count.within("count", 0, 100)?;
        self.temperature_k.within("temperature_k", 1000.0, 40_000.0)
    }
}
config!(SphereLights => LightSampler, "sphere_lights", "count = { integers = [0, 2] }");
impl LightSampler for SphereLights {
    fn lights(&self, _: &Scene, _: &Camera, _: &Shell, _: &Context) -> Result<Vec<Light>> {
        nothing()
    }
}

/// Path tracing on the processor.
#[derive(Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct CpuPath {
    /// Paths per pixel.
    #[schemars(range(min = 1, max = 65536))]
    samples_per_pixel: u32,
}
impl Default for CpuPath {
    fn default() -> Self {
        Self { samples_per_pixel: 32 }
    }
}

/// A renderer that only draws outlines.
#[derive(Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Outline {}

macro_rules! renderer {
    ($($name:ident, $kind:literal, $samples:expr => $($key:expr),*;)*) => {$(
        impl $name {
            fn validate(&self) -> Result<(), ConfigError> {
                Ok(())
            }
        }
        config!($name => Renderer, $kind, "");
        impl Renderer for $name {
            fn offers(&self) -> Vec<KeyId> {
                keys![$($key),*]
            }
            fn open(&self, _: usize) -> Result<Box<dyn RenderSession>> {
                nothing()
            }
            fn samples_per_pixel(&self) -> Option<u32> {
                let samples: fn(&Self) -> Option<u32> = $samples;
                samples(self)
            }
            fn cost(&self) -> String {
                String::new()
            }
        }
    )*};
}
renderer! {
    CpuPath, "cpu_path", |it| Some(it.samples_per_pixel) => RADIANCE, DEPTH, INSTANCE;
    Outline, "outline", |_| None => INSTANCE;
}

/// Visible and amodal masks.
#[derive(Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Masks {
    /// Keep objects without visible pixels.
    keep_hidden: bool,
}
/// Hidden fraction of every object.
#[derive(Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Rate {}

macro_rules! annotator {
    ($($name:ident, $kind:literal, [$($read:expr),*] => $($key:expr),*;)*) => {$(
        impl $name {
            fn validate(&self) -> Result<(), ConfigError> {
                Ok(())
            }
        }
        config!($name => ViewAnnotator, $kind, "");
        impl ViewAnnotator for $name {
            fn reads(&self) -> Vec<KeyId> {
                let reads: &[KeyId] = &[$($read.id()),*];
                reads.to_vec()
            }
            fn provides(&self) -> Vec<KeyId> {
                keys![$($key),*]
            }
            fn annotate(&self, _: &ViewContext, _: &mut Products) -> Result<()> {
                nothing()
            }
        }
    )*};
}
annotator! { Masks, "masks", [INSTANCE] => VISIBLE_MASK, AMODAL_MASK; Rate, "rate", [AMODAL_MASK] => OCCLUSION_RATE; }

/// Images as PNG files.
#[derive(Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Png {
    /// Products to write.
    #[schemars(length(min = 1))]
    include: Vec<ProductName>,
    /// Bits per channel.
    #[serde(default)]
    depth: PngDepth,
}
/// Bits of a channel.
#[derive(Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum PngDepth {
    /// 8 bits.
    #[default]
    Eight,
    /// 16 bits.
    Sixteen,
}
/// Arrays as NumPy files.
#[derive(Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Npy {
    /// Products to write.
    include: Vec<ProductName>,
    /// Limits of named quantities.
    limits: std::collections::BTreeMap<String, Limit>,
}
/// A limit.
#[derive(Serialize, Deserialize, JsonSchema)]
#[serde(tag = "type", rename_all = "snake_case", deny_unknown_fields)]
pub enum Limit {
    /// Not above.
    Below {
        /// The bound.
        #[schemars(range(min = 0))]
        bound: f64,
    },
    /// Not outside.
    Between {
        /// The bounds.
        bounds: [f64; 2],
    },
}
impl Default for Npy {
    fn default() -> Self {
        Self { include: vec!["depth".into()], limits: Default::default() }
    }
}

/// A PNG file holds images and masks.
fn stored_as_png(key: &KeyId) -> Result<(), String> {
    match key.form().of_one() {
        Form::Image { .. } | Form::Mask => Ok(()),
        _ => Err("a PNG file holds images and masks; write it with npy".to_owned()),
    }
}

macro_rules! writer {
    ($($name:ident, $kind:literal, $example:literal, $accepts:expr;)*) => {$(
        impl $name {
            fn validate(&self) -> Result<(), ConfigError> {
                Ok(())
            }
        }
        config!($name => Writer, $kind, $example);
        impl Writer for $name {
            fn reads(&self) -> Vec<Input> {
                Input::included(&self.include, $accepts)
            }
            fn scene(&self, _: &ImagesContext, _: Output) -> Result<Box<dyn SceneWriter>> {
                nothing()
            }
        }
    )*};
}
writer! {
    Png, "png", "include = [\"radiance\", \"depth\"]", Accepts::when(stored_as_png);
    Npy, "npy", "include = [\"occlusion_rate\"]\nlimits = { depth = { type = \"below\", bound = 4.0 } }", Accepts::Any;
}

/// Kinds for all slots.
pub fn registry() -> Registry {
    macro_rules! entries {
        ($($name:ident),*) => { [$(Entry::of::<$name>("syntable-kit", "1.2.3")),*] };
    }
    Registry::new(entries![
        MeshFolder,
        PbrFolder,
        Room,
        DropBox,
        Rapier,
        Pinhole,
        HemisphereShell,
        Listed,
        SphereLights,
        CpuPath,
        Outline,
        Masks,
        Rate,
        Png,
        Npy
    ])
    .expect("kinds are unique")
}

/// Loads a recipe with the kit's registry and an environment of one variable, `ASSETS`.
pub fn load(source: Source, set: &[(&str, &str)]) -> Result<(Recipe, Vec<Diagnostic>), Report> {
    let set = set.iter().map(|(path, value)| ((*path).to_owned(), (*value).to_owned())).collect();
    syntable_recipe::load(
        &registry(),
        source,
        &Overrides {
            exists: &|_| true,
            opens_urls: false,
            set,
            variable: &|name| (name == "ASSETS").then(|| "/data/assets".to_owned()),
            read: &|path| std::fs::read_to_string(path),
            current_folder: Path::new(env!("CARGO_MANIFEST_DIR")).to_owned(),
            choose: false,
            wanted: Vec::new(),
        },
    )
}
