//! Suggestions for misspelled names.

pub(crate) use syntable_toml_schema::listing;

/// Words of users who know another tool or another dataset, each with its possible meanings, the likeliest first.
const SYNONYMS: &[(&str, &[&str])] = &[
    // Of the dataset.
    ("num_scenes", &["scenes"]),
    ("n_scenes", &["scenes"]),
    ("num_views", &["views_per_scene"]),
    ("views", &["views_per_scene"]),
    ("cameras", &["views_per_scene"]),
    ("images", &["views_per_scene"]),
    ("random_seed", &["seed"]),
    ("retries", &["max_attempts"]),
    // Of pools.
    ("path", &["root", "library", "file"]),
    ("dir", &["root", "folder"]),
    ("directory", &["root", "folder"]),
    ("folder", &["root"]),
    ("pool", &["from"]),
    ("assets", &["from"]),
    ("objects", &["from"]),
    ("materials", &["material", "from"]),
    // Of quantities.
    ("uniform", &["integers"]),
    ("integers", &["uniform"]),
    ("range", &["uniform", "integers"]),
    ("num_objects", &["count"]),
    ("number", &["count"]),
    ("num", &["count"]),
    ("n", &["count"]),
    ("width", &["resolution", "size_m", "width_m", "width_px"]),
    ("height", &["resolution", "height_m", "height_px"]),
    ("image_size", &["resolution"]),
    ("size", &["resolution", "size_m"]),
    ("radius_m", &["radius", "distance_m", "distance"]),
    ("distance", &["radius", "distance_m"]),
    ("distance_m", &["radius"]),
    ("fov", &["intrinsics"]),
    ("fov_deg", &["intrinsics"]),
    ("focal_length", &["intrinsics"]),
    ("spp", &["samples_per_pixel"]),
    // Of convex decompositions.
    ("resolution", &["max_deviation_m"]),
    ("concavity", &["max_deviation_m"]),
    ("max_convex_hulls", &["max_parts"]),
    ("bounces", &["max_bounces"]),
    ("depth_scale", &["depth_scale_mm"]),
    ("intensity", &["brightness"]),
    ("power", &["brightness"]),
    ("lux", &["brightness"]),
    ("color_temperature", &["temperature_k"]),
    ("products", &["include"]),
    ("outputs", &["include"]),
    // Products.
    ("bbox", &["visible_box", "amodal_box"]),
    ("bounding_box", &["visible_box", "amodal_box"]),
    ("box", &["visible_box", "amodal_box"]),
    ("mask", &["visible_mask", "amodal_mask"]),
    ("masks", &["visible_mask", "amodal_mask"]),
    ("modal_mask", &["visible_mask"]),
    ("segmentation", &["instance", "visible_mask"]),
    ("instances", &["instance"]),
    ("instance_mask", &["instance", "visible_mask"]),
    ("image", &["rgb"]),
    ("color", &["rgb"]),
    ("normals", &["normal"]),
    ("pose", &["object_info"]),
    ("poses", &["object_info"]),
    ("intrinsics", &["camera"]),
    ("occlusion", &["occlusion_rate", "occlusion_order"]),
    // Kinds.
    ("coco", &["syntable"]),
    ("json", &["jsonl", "syntable"]),
    ("bop", &["bop_models"]),
    ("gso", &["google_scanned_objects"]),
    ("glb_folder", &["mesh_folder"]),
    ("obj_folder", &["mesh_folder"]),
    ("hdri", &["environment"]),
    ("hdri_folder", &["environment_folder"]),
    ("bullet", &["rapier"]),
    ("path_tracer", &["cpu_path"]),
];

/// The candidate that a word of another tool means.
pub(crate) fn synonym<'a>(name: &str, candidates: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let plain = simplify(name);
    let (_, meant) = SYNONYMS.iter().find(|(word, _)| *word == plain)?;
    let candidates: Vec<&str> = candidates.into_iter().collect();
    meant.iter().find_map(|meant| candidates.iter().find(|candidate| *candidate == meant).copied())
}

