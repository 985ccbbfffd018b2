//! The calls that change the file system. In tests each of them is a point at which the program is killed or the call fails.

use std::fs::{self, File, Permissions};
use std::io::{self, ErrorKind, Write};
use std::path::Path;

/// Unit tests lose no power: they count syncs, and do not wait for them.
const IS_TEST: bool = cfg!(test);

/// Whether something has a path, be it a link that leads nowhere. A path that cannot be looked at is an error: what stands
/// there must not count as gone.
pub fn is_there(path: &Path) -> io::Result<bool> {
    point()?;
    match fs::symlink_metadata(path) {
        Ok(_) => Ok(true),
        Err(error) if error.kind() == ErrorKind::NotFound => Ok(false),
        Err(error) => Err(error),
    }
}

pub fn create_dir(path: &Path) -> io::Result<()> {
    point()?;
    fs::create_dir(path)
}

pub fn create_dir_all(path: &Path) -> io::Result<()> {
    point()?;
    fs::create_dir_all(path)
}

/// Opens a file to lock it; makes an empty one where there is none.
pub fn open_lock(path: &Path) -> io::Result<File> {
    point()?;
    File::options().read(true).write(true).create(true).truncate(false).open(path)
}

pub fn write(mut file: &File, bytes: &[u8]) -> io::Result<()> {
    point()?;
    file.write_all(bytes)
}

/// Writes a file that must not be there yet.
pub fn write_new(path: &Path, bytes: &[u8]) -> io::Result<()> {
    point()?;
    let file = File::create_new(path)?;
    write(&file, bytes)
}

pub fn set_permissions(path: &Path, permissions: Permissions) -> io::Result<()> {
    point()?;
    fs::set_permissions(path, permissions)
}

/// Brings a file to disk.
pub fn sync_file(path: &Path) -> io::Result<()> {
    point()?;
    if IS_TEST {
        return Ok(());
    }
    // Windows syncs only what is open for writing.
    File::options().read(true).write(cfg!(windows)).open(path)?.sync_all()
}

/// Brings the entries of a folder to disk, where the system can.
pub fn sync_folder(path: &Path) -> io::Result<()> {
    point()?;
    if IS_TEST || cfg!(windows) {
        return Ok(());
    }
    match File::open(path)?.sync_all() {
        Err(error) if matches!(error.kind(), ErrorKind::InvalidInput | ErrorKind::Unsupported) => Ok(()),
        synced => synced,
    }
}

pub fn rename(from: &Path, to: &Path) -> io::Result<()> {
    point()?;
    fs::rename(from, to)
}

/// Gives a file a second name.
pub fn link(file: &Path, name: &Path) -> io::Result<()> {
    point()?;
    fs::hard_link(file, name)
}

/// Lets two files or folders take each other's place in one step. Returns false where the system cannot.
#[cfg(target_os = "linux")]
pub fn exchange(one: &Path, other: &Path) -> io::Result<bool> {
    use rustix::fs::{CWD, RenameFlags, renameat_with};
    use rustix::io::Errno;
    point()?;
    if !can_exchange() {
        return Ok(false);
    }
    match renameat_with(CWD, one, CWD, other, RenameFlags::EXCHANGE) {
        Ok(()) => Ok(true),
        Err(Errno::INVAL | Errno::NOSYS | Errno::OPNOTSUPP) => Ok(false),
        Err(error) => Err(error.into()),
    }
}

/// Lets two files or folders take each other's place in one step. Returns false where the system cannot.
#[cfg(not(target_os = "linux"))]
pub fn exchange(_: &Path, _: &Path) -> io::Result<bool> {
    Ok(false)
}

/// Renames a file to a name that is free: fails where something has that name.
#[cfg(target_os = "linux")]
pub fn rename_new(from: &Path, to: &Path) -> io::Result<()> {
    use rustix::fs::{CWD, RenameFlags, renameat_with};
    use rustix::io::Errno;
    point()?;
    if !can_exchange() {
        return fs::rename(from, to);
    }
    match renameat_with(CWD, from, CWD, to, RenameFlags::NOREPLACE) {
        // The file system does not know the flag.
        Err(Errno::INVAL | Errno::NOSYS | Errno::OPNOTSUPP) => fs::rename(from, to),
        renamed => Ok(renamed?),
    }
}

