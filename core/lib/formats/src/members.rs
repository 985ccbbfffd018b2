//! Members of tar files, read in any order.

use crate::decode::{self, FileContent};
use crate::read::{Faults, file_name, place_in_name};
use std::collections::BTreeMap;
use std::io::{Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use syntable_model::error::{Error, Result};
use syntable_model::limits::{ARCHIVE_MEMBERS, MEMBER_BYTES};
use syntable_model::mirror::DatasetFile;
use syntable_model::panics::guarded;
use syntable_model::rule;
use syntable_model::shown::shown;

/// A file in a tar file.
#[derive(Debug, Clone)]
pub struct TarMember {
    archive: Arc<Path>,
    /// Its name in the archive.
    pub name: String,
    at: u64,
    size: u64,
}

impl TarMember {
    /// Its bytes.
    pub fn content(&self) -> Result<FileContent> {
        let fail = |error| Error::io(self.path(), &error);
        MEMBER_BYTES.check(self.size).map_err(|error| error.in_file(self.path()))?;
        let mut bytes = vec![0; self.size as usize];
        let mut archive = DatasetFile::open(&self.archive).map_err(fail)?;
        archive.seek(SeekFrom::Start(self.at)).and_then(|_| archive.read_exact(&mut bytes)).map_err(fail)?;
        Ok(FileContent::new(bytes, self.path()))
    }

    /// Its path in messages, with the archive as a folder.
    pub fn path(&self) -> PathBuf {
        self.archive.join(&self.name)
    }
}

/// A sample of tar files: members with the same key.
#[derive(Debug)]
pub struct TarSample {
    /// Index of its archive in the given list.
    pub archive: usize,
    /// Its members, by the part of the name after the key.
    pub fields: BTreeMap<String, TarMember>,
}

/// The samples of tar files whose keys are numbers of scene and view, `{scene}_{view}`, at any place in the archive. An
/// unreadable archive is a fault.
pub fn samples(archives: &[PathBuf], faults: &mut Faults) -> BTreeMap<(u32, u32), TarSample> {
    let mut samples: BTreeMap<(u32, u32), TarSample> = BTreeMap::new();
    for (archive, path) in archives.iter().enumerate() {
        let (found, damage) = members(path);
        let nothing = found.is_empty().then(|| Error::new("the archive is empty").in_file(path));
        if let Some(error) = damage.or(nothing) {
            let message = format!("{error}: nothing that follows in it is read");
            faults.lost(rule::READABLE, file_name(path), message);
        }
        let mut others = 0;
        for member in found {
            let name = member.name.rsplit('/').next().unwrap_or_default();
            let Some((key, field)) = name.split_once('.') else { continue };
            let Some(place) = place_in_name(key) else {
                others += 1;
                continue;
            };
            let field = field.to_owned();
            let sample = samples.entry(place).or_insert_with(|| TarSample { archive, fields: BTreeMap::new() });
            if sample.archive != archive || sample.fields.contains_key(&field) {
                let message = "the sample has this member twice; the first one counts";
                faults.add(rule::UNIQUE_VIEWS, shown(&member.path()).display().to_string(), message);
                continue;
            }
            sample.fields.insert(field, member);
        }
        if others > 0 {
            let message =
                format!("{others} members do not begin with the numbers of a scene and a view, such as 000003_0017");
            faults.lost(rule::KNOWN_IMAGES, file_name(path), message);
        }
    }
    samples
}

/// The files in a tar file, in order, up to the first damage, and the damage. Contents are skipped, not read.
pub fn members(archive: &Path) -> (Vec<TarMember>, Option<Error>) {
    let mut found = Vec::new();
    let damage = collect(archive, ARCHIVE_MEMBERS.most as usize + 1, &mut found).err();
    let damage = damage.or_else(|| ARCHIVE_MEMBERS.check(found.len() as u64).err().map(|error| error.in_file(archive)));
    (found, damage)
}

/// The first `count` readable files of a tar file.
pub fn first(archive: &Path, count: usize) -> Vec<TarMember> {
    let mut found = Vec::new();
    // The reader of the whole archive reports damage.
    let _ = collect(archive, count, &mut found);
    found
}

fn collect(path: &Path, most: usize, found: &mut Vec<TarMember>) -> Result<()> {
    guarded("the library that reads tar files", path, || list(path, most, found))
}

fn list(path: &Path, most: usize, found: &mut Vec<TarMember>) -> Result<()> {
    let fail = |error: std::io::Error| match error.kind() {
        // These errors mean a damaged file, not a failing disk.
        std::io::ErrorKind::UnexpectedEof | std::io::ErrorKind::Other | std::io::ErrorKind::InvalidData => {
            Error::new(format!("not a readable tar file: {error}")).in_file(path)
        }
        _ => Error::io(path, &error),
    };
    let file = decode::open(path)?;
    let length = file.size().map_err(fail)?;
    let name: Arc<Path> = path.into();
    let mut archive = tar::Archive::new(file);
    for entry in archive.entries_with_seek().map_err(fail)? {
        if found.len() >= most {
            break;
        }
        let entry = entry.map_err(fail)?;
        if !entry.header().entry_type().is_file() {
            continue;
        }
        let (at, size) = (entry.raw_file_position(), entry.size());
        let member = String::from_utf8_lossy(&entry.path_bytes()).into_owned();
        if at.checked_add(size).is_none_or(|end| end > length) {
            return Err(Error::new(format!("the tar file ends within `{member}`")).in_file(path));
        }
        found.push(TarMember { archive: name.clone(), name: member, at, size });
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::encode::tar::TarWriter;
    use std::fs::File;

    #[test]
    fn members_are_read_in_any_order() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("a.tar");
        let mut archive = TarWriter::new(File::create(&path).expect("a file"), "a.tar");
        let long = format!("{}b.json", "ab/".repeat(60));
        for (name, bytes) in [("a.txt", &b"first"[..]), (&long, &[7; 700]), ("c", b"")] {
            archive.add(name, bytes).expect("added");
        }
        archive.finish().expect("ended");
        let (found, damage) = members(&path);
        assert!(damage.is_none(), "{damage:?}");
        assert_eq!(found.iter().map(|it| it.name.as_str()).collect::<Vec<_>>(), ["a.txt", &long, "c"]);
        assert_eq!(found[1].content().expect("read").bytes(), [7; 700]);
        assert_eq!(found[0].content().expect("read").bytes(), b"first");
        assert!(found[2].content().expect("read").bytes().is_empty());

        // The file is cut off within the second member.
        let bytes = std::fs::read(&path).expect("read");
        std::fs::write(&path, &bytes[..bytes.len() - 2048]).expect("written");
        let (found, damage) = members(&path);
        let damage = damage.expect("damaged").to_string();
        assert!(found.len() == 1 && damage.contains("b.json`") && damage.contains("a.tar"), "{damage}");
        std::fs::write(&path, [b'x'; 900]).expect("written");
        let (found, damage) = members(&path);
        let damage = damage.expect("no archive").to_string();
        assert!(found.is_empty() && damage.contains("not a readable tar file"), "{damage}");
    }
}
