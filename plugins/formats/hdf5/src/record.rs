//! Names in files of BlenderProc's layout, and the record of a body.

use crate::hdf5::BlenderProcDataset;
use syntable_formats::json::or_default;
use syntable_model::prelude::*;
use syntable_model::reader::unnamed_category;

/// Extension of the files.
pub const EXTENSION: &str = "hdf5";
/// Suffix of the names of arrays of ids.
pub const IDS_END: &str = "_ids";
/// Role of objects among the bodies.
pub const OBJECT_ROLE: &str = "object";

impl BlenderProcDataset {
    /// All datasets, in the default order.
    pub const ALL: [Self; 7] = [
        Self::Colors,
        Self::Depth,
        Self::Distance,
        Self::Normals,
        Self::InstanceSegmaps,
        Self::CategoryIdSegmaps,
        Self::InstanceAttributeMaps,
    ];

    /// Its name in files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Colors => "colors",
            Self::Depth => "depth",
            Self::Distance => "distance",
            Self::Normals => "normals",
            Self::InstanceSegmaps => "instance_segmaps",
            Self::CategoryIdSegmaps => "category_id_segmaps",
            Self::InstanceAttributeMaps => "instance_attribute_maps",
        }
    }
}

/// An entry of `instance_attribute_maps`. Other programs omit some of the fields.
#[derive(Serialize, Deserialize)]
pub struct BodyAttributes {
    pub idx: u16,
    /// 0 for no category.
    #[serde(default, deserialize_with = "or_default")]
    pub category_id: u32,
    #[serde(default)]
    pub name: String,
    pub category: Option<String>,
    pub role: Option<String>,
}

impl BodyAttributes {
    pub fn is_object(&self) -> bool {
        self.idx > 0
            && match &self.role {
                Some(role) => role == OBJECT_ROLE,
                None => self.category_id > 0,
            }
    }

    /// Name of the category. Objects without a class have their own category.
    pub fn category_name(&self) -> String {
        let (object, object_name) = DatasetInfo::OBJECT;
        match &self.category {
            _ if self.category_id == object && self.role.is_some() => object_name.to_owned(),
            Some(name) if !name.is_empty() => name.clone(),
            _ if self.category_id == object => object_name.to_owned(),
            _ => unnamed_category(self.category_id.into()),
        }
    }

    pub fn id(&self) -> InstanceId {
        InstanceId(self.idx)
    }
}
