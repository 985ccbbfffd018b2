//! What a run may do with the folder that it finds: continue a dataset, let it grow, or leave it alone; and the work that follows.

pub(crate) mod growth;
pub(crate) mod inputs;
pub(crate) mod opening;
pub(crate) mod work_list;
