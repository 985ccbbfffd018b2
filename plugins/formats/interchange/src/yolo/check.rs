//! Faults of YOLO's label files.

use super::read::YoloSource;
use super::record::{BOX, DATA, LabelLine, LabelShape};
use syntable_model::reader::{DatasetFault, FaultSubject};
use syntable_model::rule;

impl YoloSource {
    /// The rules that the lines of an image break.
    pub fn faults_of(&self, image: usize) -> Vec<DatasetFault> {
        let lines = self.lines(image).unwrap_or_default();
        let of_line = |line: &LabelLine| {
            let (number, faults) = (line.number, self.faults_of_line(line));
            faults.into_iter().map(move |fault| fault.of(FaultSubject::Line(number)))
        };
        lines.iter().flat_map(of_line).collect()
    }

    fn faults_of_line(&self, line: &LabelLine) -> Vec<DatasetFault> {
        let mut faults = Vec::new();
        if !self.classes.contains(&line.class) {
            let message = format!("{} has no class {}", self.names_file.unwrap_or(DATA), line.class);
            faults.push(DatasetFault::new(rule::KNOWN_CATEGORIES, message));
        }
        if self.shape == LabelShape::Polygons && line.is_box() {
            let message = "a box among polygons: the object has no mask";
            faults.push(DatasetFault::new(rule::RECORDS_AGREE, message));
        }
        // The points of poses have flags; corners of rotated boxes may lie outside the image.
        let coordinates = if self.shape == LabelShape::Poses { &line.values[..BOX] } else { &line.values };
        let beyond = coordinates.iter().find(|value| !(0.0..=1.0).contains(*value));
        if let Some(value) = beyond.filter(|_| self.shape != LabelShape::RotatedBoxes) {
            let message = format!("{value} is not in [0, 1]");
            faults.push(DatasetFault::new("coordinates_are_within_the_image", message));
        }
        faults
    }
}
