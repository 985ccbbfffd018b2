//! Limits on what a file may make the program hold, in one table.
//!
//! A few bytes can ask for gigabytes: a header that states a huge image, an archive that unfolds, a list that repeats one
//! value. An allocation that fails and a stack that overflows end the process, so readers compare what a header states with
//! these limits before they allocate. The page [Limits](https://github.com/syntable/syntable/blob/main/book/src/limits.md) of the
//! book shows [`ALL`].
//!
//! The limits of assets are options of their pool ([`AssetLimits`](crate::stage::AssetLimits)).

use crate::error::Error;

/// A limit: the largest value, and what to do about a file that exceeds it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Limit {
    /// The limited quantity, such as "pixels of an image".
    pub what: &'static str,
    /// Largest value that is read.
    pub most: u64,
    /// Whether the value is a number of bytes.
    pub is_bytes: bool,
    /// Why the limit exists, and why honest data stays below it.
    pub why: &'static str,
    /// The remedy for data that exceeds it.
    pub remedy: &'static str,
}

/// Pixels of an image of a dataset or of a texture.
pub const IMAGE_PIXELS: Limit = Limit {
    what: "pixels of an image, a mask or a texture",
    most: 1 << 27,
    is_bytes: false,
    why: "134 megapixels, more than almost any camera; a decoded image takes up to 4 bytes per pixel, twice for a moment",
    remedy: "downscale the image, or cut it into tiles with labels of their own",
};

/// Levels of folders below the root of a pool that are searched.
pub const FOLDER_DEPTH: Limit = Limit {
    what: "levels of folders below the root of a pool that are searched",
    most: 8,
    is_bytes: false,
    why: "collections have three or four; a search of a whole disk would take hours. Symbolic links to folders are not \
          searched, because they may form circles",
    remedy: "name a folder further down, or the linked folder, as the `root` of a pool",
};

/// Files and folders below the root of a pool.
pub const FOLDER_ENTRIES: Limit = Limit {
    what: "files and folders below the root of a pool",
    most: 1_000_000,
    is_bytes: false,
    why: "the largest collections of meshes have as many files; each takes some hundred bytes of memory",
    remedy: "name a folder further down as the `root` of a pool",
};

/// Files below a URL that are read.
pub const REMOTE_FILES: Limit = Limit {
    what: "files below the URL of a dataset or of assets",
    most: 5_000_000,
    is_bytes: false,
    why: "a list of all files takes some hundred bytes of memory per file, and an empty file on this machine",
    remedy: "name the folder of one dataset, and write large datasets in shards (`webdataset`, `parquet`)",
};

/// Bytes of an image after decoding.
pub const IMAGE_BYTES: Limit = Limit {
    what: "bytes of a decoded image",
    most: 1 << 29,
    is_bytes: true,
    why: "RGBA of 8 bits at the largest number of pixels; readers hold the image twice for a moment",
    remedy: "downscale the image, or store fewer channels or bits per pixel",
};

/// Bytes of an array or of another member of an archive that is read at once.
pub const MEMBER_BYTES: Limit = Limit {
    what: "bytes of a member of an archive, or of an HDF5 dataset",
    most: 1 << 29,
    is_bytes: true,
    why: "250 full masks of 1920 × 1080 pixels; a compressed member can unfold a thousandfold, which masks honestly do, so \
          the size is limited and not the ratio",
    remedy: "store masks as run lengths (`jsonl`, `coco`, `parquet`), or one array per object",
};

/// Members of an archive.
pub const ARCHIVE_MEMBERS: Limit = Limit {
    what: "members of an archive",
    most: 1 << 20,
    is_bytes: false,
    why: "100,000 samples of ten files each; shards of WebDataset have up to 10,000 samples",
    remedy: "split the archive into several",
};

/// Values of the columns of a table that are read at once, elements of lists included.
pub const TABLE_VALUES: Limit = Limit {
    what: "values of a Parquet table that are read at once, elements of lists included",
    most: 1 << 24,
    is_bytes: false,
    why: "a scene of 1,000 views and 50 objects has 3 million; values that repeat take no space in a file",
    remedy: "write one table per scene, or tables of fewer views",
};

/// Bytes of the columns of a table that are read at once, before compression.
pub const TABLE_BYTES: Limit = Limit {
    what: "bytes of the columns of a Parquet table that are read at once, decompressed",
    most: 1 << 29,
    is_bytes: true,
    why: "texts and images in a table are held twice for a moment; a compressed page can unfold a thousandfold",
    remedy: "write one table per scene, or images as files beside it (`images = \"files\"`)",
};

