//! The functions of Open Image Denoise's C interface that this crate needs, loaded from a library at run time.
//!
//! Supports versions 1.4 to 2.x: 2.0 renamed the setters and kept their meaning.

use libloading::Library;
use std::ffi::{CStr, c_char, c_int, c_void};
use std::mem::ManuallyDrop;
use std::path::Path;
use std::ptr::null_mut;
use syntable_model::prelude::*;

/// An object of the library.
type Handle = *mut c_void;

type SetInt = unsafe extern "C" fn(Handle, *const c_char, c_int);
type SetBool = unsafe extern "C" fn(Handle, *const c_char, bool);
type SetFloat = unsafe extern "C" fn(Handle, *const c_char, f32);
type SetImage = unsafe extern "C" fn(Handle, *const c_char, *mut c_void, c_int, usize, usize, usize, usize, usize);

/// `OIDN_DEVICE_TYPE_CPU`.
const CPU: c_int = 1;
/// `OIDN_FORMAT_FLOAT3`.
const FLOAT3: c_int = 3;

/// The functions. Their library is never unloaded: its threads would lose their code.
struct Functions {
    new_device: unsafe extern "C" fn(c_int) -> Handle,
    set_device_int: SetInt,
    set_device_bool: SetBool,
    get_device_int: unsafe extern "C" fn(Handle, *const c_char) -> c_int,
    commit_device: unsafe extern "C" fn(Handle),
    device_error: unsafe extern "C" fn(Handle, *mut *const c_char) -> c_int,
    release_device: unsafe extern "C" fn(Handle),
    new_filter: unsafe extern "C" fn(Handle, *const c_char) -> Handle,
    set_image: SetImage,
    set_int: SetInt,
    set_bool: SetBool,
    set_float: SetFloat,
    commit_filter: unsafe extern "C" fn(Handle),
    execute_filter: unsafe extern "C" fn(Handle),
    release_filter: unsafe extern "C" fn(Handle),
}

/// A device on the processor, ready to filter.
pub(super) struct Device {
    functions: Functions,
    handle: Handle,
    version: c_int,
}

// SAFETY: a device of the library may be used from any thread; `&mut self` prevents concurrent calls.
unsafe impl Send for Device {}

/// An image to filter, and its settings.
pub(super) struct Job<'a> {
    pub width: usize,
    pub height: usize,
    /// Radiance, replaced by the result.
    pub color: &'a mut [[f32; 3]],
    pub albedo: &'a mut [[f32; 3]],
    pub normal: &'a mut [[f32; 3]],
    /// Whether the guides are free of noise.
    pub clean_guides: bool,
    /// `OIDNQuality`; versions before 2.0 only have one quality.
    pub quality: c_int,
    /// Factor on the radiance that makes 1 approximately white.
    pub scale: f32,
}

impl Functions {
    fn load(file: &Path) -> Result<Self, libloading::Error> {
        // SAFETY: loading runs the library's own initializers; the recipe's author chose the file. Every type below
        // matches the published C header.
        unsafe {
            let _ = Self::load_threading(file);
            let library = ManuallyDrop::new(Library::new(file)?);
            macro_rules! find {
                ($name:literal $(or $older:literal)?) => {{
                    let found = library.get(concat!($name, "\0").as_bytes());
                    $(let found = found.or_else(|_| library.get(concat!($older, "\0").as_bytes()));)?
                    *found?
                }};
            }
            Ok(Self {
                new_device: find!("oidnNewDevice"),
                set_device_int: find!("oidnSetDeviceInt" or "oidnSetDevice1i"),
                set_device_bool: find!("oidnSetDeviceBool" or "oidnSetDevice1b"),
                get_device_int: find!("oidnGetDeviceInt" or "oidnGetDevice1i"),
                commit_device: find!("oidnCommitDevice"),
                device_error: find!("oidnGetDeviceError"),
                release_device: find!("oidnReleaseDevice"),
                new_filter: find!("oidnNewFilter"),
                set_image: find!("oidnSetSharedFilterImage"),
                set_int: find!("oidnSetFilterInt" or "oidnSetFilter1i"),
                set_bool: find!("oidnSetFilterBool" or "oidnSetFilter1b"),
                set_float: find!("oidnSetFilterFloat" or "oidnSetFilter1f"),
                commit_filter: find!("oidnCommitFilter"),
                execute_filter: find!("oidnExecuteFilter"),
                release_filter: find!("oidnReleaseFilter"),
            })
        }
    }

