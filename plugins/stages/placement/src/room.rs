//! The room: floor, four walls and a ceiling.

use crate::bounds::rotated_bounds;
use crate::floor_support::{FloorSupport, floor_parts};
use crate::material::{TEXTURE_SCALE, any_angle_deg, check_scale, draw_material, real_size};
use std::sync::Arc;
use syntable_model::digest::Hasher;
use syntable_model::geometry::{Aabb, Point3};
use syntable_model::prelude::*;
use syntable_model::scene::{
    AssetRef, BodyDraft, MassOrigin, MassProperties, Material, Mesh, MeshData, Motion, Object, Role, SourceModel,
};

/// Pool of the parts of a room.
pub const POOL: &str = "room";

/// Thickness of floor, walls and ceiling, meters. They extend outwards from the inner size.
const THICKNESS_M: f64 = 0.1;

/// Places a closed room around the origin: a floor at z = 0, four walls and a ceiling.
///
/// Each of the six surfaces draws its own material from its pool; without a pool it is plain gray. `floor_only` leaves
/// out walls and ceiling, for outdoor scenes lit by `environment` and `sun`; the kind `ground` is, in its place, a floor
/// that looks like the environment. `open_top` leaves out the ceiling alone. Cameras and lights are not constrained to the room; with the default size and tables
/// below 2 m they are always inside. A table that reaches through a wall or the ceiling fails the attempt.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Room {
    /// Inner size of the floor along world x, and along y if `length_m` is not set, meters; 1 to 1000.
    #[schemars(extend("minimum" = SIZE_M[0], "maximum" = SIZE_M[1]))]
    size_m: Dist,
    /// Inner size of the floor along world y, meters; 1 to 1000. The floor is square without it.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(extend("minimum" = SIZE_M[0], "maximum" = SIZE_M[1]))]
    length_m: Option<Dist>,
    /// Inner height, meters; 1 to 1000.
    #[schemars(extend("minimum" = SIZE_M[0], "maximum" = SIZE_M[1]))]
    height_m: Dist,
    /// Material pools of the surfaces.
    material: RoomMaterials,
    /// Whether all four walls get the same material and texture mapping. Otherwise each wall draws its own.
    walls_alike: bool,
    /// Whether all surfaces get the material and texture mapping of the walls.
    all_alike: bool,
    /// Whether to leave out walls and ceiling.
    floor_only: bool,
    /// Whether to leave out the ceiling.
    open_top: bool,
    /// Makes an area of the floor a support, for scenes without a table: `{ name = "floor", size_m = [1.5, 1.5] }`.
    #[serde(skip_serializing_if = "Option::is_none")]
    support: Option<FloorSupport>,
    /// Rotation of the textures, degrees, drawn per surface.
    texture_rotation_deg: Dist,
    /// Scale of the textures relative to their real size, 0.001 to 1000, drawn per surface.
    #[schemars(extend("minimum" = TEXTURE_SCALE[0], "maximum" = TEXTURE_SCALE[1]))]
    texture_scale: Dist,
}

/// Material pools of the surfaces of a room. A surface without a pool is plain gray.
#[derive(Debug, Clone, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
struct RoomMaterials {
    /// Pools for the floor.
    #[serde(skip_serializing_if = "Option::is_none")]
    floor: Option<MaterialPools>,
    /// Pools for the walls. Each wall draws its own material unless `walls_alike` is set.
    #[serde(skip_serializing_if = "Option::is_none")]
    walls: Option<MaterialPools>,
    /// Pools for the ceiling.
    #[serde(skip_serializing_if = "Option::is_none")]
    ceiling: Option<MaterialPools>,
}

impl Default for Room {
    fn default() -> Self {
        Self {
            size_m: Dist::Constant(15.0),
            length_m: None,
            height_m: Dist::Constant(15.0),
            material: RoomMaterials::default(),
            walls_alike: false,
            all_alike: false,
            floor_only: false,
            open_top: false,
            support: None,
            texture_rotation_deg: any_angle_deg(),
            texture_scale: real_size(),
        }
    }
}

/// Limits of the inner sizes, meters.
const SIZE_M: [f64; 2] = [1.0, 1000.0];

impl Config for Room {
    type Stage = dyn Placer;
    const KIND: &'static str = "room";
    const EXAMPLE: &'static str = "size_m = { uniform = [6, 15] }\nheight_m = 15\n\
        material = { floor = \"materials\", walls = \"materials\", ceiling = \"materials\" }";

