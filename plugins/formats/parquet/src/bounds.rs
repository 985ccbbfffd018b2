//! Compares sizes in a Parquet file with the limits before the format's library reads it.
//!
//! The library allocates memory for the sizes in headers: the children of a group of the schema, the bytes of a page,
//! the text of a statistic. It also recurses once per level of the schema. Both can end the process. Therefore this
//! module first reads the footer and the page headers, in Thrift's compact protocol, without a tree in memory. All
//! other damage is left to the library.

use parquet::basic::{Encoding, Type as Physical};
use parquet::column::page::Page as DataPage;
use parquet::column::reader::ColumnReader;
use parquet::data_type::ByteArray;
use parquet::errors::ParquetError;
use parquet::file::metadata::{ColumnChunkMetaData, ParquetMetaData};
use parquet::file::reader::FileReader;
use std::io::{Read, Seek, SeekFrom};
use syntable_model::error::{Error, Result};
use syntable_model::limits::{NESTING, PAGE_BYTES, TABLE_BYTES, TABLE_VALUES, TEXT_BYTES};

/// Magic bytes at the end of a file, after the length of the footer.
const MAGIC: &[u8] = b"PAR1";
/// Bytes of the length of the footer and of [`MAGIC`].
const TAIL: u64 = 8;
/// Largest header of a page: a few numbers, and statistics with the smallest and the largest value.
const PAGE_HEADER: u64 = 1 << 20;
/// Bytes that are first read of a page to find its header, and the factor of growth while the header is incomplete.
const PAGE_START: u64 = 4 << 10;
const PAGE_GROWTH: u64 = 16;

/// Types of the compact protocol that this module distinguishes.
const TRUE: u8 = 1;
const FALSE: u8 = 2;
const LIST: u8 = 9;
const STRUCT: u8 = 12;

/// Fields of `FileMetaData` and of `SchemaElement`.
const SCHEMA: i16 = 2;
const NUM_CHILDREN: i16 = 5;
/// Fields of `PageHeader`.
const UNCOMPRESSED: i16 = 2;
const COMPRESSED: i16 = 3;
/// Fields of `PageHeader` with the headers of each kind of page: data, dictionary, and data in the second version. The
/// first field of each is the number of its values. The second number of each pair is the field with the encoding of
/// its values.
const KINDS: [(i16, i16); 3] = [(5, 2), (7, 2), (8, 4)];
const OF_DICTIONARY: i16 = 7;
const NUM_VALUES: i16 = 1;
/// The encodings `DELTA_LENGTH_BYTE_ARRAY` and `DELTA_BYTE_ARRAY`.
const DELTAS: [i64; 2] = [6, 7];

/// The error of a file that cannot be read. A store that does not answer says nothing about the file.
fn failed(error: &std::io::Error) -> Error {
    let of_store = error.get_ref().and_then(|inner| inner.downcast_ref::<Error>());
    of_store.cloned().unwrap_or_else(|| damaged(&error.to_string()))
}

fn damaged(what: &str) -> Error {
    Error::new(format!("not a readable Parquet file: {what}"))
}

/// Compares the footer with the limits: the levels of the schema, and the stated against the actual number of children.
pub fn check_footer(file: &mut (impl Read + Seek)) -> Result<()> {
    let io = |error: std::io::Error| failed(&error);
    let length = file.seek(SeekFrom::End(0)).map_err(io)?;
    let mut tail = [0; TAIL as usize];
    if length < TAIL {
        return Ok(());
    }
    file.seek(SeekFrom::Start(length - TAIL)).and_then(|_| file.read_exact(&mut tail)).map_err(io)?;
    let footer = u64::from(u32::from_le_bytes([tail[0], tail[1], tail[2], tail[3]]));
    // The library reports the error.
    if &tail[4..] != MAGIC || footer > length - TAIL {
        return Ok(());
    }
    TEXT_BYTES.check(footer)?;
    let bytes = read_range(file, length - TAIL - footer, footer)?;
    let mut thrift = Thrift { bytes: &bytes, at: 0 };
    thrift.fields(|thrift, id, kind| match (id, kind) {
        (SCHEMA, LIST) => thrift.schema(),
        _ => thrift.skip(kind, DEEPEST),
    })
}

