//! Shards: lines of JSON that a writer keeps for each scene until the end of the run.

use serde::Serialize;
use std::io::BufRead;
use syntable_model::error::{Error, Result};
use syntable_model::scene::SceneId;
use syntable_model::stage::Finish;

/// Appends a value as one line.
pub fn push_line(lines: &mut Vec<u8>, value: &impl Serialize) -> Result<()> {
    serde_json::to_writer(&mut *lines, value)
        .map_err(|error| Error::new(format!("cannot be written as JSON: {error}")))?;
    lines.push(b'\n');
    Ok(())
}

/// Calls `each` with every line of the shards of all scenes, without line breaks, in order. Memory is bounded by one
/// line.
pub fn for_each_line(finish: &Finish, mut each: impl FnMut(SceneId, &str) -> Result<()>) -> Result<()> {
    for &scene in finish.scenes() {
        let mut shard = finish.shard(scene)?;
        let damaged = |what: &str| {
            Error::new(format!("the shard of scene {} {what}", scene.0))
                .context(format!("write.{}", finish.id()))
                .help("the dataset is damaged; `syntable run --repair` makes the scene again")
        };
        let mut line = String::new();
        loop {
            line.clear();
            match shard.read_line(&mut line) {
                Ok(0) => break,
                Ok(_) => match line.strip_suffix('\n') {
                    Some(line) => each(scene, line)?,
                    None => return Err(damaged("ends in the middle of a line")),
                },
                Err(error) => return Err(damaged(&format!("cannot be read: {error}"))),
            }
        }
    }
    Ok(())
}
