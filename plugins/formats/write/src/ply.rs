//! Point clouds.

use syntable_formats::encode::view_name;
use syntable_formats::writer::ImageWriter;
use syntable_model::geometry::Point3;
use syntable_model::prelude::*;
use syntable_model::product::standard::{CAMERA, DEPTH, INSTANCE, RGB};
use syntable_model::product::{StatedCamera, Tensor};

/// Writes the point cloud of each view as a PLY file.
///
/// # Behavior
///
/// Each pixel with a depth is a point, row by row from the top left. Lens distortion is taken into account. Points have
/// the properties `x`, `y`, `z` (float, meters), with `colors` also `red`, `green`, `blue` (uchar), and with
/// `instances` also `instance` (ushort): the id of the body, as in the product `instance`. Files are binary,
/// little-endian.
///
/// # Output
///
/// `{id}/{scene:06}_{view:04}.ply`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Ply {
    /// Depth in meters along the optical axis: `depth`, or `depth_sensed` for the measurements of a depth camera.
    pub depth: ProductName,
    /// Frame of the points.
    pub frame: PointFrame,
    /// Whether points have the color of their pixel in `rgb`.
    pub colors: bool,
    /// Whether points have the id of their body.
    pub instances: bool,
}

/// A coordinate frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum PointFrame {
    /// x right, y down, z forward.
    Camera,
    /// The frame of the scene, z up: the clouds of its views fit together.
    World,
}

impl Default for Ply {
    fn default() -> Self {
        Self { depth: "depth".into(), frame: PointFrame::World, colors: true, instances: true }
    }
}

impl Config for Ply {
    type Stage = dyn Writer;
    const KIND: &'static str = "ply";
    const EXAMPLE: &'static str = "depth = \"depth\"\nframe = \"camera\"";
    fn build(self) -> Result<Box<dyn Writer>, ConfigError> {
        Ok(self.boxed())
    }
}

impl ImageWriter for Ply {
    type Scene = ();

    fn reads(&self) -> Vec<Input> {
        let depth = Input {
            accepts: Accepts::Type(DEPTH.id()),
            option: Some("depth".into()),
            ..Input::named(self.depth.as_str())
        };
        let others = [(true, Input::of(CAMERA)), (self.colors, Input::of(RGB)), (self.instances, Input::of(INSTANCE))];
        let others = others.into_iter().filter_map(|(wanted, input)| wanted.then_some(input));
        std::iter::once(depth).chain(others).collect()
    }

    fn view(&self, _: &mut (), cx: &ImageContext, products: &Products, output: &Output) -> Result<()> {
        let path = path(output.id(), &view_name(cx.scene_id, cx.view_id));
        output.write(&path, &self.encode(&StatedCamera::of(products.get(CAMERA)?)?, products)?)
    }

    fn paths(&self, of: &FileOf) -> Vec<String> {
        match (of.scene, of.view) {
            (Some(scene), Some(view)) => vec![path(of.id, &view_name(scene, view))],
            _ => Vec::new(),
        }
    }
}

fn path(id: &str, name: &str) -> String {
    format!("{id}/{name}.ply")
}

impl Ply {
    /// The bytes of the file of a view.
    fn encode(&self, camera: &StatedCamera, products: &Products) -> Result<Vec<u8>> {
        let Value::Tensor(Tensor { shape, bytes, .. }) = products.value(self.depth.as_str())? else {
            return Err(Error::new(format!("`{}` is not an image", self.depth.as_str())));
        };
        let colors = if self.colors { Some(products.get(RGB)?) } else { None };
        let instances = if self.instances { Some(products.get(INSTANCE)?) } else { None };
        let help = "write points in the camera's frame: `frame = \"camera\"`";
        let world_from_camera = match self.frame {
            PointFrame::Camera => None,
            PointFrame::World => Some(camera.world_from_camera().map_err(|error| error.help(help))?),
        };
        let (mut points, mut count) = (Vec::new(), 0_usize);
        for (pixel, depth) in bytes.as_chunks().0.iter().map(|&b| f32::from_le_bytes(b)).enumerate() {
            let [x, y] = [pixel % shape[1], pixel / shape[1]];
            let seen = depth.is_finite() && depth > 0.0;
            let ray = if seen { camera.unproject(x as f64 + 0.5, y as f64 + 0.5) } else { None };
            let Some(ray) = ray else { continue };
            let in_camera = Point3::from(ray * f64::from(depth));
            let point = world_from_camera.map_or(in_camera, |pose| pose * in_camera);
            points.extend(point.iter().flat_map(|&v| (v as f32).to_le_bytes()));
            points.extend(colors.iter().flat_map(|rgb| rgb.data()[pixel]));
            points.extend(instances.iter().flat_map(|ids| ids.data()[pixel].0.to_le_bytes()));
            count += 1;
        }
        Ok([self.header(count).into_bytes(), points].concat())
    }

    fn header(&self, points: usize) -> String {
        let frame = match self.frame {
            PointFrame::Camera => "camera frame in meters: x right, y down, z forward",
            PointFrame::World => "world frame in meters: z up",
        };
        let properties = [
            (true, "property float x\nproperty float y\nproperty float z\n"),
            (self.colors, "property uchar red\nproperty uchar green\nproperty uchar blue\n"),
            (self.instances, "property ushort instance\n"),
        ];
        let properties: String = properties.iter().filter(|(wanted, _)| *wanted).map(|(_, lines)| *lines).collect();
        format!(
            "ply\nformat binary_little_endian 1.0\ncomment {frame}\nelement vertex {points}\n{properties}end_header\n"
        )
    }
}

register!(Ply);
