//! Suggestions for misspelled names.

pub(crate) use syntable_model::options::listing;

/// Returns the candidate nearest to `name`, if one is near.
pub(crate) fn nearest<'a>(name: &str, candidates: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let plain = simplify(name);
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
        (part(&plain, &other) || part(&other, &plain) || (plain.len() >= 4 && other.ends_with(&plain)))
            .then_some(50.0 + distance as f64)
    };
    candidates
        .into_iter()
        .filter(|candidate| *candidate != name)
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
        check("pixels-min", &["min_pixels", "max_pixels"], Some("min_pixels"));
        check("centre", &["center"], Some("center")); // typos: ignore
        check("banana", &["count", "clearance_m"], None);
        check("x", &["y"], None);
        check("sceen", &["seed", "scenes"], Some("scenes"));
        check("same", &["same"], None);
    }
}