/// Bytes of one page of a column.
pub const PAGE_BYTES: Limit = Limit {
    what: "bytes of one page of a Parquet column, decompressed",
    most: 1 << 28,
    is_bytes: true,
    why: "pages have 1 MB by default; one larger value has a page of its own",
    remedy: "write the table with smaller pages, for instance `data_page_size` of pyarrow",
};

/// Bytes of a text that is parsed at once.
pub const TEXT_BYTES: Limit = Limit {
    what: "bytes of a text file or JSON file that is parsed at once, or of a line of JSON Lines",
    most: 1 << 28,
    is_bytes: true,
    why: "annotation files are read record by record, and have no such limit; this one is for files of one image or one scene",
    remedy: "write one line per view (`per = \"view\"`), or large arrays with `npz`",
};

/// Bytes of the declarations of products in a dataset.
pub const DECLARED_BYTES: Limit = Limit {
    what: "bytes of the declarations of products in a dataset",
    most: 1 << 16,
    is_bytes: true,
    why: "some hundred products; the program keeps their names until it ends",
    remedy: "declare only products that the files have, with short descriptions",
};

/// Bytes of one record of an annotation file.
pub const RECORD_BYTES: Limit = Limit {
    what: "bytes of one record of a JSON annotation file",
    most: 1 << 24,
    is_bytes: true,
    why: "a mask of two million runs in uncompressed form; a byte of JSON takes up to 50 bytes of memory",
    remedy: "store masks as compressed run lengths",
};

/// Values of a JSON text that is parsed into a tree.
pub const JSON_VALUES: Limit = Limit {
    what: "values of a JSON text that is parsed at once",
    most: 1 << 23,
    is_bytes: false,
    why: "a depth image of 3840 × 2160 pixels as nested lists; a value takes 2 bytes of text and 100 bytes of memory",
    remedy: "write arrays with `npz`, `exr` or `png`, and masks as run lengths",
};

/// Levels of lists and objects in a JSON text.
pub const NESTING: Limit = Limit {
    what: "levels of nested lists and objects in JSON, or of groups in a Parquet schema",
    most: 127,
    is_bytes: false,
    why: "parsers call themselves once per level, and an overflow of the stack ends the process",
    remedy: "flatten the data; labels need fewer than ten levels",
};

/// Annotations of one image.
pub const ANNOTATIONS: Limit = Limit {
    what: "annotated objects of one image",
    most: u16::MAX as u64,
    is_bytes: false,
    why: "ids of objects have 16 bits",
    remedy: "cut the image into tiles, or remove objects",
};

/// Annotations of one image with an occlusion order.
pub const ORDERED: Limit = Limit {
    what: "annotated objects of one image with an occlusion order",
    most: 20_000,
    is_bytes: false,
    why: "an order may have a pair for every two objects, and writers store it as a matrix: 400 MB for 20,000 objects",
    remedy: "cut the image into tiles, remove objects, or convert to a format without an order",
};

/// Length of the outlines of a mask.
pub const OUTLINE_STEPS: Limit = Limit {
    what: "steps of a fifth of a pixel along the polygons of a mask",
    most: 1 << 23,
    is_bytes: false,
    why: "1.6 million pixels of outline; an outline can pass an image thousands of times in a few bytes",
    remedy: "store the mask as run lengths, or remove points far outside of the image",
};

/// Text that a template makes of one file.
pub const TEMPLATE_TEXT: Limit = Limit {
    what: "bytes of text of a file by `write.template`",
    most: 1 << 30,
    is_bytes: true,
    why: "the text is made in memory",
    remedy: "write more and smaller files: `per = \"scene\"` or `per = \"view\"`",
};

/// A single value of a template.
pub const TEMPLATE_VALUE: Limit = Limit {
    what: "bytes of one value that a template of `write.template` makes, such as a `set` variable or the text of a macro",
    most: 64 << 20,
    is_bytes: true,
    why: "a depth image of 1920 × 1080 pixels as JSON has 37 MB; text that is appended to itself doubles with every line",
    remedy: "write text where it stands, and not to a variable or in a macro first",
};

