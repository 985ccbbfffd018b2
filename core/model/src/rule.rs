//! Ids of the rules that datasets break, where several places report a rule: checks of products, readers of formats, and
//! conversions. A rule that one place reports has its id there.

/// Areas in a file are the areas of its masks.
pub const AREAS_MATCH_MASKS: &str = "areas_match_masks";
/// Boxes in a file are the boxes of its masks.
pub const BOX_MATCHES_MASK: &str = "box_matches_mask";
/// The size of the image in the camera is the size of the image.
pub const CAMERA_HAS_IMAGE_SIZE: &str = "camera_has_image_size";
/// The camera has positive focal lengths and a finite principal point.
pub const CAMERA_IS_VALID: &str = "camera_is_valid";
/// Pixel counts of an object are the counts of its masks.
pub const COUNTS_MATCH_MASKS: &str = "counts_match_masks";
/// Each file that a dataset names, or that its layout needs, exists.
pub const FILES_EXIST: &str = "files_exist";
/// Objects have categories that the dataset lists.
pub const KNOWN_CATEGORIES: &str = "known_categories";
/// Records and files belong to images of the dataset.
pub const KNOWN_IMAGES: &str = "known_images";
/// Each object has a pixel in some mask. Readers that know an object's name in the file report each object without pixels
/// under this rule, and a conversion that drops the object repeats the report.
pub const OBJECTS_HAVE_PIXELS: &str = "objects_have_pixels";
/// Occlusion masks are amodal masks without the visible ones.
pub const OCCLUSION_IS_AMODAL_MINUS_VISIBLE: &str = "occlusion_is_amodal_minus_visible";
/// The occlusion order in a file is the one that its masks imply.
pub const ORDER_MATCHES_MASKS: &str = "order_matches_masks";
/// Occlusion rates are ratios of the masks' areas.
pub const RATE_IS_RATIO_OF_AREAS: &str = "rate_is_ratio_of_areas";
/// Files and records can be read.
pub const READABLE: &str = "readable";
/// Two records of the same subject do not contradict each other.
pub const RECORDS_AGREE: &str = "records_agree";
/// No two records of a kind have one id.
pub const UNIQUE_IDS: &str = "unique_ids";
/// No two records of a kind have one name.
pub const UNIQUE_NAMES: &str = "unique_names";
/// No two images are one view.
pub const UNIQUE_VIEWS: &str = "unique_views";
/// No pixel is in the visible masks of two objects.
pub const VISIBLE_MASKS_DISJOINT: &str = "visible_masks_disjoint";
