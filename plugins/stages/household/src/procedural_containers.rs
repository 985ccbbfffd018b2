//! `procedural_containers`: bins, totes, crates and trays that carry objects.

use crate::family::HouseholdModel;
use crate::household::carrier;
use crate::joinery::{FRAME, Joinery, TEXELS, TOP};
use crate::material::{LICENSE, MaterialCache, MaterialFamily, SurfaceFinish, hsv};
use crate::shape::{SlotMapping, Tub, rounded_box};
use crate::variants::{check_families, parse_name, variant_catalog};
use syntable_model::prelude::*;
use syntable_model::scene::{Asset, AssetClass, Catalog, Region, SupportArea, Walls};

/// A family of containers.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum ContainerFamily {
    /// A plastic box for parts, as in picking cells.
    Bin,
    /// A box of wooden slats.
    Crate,
    /// A stackable plastic box of 0.6 by 0.4 m, with ribs and handles.
    Tote,
    /// A low tray of plastic, metal or wood.
    Tray,
}

impl ContainerFamily {
    const ALL: [Self; 4] = [Self::Bin, Self::Crate, Self::Tote, Self::Tray];

    fn name(self) -> &'static str {
        match self {
            Self::Bin => "bin",
            Self::Crate => "crate",
            Self::Tote => "tote",
            Self::Tray => "tray",
        }
    }

    /// The ranges of the dimensions that the options do not set.
    fn ranges(self) -> Ranges {
        let range = Dist::Uniform;
        let plastic = Ranges {
            length_m: range(0.3, 0.5),
            width_m: range(0.22, 0.38),
            height_m: range(0.1, 0.2),
            wall_m: range(0.003, 0.005),
            draft_deg: range(2.0, 6.0),
            rim_m: range(0.008, 0.02),
            ribs: IntDist::Integers(0, 3),
        };
        match self {
            Self::Bin => plastic,
            Self::Tote => Ranges {
                length_m: range(0.52, 0.56),
                width_m: range(0.33, 0.36),
                height_m: range(0.12, 0.3),
                draft_deg: range(1.0, 3.0),
                rim_m: range(0.015, 0.02),
                ribs: IntDist::Integers(3, 6),
                ..plastic
            },
            Self::Crate => Ranges {
                length_m: range(0.35, 0.55),
                width_m: range(0.26, 0.38),
                height_m: range(0.14, 0.26),
                wall_m: range(0.008, 0.012),
                draft_deg: Dist::Constant(0.0),
                rim_m: Dist::Constant(0.0),
                ribs: IntDist::Constant(0),
            },
            Self::Tray => Ranges {
                length_m: range(0.3, 0.5),
                width_m: range(0.22, 0.36),
                height_m: range(0.018, 0.045),
                wall_m: range(0.002, 0.004),
                draft_deg: range(10.0, 40.0),
                rim_m: range(0.004, 0.015),
                ribs: IntDist::Constant(0),
            },
        }
    }
}

/// Distributions of the dimensions of a container.
struct Ranges {
    length_m: Dist,
    width_m: Dist,
    height_m: Dist,
    wall_m: Dist,
    draft_deg: Dist,
    rim_m: Dist,
    ribs: IntDist,
}

