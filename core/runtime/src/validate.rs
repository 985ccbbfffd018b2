//! Checks of existing datasets in any readable format.

use crate::images::{self, ImageWork};
use parking_lot::Mutex;
use serde::Serialize;
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;
use syntable_model::check::LabelCheck;
use syntable_model::error::{Error, Result};
use syntable_model::product::standard::{OBJECT_INFO, is_image_file};
use syntable_model::product::{KeyId, Products, Value};
use syntable_model::reader::{DatasetFault, OpenDataset, Source, is_unnamed};
use syntable_model::registry::Registry;
use syntable_model::rule::READABLE;

/// Name of the check that datasets agree on the ids of categories and objects.
const NUMBERS_AGREE: &str = "numbers_agree";
/// Description of the check [`READABLE`].
const CAN_BE_READ: &str = "Files exist, and files and records are readable.";

/// Result of all checks of a dataset.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Validated {
    /// Number of images of the dataset.
    pub images: u32,
    /// The checks, by name.
    pub checks: Vec<CheckResult>,
    /// Faults, by check and place.
    pub faults: Vec<FaultAt>,
    /// Ids of its categories and objects, to compare with other datasets.
    #[serde(skip)]
    pub numbers: NumberNames,
}

/// A dataset that was found by its path, and checked.
#[derive(Debug, Clone)]
pub struct ValidatedDataset {
    /// The path as the caller gave it.
    pub dataset: String,
    /// Format of the dataset.
    pub format: &'static str,
    /// Result of the checks.
    pub found: Validated,
}

/// Finds a dataset, opens it and checks it. For a dataset that cannot be opened, the result has a fault.
///
/// # Errors
/// If the path has no dataset, its format is unknown, a file system or device fails, or the work was asked to stop.
pub fn validate_path(
    registry: &Registry,
    named: &Source,
    format: Option<&str>,
    work: &ImageWork,
) -> Result<ValidatedDataset> {
    let (format, found_at) = registry.find_dataset(named, format)?;
    let found = match format.open(&found_at) {
        Ok(dataset) => {
            let found = validate(&dataset, registry.checks(), work)?;
            // A file that could not be downloaded is no fault of the dataset.
            dataset.take_outage().map_or(Ok(found), Err)?
        }
        Err(error) if error.is_transient() => return Err(error),
        Err(error) => Validated::unreadable(found_at.name().display().to_string(), &error),
    };
    Ok(ValidatedDataset { dataset: named.name().display().to_string(), format: format.name(), found })
}

/// Contradictory ids: an id with different names, or a name with different ids. Compares each dataset with all before
/// it.
pub fn differences(all: &[ValidatedDataset]) -> Vec<FaultAt> {
    let pairs = all.iter().enumerate().flat_map(|(at, other)| all[..at].iter().map(move |one| (one, other)));
    pairs
        .flat_map(|(one, other)| one.found.numbers.differences(&other.found.numbers, [&one.dataset, &other.dataset]))
        .collect()
}

/// Names of the categories and objects of a dataset, by id.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct NumberNames {
    /// Names of categories by id.
    categories: NamesByNumber,
    /// Names of objects by `obj_id`, without their pools.
    objects: NamesByNumber,
}

/// Names by id. An id has several names if models of several sources differ by name alone.
type NamesByNumber = BTreeMap<u64, BTreeSet<String>>;

impl NumberNames {
    /// Records the ids in the records of an image's objects.
    fn note_objects(&mut self, products: &Products) {
        let Ok(Some(infos)) = products.optional(OBJECT_INFO) else { return };
        for (_, info) in infos.iter() {
            let Value::Record(fields) = info else { continue };
            let field = |name: &str| fields.iter().find(|(field, _)| field == name).map(|(_, value)| value);
            let id = match field("obj_id") {
                Some(Value::Int(id)) => u64::try_from(*id).ok(),
                Some(Value::Uint(id)) => Some(*id),
                _ => None,
            };
            let text = |name: &str| match field(name) {
                Some(Value::Text(text)) => Some(text.as_str()),
                _ => None,
            };
            // Some formats store pool and name as one text.
            let of_asset = || text("asset").map(|asset| asset.split_once('/').map_or(asset, |(_, name)| name));
            let named = id.zip(text("name").or_else(of_asset));
            if let Some((id, name)) = named.filter(|(id, name)| !is_unnamed(*id, name)) {
                self.objects.entry(id).or_default().insert(name.to_owned());
            }
        }
    }