/// Columns whose text sizes are not bounded by headers, by row group and column.
#[derive(Debug, Default, PartialEq, Eq)]
pub struct Uncounted {
    /// Lists of texts that would exceed the limit if all elements were as long as the dictionary.
    lists: Vec<(usize, usize)>,
    /// Texts that are stored as differences from each other.
    deltas: Vec<(usize, usize)>,
}

/// Compares the pages of some columns with the limits. Returns the columns that [`check_texts`] must count.
pub fn check_pages(
    file: &mut (impl Read + Seek),
    metadata: &ParquetMetaData,
    wanted: impl Fn(&str) -> bool,
) -> Result<Uncounted> {
    let length = file.seek(SeekFrom::End(0)).map_err(|error| failed(&error))?;
    let (mut table, mut listed, mut found) = (Sums::default(), 0_u64, Uncounted::default());
    for (group_number, group) in metadata.row_groups().iter().enumerate() {
        let columns = group.columns().iter().enumerate();
        // Rows take memory even if all their values repeat.
        let rows = u64::try_from(group.num_rows()).map_err(|_| damaged("a negative number of rows"))?;
        for (number, column) in
            columns.filter(|(_, it)| it.column_path().parts().first().is_some_and(|name| wanted(name)))
        {
            let of_column = pages(file, length, column)?;
            table.values = table.values.saturating_add(of_column.values.max(rows));
            table.bytes = table.bytes.saturating_add(of_column.bytes);
            TABLE_VALUES.check(table.values)?;
            TABLE_BYTES.check(table.bytes)?;
            let descriptor = column.column_descr();
            if descriptor.max_rep_level() > 0 && descriptor.physical_type() == Physical::BYTE_ARRAY {
                // Every element of a list of texts is a copy of a dictionary entry, or a part of a page.
                let most = of_column.dictionary.saturating_mul(of_column.values).saturating_add(of_column.bytes);
                listed = listed.saturating_add(most);
                found.lists.push((group_number, number));
            }
            if of_column.has_deltas {
                found.deltas.push((group_number, number));
            }
        }
    }
    // Lists within the limit even if all elements are as long as the dictionary need no count.
    if listed <= TABLE_BYTES.most {
        found.lists.clear();
    }
    Ok(found)
}

/// Number of rows whose texts are decoded at once.
const ROWS_AT_ONCE: usize = 64;

/// Compares the texts of some columns with the limit. One row may have a list of millions of copies of a long
/// dictionary entry, so the lengths are summed before any row is read. Values decoded from a dictionary share its
/// memory. Values decoded from differences do not, so they are summed first, without the library.
pub fn check_texts(reader: &impl FileReader, columns: Uncounted) -> Result<()> {
    let fail = |error: ParquetError| damaged(&error.to_string());
    TABLE_BYTES.check(delta_bytes(reader, &columns.deltas)?)?;
    let mut bytes = 0_u64;
    for (group, column) in columns.lists {
        let column = reader.get_row_group(group).and_then(|group| group.get_column_reader(column)).map_err(fail)?;
        let ColumnReader::ByteArrayColumnReader(mut column) = column else { continue };
        let (mut definition, mut repetition, mut values) = (Vec::new(), Vec::new(), Vec::<ByteArray>::new());
        loop {
            let read = column.read_records(ROWS_AT_ONCE, Some(&mut definition), Some(&mut repetition), &mut values);
            let (rows, _, levels) = read.map_err(fail)?;
            bytes = values.iter().fold(bytes, |sum, text| sum.saturating_add(text.len() as u64));
            TABLE_BYTES.check(bytes)?;
            if rows == 0 && levels == 0 {
                break;
            }
            definition.clear();
            repetition.clear();
            values.clear();
        }
    }
    Ok(())
}

