//! Checks of datasets that are there, in any format that can be read.

use crate::workers::Pool;
use parking_lot::Mutex;
use serde::Serialize;
use std::collections::BTreeSet;
use syntable_model::check::{self, Check};
use syntable_model::context::Workers;
use syntable_model::error::{Error, Result};
use syntable_model::product::{KeyId, Products};
use syntable_model::reader::{DatasetFault, DatasetReader};

/// Name of the check that files and records can be read.
const READABLE: &str = "readable";
/// What that check says.
const CAN_BE_READ: &str = "Files are there, and files and records can be read.";

/// What is known of a dataset after all checks.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Validated {
    /// Images of the dataset.
    pub images: u32,
    /// The checks, by name.
    pub checks: Vec<Checked>,
    /// What is wrong, by check and place.
    pub faults: Vec<FaultAt>,
}

/// A check that was made.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Checked {
    /// Its name.
    pub check: String,
    /// What holds in a sound dataset.
    pub says: String,
    /// Images in which all that it looks at is there; none for a check of the dataset as a whole.
    pub images: Option<u32>,
    /// Number of faults.
    pub faults: u32,
}

/// Something that is wrong.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Serialize)]
pub struct FaultAt {
    /// Name of the check.
    pub check: String,
    /// Where: an image, an annotation, a file.
    pub place: String,
    /// What is wrong.
    pub message: String,
}

/// Reads all images of a dataset and makes all checks on each.
pub fn validate(dataset: &dyn DatasetReader, threads: usize) -> Result<Validated> {
    let checks = check::linked();
    let offers = dataset.offers();
    let found = Mutex::new((vec![0_u32; checks.len()], BTreeSet::new()));
    Pool::new(threads)?.run(dataset.images().len(), &|image| {
        let (products, mut faults) = read(dataset, image, &offers);
        let made: Vec<bool> = checks.iter().map(|check| check.applies(&products)).collect();
        faults.extend(checks.iter().flat_map(|check| of_image(check, &products)));
        faults.extend(dataset.image_faults(image).into_iter().map(|(check, message)| (check.to_owned(), message)));
        let place = &dataset.images()[image].name;
        let mut found = found.lock();
        for (count, made) in found.0.iter_mut().zip(made) {
            *count += u32::from(made);
        }
        found.1.extend(faults.into_iter().map(|(check, message)| FaultAt { check, place: place.clone(), message }));
    });
    let (counts, mut faults) = found.into_inner();
    if dataset.images().is_empty() && dataset.lists_all_images() {
        let message = "the dataset has no image".to_owned();
        faults.insert(FaultAt { check: READABLE.to_owned(), place: "images".to_owned(), message });
    }
    faults.extend(dataset.faults().iter().map(FaultAt::from));
    let of = |name: &str| faults.iter().filter(|fault| fault.check == name).count() as u32;
    let images = dataset.images().len() as u32;
    let checked = |name: &str, says: &str, images| Checked {
        check: name.to_owned(),
        says: says.to_owned(),
        images,
        faults: of(name),
    };
    let mut all: Vec<Checked> =
        checks.iter().zip(counts).map(|(check, count)| checked(check.name, check.doc, Some(count))).collect();
    all.push(checked(READABLE, CAN_BE_READ, Some(images)));
    // Rules of the format, which a reader names when they are broken.
    let known: BTreeSet<&str> = all.iter().map(|it| it.check.as_str()).collect();
    let broken: BTreeSet<&str> = faults.iter().map(|fault| fault.check.as_str()).collect();
    let more: Vec<Checked> =
        broken.difference(&known).map(|name| checked(name, "Records fit together.", None)).collect();
    all.extend(more);
    Ok(Validated { images, checks: all, faults: faults.into_iter().collect() })
}

/// The products of an image that can be read, and why others cannot.
fn read(dataset: &dyn DatasetReader, image: usize, wants: &[KeyId]) -> (Products, Vec<(String, String)>) {
    match dataset.read(image, wants) {
        Ok((_, products)) => (products, Vec::new()),
        Err(_) => {
            let (mut products, mut messages) = (Products::new(), BTreeSet::new());
            for want in wants {
                let one = dataset.read(image, std::slice::from_ref(want));
                if let Err(error) = one.and_then(|(_, one)| products.extend(one)) {
                    messages.insert(error.to_string());
                }
            }
            (products, messages.into_iter().map(|message| (READABLE.to_owned(), message)).collect())
        }
    }
}

fn of_image(check: &Check, products: &Products) -> Vec<(String, String)> {
    let messages = check.run(products).unwrap_or_else(|error: Error| vec![error.to_string()]);
    messages.into_iter().map(|message| (check.name.to_owned(), message)).collect()
}

impl From<&DatasetFault> for FaultAt {
    fn from(fault: &DatasetFault) -> Self {
        Self { check: fault.check.to_owned(), place: fault.place.clone(), message: fault.message.clone() }
    }
}

impl Validated {
    /// What is known of a dataset that cannot be opened: why.
    pub fn unreadable(place: String, error: &Error) -> Self {
        let check = READABLE.to_owned();
        let message = error.help_text().map_or_else(|| error.to_string(), |help| format!("{error}; {help}"));
        let checks = vec![Checked { check: check.clone(), says: CAN_BE_READ.to_owned(), images: None, faults: 1 }];
        Self { images: 0, checks, faults: vec![FaultAt { check, place, message }] }
    }

    /// The faults of each check in turn, so that a few show all that is wrong: at most `most`.
    pub fn some_of_each(&self, most: usize) -> Vec<&FaultAt> {
        // They are ordered by check.
        let of_checks = self.faults.chunk_by(|a, b| a.check == b.check);
        let mut turns: Vec<(usize, &FaultAt)> = of_checks.flat_map(|faults| faults.iter().enumerate()).collect();
        turns.sort_by_key(|(turn, _)| *turn);
        turns.truncate(most);
        let mut shown: Vec<&FaultAt> = turns.into_iter().map(|(_, fault)| fault).collect();
        shown.sort();
        shown
    }

    /// Whether nothing is wrong.
    pub fn is_sound(&self) -> bool {
        self.faults.is_empty()
    }
}