    /// Whether the dataset states no id of a named category or object.
    pub fn is_empty(&self) -> bool {
        self.categories.is_empty() && self.objects.is_empty()
    }

    /// Contradictory ids of two datasets with these names: an id with different names, or a name with different ids.
    pub fn differences(&self, other: &Self, [one, two]: [&str; 2]) -> Vec<FaultAt> {
        let mut faults = Vec::new();
        for (what, number, here, there) in [
            ("category", "id", &self.categories, &other.categories),
            ("object", "`obj_id`", &self.objects, &other.objects),
        ] {
            let fault = |message| FaultAt { check: NUMBERS_AGREE.to_owned(), place: two.to_owned(), message };
            let [own_numbers, other_numbers] = [here, there].map(numbers_by_name);
            // The categories of BOP are its objects, with their pools.
            let is_object = |category: &String, object: &String| {
                category.strip_suffix(object.as_str()).is_some_and(|pool| pool.is_empty() || pool.ends_with('/'))
            };
            let is_of_objects = |id: &u64, names: &BTreeSet<String>| {
                let objects = || self.objects.get(id).into_iter().flatten();
                what == "category" && names.iter().any(|name| objects().any(|object| is_object(name, object)))
            };
            for (id, names) in here.iter().filter(|(id, names)| !is_of_objects(id, names)) {
                if let Some(others) = there.get(id).filter(|others| others.is_disjoint(names))
                    && let (Some(name), Some(other)) = (names.first(), others.first())
                {
                    faults.push(fault(format!("{what} {id} is `{name}` in {one}, and `{other}` in {two}")));
                }
                for name in names {
                    let of =
                        |numbers: &BTreeMap<&str, Vec<u64>>| numbers.get(name.as_str()).cloned().unwrap_or_default();
                    let [own, others] = [of(&own_numbers), of(&other_numbers)];
                    // Several pools may have an object of the same name. The first id represents them.
                    let are_apart = own.first() == Some(id) && !own.iter().any(|id| others.contains(id));
                    if let Some(other) = others.first().filter(|_| are_apart) {
                        faults.push(fault(format!(
                            "{what} `{name}` has the {number} {id} in {one}, and {other} in {two}"
                        )));
                    }
                }
            }
        }
        faults
    }
}

/// The ids of each name, ascending.
fn numbers_by_name(names: &NamesByNumber) -> BTreeMap<&str, Vec<u64>> {
    let mut numbers: BTreeMap<&str, Vec<u64>> = BTreeMap::new();
    for (id, name) in names.iter().flat_map(|(id, names)| names.iter().map(move |name| (*id, name.as_str()))) {
        numbers.entry(name).or_default().push(id);
    }
    numbers
}

/// A check, and its result.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct CheckResult {
    /// Name of the check.
    pub check: String,
    /// The statement that holds in a correct dataset.
    pub says: String,
    /// Number of images that have all inputs of the check; `None` for a check of the dataset as a whole.
    pub images: Option<u32>,
    /// Number of faults.
    pub faults: u32,
}

/// A fault.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Serialize)]
pub struct FaultAt {
    /// Name of the check.
    pub check: String,
    /// Location: an image, an annotation or a file.
    pub place: String,
    /// The fault in words.
    pub message: String,
}