/// Bytes of the values in pages that store differences, for some columns. For each text, `DELTA_BYTE_ARRAY` stores the
/// number of bytes that it shares with the text before, so a page of a few bytes may expand to gigabytes. Stops above
/// the limit.
fn delta_bytes(reader: &impl FileReader, columns: &[(usize, usize)]) -> Result<u64> {
    let fail = |error: ParquetError| damaged(&error.to_string());
    let mut bytes = 0_u64;
    for &(group, number) in columns {
        let group = reader.get_row_group(group).map_err(fail)?;
        let descriptor = group.metadata().column(number).column_descr_ptr();
        let levels = [descriptor.max_rep_level(), descriptor.max_def_level()];
        let mut pages = group.get_column_page_reader(number).map_err(fail)?;
        while let Some(page) = pages.get_next_page().map_err(fail)? {
            let (encoding, values) = (page.encoding(), u64::from(page.num_values()));
            let lists = match encoding {
                Encoding::DELTA_LENGTH_BYTE_ARRAY => 1,
                Encoding::DELTA_BYTE_ARRAY => 2,
                _ => continue,
            };
            let mut data = Thrift { bytes: values_of(&page, levels)?, at: 0 };
            // The lengths of shared prefixes and then of the remainders of each text; or the lengths of whole texts.
            for _ in 0..lists {
                data.lengths(values, |length| bytes = bytes.saturating_add(length))?;
            }
            if bytes > TABLE_BYTES.most {
                return Ok(bytes);
            }
        }
    }
    Ok(bytes)
}

/// The values of a data page, which follow its repetition and definition levels.
fn values_of(page: &DataPage, levels: [i16; 2]) -> Result<&[u8]> {
    let cut = || damaged("the levels of a page are cut off");
    let skip = |bytes: &'_ [u8], count: u64| usize::try_from(count).ok().filter(|count| *count <= bytes.len());
    match page {
        DataPage::DataPage { buf, num_values, rep_level_encoding, def_level_encoding, .. } => {
            let mut rest = &buf[..];
            for (most, encoding) in levels.into_iter().zip([rep_level_encoding, def_level_encoding]) {
                if most == 0 {
                    continue;
                }
                let count = match encoding {
                    Encoding::RLE => {
                        let (length, _) = rest.split_first_chunk().ok_or_else(cut)?;
                        4 + u64::from(u32::from_le_bytes(*length))
                    }
                    // Every level takes the same number of bits.
                    _ => (u64::from(*num_values) * u64::from(i16::BITS - most.leading_zeros())).div_ceil(8),
                };
                rest = &rest[skip(rest, count).ok_or_else(cut)?..];
            }
            Ok(rest)
        }
        DataPage::DataPageV2 { buf, def_levels_byte_len, rep_levels_byte_len, .. } => {
            let count = u64::from(*def_levels_byte_len) + u64::from(*rep_levels_byte_len);
            Ok(&buf[skip(buf, count).ok_or_else(cut)?..])
        }
        DataPage::DictionaryPage { .. } => Ok(&[]),
    }
}

/// Sums over pages.
#[derive(Default)]
struct Sums {
    values: u64,
    bytes: u64,
    /// Bytes of the dictionary.
    dictionary: u64,
    /// Whether a page stores texts as differences.
    has_deltas: bool,
}

/// Sums the pages of a column by their headers.
fn pages(file: &mut (impl Read + Seek), length: u64, column: &ColumnChunkMetaData) -> Result<Sums> {
    let number = |value: i64| u64::try_from(value).map_err(|_| damaged("a column starts or ends before the file"));
    let start = number(column.dictionary_page_offset().unwrap_or_else(|| column.data_page_offset()))?;
    number(column.data_page_offset())?;
    let end = start.checked_add(number(column.compressed_size())?).filter(|end| *end <= length);
    let end = end.ok_or_else(|| damaged("a column ends beyond the file"))?;
    let (mut sums, mut at) = (Sums::default(), start);
    while at < end {
        let (most, mut start) = (PAGE_HEADER.min(end - at), PAGE_START);
        let (page, header) = loop {
            let size = start.min(most);
            match PageHeader::of(&read_range(file, at, size)?) {
                // The header may be incomplete.
                Err(_) if size < most => start *= PAGE_GROWTH,
                page => break page?,
            }
        };
        let [uncompressed, compressed, values] = [page.uncompressed, page.compressed, page.values]
            .map(|value| u64::try_from(value).map_err(|_| damaged("a page of a negative size")));
        let (uncompressed, compressed, values) = (uncompressed?, compressed?, values?);
        PAGE_BYTES.check(uncompressed.max(compressed))?;
        sums.bytes = sums.bytes.saturating_add(uncompressed);
        sums.has_deltas |= DELTAS.contains(&page.encoding);
        match page.is_dictionary {
            true => sums.dictionary = sums.dictionary.max(uncompressed),
            false => sums.values = sums.values.saturating_add(values),
        }
        // The library also reads the values of a dictionary at once.
        TABLE_VALUES.check(sums.values.max(values))?;
        at = at.saturating_add(header).saturating_add(compressed);
    }
    Ok(sums)
}

