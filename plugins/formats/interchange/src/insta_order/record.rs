//! The records of InstaOrder's annotation file.

use syntable_model::prelude::*;

/// Prefix of files of orders.
pub const FILE: &str = "InstaOrder_";

/// The orders of the objects of a view.
#[derive(Debug, Serialize, Deserialize)]
pub struct Orders {
    pub occlusion: Vec<Occlusion>,
    pub depth: Vec<Depth>,
}

#[derive(Debug, Serialize, Deserialize)]
pub struct Occlusion {
    pub order: String,
    pub count: u32,
}

#[derive(Debug, Serialize, Deserialize)]
pub struct Depth {
    pub order: String,
    pub overlap: bool,
    pub count: u32,
}

/// The record of an image in the annotation file.
#[derive(Serialize)]
pub struct ImageOrders {
    pub image_id: u64,
    pub instance_ids: Vec<u64>,
    #[serde(flatten)]
    pub orders: Orders,
}