/// Reads all images of a dataset and runs all checks on each.
///
/// # Errors
/// If the work was asked to stop. Unreadable images are faults.
pub fn validate(dataset: &OpenDataset, checks: &[Arc<dyn LabelCheck>], work: &ImageWork) -> Result<Validated> {
    let offers = &dataset.offers;
    let category = |(id, name): (u32, &str)| (u64::from(id), BTreeSet::from([name.to_owned()]));
    // Names that merely repeat the id may differ between datasets.
    let has_name = |(id, name): &(u32, &str)| !is_unnamed((*id).into(), name);
    let categories = dataset.info.categories().filter(has_name).map(category).collect();
    let (mut counts, mut faults) = (vec![0_u32; checks.len()], BTreeSet::new());
    let numbers = Mutex::new(NumberNames { categories, ..NumberNames::default() });
    let image = |image: usize| {
        let (products, mut faults) = read(dataset, image, offers);
        let made: Vec<bool> = checks.iter().map(|check| dataset.demands(&**check, &products)).collect();
        faults.extend(checks.iter().flat_map(|check| of_image(dataset, image, &**check, &products)));
        let of_records = dataset.image_faults(image);
        let of_records = of_records.iter().map(|fault| FaultAt::of(fault, dataset));
        let place = &dataset.images[image].name;
        numbers.lock().note_objects(&products);
        let faults = faults.into_iter().map(|(check, message)| FaultAt { check, place: place.clone(), message });
        Ok((made, faults.chain(of_records).collect::<Vec<FaultAt>>()))
    };
    images::each(work, "checked", dataset.images.len(), &image, &mut |_, (made, found)| {
        counts.iter_mut().zip(made).for_each(|(count, made)| *count += u32::from(made));
        faults.extend(found);
    })?;
    let numbers = numbers.into_inner();
    if dataset.images.is_empty() && dataset.lists_all_images {
        let message = "the dataset has no image".to_owned();
        faults.insert(FaultAt { check: READABLE.to_owned(), place: "images".to_owned(), message });
    }
    faults.extend(dataset.all_faults().iter().map(|fault| FaultAt::of(fault, dataset)));
    let of = |name: &str| faults.iter().filter(|fault| fault.check == name).count() as u32;
    let images = dataset.images.len() as u32;
    let checked = |name: &str, says: &str, images| CheckResult {
        check: name.to_owned(),
        says: says.to_owned(),
        images,
        faults: of(name),
    };
    let mut all: Vec<CheckResult> =
        checks.iter().zip(counts).map(|(check, count)| checked(check.name(), check.doc(), Some(count))).collect();
    all.push(checked(READABLE, CAN_BE_READ, Some(images)));
    // Rules of the format, which a reader names when a file breaks them.
    let known: BTreeSet<&str> = all.iter().map(|it| it.check.as_str()).collect();
    let broken: BTreeSet<&str> = faults.iter().map(|fault| fault.check.as_str()).collect();
    let more: Vec<CheckResult> =
        broken.difference(&known).map(|name| checked(name, "Records fit together.", None)).collect();
    all.extend(more);
    Ok(Validated { images, checks: all, faults: faults.into_iter().collect(), numbers })
}

/// The readable products of an image, and the errors of the others.
fn read(dataset: &OpenDataset, image: usize, wants: &[KeyId]) -> (Products, Vec<(String, String)>) {
    match dataset.read(image, wants) {
        Ok(read) => (read.products, Vec::new()),
        Err(_) => {
            let (mut products, mut messages) = (Products::new(), BTreeSet::new());
            // Often the image files alone are missing. Product by product, an image takes a dozen reads.
            let (files, labels): (Vec<KeyId>, Vec<KeyId>) = wants.iter().copied().partition(|key| is_image_file(*key));
            let one_by_one = match dataset.read(image, &labels) {
                Ok(read) => {
                    products = read.products;
                    files
                }
                Err(_) => wants.to_vec(),
            };
            for want in &one_by_one {
                let one = dataset.read(image, std::slice::from_ref(want));
                if let Err(error) = one.and_then(|one| products.extend(one.products)) {
                    messages.insert(error.to_string());
                }
            }
            (products, messages.into_iter().map(|message| (READABLE.to_owned(), message)).collect())
        }
    }
}

fn of_image(dataset: &OpenDataset, image: usize, check: &dyn LabelCheck, products: &Products) -> Vec<(String, String)> {
    let found = dataset.label_faults(image, check, products);
    let messages = found.unwrap_or_else(|error: Error| vec![error.to_string()]);
    messages.into_iter().map(|message| (check.name().to_owned(), message)).collect()
}

impl FaultAt {
    fn of(fault: &DatasetFault, dataset: &OpenDataset) -> Self {
        let [place, message] = fault.place_and_text(&dataset.images);
        Self { check: fault.rule.to_owned(), place, message }
    }
}