/// Returns the candidate nearest to `name`, if one is near.
pub fn nearest<'a>(name: &str, candidates: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let candidates: Vec<&str> = candidates.into_iter().filter(|candidate| *candidate != name).collect();
    let plain = simplify(name);
    if let Some(same) = candidates.iter().find(|candidate| simplify(candidate) == plain) {
        return Some(same);
    }
    if let Some(meant) = synonym(name, candidates.iter().copied()) {
        return Some(meant);
    }
    let words = sorted_words(&plain);
    // Ties in edit distance go to the longer common prefix.
    let likeness = |other: &str| strsim::jaro_winkler(&plain, other);
    // Lower is nearer; equal scores keep the first candidate.
    let score = |candidate: &str| {
        let other = simplify(candidate);
        if other == plain || sorted_words(&other) == words {
            return Some(0.0);
        }
        let distance = strsim::damerau_levenshtein(&plain, &other);
        if distance <= ((plain.len().max(other.len()) + 1) / 3).min(3) {
            return Some(distance as f64 - likeness(&other));
        }
        // A unit or a word left out or added: `radius` for `radius_m`, `samples` for `samples_per_pixel`.
        let part = |short: &str, long: &str| short.len() >= 3 && long.starts_with(short);
        if part(&plain, &other) || part(&other, &plain) || (plain.len() >= 4 && other.ends_with(&plain)) {
            return Some(50.0 + distance as f64);
        }
        // A word misspelled, and others left out: `sampels` for `samples_per_pixel`.
        let start = other.splitn(words.len() + 1, '_').take(words.len()).collect::<Vec<_>>().join("_");
        let away = strsim::damerau_levenshtein(&plain, &start);
        (plain.len() >= 5 && away <= 2).then_some(60.0 + away as f64)
    };
    candidates
        .into_iter()
        .filter_map(|candidate| Some((score(candidate)?, candidate)))
        .min_by(|(a, _), (b, _)| a.total_cmp(b))
        .map(|(_, candidate)| candidate)
}

/// Formats a suggestion: `did you mean …?`, or nothing.
pub(crate) fn did_you_mean<'a>(name: &str, candidates: impl IntoIterator<Item = &'a str>) -> String {
    nearest(name, candidates).map_or_else(String::new, |near| format!("did you mean `{near}`?"))
}

fn simplify(name: &str) -> String {
    name.to_lowercase().replace(['-', ' '], "_")
}

fn sorted_words(name: &str) -> Vec<&str> {
    let mut words: Vec<&str> = name.split('_').collect();
    words.sort_unstable();
    words
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn finds_what_was_meant() {
        let check = |name: &str, known: &[&str], expected| {
            assert_eq!(nearest(name, known.iter().copied()), expected, "{name} among {known:?}");
        };
        check("cuont", &["clearance_m", "count"], Some("count"));
        check("amodal_masks", &["amodal_box", "amodal_mask"], Some("amodal_mask"));
        check("radius", &["height_m", "radius_m"], Some("radius_m"));
        check("samples", &["bounces", "samples_per_pixel"], Some("samples_per_pixel"));
        check("Resolution", &["resolution"], Some("resolution"));
        check("COCO", &["syntable", "coco"], Some("coco"));
        check("sampels", &["bounces", "samples_per_pixel"], Some("samples_per_pixel")); // typos: ignore
        check("pixels-min", &["min_pixels", "max_pixels"], Some("min_pixels"));
        check("centre", &["center"], Some("center")); // typos: ignore
        check("banana", &["count", "clearance_m"], None);
        check("x", &["y"], None);
        check("sceen", &["seed", "scenes"], Some("scenes"));
        check("same", &["same"], None);
        check("mask", &["amodal_mask", "visible_mask"], Some("visible_mask"));
        check("uniform", &["choice", "integers"], Some("integers"));
        check("num_scenes", &["seed", "scenes"], Some("scenes"));
        check("path", &["path_m", "root"], Some("root"));
    }
}