    fn build(self) -> Result<Box<dyn Placer>, ConfigError> {
        self.size_m.within("size_m", SIZE_M[0], SIZE_M[1])?;
        self.length_m.as_ref().map_or(Ok(()), |length| length.within("length_m", SIZE_M[0], SIZE_M[1]))?;
        self.height_m.within("height_m", SIZE_M[0], SIZE_M[1])?;
        check_scale("texture_scale", &self.texture_scale)?;
        let (size, _) = self.size_m.range();
        let length = self.length_m.as_ref().map_or(size, |length| length.range().0);
        self.support.as_ref().map_or(Ok(()), |support| support.check([size, length]))?;
        if self.floor_only && self.open_top {
            let message = "a room with `floor_only` has no ceiling to leave out";
            return Err(ConfigError::new("open_top", message).help("remove `open_top`"));
        }
        let RoomMaterials { floor, ceiling, .. } = &self.material;
        for (key, pools) in [("material.floor", floor), ("material.ceiling", ceiling)] {
            if self.all_alike && pools.is_some() {
                let message =
                    format!("with `all_alike`, all surfaces have the material of the walls, so `{key}` has no effect");
                return Err(ConfigError::new(key, message).help(format!("remove `{key}` or `all_alike`")));
            }
        }
        Ok(Box::new(self))
    }
}
register!(Room);

impl Placer for Room {
    fn parts(&self) -> Option<Vec<PartUse>> {
        let mut parts = floor_parts(self.support.as_ref());
        if !self.floor_only {
            parts.push(PartUse::Sets(Part::Walls));
        }
        Some(parts)
    }

    fn places_objects(&self) -> bool {
        false
    }

    fn place(&self, scene: &mut SceneBuilder, context: &Context) -> Result<()> {
        refuse_second_floor(scene)?;
        self.support.as_ref().map_or(Ok(()), |support| support.add_to(scene))?;
        let size = self.size_m.draw(&mut context.stream.child("size"));
        let length = self.length_m.as_ref().map_or(size, |length| length.draw(&mut context.stream.child("length")));
        let half = [size / 2.0, length / 2.0];
        let height = self.height_m.draw(&mut context.stream.child("height"));
        let count = match (self.floor_only, self.open_top) {
            (true, _) => 1,
            (false, true) => 5,
            (false, false) => 6,
        };
        for part in parts(half, height).into_iter().take(count) {
            let (pools, gray, stream) = match part.name {
                _ if self.all_alike => (&self.material.walls, 0.7, "walls"),
                "floor" => (&self.material.floor, 0.45, part.name),
                "ceiling" => (&self.material.ceiling, 0.8, part.name),
                _ => (&self.material.walls, 0.7, if self.walls_alike { "walls" } else { part.name }),
            };
            let (rotation, scale) = (&self.texture_rotation_deg, &self.texture_scale);
            let surface = pools
                .as_ref()
                .map(|pools| draw_material(pools, rotation, scale, context.assets, &context.stream.child(stream)))
                .transpose()?;
            let center = part.bounds.center().coords;
            let asset = AssetRef { pool: POOL.into(), name: part.name.into() };
            let object = Arc::new(slab(&part, Material::plain(part.name, [gray; 3], 0.9))?);
            let body = BodyDraft::new(
                asset,
                object,
                Pose::translation(center.x, center.y, center.z),
                Role::Room,
                Motion::Fixed,
            );
            scene.add(body.with_material_override(surface));
        }
        refuse_table_through_wall(scene)
    }
}

/// Two floors at one height would show through each other.
pub fn refuse_second_floor(scene: &SceneBuilder) -> Result<()> {
    if scene.bodies().any(|(_, body)| body.role == Role::Room && body.asset.name == "floor") {
        let help = "keep one [[place]] of the kinds `room` and `ground`";
        return Err(Error::new("the scene already has a floor").help(help));
    }
    Ok(())
}

/// Maximum distance that a table may reach into a wall, meters: real tables and rooms of one size touch.
const INTO_WALL_M: f64 = 1e-3;

/// Refuses a table that is larger than its room. Another attempt may draw a smaller one.
pub fn refuse_table_through_wall(scene: &SceneBuilder) -> Result<()> {
    let of = |role| scene.bodies().map(|(_, body)| body).filter(move |body| body.role == role);
    for table in of(Role::Support) {
        let (mesh, pose) = (&table.object.mesh, &table.world_from_body);
        let bounds = rotated_bounds(mesh, &pose.rotation);
        let [low, high] = [bounds.min, bounds.max].map(|corner| corner + pose.translation.vector);
        let depth = |wall: &Aabb, k: usize| high[k].min(wall.max[k]) - low[k].max(wall.min[k]);
        let through = |wall: &Aabb| (0..3).all(|k| depth(wall, k) > INTO_WALL_M);
        // The table stands on the floor; the room of another placer may be a single mesh around it.
        let mut walls = of(Role::Room).filter(|part| part.asset.pool == POOL && part.asset.name != "floor");
        if let Some(wall) = walls.find(|part| through(&part.world_bounds())) {
            let [x, y, z] = [0, 1, 2].map(|k| high[k] - low[k]);
            let table = &table.asset;
            let message = format!(
                "the table {table} of {x:.2} m × {y:.2} m × {z:.2} m reaches through the {} of the room",
                wall.asset.name
            );
            return Err(Error::unlucky(message).help(
                "give the room a larger `size_m` or `height_m`, or the table a `longer_side_m`; if all tables of the pool are too \
                 large, look at the unit of their meshes",
            ));
        }
    }
    Ok(())
}