/// Renames a file. The system cannot refuse a name that is taken.
#[cfg(not(target_os = "linux"))]
pub fn rename_new(from: &Path, to: &Path) -> io::Result<()> {
    rename(from, to)
}

pub fn remove_file(path: &Path) -> io::Result<()> {
    point()?;
    fs::remove_file(path)
}

pub fn remove_dir(path: &Path) -> io::Result<()> {
    point()?;
    fs::remove_dir(path)
}

pub fn remove_dir_all(path: &Path) -> io::Result<()> {
    point()?;
    fs::remove_dir_all(path)
}

#[cfg(all(test, target_os = "linux"))]
use faults::can_exchange;
#[cfg(test)]
pub use faults::is_killed;
#[cfg(test)]
use faults::point;
#[cfg(all(not(test), target_os = "linux"))]
use real::can_exchange;
#[cfg(not(test))]
pub use real::is_killed;
#[cfg(not(test))]
use real::point;

#[cfg(not(test))]
#[allow(clippy::unnecessary_wraps, reason = "tests let it fail")]
mod real {
    pub fn point() -> std::io::Result<()> {
        Ok(())
    }

    #[cfg(target_os = "linux")]
    pub fn can_exchange() -> bool {
        true
    }

    pub fn is_killed() -> bool {
        false
    }
}

/// Faults of this thread's calls.
#[cfg(test)]
pub mod faults {
    use std::cell::Cell;
    use std::io;

    /// What happens at a call.
    #[derive(Debug, Clone, Copy, PartialEq, Eq)]
    pub enum InjectedFault {
        /// The program is killed before the call.
        Kill,
        /// The call fails with an error of the system.
        Error(i32),
    }

    thread_local! {
        static CALLS: Cell<u32> = const { Cell::new(0) };
        static PLAN: Cell<Option<(u32, InjectedFault)>> = const { Cell::new(None) };
        static KILLED: Cell<bool> = const { Cell::new(false) };
        static EXCHANGES: Cell<bool> = const { Cell::new(true) };
        static MEANWHILE: Cell<Option<Box<dyn FnOnce()>>> = const { Cell::new(None) };
    }

    /// Runs some work with a fault at the given call, counted from 0. Returns what the work returned, unless it was killed,
    /// and the number of calls.
    pub fn with<T>(plan: Option<(u32, InjectedFault)>, work: impl FnOnce() -> T) -> (Option<T>, u32) {
        CALLS.set(0);
        KILLED.set(false);
        PLAN.set(plan);
        let done = std::panic::catch_unwind(std::panic::AssertUnwindSafe(work));
        PLAN.set(None);
        let killed = KILLED.replace(false);
        match done {
            Ok(value) => (Some(value), CALLS.get()),
            Err(_) if killed => (None, CALLS.get()),
            Err(panic) => std::panic::resume_unwind(panic),
        }
    }

    /// Sets what a user does once, just before the next exchange or rename to a free name.
    pub fn set_meanwhile(action: impl FnOnce() + 'static) {
        MEANWHILE.set(Some(Box::new(action)));
    }

    /// Whether the action of [`set_meanwhile`] still has to run; forgets it.
    pub fn take_meanwhile() -> bool {
        MEANWHILE.take().is_some()
    }

    /// Whether the system can exchange two files, and refuse to rename over one.
    pub fn set_exchanges(can: bool) {
        EXCHANGES.set(can);
    }

    pub fn can_exchange() -> bool {
        if let Some(action) = MEANWHILE.take() {
            action();
        }
        EXCHANGES.get()
    }

    /// Whether the program is dead: nothing that is dropped may tidy up.
    pub fn is_killed() -> bool {
        KILLED.get()
    }

    pub fn point() -> io::Result<()> {
        let call = CALLS.get();
        CALLS.set(call + 1);
        match PLAN.get() {
            Some((at, InjectedFault::Kill)) if at == call => {
                KILLED.set(true);
                // No message: the hook for panics is not asked.
                std::panic::resume_unwind(Box::new("killed"))
            }
            Some((at, InjectedFault::Error(code))) if at == call => Err(io::Error::from_raw_os_error(code)),
            _ => Ok(()),
        }
    }
}
