//! Symmetries of models.

use serde::{Deserialize, Serialize};

/// Rigid motions that leave the look of a model unchanged, in the frame of the model's file.
///
/// They are read and written in the form of BOP's `models_info.json`: `symmetries_discrete`, 4 × 4 matrices row by row,
/// and `symmetries_continuous`, each with `axis` and `offset`; lengths in millimeters. Reading refuses anything but
/// rigid motions.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "SymmetriesInFile", into = "SymmetriesInFile")]
pub struct Symmetries {
    /// 4 × 4 matrices, row by row; translations in meters. The identity is not listed.
    pub discrete: Vec<[[f64; 4]; 4]>,
    /// Axes about which any rotation is a symmetry.
    pub continuous: Vec<SymmetryAxis>,
}

/// An axis about which any rotation is a symmetry.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SymmetryAxis {
    /// Direction.
    pub axis: [f64; 3],
    /// A point of the axis, meters.
    pub offset_m: [f64; 3],
}

impl Symmetries {
    /// Whether no symmetry is known.
    pub fn is_empty(&self) -> bool {
        self.discrete.is_empty() && self.continuous.is_empty()
    }

    /// The symmetries of the model at another size.
    pub fn scaled(mut self, factor: f64) -> Self {
        self.discrete.iter_mut().flat_map(|motion| &mut motion[..3]).for_each(|row| row[3] *= factor);
        self.continuous.iter_mut().flat_map(|axis| &mut axis.offset_m).for_each(|x| *x *= factor);
        self
    }
}

/// Millimeters per meter.
const MM: f64 = 1000.0;
/// Written lengths are rounded to this many steps per millimeter, which hides rounding from the conversion of units.
const STEPS: f64 = 1e9;
/// Largest deviation of an entry from the entry of a rotation.
const TOLERANCE: f64 = 1e-3;

/// The form in files.
#[derive(Clone, Default, Serialize, Deserialize)]
struct SymmetriesInFile {
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    symmetries_discrete: Vec<[f64; 16]>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    symmetries_continuous: Vec<AxisInFile>,
}

#[derive(Clone, Serialize, Deserialize)]
struct AxisInFile {
    axis: [f64; 3],
    #[serde(default)]
    offset: [f64; 3],
}

impl TryFrom<SymmetriesInFile> for Symmetries {
    type Error = String;

    fn try_from(file: SymmetriesInFile) -> Result<Self, String> {
        let discrete = (0..).zip(file.symmetries_discrete).map(|(number, entries)| {
            let mut motion: [[f64; 4]; 4] = std::array::from_fn(|row| std::array::from_fn(|i| entries[4 * row + i]));
            if !is_rigid(&motion) {
                return Err(format!("`symmetries_discrete[{number}]` is no rigid motion: {entries:?}"));
            }
            motion[..3].iter_mut().for_each(|row| row[3] /= MM);
            Ok(motion)
        });
        let continuous = (0..).zip(file.symmetries_continuous).map(|(number, AxisInFile { axis, offset })| {
            let length = axis.iter().map(|x| x * x).sum::<f64>();
            let is_sound = length.is_finite() && length > 0.0 && offset.iter().all(|x| x.is_finite());
            is_sound
                .then(|| SymmetryAxis { axis, offset_m: offset.map(|x| x / MM) })
                .ok_or_else(|| format!("`symmetries_continuous[{number}]` is no axis: {axis:?}, offset {offset:?}"))
        });
        Ok(Self { discrete: discrete.collect::<Result<_, _>>()?, continuous: continuous.collect::<Result<_, _>>()? })
    }
}

impl From<Symmetries> for SymmetriesInFile {
    fn from(symmetries: Symmetries) -> Self {
        let mm = |m: f64| (m * MM * STEPS).round() / STEPS;
        let entries = |motion: [[f64; 4]; 4]| {
            std::array::from_fn(|i| match (i / 4, i % 4) {
                (row @ 0..3, 3) => mm(motion[row][3]),
                (row, column) => motion[row][column],
            })
        };
        let axis = |it: SymmetryAxis| AxisInFile { axis: it.axis, offset: it.offset_m.map(mm) };
        Self {
            symmetries_discrete: symmetries.discrete.into_iter().map(entries).collect(),
            symmetries_continuous: symmetries.continuous.into_iter().map(axis).collect(),
        }
    }
}

/// Whether a matrix is a rotation and a translation.
fn is_rigid(motion: &[[f64; 4]; 4]) -> bool {
    let dot = |a: usize, b: usize| (0..3).map(|i| motion[a][i] * motion[b][i]).sum::<f64>();
    let is_orthonormal = (0..3).all(|a| (0..3).all(|b| (dot(a, b) - f64::from(u8::from(a == b))).abs() <= TOLERANCE));
    let [x, y, z, last] = motion;
    let volume =
        x[0] * (y[1] * z[2] - y[2] * z[1]) - x[1] * (y[0] * z[2] - y[2] * z[0]) + x[2] * (y[0] * z[1] - y[1] * z[0]);
    let is_affine = *last == [0.0, 0.0, 0.0, 1.0] && motion.iter().flatten().all(|x| x.is_finite());
    is_affine && is_orthonormal && volume > 0.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_form_in_files_matches_bop() {
        let text = r#"{"symmetries_discrete":[[-1.0,0.0,0.0,0.1,0.0,-1.0,0.0,3.3,0.0,0.0,1.0,0.7,0.0,0.0,0.0,1.0]],"symmetries_continuous":[{"axis":[0.0,0.0,1.0],"offset":[1.1,0.3,0.0]}]}"#;
        let read: Symmetries = serde_json::from_str(text).expect("sound");
        assert!(
            (read.discrete[0][1][3] - 0.0033).abs() < 1e-15 && (read.continuous[0].offset_m[0] - 0.0011).abs() < 1e-15
        );
        // Other keys of a model do not matter, and the conversion to meters and back changes no digit.
        assert_eq!(serde_json::to_string(&read).expect("plain data"), text);
        let twice = read.clone().scaled(2.0).scaled(0.5);
        assert_eq!(serde_json::to_string(&twice).expect("plain data"), text);
        assert_eq!(serde_json::from_str::<Symmetries>(r#"{"diameter": 3}"#).expect("none"), Symmetries::default());
        for (text, wanted) in [
            // A mirror, a scale, a matrix of nine, no axis.
            (r#"{"symmetries_discrete":[[-1,0,0,0,0,1,0,0,0,0,1,0,0,0,0,1]]}"#, "[0]` is no rigid motion"),
            (r#"{"symmetries_discrete":[[2,0,0,0,0,1,0,0,0,0,0.5,0,0,0,0,1]]}"#, "[0]` is no rigid motion"),
            (r#"{"symmetries_discrete":[[1,0,0,0,1,0,0,0,1]]}"#, "invalid length 9"),
            (r#"{"symmetries_continuous":[{"axis":[0,0,0],"offset":[0,0,0]}]}"#, "[0]` is no axis"),
        ] {
            let error = serde_json::from_str::<Symmetries>(text).expect_err(text).to_string();
            assert!(error.contains(wanted), "{error}");
        }
    }
}