/// All values that a template makes of one file.
pub const TEMPLATE_WORK: Limit = Limit {
    what: "bytes of all values that a template of `write.template` makes for one file",
    most: 4 << 30,
    is_bytes: true,
    why: "four times the largest text; loops may copy a large value each time",
    remedy: "take constant values out of loops, or write more and smaller files",
};

/// Steps of a template.
pub const TEMPLATE_STEPS: Limit = Limit {
    what: "turns of loops and calls of macros of a template of `write.template` for one file",
    most: 50_000_000,
    is_bytes: false,
    why: "a dataset of 100,000 images with 20 objects each needs 2 million per nested loop; nested loops over `range` may never end",
    remedy: "write more and smaller files: `per = \"scene\"` or `per = \"view\"`",
};

/// Text whose letters a template takes one by one.
pub const TEMPLATE_LOOP_TEXT: Limit = Limit {
    what: "bytes of a text that a template loops over, letter by letter",
    most: 10_000,
    is_bytes: false,
    why: "every turn looks for its letter from the beginning of the text",
    remedy: "loop over a list",
};

/// Numbers that `range` gives in a template.
pub const TEMPLATE_RANGE: Limit = Limit {
    what: "numbers that `range` gives in a template",
    most: 1_000_000,
    is_bytes: false,
    why: "all of them are held in memory",
    remedy: "count in nested loops",
};

/// Bytes of a recipe, a list or a template.
pub const SMALL_FILE_BYTES: Limit = Limit {
    what: "bytes of a recipe, a list or a template",
    most: 64 << 20,
    is_bytes: true,
    why: "such files are text that people write",
    remedy: "split the file",
};

/// Bytes of a file of assets that belongs to no asset.
pub const LIST_BYTES: Limit = Limit {
    what: "bytes of a list that belongs to a pool of assets, such as `models_info.json`",
    most: 1 << 30,
    is_bytes: true,
    why: "lists have some hundred bytes per asset",
    remedy: "split the pool",
};

/// Bytes of a file that a run keeps in its dataset for itself: lists, times, catalogs, settled poses and the resolved recipe.
pub const RUN_LIST_BYTES: Limit = Limit {
    what: "bytes of a file that a run keeps in its dataset, or of a line of its journal",
    most: 1 << 28,
    is_bytes: true,
    why: "a list has some hundred bytes per file of a scene; the journal is read line by line, and has no limit as a whole",
    remedy: "no run writes such a file: delete it, and run the dataset's recipe with `options.repair`",
};

/// Bytes of what a run records of one scene for annotators of the whole dataset.
pub const SCENE_RECORD_BYTES: Limit = Limit {
    what: "bytes of what a run records of one scene for annotators of the whole dataset",
    most: 1 << 28,
    is_bytes: true,
    why: "records of one scene at a time are in memory; a byte of JSON takes up to 50 bytes of memory",
    remedy: "lower `views_per_scene` in [dataset]; delete a file that no run wrote, and a run with `options.repair` makes the scene again",
};

/// Pixels of a canvas or an atlas that is rendered.
pub const CANVAS_PIXELS: Limit = Limit {
    what: "pixels of a canvas or of the windows around objects that a renderer makes",
    most: 1 << 28,
    is_bytes: false,
    why: "a canvas is up to nine times as wide as the image, and every product of it takes several bytes per pixel",
    remedy: "ask for a smaller canvas, fewer sub-pixels, fewer objects, or a lower resolution in [camera]",
};

/// All limits, in the order of the book.
pub const ALL: &[Limit] = &[
    IMAGE_PIXELS,
    IMAGE_BYTES,
    MEMBER_BYTES,
    ARCHIVE_MEMBERS,
    TABLE_VALUES,
    TABLE_BYTES,
    PAGE_BYTES,
    TEXT_BYTES,
    DECLARED_BYTES,
    RECORD_BYTES,
    JSON_VALUES,
    NESTING,
    ANNOTATIONS,
    ORDERED,
    OUTLINE_STEPS,
    TEMPLATE_TEXT,
    TEMPLATE_VALUE,
    TEMPLATE_WORK,
    TEMPLATE_STEPS,
    TEMPLATE_LOOP_TEXT,
    TEMPLATE_RANGE,
    SMALL_FILE_BYTES,
    LIST_BYTES,
    FOLDER_DEPTH,
    FOLDER_ENTRIES,
    REMOTE_FILES,
    RUN_LIST_BYTES,
    SCENE_RECORD_BYTES,
    CANVAS_PIXELS,
];