    /// Loads Threading Building Blocks from the library's folder, where its releases have them. Linux only finds them
    /// there if the library has a search path for it, which the library of the Python wheel has not.
    #[cfg(unix)]
    unsafe fn load_threading(file: &Path) -> Option<()> {
        use libloading::os::unix;
        let beside = std::fs::read_dir(file.parent()?).ok()?;
        let mut found: Vec<_> = beside.filter_map(|entry| Some(entry.ok()?.path())).collect();
        found.retain(|path| path.file_name().is_some_and(|name| name.to_string_lossy().starts_with("libtbb.")));
        found.sort();
        // SAFETY: as in `load`.
        let open = |path| unsafe { unix::Library::open(Some(path), unix::RTLD_NOW | unix::RTLD_GLOBAL) };
        found.iter().find_map(|path| open(path).ok()).map(std::mem::forget)
    }

    #[cfg(not(unix))]
    unsafe fn load_threading(_file: &Path) -> Option<()> {
        None
    }

    /// The error of the device since the last call, or of the thread if the device is null.
    fn check(&self, device: Handle) -> Result<()> {
        let mut message = std::ptr::null();
        // SAFETY: the device is null or alive, and `message` can be written to.
        let code = unsafe { (self.device_error)(device, &mut message) };
        if code == 0 {
            return Ok(());
        }
        let text = if message.is_null() {
            format!("error {code}")
        } else {
            // SAFETY: the library returns text that ends in 0 and stays valid until the next call.
            unsafe { CStr::from_ptr(message) }.to_string_lossy().to_lowercase()
        };
        Err(Error::new(format!("open image denoise: {text}")))
    }
}

impl Device {
    /// Loads the library and opens a device with `threads` threads.
    pub fn open(file: &Path, threads: usize) -> Result<Self> {
        let functions = Functions::load(file).map_err(|error| Error::new(reason(&error)))?;
        // SAFETY: the handle is used only if it is not null; names are C strings.
        unsafe {
            let handle = (functions.new_device)(CPU);
            if handle.is_null() {
                functions.check(null_mut())?;
                return Err(Error::new("open image denoise gives no device of the processor"));
            }
            let version = (functions.get_device_int)(handle, c"version".as_ptr());
            let device = Self { functions, handle, version };
            let threads = c_int::try_from(threads).unwrap_or(c_int::MAX);
            (device.functions.set_device_int)(handle, c"numThreads".as_ptr(), threads);
            (device.functions.set_device_bool)(handle, c"setAffinity".as_ptr(), false);
            (device.functions.commit_device)(handle);
            device.functions.check(handle)?;
            Ok(device)
        }
    }

    /// The library's version, such as `2.3.3`.
    pub fn version(&self) -> String {
        format!("{}.{}.{}", self.version / 10_000, self.version / 100 % 100, self.version % 100)
    }

    /// Whether the library is at least of a version.
    pub fn at_least(&self, major: c_int, minor: c_int) -> bool {
        self.version >= major * 10_000 + minor * 100
    }

    /// Filters an image.
    pub fn filter(&mut self, job: Job) -> Result<()> {
        let Job { width, height, color, albedo, normal, .. } = job;
        assert!([color.len(), albedo.len(), normal.len()] == [width * height; 3], "images of one size");
        let f = &self.functions;
        // SAFETY: every image is width × height packed pixels of three floats, as checked above, and outlives the
        // filter, which is released below in every case; reading and writing the same image is allowed.
        unsafe {
            let filter = (f.new_filter)(self.handle, c"RT".as_ptr());
            if filter.is_null() {
                f.check(self.handle)?;
                return Err(Error::new("open image denoise has no filter `RT`"));
            }
            let image = |name: &CStr, data: *mut [f32; 3]| {
                (f.set_image)(filter, name.as_ptr(), data.cast(), FLOAT3, width, height, 0, 0, 0);
            };
            let radiance = color.as_mut_ptr();
            image(c"color", radiance);
            image(c"albedo", albedo.as_mut_ptr());
            image(c"normal", normal.as_mut_ptr());
            image(c"output", radiance);
            (f.set_bool)(filter, c"hdr".as_ptr(), true);
            (f.set_bool)(filter, c"cleanAux".as_ptr(), job.clean_guides);
            (f.set_float)(filter, c"inputScale".as_ptr(), job.scale);
            if self.at_least(2, 0) {
                (f.set_int)(filter, c"quality".as_ptr(), job.quality);
            }
            (f.commit_filter)(filter);
            let committed = f.check(self.handle);
            if committed.is_ok() {
                (f.execute_filter)(filter);
            }
            let done = committed.and_then(|()| f.check(self.handle));
            (f.release_filter)(filter);
            done
        }
    }
}

impl Drop for Device {
    fn drop(&mut self) {
        // SAFETY: the device is alive and no longer used.
        unsafe { (self.functions.release_device)(self.handle) }
    }
}

/// The loader's reason, on one line.
fn reason(error: &libloading::Error) -> String {
    let text = match std::error::Error::source(error) {
        Some(source) => format!("{error}: {source}"),
        None => error.to_string(),
    };
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}