/// The sizes in the header of a page.
#[derive(Default)]
struct PageHeader {
    uncompressed: i64,
    compressed: i64,
    values: i64,
    encoding: i64,
    is_dictionary: bool,
}

impl PageHeader {
    /// Reads the header at the start of some bytes. Returns the header and its length in bytes.
    fn of(bytes: &[u8]) -> Result<(Self, u64)> {
        let mut thrift = Thrift { bytes, at: 0 };
        let mut page = Self::default();
        thrift.fields(|thrift, id, kind| match id {
            UNCOMPRESSED => thrift.integer(kind).map(|value| page.uncompressed = value),
            COMPRESSED => thrift.integer(kind).map(|value| page.compressed = value),
            id => match KINDS.iter().find(|(of, _)| *of == id && kind == STRUCT) {
                Some((_, encoding)) => {
                    page.is_dictionary |= id == OF_DICTIONARY;
                    thrift.fields(|thrift, id, kind| match id {
                        NUM_VALUES => thrift.integer(kind).map(|value| page.values = value),
                        id if id == *encoding => thrift.integer(kind).map(|value| page.encoding = value),
                        _ => thrift.skip(kind, DEEPEST),
                    })
                }
                None => thrift.skip(kind, DEEPEST),
            },
        })?;
        Ok((page, thrift.at as u64))
    }
}

fn read_range(file: &mut (impl Read + Seek), start: u64, length: u64) -> Result<Vec<u8>> {
    let mut bytes = vec![0; length as usize];
    let read = file.seek(SeekFrom::Start(start)).and_then(|_| file.read_exact(&mut bytes));
    read.map_err(|error| failed(&error))?;
    Ok(bytes)
}

/// Maximum nesting of structures and lists in the format, with a margin.
const DEEPEST: u32 = 16;

/// A position in bytes of Thrift's compact protocol.
struct Thrift<'b> {
    bytes: &'b [u8],
    at: usize,
}

