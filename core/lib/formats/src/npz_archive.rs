//! NumPy archives, read array by array.

use crate::decode::{self, FileContent};
use crate::samples;
use std::borrow::Cow;
use std::collections::BTreeSet;
use std::io::{BufReader, Cursor, Read, Seek};
use std::path::{Path, PathBuf};
use syntable_model::error::{Error, Result};
use syntable_model::limits::{ARCHIVE_MEMBERS, MEMBER_BYTES};
use syntable_model::mirror::DatasetFile;
use syntable_model::panics::guarded;
use syntable_model::scene::InstanceId;
use zip::{CompressionMethod, ZipArchive};

/// Extension of an archive.
pub const ARCHIVE: &str = "npz";
/// Name of the array of the instances' ids.
pub const IDS: &str = "ids";

/// Extension of an array in an archive, with its dot.
const ARRAY_END: &str = ".npy";
/// Name of the library in errors.
const LIBRARY: &str = "the library that reads ZIP archives";

/// An open archive. An array is read only when it is requested.
pub struct NpzArchive<R> {
    zip: ZipArchive<R>,
    path: PathBuf,
}

impl NpzArchive<BufReader<DatasetFile>> {
    /// Opens a file.
    pub fn open(path: &Path) -> Result<Self> {
        Self::new(BufReader::new(decode::open(path)?), path)
    }
}

impl NpzArchive<Cursor<Vec<u8>>> {
    /// Opens an archive in memory; `path` names it in messages.
    pub fn of_bytes(bytes: Vec<u8>, path: &Path) -> Result<Self> {
        Self::new(Cursor::new(bytes), path)
    }
}

impl<R: Read + Seek> NpzArchive<R> {
    fn new(reader: R, path: &Path) -> Result<Self> {
        let refuse = |error| Error::new(format!("not a readable NumPy archive: {error}")).in_file(path);
        let zip = guarded(LIBRARY, path, || ZipArchive::new(reader).map_err(refuse))?;
        ARCHIVE_MEMBERS.check(zip.len() as u64).map_err(|error| error.in_file(path))?;
        Ok(Self { zip, path: path.to_owned() })
    }

    /// Name of the archive in messages.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Names of its arrays, without the array of ids.
    pub fn names(&self) -> BTreeSet<String> {
        let names = self.zip.file_names().flatten();
        let names = names.filter_map(|name| name.strip_suffix(ARRAY_END).map(str::to_owned));
        names.filter(|name| name != IDS).collect()
    }

    /// Names of members that are neither arrays nor folders.
    pub fn others(&self) -> Vec<String> {
        let name =
            |index| self.zip.name_for_index(index).and_then(Result::ok).map_or_else(|| "?".to_owned(), Cow::into_owned);
        let is_other = |name: &String| !name.ends_with(ARRAY_END) && !name.ends_with('/');
        (0..self.zip.len()).map(name).filter(is_other).collect()
    }

    /// Whether no array is compressed, so that the arrays together are smaller than the archive.
    pub fn is_stored(&mut self) -> Result<bool> {
        for index in 0..self.zip.len() {
            let member = self.zip.by_index_raw(index);
            let member =
                member.map_err(|error| Error::new(format!("the archive is damaged: {error}")).in_file(&self.path))?;
            if member.compression() != CompressionMethod::Stored {
                return Ok(false);
            }
        }
        Ok(true)
    }

    /// The ids of the instances along the first axes; none if the archive has no array of ids.
    pub fn ids(&mut self) -> Result<Option<Vec<InstanceId>>> {
        if self.zip.index_for_name(&format!("{IDS}{ARRAY_END}")).is_none() {
            return Ok(None);
        }
        let content = self.array(IDS)?;
        samples::ids_of(&content.npy()?).map(Some).map_err(|reason| content.refuse(reason))
    }

    /// The content of an array, as a NumPy file.
    pub fn array(&mut self, name: &str) -> Result<FileContent> {
        let path = self.path.join(format!("{name}{ARRAY_END}"));
        guarded(LIBRARY, &path.clone(), || self.unpacked(name, path))
    }

    fn unpacked(&mut self, name: &str, path: PathBuf) -> Result<FileContent> {
        let refuse = |what: String| Error::new(what).in_file(&path);
        let file = self.zip.by_name(&format!("{name}{ARRAY_END}"));
        let file = file.map_err(|error| refuse(format!("the archive has no such array: {error}")))?;
        let mut bytes = Vec::new();
        let size = file.size();
        MEMBER_BYTES.check(size).map_err(|error| error.in_file(&path))?;
        // An array that is larger than the archive states is damaged. The library verifies the checksum at the end of
        // the array.
        file.take(size + 1)
            .read_to_end(&mut bytes)
            .map_err(|error| refuse(format!("the array is damaged: {error}")))?;
        Ok(FileContent::new(bytes, path.clone()))
    }
}
