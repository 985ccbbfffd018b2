//! Finds the image that a name refers to.

use std::collections::BTreeMap;

/// Parts of names to compare, strictest first: the whole name; the name without extension; the file's name without
/// folder and extension.
const PARTS: [fn(&str) -> &str; 3] = [|name| name, without_extension, stem];

/// Names of images. An unknown name matches the only image whose name is equal without extension, or without folder and
/// extension.
#[derive(Debug)]
pub struct ImageNames {
    /// Images by parts of their names; `None` for a part that several images share.
    images: [BTreeMap<String, Option<usize>>; PARTS.len()],
}

impl ImageNames {
    /// Images by their indices.
    pub fn of<'a>(names: impl Iterator<Item = &'a str> + Clone) -> Self {
        let images = PARTS.map(|part| {
            let mut images = BTreeMap::new();
            for (image, name) in names.clone().enumerate() {
                images.entry(part(name).to_owned()).and_modify(|it| *it = None).or_insert(Some(image));
            }
            images
        });
        Self { images }
    }

    /// The image with a name.
    pub fn find(&self, name: &str) -> Option<usize> {
        PARTS.iter().zip(&self.images).find_map(|(part, images)| images.get(part(name)).copied()).flatten()
    }
}

fn without_extension(name: &str) -> &str {
    let folder = name.rfind(['/', '\\']).map_or(0, |at| at + 1);
    name[folder..].rfind('.').filter(|at| *at > 0).map_or(name, |at| &name[..folder + at])
}

fn stem(name: &str) -> &str {
    let name = without_extension(name);
    name.rfind(['/', '\\']).map_or(name, |at| &name[at + 1..])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_strictest_part_that_is_known_decides() {
        let names = ["a/1.png", "b/1.png", "b/2.x.png", "b/2.png", ".png", "c/3"];
        let found = ImageNames::of(names.into_iter());
        for (image, name) in names.iter().enumerate() {
            assert_eq!(found.find(name), Some(image), "{name}");
        }
        for (name, image) in [("b/1.jpg", Some(1)), ("2.x.jpg", Some(2)), ("other/3.png", Some(5)), ("x/2", Some(3))] {
            assert_eq!(found.find(name), image, "{name}");
        }
        assert_eq!((found.find("1.png"), found.find("4.png"), found.find("b/1/.png")), (None, None, Some(4)));
    }
}
