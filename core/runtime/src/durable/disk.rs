//! Calls that change the file system. In tests, each call can fail or kill the program.

use std::fs::{self, File, Permissions};
use std::io::{self, ErrorKind, Write};
use std::path::Path;

/// Unit tests never lose power: they count syncs without waiting for them.
const IS_TEST: bool = cfg!(test);

/// Whether a path exists, even as a link with a missing target. An unreadable path is an error, because its file must
/// not count as missing.
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

/// Opens a file to lock it, and creates it empty if it is missing.
pub fn open_lock(path: &Path) -> io::Result<File> {
    point()?;
    File::options().read(true).write(true).create(true).truncate(false).open(path)
}

pub fn write(mut file: &File, bytes: &[u8]) -> io::Result<()> {
    point()?;
    file.write_all(bytes)
}

/// Writes a new file. Fails if the path exists.
pub fn write_new(path: &Path, bytes: &[u8]) -> io::Result<()> {
    point()?;
    let file = File::create_new(path)?;
    write(&file, bytes)
}

pub fn set_permissions(path: &Path, permissions: Permissions) -> io::Result<()> {
    point()?;
    fs::set_permissions(path, permissions)
}

/// Syncs a file to disk.
pub fn sync_file(path: &Path) -> io::Result<()> {
    point()?;
    if IS_TEST {
        return Ok(());
    }
    // Windows syncs only files that are open for writing.
    File::options().read(true).write(cfg!(windows)).open(path)?.sync_all()
}

/// Syncs the entries of a folder to disk, on systems that can.
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

/// Creates a hard link to a file.
pub fn link(file: &Path, name: &Path) -> io::Result<()> {
    point()?;
    fs::hard_link(file, name)
}

/// Exchanges two files or folders in one step. Returns `false` on systems that cannot.
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

/// Exchanges two files or folders in one step. Returns `false` on systems that cannot.
#[cfg(not(target_os = "linux"))]
pub fn exchange(_: &Path, _: &Path) -> io::Result<bool> {
    Ok(false)
}

/// Renames a file to an unused name. Fails if the name is in use.
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

/// Renames a file. The system cannot refuse a name in use.
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
#[allow(clippy::unnecessary_wraps, reason = "tests make it fail")]
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

/// Injected faults of this thread's calls.
#[cfg(test)]
pub mod faults {
    use std::cell::Cell;
    use std::io;

    /// The fault at a call.
    #[derive(Debug, Clone, Copy, PartialEq, Eq)]
    pub enum InjectedFault {
        /// The program dies before the call.
        Kill,
        /// The call fails with this error number of the system.
        Error(i32),
    }

    thread_local! {
        static CALLS: Cell<u32> = const { Cell::new(0) };
        static PLAN: Cell<Option<(u32, InjectedFault)>> = const { Cell::new(None) };
        static KILLED: Cell<bool> = const { Cell::new(false) };
        static EXCHANGES: Cell<bool> = const { Cell::new(true) };
        static MEANWHILE: Cell<Option<Box<dyn FnOnce()>>> = const { Cell::new(None) };
    }

    /// Runs work with a fault at the given call, counted from 0. Returns the number of calls and, unless the work was
    /// killed, its result.
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

    /// Sets an action of another user, which runs once just before the next exchange or rename to an unused name.
    pub fn set_meanwhile(action: impl FnOnce() + 'static) {
        MEANWHILE.set(Some(Box::new(action)));
    }

    /// Removes the action of [`set_meanwhile`], and returns whether it had not run yet.
    pub fn take_meanwhile() -> bool {
        MEANWHILE.take().is_some()
    }

    /// Sets whether the system can exchange two files and can refuse to rename over an existing one.
    pub fn set_exchanges(can: bool) {
        EXCHANGES.set(can);
    }

    pub fn can_exchange() -> bool {
        if let Some(action) = MEANWHILE.take() {
            action();
        }
        EXCHANGES.get()
    }

    /// Whether the program is dead. Destructors of a dead program must not clean up.
    pub fn is_killed() -> bool {
        KILLED.get()
    }

    pub fn point() -> io::Result<()> {
        let call = CALLS.get();
        CALLS.set(call + 1);
        match PLAN.get() {
            Some((at, InjectedFault::Kill)) if at == call => {
                KILLED.set(true);
                // `resume_unwind` prints no message, because it skips the panic hook.
                std::panic::resume_unwind(Box::new("killed"))
            }
            Some((at, InjectedFault::Error(code))) if at == call => Err(io::Error::from_raw_os_error(code)),
            _ => Ok(()),
        }
    }
}
