//! Shards: lines of JSON that a writer keeps for each scene until the end of the run.

use crate::json::unwritable;
use serde::Serialize;
use std::io::{self, BufRead};
use syntable_model::error::{Error, Result};
use syntable_model::scene::SceneId;
use syntable_model::stage::{DAMAGED, Finish, unreadable};

/// Appends a value as one line.
pub fn push_line(lines: &mut Vec<u8>, value: &impl Serialize) -> Result<()> {
    serde_json::to_writer(&mut *lines, value).map_err(unwritable)?;
    lines.push(b'\n');
    Ok(())
}

/// Calls `each` with every line of the shards of all scenes, without line breaks, in order. Memory is bounded by one
/// line.
pub fn for_each_line(finish: &Finish, mut each: impl FnMut(SceneId, &str) -> Result<()>) -> Result<()> {
    finish.scenes().iter().try_for_each(|&scene| for_each_line_of(finish, scene, |line| each(scene, line)))
}

/// Calls `each` with every line of one scene's shard, like [`for_each_line`].
pub fn for_each_line_of(finish: &Finish, scene: SceneId, mut each: impl FnMut(&str) -> Result<()>) -> Result<()> {
    let mut shard = finish.shard(scene)?;
    let mut line = String::new();
    loop {
        line.clear();
        match shard.read_line(&mut line) {
            Ok(0) => return Ok(()),
            Ok(_) => match line.strip_suffix('\n') {
                Some(line) => each(line)?,
                None => return Err(damaged(finish, scene, "ends in the middle of a line")),
            },
            Err(error) => return Err(unread(finish, scene, &error)),
        }
    }
}

fn damaged(finish: &Finish, scene: SceneId, what: &str) -> Error {
    Error::new(format!("the shard of scene {} {what}", scene.0)).context(format!("write.{}", finish.id())).help(DAMAGED)
}

/// The error of a shard that its disk or network did not deliver, or that is not text.
pub fn unread(finish: &Finish, scene: SceneId, error: &io::Error) -> Error {
    let shard = format!("the shard of scene {}", scene.0);
    unreadable(Error::io(shard, error)).context(format!("write.{}", finish.id()))
}
