//! The orientation of photographs.

use syntable_model::product::Plane;

/// Turns an image upright, given its EXIF orientation from 1 to 8 (CIPA DC-008, 4.6.4): the number states where the first row and
/// the first column of the file belong.
pub fn turned(image: Plane<[u8; 3]>, orientation: u16) -> Plane<[u8; 3]> {
    let (width, height) = (image.width(), image.height());
    let (right, bottom) = (width.saturating_sub(1), height.saturating_sub(1));
    match orientation {
        2 => Plane::from_fn(width, height, |x, y| *image.at(right - x, y)),
        3 => Plane::from_fn(width, height, |x, y| *image.at(right - x, bottom - y)),
        4 => Plane::from_fn(width, height, |x, y| *image.at(x, bottom - y)),
        5 => Plane::from_fn(height, width, |x, y| *image.at(y, x)),
        6 => Plane::from_fn(height, width, |x, y| *image.at(y, bottom - x)),
        7 => Plane::from_fn(height, width, |x, y| *image.at(right - y, bottom - x)),
        8 => Plane::from_fn(height, width, |x, y| *image.at(right - y, x)),
        _ => image,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The letters `ab` over `cd` over `ef`, as the file has them in each orientation.
    #[test]
    fn every_orientation_is_turned_upright() {
        let files: [(u16, &[&str]); 8] = [
            (1, &["ab", "cd", "ef"]),
            (2, &["ba", "dc", "fe"]),
            (3, &["fe", "dc", "ba"]),
            (4, &["ef", "cd", "ab"]),
            (5, &["ace", "bdf"]),
            (6, &["bdf", "ace"]),
            (7, &["fdb", "eca"]),
            (8, &["eca", "fdb"]),
        ];
        for (orientation, rows) in files {
            let letter = |x: u32, y: u32| [rows[y as usize].as_bytes()[x as usize]; 3];
            let file = Plane::from_fn(rows[0].len() as u32, rows.len() as u32, letter);
            let shown: Vec<u8> = turned(file, orientation).data().iter().map(|pixel| pixel[0]).collect();
            assert_eq!(shown, b"abcdef", "orientation {orientation}");
        }
    }
}