impl Thrift<'_> {
    fn byte(&mut self) -> Result<u8> {
        let byte = self.bytes.get(self.at).copied().ok_or_else(|| damaged("a header is cut off"))?;
        self.at += 1;
        Ok(byte)
    }

    /// An unsigned number in groups of seven bits, the lowest group first.
    fn varint(&mut self) -> Result<u64> {
        let mut value = 0;
        for shift in (0..64).step_by(7) {
            let byte = self.byte()?;
            value |= u64::from(byte & 0x7f) << shift;
            if byte & 0x80 == 0 {
                return Ok(value);
            }
        }
        Err(damaged("a number of more than 64 bits"))
    }

    /// A signed number of 16, 32 or 64 bits.
    fn integer(&mut self, kind: u8) -> Result<i64> {
        if !(4..=6).contains(&kind) {
            return Err(damaged("a number of another type"));
        }
        let value = self.varint()?;
        Ok((value >> 1) as i64 ^ -((value & 1) as i64))
    }

    /// The fields of a structure: `each` reads or skips the value of a field, given its id and its type.
    fn fields(&mut self, mut each: impl FnMut(&mut Self, i16, u8) -> Result<()>) -> Result<()> {
        let mut id = 0_i16;
        loop {
            let head = self.byte()?;
            if head == 0 {
                return Ok(());
            }
            let (delta, kind) = (head >> 4, head & 0x0f);
            id = match delta {
                0 => self.integer(6)? as i16,
                delta => id.wrapping_add(delta.into()),
            };
            each(self, id, kind)?;
        }
    }

    /// Number and type of the elements of a list. Each element takes at least one byte.
    fn list(&mut self) -> Result<(u64, u8)> {
        let head = self.byte()?;
        let count = if head >> 4 == 15 { self.varint()? } else { u64::from(head >> 4) };
        if count > (self.bytes.len() - self.at) as u64 {
            return Err(damaged("a list is longer than its header"));
        }
        Ok((count, head & 0x0f))
    }

    fn skip_bytes(&mut self, count: u64) -> Result<()> {
        let rest = (self.bytes.len() - self.at) as u64;
        if count > rest {
            return Err(damaged("a text is longer than its header"));
        }
        self.at += count as usize;
        Ok(())
    }

    /// Skips a value of a type.
    fn skip(&mut self, kind: u8, depth: u32) -> Result<()> {
        let inner = || depth.checked_sub(1).ok_or_else(|| damaged("its header is nested too deeply"));
        match kind {
            // The type of a boolean field is its value.
            TRUE | FALSE => Ok(()),
            3 => self.skip_bytes(1),
            4..=6 => self.varint().map(drop),
            7 => self.skip_bytes(8),
            8 => {
                let count = self.varint()?;
                self.skip_bytes(count)
            }
            LIST | 10 => {
                let ((count, kind), depth) = (self.list()?, inner()?);
                (0..count).try_for_each(|_| self.skip_element(kind, depth))
            }
            11 => {
                let count = self.varint()?;
                let kinds = if count > 0 { self.byte()? } else { 0 };
                let depth = inner()?;
                // Each entry takes at least one byte; otherwise the loop ends with the bytes.
                (0..count).try_for_each(|_| {
                    self.skip_element(kinds >> 4, depth)?;
                    self.skip_element(kinds & 0x0f, depth)
                })
            }
            STRUCT => {
                let depth = inner()?;
                self.fields(|thrift, _, kind| thrift.skip(kind, depth))
            }
            13 => self.skip_bytes(16),
            _ => Err(damaged("a header has a value of an unknown type")),
        }
    }

    /// Skips an element of a list, where a boolean takes one byte.
    fn skip_element(&mut self, kind: u8, depth: u32) -> Result<()> {
        match kind {
            TRUE | FALSE => self.skip_bytes(1),
            kind => self.skip(kind, depth),
        }
    }

    /// The lengths in one list of the encoding `DELTA_BINARY_PACKED`. A list has at most as many lengths as the page
    /// has values, but the library allocates for the stated number. The library refuses negative lengths.
    fn lengths(&mut self, most: u64, mut each: impl FnMut(u64)) -> Result<()> {
        let (block, parts, count, first) = (self.varint()?, self.varint()?, self.varint()?, self.integer(6)?);
        if count > most {
            return Err(damaged(&format!("a page of {most} values has {count} lengths")));
        }
        let of_part = block.checked_div(parts).filter(|of_part| *of_part > 0 && of_part.is_multiple_of(32));
        let of_part = of_part.ok_or_else(|| damaged("lengths in blocks of a size that the format does not have"))?;
        let (mut length, mut left) = (first as i32, count);
        let mut tell = |length: i32| each(u64::try_from(length).unwrap_or(0));
        if left > 0 {
            tell(length);
            left -= 1;
        }
        while left > 0 {
            let least = self.integer(6)? as i32;
            let start = self.at;
            self.skip_bytes(parts)?;
            for part in start..self.at {
                if left == 0 {
                    break;
                }
                let bits = usize::from(self.bytes[part]);
                if bits > 32 {
                    return Err(damaged("a length of more than 32 bits"));
                }
                let packed = self.at;
                self.skip_bytes(of_part.checked_mul(bits as u64).ok_or_else(|| damaged("a block is too long"))? / 8)?;
                for index in 0..left.min(of_part) as usize {
                    let (byte, shift) = (packed + index * bits / 8, index * bits % 8);
                    let mut word = [0; 8];
                    let there = &self.bytes[byte..self.bytes.len().min(byte + 8)];
                    word[..there.len()].copy_from_slice(there);
                    let delta = (u64::from_le_bytes(word) >> shift) & ((1 << bits) - 1);
                    length = length.wrapping_add(least).wrapping_add(delta as u32 as i32);
                    tell(length);
                }
                left -= left.min(of_part);
            }
        }
        Ok(())
    }

    /// The elements of the schema in depth-first order. A group states the number of its children.
    fn schema(&mut self) -> Result<()> {
        let (count, kind) = self.list()?;
        if kind != STRUCT {
            return Err(damaged("its schema is no list of elements"));
        }
        // The remaining children of each group around an element.
        let mut open: Vec<u64> = Vec::new();
        for element in 0..count {
            let mut children = 0;
            self.fields(|thrift, id, kind| match id {
                NUM_CHILDREN => thrift.integer(kind).map(|count| children = count),
                _ => thrift.skip(kind, DEEPEST),
            })?;
            if let Some(last) = open.last_mut() {
                *last -= 1;
            }
            let children = u64::try_from(children).map_err(|_| damaged("a group of a negative number of columns"))?;
            if children > count - element - 1 {
                return Err(damaged(&format!("a group of {children} columns, and the schema has {count} elements")));
            }
            open.push(children);
            NESTING.check(open.len() as u64)?;
            while open.last() == Some(&0) {
                open.pop();
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use parquet::basic::Compression;
    use parquet::data_type::Int64Type;
    use parquet::data_type::{ByteArrayType, DataType};
    use parquet::file::properties::{WriterProperties, WriterVersion};
    use parquet::file::reader::SerializedFileReader;
    use parquet::file::writer::SerializedFileWriter;
    use parquet::schema::parser::parse_message_type;
    use std::fs::File;
    use std::io::Write;
    use std::sync::Arc;

    /// A file that consists of a footer with a schema of groups with these numbers of children.
    fn check(children: &[u8]) -> Result<()> {
        let mut footer = vec![0x15, 2, 0x19, 0xfc];
        // The version in zigzag form, then a list of structures and its length.
        assert!(children.len() < 1 << 14);
        footer.extend([children.len() as u8 | 0x80, (children.len() >> 7) as u8]);
        for count in children {
            // Field 4 is a string, field 5 is a number.
            footer.extend([0x48, 1, b'x', 0x15, 2 * count, 0]);
        }
        footer.push(0);
        let mut file = tempfile::tempfile().expect("a file");
        let length = (footer.len() as u32).to_le_bytes();
        file.write_all(&[MAGIC, &footer, &length, MAGIC].concat()).expect("written");
        check_footer(&mut file)
    }

    #[test]
    fn schemas_are_walked_without_recursion() {
        assert_eq!(check(&[2, 1, 0, 0]), Ok(()));
        let deep: Vec<u8> = [vec![1; 126], vec![0]].concat();
        assert_eq!(check(&deep), Ok(()));
        let deeper = [vec![1; 9000], vec![0]].concat();
        let error = check(&deeper).expect_err("too deep").to_string();
        assert!(error.contains("128 levels") && error.contains("limit of 127"), "{error}");
        let error = check(&[60, 0]).expect_err("too many").to_string();
        assert!(error.contains("a group of 60 columns, and the schema has 2 elements"), "{error}");
    }

    /// A file with one column of zeros.
    fn zeros(rows: usize) -> File {
        let mut file = tempfile::tempfile().expect("a file");
        let schema = Arc::new(parse_message_type("message m { REQUIRED INT64 a; }").expect("a schema"));
        let properties = Arc::new(WriterProperties::builder().set_compression(Compression::SNAPPY).build());
        let mut writer = SerializedFileWriter::new(&mut file, schema, properties).expect("a writer");
        let mut group = writer.next_row_group().expect("a group");
        let mut column = group.next_column().expect("a column").expect("the column");
        let batch = vec![0; 1 << 20];
        for start in (0..rows).step_by(batch.len()) {
            let values = &batch[..batch.len().min(rows - start)];
            column.typed::<Int64Type>().write_batch(values, None, None).expect("written");
        }
        column.close().expect("closed");
        group.close().expect("closed");
        writer.close().expect("closed");
        file
    }

    #[test]
    fn pages_have_the_values_that_the_footer_states() {
        let mut file = zeros(100_000);
        check_footer(&mut file).expect("sound");
        let reader = SerializedFileReader::new(file.try_clone().expect("a file")).expect("readable");
        let column = reader.metadata().row_group(0).column(0);
        let length = file.metadata().expect("a file").len();
        let sums = pages(&mut file, length, column).expect("sound");
        assert_eq!(sums.values, 100_000);
        // Headers are not part of the pages.
        let stated = column.uncompressed_size() as u64;
        assert!(sums.bytes <= stated && sums.bytes + 200 > stated, "{} of {stated}", sums.bytes);
        assert!(check_pages(&mut file, reader.metadata(), |name| name == "a").is_ok());
    }

    /// A file with one column of a type.
    fn column<T: DataType>(schema: &str, properties: WriterProperties, values: &[T::T], levels: &[[i16; 2]]) -> File {
        let mut file = tempfile::tempfile().expect("a file");
        let schema = Arc::new(parse_message_type(schema).expect("a schema"));
        let mut writer = SerializedFileWriter::new(&mut file, schema, Arc::new(properties)).expect("a writer");
        let mut group = writer.next_row_group().expect("a group");
        let mut column = group.next_column().expect("a column").expect("the column");
        let [definition, repetition] = [0, 1].map(|of| levels.iter().map(|pair| pair[of]).collect::<Vec<i16>>());
        let levels = [&definition, &repetition].map(|all| (!all.is_empty()).then_some(&all[..]));
        column.typed::<T>().write_batch(values, levels[0], levels[1]).expect("written");
        column.close().expect("closed");
        group.close().expect("closed");
        writer.close().expect("closed");
        file
    }

    /// A reader of a file that counts the bytes.
    struct CountedReader(File, u64);

    impl Read for CountedReader {
        fn read(&mut self, bytes: &mut [u8]) -> std::io::Result<usize> {
            let read = self.0.read(bytes)?;
            self.1 += read as u64;
            Ok(read)
        }
    }

    impl Seek for CountedReader {
        fn seek(&mut self, to: SeekFrom) -> std::io::Result<u64> {
            self.0.seek(to)
        }
    }

    #[test]
    fn headers_are_read_in_pieces() {
        let builder = || WriterProperties::builder().set_dictionary_enabled(false).set_write_batch_size(1);
        let small = builder().set_data_page_row_count_limit(1).build();
        let values: Vec<i64> = (0..20_000).collect();
        let file = column::<Int64Type>("message m { REQUIRED INT64 a; }", small, &values, &[]);
        // Statistics contain the smallest and the largest value, which are longer than the first read.
        let long = builder().set_data_page_row_count_limit(2).set_statistics_truncate_length(None);
        let long = long.set_write_page_header_statistics(true).build();
        let texts: Vec<ByteArray> = (0..20_u8).map(|i| vec![i; 30_000].into()).collect();
        let long = column::<ByteArrayType>("message m { REQUIRED BINARY a; }", long, &texts, &[]);
        for (file, values, most) in
            [(file, 20_000, 20_000 * PAGE_START), (long, 20, 10 * 20 * PAGE_GROWTH * PAGE_START)]
        {
            let reader = SerializedFileReader::new(file.try_clone().expect("a file")).expect("readable");
            let length = file.metadata().expect("a file").len();
            let mut file = CountedReader(file, 0);
            let sums = pages(&mut file, length, reader.metadata().row_group(0).column(0)).expect("sound");
            assert_eq!(sums.values, values);
            let is_long = values == 20;
            assert!(!is_long || file.1 > 10 * 30_000, "headers have no statistics");
            assert!(file.1 <= most, "{} bytes were read, more than {most}", file.1);
        }
    }

    #[test]
    fn texts_of_lists_are_counted_before_they_are_copied() {
        let check = |length: usize, elements: usize| {
            let schema = "message m { REPEATED BINARY a (UTF8); }";
            let texts: Vec<ByteArray> = vec!["x".repeat(length).as_str().into(); elements];
            let levels: Vec<[i16; 2]> = (0..elements).map(|element| [1, i16::from(element > 0)]).collect();
            let file = column::<ByteArrayType>(schema, WriterProperties::default(), &texts, &levels);
            assert!(file.metadata().expect("a file").len() < 2 << 20, "the text is there once");
            let reader = SerializedFileReader::new(file.try_clone().expect("a file")).expect("readable");
            let uncounted = check_pages(&mut file.try_clone().expect("a file"), reader.metadata(), |_| true)?;
            assert_eq!(uncounted.lists.is_empty(), length * elements + (1 << 20) < TABLE_BYTES.most as usize);
            check_texts(&reader, uncounted)
        };
        assert_eq!(check(900_000, 100), Ok(()));
        // A row whose list exceeds the limit by one element, and a row whose list does not.
        let (length, most) = (1_000_000, TABLE_BYTES.most as usize / 1_000_000);
        assert_eq!(check(length, most), Ok(()));
        let error = check(length, most + 1).expect_err("too long").to_string();
        assert!(error.contains("bytes of the columns of a Parquet table"), "{error}");
    }

    /// Texts stored as differences by the library: in lists and alone, on pages of both versions.
    #[test]
    fn differences_are_counted_without_unfolding_them() {
        let properties = |version| {
            let builder = WriterProperties::builder().set_dictionary_enabled(false).set_writer_version(version);
            builder.set_encoding(Encoding::DELTA_BYTE_ARRAY).set_data_page_row_count_limit(300).build()
        };
        // Lengths that rise, fall and repeat, over several blocks.
        let texts: Vec<ByteArray> =
            (0..1000_usize).map(|i| "x".repeat(i * i % 977 + 1000 * usize::from(i == 500)).as_str().into()).collect();
        let length: u64 = texts.iter().map(|text| text.len() as u64).sum();
        let (none, listed) = (Vec::new(), (0..1000).map(|i| [1, i16::from(i % 10 > 0)]).collect::<Vec<_>>());
        for version in [WriterVersion::PARQUET_1_0, WriterVersion::PARQUET_2_0] {
            for (schema, levels) in [("REQUIRED BINARY", &none), ("REPEATED BINARY", &listed)] {
                let schema = format!("message m {{ {schema} a (UTF8); }}");
                let mut file = column::<ByteArrayType>(&schema, properties(version), &texts, levels);
                let reader = SerializedFileReader::new(file.try_clone().expect("a file")).expect("readable");
                let found = check_pages(&mut file, reader.metadata(), |_| true).expect("sound");
                assert_eq!(found.deltas, [(0, 0)]);
                assert_eq!(delta_bytes(&reader, &found.deltas), Ok(length), "{schema}");
                assert_eq!(check_texts(&reader, found), Ok(()));
            }
            // A gigabyte in one row's list, and in separate rows.
            for (schema, levels) in [("REQUIRED BINARY", &none), ("REPEATED BINARY", &listed)] {
                let schema = format!("message m {{ {schema} a (UTF8); }}");
                let texts = vec![ByteArray::from("x".repeat(1 << 20).as_str()); 1000];
                let levels: Vec<[i16; 2]> = (0..levels.len()).map(|i| [1, i16::from(i > 0)]).collect();
                let mut file = column::<ByteArrayType>(&schema, properties(version), &texts, &levels);
                assert!(file.metadata().expect("a file").len() < 8 << 20, "the text is there a few times");
                let reader = SerializedFileReader::new(file.try_clone().expect("a file")).expect("readable");
                let found = check_pages(&mut file, reader.metadata(), |_| true).expect("headers are small");
                let error = check_texts(&reader, found).expect_err("too long").to_string();
                assert!(error.contains("bytes of the columns of a Parquet table"), "{error}");
            }
        }
    }

    #[test]
    fn lists_of_lengths_are_not_longer_than_their_page() {
        // Blocks of 128 in 4 parts, the number of lengths, and the first length.
        let lengths = |bytes: &[u8]| {
            let (mut all, mut thrift) = (Vec::new(), Thrift { bytes, at: 0 });
            thrift.lengths(40, |length| all.push(length)).map(|()| (all, thrift.at))
        };
        assert_eq!(lengths(&[0x80, 1, 4, 1, 10]), Ok((vec![5], 5)));
        // 34 lengths that increase by one: besides the smallest difference, no bits are stored.
        assert_eq!(lengths(&[0x80, 1, 4, 34, 0, 2, 0, 0, 0, 0]), Ok(((0..34).collect(), 10)));
        let error = lengths(&[0x80, 1, 4, 0xff, 0xff, 0xff, 0xff, 0xff, 1, 10]).expect_err("too many").to_string();
        assert!(error.contains("a page of 40 values has 68719476735 lengths"), "{error}");
        for odd in [&[0x80, 1, 0, 34, 0][..], &[0x80, 1, 3, 34, 0], &[0x80, 1, 4, 34, 0, 2, 33, 0, 0, 0], &[0x80]] {
            assert!(lengths(odd).is_err(), "{odd:?}");
        }
    }

    #[test]
    fn rows_that_repeat_are_refused_before_they_are_read() {
        let mut file = zeros(TABLE_VALUES.most as usize + 1);
        assert!(file.metadata().expect("a file").len() < 1 << 20, "zeros take no space");
        let reader = SerializedFileReader::new(file.try_clone().expect("a file")).expect("readable");
        let error = check_pages(&mut file, reader.metadata(), |_| true).expect_err("too many").to_string();
        assert!(error.contains("values of a Parquet table") && error.contains("limit of 16777216"), "{error}");
        assert!(check_pages(&mut file, reader.metadata(), |_| false).is_ok(), "other columns are not looked at");
    }
}