impl Limit {
    /// Refuses a value above the limit. The error has the limit, the value and the remedy; callers add the file.
    pub fn check(&self, value: u64) -> Result<(), Error> {
        if value <= self.most { Ok(()) } else { Err(self.refuse(value)) }
    }

    /// Refuses a product of lengths above the limit, including products that overflow. A length of 0 counts as 1: an
    /// empty array may not be longer than others, or a loop over its rows would not end.
    pub fn check_product(&self, factors: &[u64]) -> Result<(), Error> {
        let product = factors.iter().try_fold(1_u64, |product, factor| product.checked_mul((*factor).max(1)));
        self.check(product.unwrap_or(u64::MAX))
    }

    /// Refuses an image with too many pixels. A width or height of 0 counts as 1: a loop over the rows of a longer image
    /// without pixels would not end.
    pub fn check_size(&self, [width, height]: [u32; 2]) -> Result<(), Error> {
        let pixels = u64::from(width.max(1)) * u64::from(height.max(1));
        if pixels <= self.most {
            return Ok(());
        }
        let what = format!("{width} × {height} pixels are more than the limit of {}", self.most);
        Err(Error::new(what).help(self.remedy))
    }

    /// The error of a value above the limit.
    pub fn refuse(&self, value: u64) -> Error {
        let more = if value == u64::MAX { "too many".to_owned() } else { value.to_string() };
        Error::new(format!("{more} {} are more than the limit of {}", self.what, self.most)).help(self.remedy)
    }

    /// The limit as people read it, such as `512 MiB` or `134,217,728`.
    pub fn shown(&self) -> String {
        if self.is_bytes {
            let units = [(30, "GiB"), (20, "MiB"), (10, "KiB")];
            let unit =
                units.into_iter().find(|(shift, _)| self.most >> shift > 0 && self.most.is_multiple_of(1 << shift));
            return unit.map_or_else(
                || format!("{} bytes", self.most),
                |(shift, unit)| format!("{} {unit}", self.most >> shift),
            );
        }
        let digits = self.most.to_string();
        let groups: Vec<&str> =
            digits.as_bytes().rchunks(3).rev().filter_map(|it| std::str::from_utf8(it).ok()).collect();
        groups.join(",")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_and_products_are_compared_without_overflow() {
        assert!(IMAGE_BYTES.check(1 << 29).is_ok() && IMAGE_BYTES.check((1 << 29) + 1).is_err());
        assert!(IMAGE_BYTES.check_product(&[1 << 28, 2]).is_ok());
        assert!(IMAGE_BYTES.check_product(&[u64::MAX, u64::MAX]).is_err());
        assert!(IMAGE_BYTES.check_product(&[u64::MAX, 0]).is_err() && IMAGE_BYTES.check_product(&[3, 0]).is_ok());
        assert!(IMAGE_PIXELS.check_size([u32::MAX, 0]).is_err() && IMAGE_PIXELS.check_size([0, 0]).is_ok());
        assert!(IMAGE_PIXELS.check_size([1 << 14, 1 << 13]).is_ok());
        let error = IMAGE_PIXELS.check_size([u32::MAX; 2]).expect_err("too large").to_string();
        assert!(error.starts_with("4294967295 × 4294967295 pixels are more than the limit of 134217728"), "{error}");
        let error = JSON_VALUES.check(9_000_000).expect_err("too many").to_string();
        assert!(
            error.contains("9000000 values of a JSON text") && error.contains("write arrays with `npz`"),
            "{error}"
        );
    }

    #[test]
    fn the_book_shows_every_limit() {
        let book = concat!(env!("CARGO_MANIFEST_DIR"), "/../../book/src/limits.md");
        let book = std::fs::read_to_string(book).expect("the page");
        for limit in ALL {
            // The book is for the command line, which prints an option of the library as its flag.
            let remedy = limit.remedy.replace("`options.repair`", "`--repair`");
            let row = format!("| {} | {} | {} | {remedy} |", limit.what, limit.shown(), limit.why);
            assert!(book.lines().any(|line| line == row), "book/src/limits.md lacks this row:\n{row}");
        }
        let is_row =
            |line: &&str| line.starts_with("| ") && !["| what ", "| --- "].iter().any(|head| line.starts_with(head));
        let rows = book.lines().filter(is_row).count();
        assert_eq!(rows, ALL.len(), "rows of limits");
    }
}