/// A part of the room and its bounding box, world frame.
pub struct RoomPart {
    pub name: &'static str,
    pub bounds: Aabb,
}

/// The six parts, the floor first, around an inner box of half edges `half`. They touch and do not overlap.
pub fn parts(half: [f64; 2], height: f64) -> [RoomPart; 6] {
    let [x, y] = half;
    let [outer_x, outer_y] = half.map(|half| half + THICKNESS_M);
    let part = |name, low: [f64; 3], high: [f64; 3]| RoomPart {
        name,
        bounds: Aabb { min: Point3::from(low), max: Point3::from(high) },
    };
    [
        part("floor", [-outer_x, -outer_y, -THICKNESS_M], [outer_x, outer_y, 0.0]),
        part("wall_east", [x, -outer_y, 0.0], [outer_x, outer_y, height]),
        part("wall_north", [-x, y, 0.0], [x, outer_y, height]),
        part("wall_west", [-outer_x, -outer_y, 0.0], [-x, outer_y, height]),
        part("wall_south", [-x, -outer_y, 0.0], [x, -y, height]),
        part("ceiling", [-outer_x, -outer_y, height], [outer_x, outer_y, height + THICKNESS_M]),
    ]
}

/// Half length of an edge from which on a sheet is cut, meters.
const LARGE_M: f64 = 20.0;

/// Coordinates at which an edge is cut, including its ends: 1 m from the center, and then at twice the distance each
/// time. The position of a hit is known to within a fraction of the triangle's size. Near the table, this error must be
/// smaller than the offset of rays from a surface; otherwise, rays hit their own surface and light is lost.
fn cuts(half: f64) -> Vec<f64> {
    let doubled = std::iter::successors(Some(1.0), |at| Some(at * 2.0)).take_while(|at| *at < 0.75 * half);
    let outwards: Vec<f64> = doubled.filter(|_| half > LARGE_M).chain([half]).collect();
    outwards.iter().rev().map(|at| -at).chain(outwards.iter().copied()).collect()
}

/// A box centered at the origin with texture coordinates in meters.
pub fn slab(part: &RoomPart, material: Material) -> Result<Object> {
    let half = part.bounds.size() / 2.0;
    let mut data = MeshData::default();
    for axis in 0..3 {
        for sign in [-1.0, 1.0] {
            let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
            let (columns, rows) = (cuts(half[u]), cuts(half[v]));
            for (row, column) in (1..rows.len()).flat_map(|row| (1..columns.len()).map(move |column| (row, column))) {
                let ([left, right], [low, high]) = ([columns[column - 1], columns[column]], [rows[row - 1], rows[row]]);
                let first = data.positions.len() as u32;
                for (at_u, at_v) in [(left, low), (right, low), (right, high), (left, high)] {
                    let mut p = [0.0; 3];
                    (p[axis], p[u], p[v]) = (sign * half[axis], at_u, at_v);
                    let mut normal = [0.0; 3];
                    normal[axis] = sign as f32;
                    data.positions.push(p.map(|x| x as f32));
                    data.normals.push(normal);
                    data.uvs.push([p[u] as f32, p[v] as f32]);
                }
                // u × v points along the positive axis.
                let corners = if sign > 0.0 { [0, 1, 2, 3] } else { [0, 3, 2, 1] }.map(|i| first + i);
                data.triangles.push([corners[0], corners[1], corners[2]]);
                data.triangles.push([corners[0], corners[2], corners[3]]);
            }
        }
    }
    let mesh = Mesh::new(data)?;
    let corners = mesh.bounds().corners().map(|p| [p.x as f32, p.y as f32, p.z as f32]);
    let digest = Hasher::new("room part")
        .floats([half.x as f32, half.y as f32, half.z as f32].into_iter())
        .digest(material.digest)
        .finish();
    let mass = MassProperties::of_mesh(&mesh, 2000.0 * mesh.signed_volume(), MassOrigin::Estimated);
    Ok(Object {
        name: part.name.to_owned(),
        category: "room".to_owned(),
        mesh: Arc::new(mesh),
        materials: vec![Arc::new(material)],
        collision: Some(Arc::new(vec![corners.to_vec()])),
        keypoints: Vec::new(),
        support_areas: Vec::new(),
        restitution: None,
        model: SourceModel::default(),
        mass,
        friction: 0.6,
        license: String::new(),
        digest,
    })
}