impl Validated {
    /// The result for a dataset that cannot be opened: its error.
    pub fn unreadable(place: String, error: &Error) -> Self {
        let check = READABLE.to_owned();
        let message = error.to_string();
        let checks = vec![CheckResult { check: check.clone(), says: CAN_BE_READ.to_owned(), images: None, faults: 1 }];
        Self { images: 0, checks, faults: vec![FaultAt { check, place, message }], numbers: NumberNames::default() }
    }

    /// At most `most` faults, in turn from each check, so that a short list shows every kind.
    pub fn some_of_each(&self, most: usize) -> Vec<&FaultAt> {
        // Faults are sorted by check.
        let of_checks = self.faults.chunk_by(|a, b| a.check == b.check);
        let mut turns: Vec<(usize, &FaultAt)> = of_checks.flat_map(|faults| faults.iter().enumerate()).collect();
        turns.sort_by_key(|(turn, _)| *turn);
        turns.truncate(most);
        let mut shown: Vec<&FaultAt> = turns.into_iter().map(|(_, fault)| fault).collect();
        shown.sort();
        shown
    }

    /// Whether no check found a fault.
    pub fn is_sound(&self) -> bool {
        self.faults.is_empty()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use syntable_model::scene::InstanceId;

    #[test]
    fn numbers_of_two_datasets_are_compared_both_ways() {
        let names = |pairs: &[(u64, &str)]| {
            let mut names = NamesByNumber::new();
            pairs.iter().for_each(|(id, name)| {
                names.entry(*id).or_default().insert((*name).to_owned());
            });
            names
        };
        let numbers = |categories: &[(u64, &str)], objects: &[(u64, &str)]| NumberNames {
            categories: names(categories),
            objects: names(objects),
        };
        let train = numbers(&[(1, "object"), (2, "bowl"), (3, "mug")], &[(5, "can"), (6, "cat"), (9, "cat")]);
        let compare = |other: &NumberNames| -> Vec<String> {
            train.differences(other, ["train", "val"]).into_iter().map(|fault| fault.message).collect()
        };
        assert!(compare(&train).is_empty());
        // A name or id that only one dataset has is no contradiction, nor is an id of two objects with one name.
        assert!(compare(&numbers(&[(3, "mug"), (4, "pan")], &[(9, "cat"), (7, "duck")])).is_empty());
        assert_eq!(
            compare(&numbers(&[(1, "object"), (2, "mug")], &[(5, "duck"), (7, "cat")])),
            [
                "category 2 is `bowl` in train, and `mug` in val",
                "category `mug` has the id 3 in train, and 2 in val",
                "object 5 is `can` in train, and `duck` in val",
                "object `cat` has the `obj_id` 6 in train, and 7 in val",
            ]
        );
        // An id of two objects does not identify either.
        assert!(compare(&numbers(&[], &[(5, "can"), (5, "duck")])).is_empty());
        // BOP's categories are its objects, so they are reported once.
        let [one, two] =
            [["a/can", "can"], ["b/cat", "cat"]].map(|[category, object]| numbers(&[(1, category)], &[(1, object)]));
        assert_eq!(one.differences(&two, ["a", "b"]).len(), 1);
    }

    #[test]
    fn names_that_repeat_a_number_are_not_compared() {
        let numbers = |objects: &[(u64, &str)]| {
            let info = |&(id, name): &(u64, &str)| {
                let fields = [("obj_id", Value::Uint(id)), ("asset", Value::Text(name.to_owned()))];
                Value::Record(fields.map(|(field, value)| (field.to_owned(), value)).to_vec())
            };
            let infos = (1..).map(InstanceId).zip(objects.iter().map(info)).collect();
            let (mut products, mut numbers) = (Products::new(), NumberNames::default());
            products.put(OBJECT_INFO, infos).expect("a new product");
            numbers.note_objects(&products);
            numbers
        };
        let named = numbers(&[(8, "ycb/bowl"), (9, "ycb/mug")]);
        let compare = |other: &NumberNames| named.differences(other, ["train", "val"]).len();
        assert_eq!(compare(&numbers(&[(8, "obj_000008"), (9, "mug")])), 0);
        assert_eq!(compare(&numbers(&[(8, "obj_000009"), (9, "mug")])), 1);
    }
}
