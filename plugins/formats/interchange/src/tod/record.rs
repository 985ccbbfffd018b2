//! Names of TOD's files, and the description of a scene.

use super::TodSplit;
use std::collections::BTreeMap;
use syntable_model::prelude::*;

/// The description of a scene.
pub const DESCRIPTION: &str = "scene_description.txt";
/// Number of views of each scene that the loaders expect.
pub const VIEWS: u32 = 7;
/// Number of its first views, which show no objects in TOD.
pub const WITHOUT_OBJECTS: u32 = 2;
/// Label of the table.
pub const TABLE: u16 = 1;
/// Start of the name of a scene's folder.
pub const SCENE: &str = "scene_";
/// Starts of file names: color, depth, labels.
pub const IMAGES: [&str; 3] = ["rgb_", "depth_", "segmentation_"];
/// Extensions that TOD has for them.
pub const ENDS: [&str; 3] = ["jpeg", "png", "png"];

/// Keys of views: the room alone, with the table, and with objects. Version 6 calls the table `tabletop`.
pub const ROOM: &str = "background";
pub const WITH_TABLE: &str = "background+table";
pub const WITH_OBJECTS: &str = "background+table+objects";
/// A key that only version 6 has, whose support has several labels.
pub const WITH_TABLETOP: &str = "background+tabletop";
/// Last label of the support in version 6.
pub const LAST_OF_TABLETOP: u16 = 3;

impl TodSplit {
    /// The folder of its scenes.
    pub const fn folder(self) -> &'static str {
        match self {
            Self::Train => "training_set",
            Self::Test => "test_set",
        }
    }
}

/// `scene_description.txt`. `O` and `V` are the types of its objects and views.
#[derive(Debug, Serialize, Deserialize)]
pub struct SceneDescription<O, V> {
    /// The first one has the first label after the table's.
    #[serde(default = "Vec::new")]
    pub object_descriptions: Vec<O>,
    #[serde(default = "BTreeMap::new")]
    pub views: BTreeMap<String, V>,
}

/// An object as this program writes it.
#[derive(Debug, Clone, Default, Serialize)]
pub struct ObjectDescription {
    #[serde(skip_serializing_if = "Option::is_none")]
    pub mesh_filename: Option<String>,
    /// In the world, m.
    #[serde(rename = "axis_aligned_bbox3D_center", skip_serializing_if = "Option::is_none")]
    pub center_m: Option<[f64; 3]>,
}

/// A camera, by the arguments of OpenGL's look-at matrix.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct TodCamera {
    pub camera_pos: [f64; 3],
    pub lookat_pos: [f64; 3],
    pub camera_up_vector: [f64; 3],
}

impl TodCamera {
    /// The camera with this pose, whose axes are x right, y down, z forward.
    pub fn of(world_from_camera: &[[f64; 4]; 4]) -> Self {
        let column = |axis: usize| std::array::from_fn(|row: usize| world_from_camera[row][axis]);
        let (down, forward, position): ([f64; 3], [f64; 3], [f64; 3]) = (column(1), column(2), column(3));
        Self {
            camera_pos: position,
            lookat_pos: std::array::from_fn(|axis| position[axis] + forward[axis]),
            camera_up_vector: down.map(|it| 0.0 - it),
        }
    }
}
