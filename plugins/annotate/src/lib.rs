//! Annotators: masks, occlusion, order, boxes, poses, developed pictures.