/// Procedural containers: bins, totes, crates and trays of random sizes and colors, with exact collision parts. They carry objects
/// inside: the kind `support` of `[[place]]` makes supports of them. No download is needed.
///
/// Names are `<family>_<variant>`, such as `tote_0002`. Each dimension is drawn per variant, from the option if it is set, or else from
/// a range of its family.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ProceduralContainers {
    /// Families to include; all by default.
    #[schemars(length(min = 1))]
    families: Vec<ContainerFamily>,
    /// Number of variants of each family.
    #[schemars(range(min = 1, max = 10000))]
    variants_per_family: u32,
    /// Length of the inner floor, along x, meters, 0.05 to 3.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(extend("minimum" = EDGE_M[0], "maximum" = EDGE_M[1]))]
    length_m: Option<Dist>,
    /// Width of the inner floor, along y, meters, 0.05 to 3.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(extend("minimum" = EDGE_M[0], "maximum" = EDGE_M[1]))]
    width_m: Option<Dist>,
    /// Height of the rim above the inner floor, meters, 0.01 to 2.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(extend("minimum" = HEIGHT_M[0], "maximum" = HEIGHT_M[1]))]
    height_m: Option<Dist>,
    /// Thickness of walls and floor, meters, 0.001 to 0.05.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(extend("minimum" = WALL_M[0], "maximum" = WALL_M[1]))]
    wall_m: Option<Dist>,
    /// Angle by which the walls lean outwards, degrees, 0 to 45. Crates have upright walls.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(extend("minimum" = DRAFT_DEG[0], "maximum" = DRAFT_DEG[1]))]
    draft_deg: Option<Dist>,
    /// Width of the flange around the rim, meters, 0 to 0.2. Crates have none.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(extend("minimum" = RIM_M[0], "maximum" = RIM_M[1]))]
    rim_m: Option<Dist>,
    /// Number of ribs on the outside of each wall, 0 to 50. Crates have none.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(extend("minimum" = RIBS[0], "maximum" = RIBS[1]))]
    ribs: Option<IntDist>,
    /// Seed of all variants.
    #[schemars(range(max = 9_223_372_036_854_775_807_u64))]
    seed: u64,
}

const EDGE_M: [f64; 2] = [0.05, 3.0];
const HEIGHT_M: [f64; 2] = [0.01, 2.0];
const WALL_M: [f64; 2] = [0.001, 0.05];
const DRAFT_DEG: [f64; 2] = [0.0, 45.0];
const RIM_M: [f64; 2] = [0.0, 0.2];
const RIBS: [i64; 2] = [0, 50];

impl Default for ProceduralContainers {
    fn default() -> Self {
        Self {
            families: ContainerFamily::ALL.to_vec(),
            variants_per_family: 8,
            length_m: None,
            width_m: None,
            height_m: None,
            wall_m: None,
            draft_deg: None,
            rim_m: None,
            ribs: None,
            seed: 0,
        }
    }
}

impl Config for ProceduralContainers {
    type Stage = dyn AssetSource;
    const KIND: &'static str = "procedural_containers";
    const EXAMPLE: &'static str = "families = [\"bin\"]                          # all by default\n\
                                   length_m = { uniform = [0.35, 0.45] }\nwidth_m = 0.3\nheight_m = 0.15";

    fn build(mut self) -> Result<Box<dyn AssetSource>, ConfigError> {
        check_families("families", &mut self.families, ContainerFamily::name)?;
        for (key, dist, [low, high]) in [
            ("length_m", &self.length_m, EDGE_M),
            ("width_m", &self.width_m, EDGE_M),
            ("height_m", &self.height_m, HEIGHT_M),
            ("wall_m", &self.wall_m, WALL_M),
            ("draft_deg", &self.draft_deg, DRAFT_DEG),
            ("rim_m", &self.rim_m, RIM_M),
        ] {
            dist.as_ref().map_or(Ok(()), |dist| dist.within(key, low, high))?;
        }
        self.ribs.as_ref().map_or(Ok(()), |ribs| ribs.within("ribs", RIBS[0], RIBS[1]))?;
        let materials = MaterialCache::new(Stream::root(self.seed).child("container surfaces"), TEXELS);
        Ok(Box::new(ContainerSource { config: self, materials }))
    }
}
register!(ProceduralContainers);

struct ContainerSource {
    config: ProceduralContainers,
    materials: MaterialCache,
}

impl AssetSource for ContainerSource {
    fn class(&self) -> AssetClass {
        AssetClass::Object
    }

    fn license(&self) -> Option<&str> {
        Some(LICENSE)
    }

