//! `syntable verify`.

use crate::console::Console;
use crate::exit::Exit;
use clap::Args;
use std::path::PathBuf;
use syntable_model::error::Error;
use syntable_model::store::StoreFolder;
use syntable_recipe::message::Message;
use syntable_runtime::run::Verified;
use syntable_runtime::run::progress::count;
use syntable_runtime::{run, workers};

#[derive(Args)]
pub(crate) struct VerifyArgs {
    /// Folder or URL of the dataset.
    dataset: PathBuf,
}

pub(crate) fn verify(console: &Console, args: &VerifyArgs) -> Result<(), Exit> {
    let dataset = StoreFolder::at(&args.dataset).map_err(Exit::stopped)?;
    let found = run::verify(dataset, workers::available()).map_err(Exit::stopped)?;
    let mut out = String::new();
    let lists = [
        ("missing", &found.missing),
        ("damaged", &found.damaged),
        ("linked", &found.linked),
        ("foreign", &found.foreign),
    ];
    for (what, paths) in lists {
        paths.iter().for_each(|path| out += &format!("{what}  {path}\n"));
    }
    found.faults.iter().for_each(|fault| out += &format!("journal  {fault}\n"));
    found.links.iter().for_each(|(path, to)| out += &format!("link  {path} -> {to}\n"));
    found.outside.iter().for_each(|(path, why)| out += &format!("outside  {path}: {why}\n"));
    let lost = if found.faults.is_empty() { "manifest" } else { "manifest or line" };
    for (scene, paths) in &found.unlisted {
        paths.iter().for_each(|path| out += &format!("unlisted  {path}  (of scene {scene}, whose {lost} is lost)\n"));
    }
    let (scenes, files) = (count(found.scenes, "scene"), count(found.files as u32, "file"));
    let unlisted = match found.unlisted.values().map(Vec::len).sum::<usize>() {
        0 => String::new(),
        unlisted => format!(", {unlisted} unlisted"),
    };
    let others = [(&"linked", found.linked.len()), (&"outside", found.outside.len())].into_iter();
    let others: String =
        others.filter(|(_, number)| *number > 0).map(|(what, number)| format!(", {number} {what}")).collect();
    let journal = if found.faults.is_empty() { "" } else { ", damaged journal" };
    out += &format!(
        "{scenes}, {files} compared: {} missing, {} damaged, {} foreign{unlisted}{others}{journal}\n",
        found.missing.len(),
        found.damaged.len(),
        found.foreign.len()
    );
    console.print(&out)?;
    if found.whole() {
        return Ok(());
    }
    Err(Exit { code: 3, messages: vec![Message::Error(fault(&found).in_file(&args.dataset))] })
}

/// The error of a dataset that is not whole, with what mends it.
fn fault(found: &Verified) -> Error {
    if !found.outside.is_empty() {
        Error::new("the dataset lists foreign files")
            .help("do not run or merge it: another person or program changed it")
    } else if !found.linked.is_empty() {
        let is_link = |path: &String| found.links.binary_search_by(|(link, _)| link.cmp(path)).is_ok();
        let help = match found.linked.iter().all(is_link) {
            true => {
                "replace the links by their files, as `cp -rL` does, or let `syntable run --repair` make the files again"
            }
            // A run writes nothing behind a link.
            false => {
                "replace each linked folder by the folder itself: `cp -rL` copies the dataset with it, or a mount keeps it on another disk"
            }
        };
        Error::new(format!("{} not compared, because of links", count(found.linked.len() as u32, "file"))).help(help)
    } else if found.missing.is_empty() && found.damaged.is_empty() && found.faults.is_empty() {
        Error::new("the last run did not end").help("run the same command again")
    } else {
        Error::new("the files differ from those that the run wrote")
            .help("`syntable run --repair` makes the scenes again")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_remedy_of_a_link_is_one_that_works() {
        let of = |link: &str| {
            let found = Verified {
                links: vec![("a".into(), "/x".into()), (link.into(), "/y".into())],
                linked: vec!["lines/0.json".into(), "lines/1.json".into()],
                ..Verified::default()
            };
            fault(&found).to_string()
        };
        // A run writes nothing behind a linked folder.
        let folder = of("lines");
        assert!(folder.contains("2 files not compared") && folder.contains("cp -rL"), "{folder}");
        assert!(folder.contains("mount") && !folder.contains("--repair") && !of("lines/0.json").contains("--repair"));
        let links = ["lines/0.json", "lines/1.json"].map(|link| (link.to_owned(), "/y".to_owned())).to_vec();
        let files =
            Verified { linked: links.iter().map(|(link, _)| link.clone()).collect(), links, ..Verified::default() };
        assert!(fault(&files).to_string().contains("--repair"));
        let lines = Verified { faults: vec!["line 2".into()], unfinished: true, ..Verified::default() };
        assert!(fault(&lines).to_string().contains("--repair"));
    }
}
