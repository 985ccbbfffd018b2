//! Result of a run.

use crate::left_out::LeftOutReport;
use crate::run::dataset::loss::Loss;
use crate::run::progress;
use syntable_model::error::Error;
use syntable_model::words::SHOWN;

/// Result of a run.
#[derive(Debug, Clone, PartialEq)]
pub struct RunOutcome {
    /// Number of scenes in the dataset, without failed scenes.
    pub scenes: u32,
    /// Number of failed scenes.
    pub failed: u32,
    /// Number of scenes in the dataset that could not be repaired, or could not get the additions of a grown recipe.
    /// They stay as they were.
    pub lacking: u32,
    /// Number of the recipe's scenes that no merged part has; 0 after a run.
    pub missing: u32,
    /// Texts and remedies of anomalies that make the dataset useless: all of its images are black, or no image shows an
    /// object.
    pub useless: Vec<(&'static str, &'static str)>,
    /// Number of images in the dataset.
    pub images: u32,
    /// Unusable assets that were skipped, as `pool/name`, sorted.
    pub bad_assets: Vec<String>,
    /// Data that stages omitted from the scenes of the dataset.
    pub left_out: Vec<Loss>,
}

impl RunOutcome {
    /// Skipped assets, and parts of labels that writers could not store. Failed scenes are not included.
    pub fn left_out(&self) -> LeftOutReport {
        let mut report = LeftOutReport::default();
        if !self.bad_assets.is_empty() {
            let bad =
                self.bad_assets.iter().take(SHOWN).map(|asset| Error::new(format!("asset {asset} cannot be used")));
            report.add(format!("{} skipped", progress::count(self.bad_assets.len() as u32, "bad asset")), bad);
        }
        report.losses(&self.left_out);
        report
    }
}

/// Adds help to an error that ends a run. The user can fix errors of the file system or a device.
pub(crate) fn stopping(error: Error) -> Error {
    if error.is_io() && error.help_text().is_none() {
        error.help("finished scenes are kept: free disk space, or repair the disk or folder, then run the same command")
    } else if error.is_device() {
        let own = error.help_text().map_or_else(String::new, |help| format!("; {help}"));
        error.help(format!("finished scenes are kept, and the same command continues from there{own}"))
    } else {
        error
    }
}