    fn catalog(&self, _: &dyn Log) -> Result<Catalog> {
        let families = self.config.families.iter().map(|family| family.name());
        Ok(variant_catalog(families, self.config.variants_per_family))
    }

    fn load(&self, name: &str, _: &dyn Log) -> Result<Asset> {
        let (family, variant) =
            parse_name(name, &self.config.families, |family| family.name(), self.config.variants_per_family)?;
        let stream = Stream::root(self.config.seed).child("containers").child(family.name()).at(u64::from(variant));
        let dimensions = self.config.dimensions(family, &stream);
        let (model, area) = match family {
            ContainerFamily::Crate => dimensions.slatted(&stream, &self.materials),
            _ => dimensions.molded(family, &stream, &self.materials),
        };
        carrier(name, family.name(), model, vec![area]).map(Asset::from)
    }
}

/// The dimensions of a container, meters.
struct Dimensions {
    floor: [f64; 2],
    height: f64,
    wall: f64,
    draft: f64,
    rim: f64,
    ribs: i64,
}

impl ProceduralContainers {
    fn dimensions(&self, family: ContainerFamily, stream: &Stream) -> Dimensions {
        let ranges = family.ranges();
        let draw = |option: &Option<Dist>, range: &Dist, name: &str| {
            option.as_ref().unwrap_or(range).draw(&mut stream.child("form").child(name))
        };
        let height = draw(&self.height_m, &ranges.height_m, "height");
        let angle = draw(&self.draft_deg, &ranges.draft_deg, "draft").to_radians();
        let ribs = self.ribs.as_ref().unwrap_or(&ranges.ribs);
        Dimensions {
            floor: [draw(&self.length_m, &ranges.length_m, "length"), draw(&self.width_m, &ranges.width_m, "width")],
            height,
            wall: draw(&self.wall_m, &ranges.wall_m, "wall"),
            draft: height * libm::tan(angle),
            rim: draw(&self.rim_m, &ranges.rim_m, "rim"),
            ribs: ribs.draw(&mut stream.child("form").child("ribs")),
        }
    }
}

impl Dimensions {
    /// A container of one piece, and the area inside.
    fn molded(
        &self,
        family: ContainerFamily,
        stream: &Stream,
        materials: &MaterialCache,
    ) -> (HouseholdModel, SupportArea) {
        use MaterialFamily::{BrushedMetal, Lacquer, Metal, Plastic, Timber};
        let families: &[MaterialFamily] = match family {
            ContainerFamily::Tray => &[Plastic, Plastic, BrushedMetal, Metal, Timber, Lacquer],
            _ => &[Plastic],
        };
        let mut joinery = Joinery::new(stream, materials, families, &[Plastic], 1.0);
        if family != ContainerFamily::Tray {
            joinery.set_material(TOP, plastic(&stream.child("color")).named("plastic"));
        }
        let Self { floor, height, wall, draft, rim, ribs } = *self;
        let corner = joinery.uniform(0.008, 0.035);
        let rim_height = (0.6 * rim).min(0.25 * height).max(wall).min(0.9 * height);
        let tub = Tub { floor, depth: height, wall, draft, corner, rim, rim_height };
        joinery.join(TOP, tub.solid());
        // Ribs on the outside, from near the bottom to the flange.
        let (low, high) = (0.12 * height, wall + height - 0.5 * rim_height);
        let depth = (0.55 * rim).max(wall);
        let (a, b) = (floor[0] / 2.0 + wall, floor[1] / 2.0 + wall);
        for side in 0..4 {
            let along = if side % 2 == 0 { floor[0] } else { floor[1] };
            for number in 0..ribs {
                let at = along * ((number as f64 + 0.5) / ribs as f64 - 0.5);
                let rib = rounded_box([wall.max(0.004), depth + wall, high - low], 0.001, 1, |_| SlotMapping::fit(TOP));
                let out = if side % 2 == 0 { b } else { a };
                // The rib leans with the wall: it is sheared outwards, and turned to its side.
                let rib = rib.translated(at, out + 0.5 * depth - 0.5 * wall, 0.5 * (low + high)).bent(|mut p| {
                    p.y += draft * ((p.z - wall) / height).max(0.0);
                    p
                });
                joinery.join(TOP, rib.rotated(2, 90.0 * f64::from(side)));
            }
        }
        if family == ContainerFamily::Tote && height > 0.05 {
            // Handles under the flange of the short sides.
            let handle = [0.012, 0.12_f64.min(0.6 * floor[1]), 0.02];
            for side in [-1.0, 1.0] {
                let bar = rounded_box(handle, 0.003, 1, |_| SlotMapping::fit(TOP));
                let out = a + draft + 0.5 * rim;
                joinery.join(TOP, bar.translated(side * out, 0.0, wall + height - rim_height - 0.009));
            }
        }
        let walls = Walls { height_m: height, draft_m: draft };
        (joinery.finish(0.4), area(floor, wall, walls))
    }

