//! Ids of the rules that several formats, or a format and the checks of runs, have in common.

/// Areas in a file are those of its masks.
pub const AREAS_ARE_THOSE_OF_MASKS: &str = "areas_are_those_of_masks";
/// Boxes in a file are those of its masks.
pub const BBOX_IS_THAT_OF_A_MASK: &str = "bbox_is_that_of_a_mask";
/// Each file that a dataset names, or that its layout needs, exists.
pub const FILES_ARE_THERE: &str = "files_are_there";
/// Objects have categories that the dataset lists.
pub const KNOWN_CATEGORIES: &str = "known_categories";
/// Records and files belong to images of the dataset.
pub const KNOWN_IMAGES: &str = "known_images";
/// Occlusion masks are amodal masks without the visible ones.
pub const OCCLUSION_IS_AMODAL_MINUS_VISIBLE: &str = "occlusion_is_amodal_minus_visible";
/// The occlusion order in a file is the one that its masks imply.
pub const ORDER_IS_THAT_OF_MASKS: &str = "order_is_that_of_masks";
/// Occlusion rates are ratios of the masks' areas.
pub const RATE_IS_RATIO_OF_AREAS: &str = "rate_is_ratio_of_areas";
/// Two records of one thing do not contradict each other.
pub const RECORDS_AGREE: &str = "records_agree";
/// No two records of a kind have one id.
pub const UNIQUE_IDS: &str = "unique_ids";
/// No two records of a kind have one name.
pub const UNIQUE_NAMES: &str = "unique_names";
/// No two images are one view.
pub const UNIQUE_VIEWS: &str = "unique_views";

pub use syntable_model::reader::{OBJECTS_HAVE_PIXELS, READABLE};
