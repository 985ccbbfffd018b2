//! Decides what a run may do with an existing folder: continue its dataset, grow it, or leave it unchanged; and lists
//! the resulting work.

pub(crate) mod growth;
pub(crate) mod inputs;
pub(crate) mod opening;
pub(crate) mod work_list;
