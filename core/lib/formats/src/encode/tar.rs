//! Archives of samples for WebDataset: plain tar files.

use std::io::{Read, Seek, Write};
use syntable_model::error::{Error, Result};
use tar::{Builder, EntryType, Header};

/// Permissions of all members: readable by all, writable by the owner.
const MODE: u32 = 0o644;

/// A tar file that is being written. Members have no time and no owner, so that the same members always give the same
/// bytes.
pub struct TarWriter<W: Write> {
    builder: Builder<W>,
    /// Names the file in errors.
    path: String,
}

impl<W: Write> TarWriter<W> {
    /// Starts an archive. `path` names it in errors.
    pub fn new(out: W, path: impl Into<String>) -> Self {
        Self { builder: Builder::new(out), path: path.into() }
    }

    /// Adds a member. The members of a sample must follow each other.
    pub fn add(&mut self, name: &str, bytes: &[u8]) -> Result<()> {
        let mut header = Header::new_ustar();
        header.set_entry_type(EntryType::Regular);
        header.set_mode(MODE);
        header.set_uid(0);
        header.set_gid(0);
        header.set_mtime(0);
        header.set_size(bytes.len() as u64);
        self.builder.append_data(&mut header, name, bytes).map_err(|error| Error::io(&self.path, &error))
    }

    /// Ends the archive.
    pub fn finish(self) -> Result<()> {
        let path = self.path;
        let flushed = self.builder.into_inner().and_then(|mut out| out.flush());
        flushed.map_err(|error| Error::io(path, &error))
    }
}

/// Calls `each` with the name and the content of every member of an archive, in order. Unread content is skipped: an
/// archive that is cut off inside it ends with this member. `path` names the archive in errors.
pub fn for_each_member(
    archive: impl Read + Seek,
    path: &str,
    mut each: impl FnMut(&str, &mut dyn Read) -> Result<()>,
) -> Result<()> {
    let fail = |error: std::io::Error| Error::io(path, &error);
    let mut archive = tar::Archive::new(archive);
    for entry in archive.entries_with_seek().map_err(fail)? {
        let mut entry = entry.map_err(fail)?;
        let name = String::from_utf8_lossy(&entry.path_bytes()).into_owned();
        each(&name, &mut entry)?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn members_are_read_back_or_skipped() {
        let long = format!("{}end", "ab/".repeat(60));
        let mut bytes = Vec::new();
        let mut archive = TarWriter::new(&mut bytes, "a.tar");
        let members = [("first", vec![1; 700]), (long.as_str(), vec![2; 512]), ("last", vec![3])];
        members.iter().for_each(|(name, content)| archive.add(name, content).expect("added"));
        archive.finish().expect("ended");
        let mut found = Vec::new();
        for_each_member(std::io::Cursor::new(&bytes), "a.tar", |name, content| {
            let mut read = Vec::new();
            if name != "first" {
                content.read_to_end(&mut read).expect("readable");
            }
            found.push((name.to_owned(), read));
            Ok(())
        })
        .expect("an archive");
        assert_eq!(found.iter().map(|(_, read)| read.len()).collect::<Vec<_>>(), [0, 512, 1]);
        assert_eq!((found[0].0.as_str(), &found[1].0, found[2].1[0]), ("first", &long, 3));
        // The cut is in the header of the second member.
        let cut = for_each_member(std::io::Cursor::new(&bytes[..512 + 1024 + 100]), "a.tar", |_, _| Ok(()));
        assert!(cut.is_err());
    }

    /// Checks fields of the header at the offsets that POSIX defines.
    #[test]
    fn members_have_no_time_and_no_owner() {
        let mut bytes = Vec::new();
        let mut archive = TarWriter::new(&mut bytes, "a.tar");
        archive.add("000001_0002.rgb.png", b"abc").expect("added");
        archive.finish().expect("ended");
        assert_eq!(bytes.len(), 512 + 512 + 1024);
        let text = |range: std::ops::Range<usize>| {
            String::from_utf8_lossy(&bytes[range]).trim_end_matches(['\0', ' ']).to_owned()
        };
        assert_eq!(text(0..100), "000001_0002.rgb.png");
        let number = |range| u64::from_str_radix(&text(range), 8).expect("octal");
        assert_eq!([100..108, 108..116, 116..124, 124..136, 136..148].map(number), [0o644, 0, 0, 3, 0]);
        assert_eq!((text(156..157), text(257..262), text(265..297)), ("0".into(), "ustar".into(), String::new()));
        assert_eq!(&bytes[512..516], b"abc\0");
    }
}