    /// A crate of slats with gaps between them, and the area inside.
    fn slatted(&self, stream: &Stream, materials: &MaterialCache) -> (HouseholdModel, SupportArea) {
        let timber = [MaterialFamily::Timber];
        let mut joinery = Joinery::new(stream, materials, &timber, &timber, 0.8).with_top_round(0.0015);
        let Self { floor: [length, width], height, wall, .. } = *self;
        let (a, b) = (length / 2.0, width / 2.0);
        // Floor slats along x, wall slats around, and a post in each corner.
        let count = joinery.form.integer(4, 6);
        let pitch = width / count as f64;
        let gap = joinery.uniform(0.08, 0.25) * pitch;
        for number in 0..count {
            let y = -b + pitch * number as f64 + 0.5 * gap;
            joinery.board(TOP, [-a - wall, y, 0.0], [a + wall, y + pitch - gap, wall]);
        }
        let rows = joinery.form.integer(2, 4);
        let pitch = height / rows as f64;
        let gap = joinery.uniform(0.12, 0.35) * pitch;
        for row in 0..rows {
            let z = wall + pitch * row as f64 + gap;
            for side in [-1.0, 1.0] {
                let [near, far] = [b, b + wall].map(|y| side * y);
                joinery.board(TOP, [-a - wall, near.min(far), z], [a + wall, near.max(far), z + pitch - gap]);
                let [near, far] = [a, a + wall].map(|x| side * x);
                joinery.board(TOP, [near.min(far), -b, z], [near.max(far), b, z + pitch - gap]);
            }
        }
        let post = joinery.uniform(0.018, 0.028);
        for (x, y) in [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)] {
            let [x0, x1] = [a + wall, a + wall - post].map(|at| x * at);
            let [y0, y1] = [b + wall, b + wall + post].map(|at| y * at);
            joinery.board(FRAME, [x0.min(x1), y0.min(y1), 0.0], [x0.max(x1), y0.max(y1), wall + height]);
        }
        let walls = Walls { height_m: height, draft_m: 0.0 };
        (joinery.finish(0.5), area([length, width], wall, walls))
    }
}

fn area(floor: [f64; 2], height: f64, walls: Walls) -> SupportArea {
    SupportArea { surface: Region::rectangle([0.0, 0.0, height], floor), clear_height_m: None, walls: Some(walls) }
}

/// Polypropylene in the colors of boxes on the market.
fn plastic(stream: &Stream) -> SurfaceFinish {
    let mut stream = stream.clone();
    let hue = stream.pick(&[0.0, 0.09, 0.14, 0.36, 0.58, 0.6, 0.62]).copied().unwrap_or(0.6);
    let color = if stream.chance(0.4) {
        hsv(0.0, 0.0, stream.uniform(0.08, 0.75))
    } else {
        hsv(hue, stream.uniform(0.55, 0.9), stream.uniform(0.35, 0.85))
    };
    SurfaceFinish::plain(color, stream.uniform(0.3, 0.55), 0.0)
}
