//! `auto`: the best denoiser that is found.

use crate::guided::Guided;
use crate::oidn::{Oidn, OidnDenoiser};
use std::path::PathBuf;
use std::sync::OnceLock;
use syntable_model::prelude::*;

/// Environment variable that names the library.
const LIBRARY: &str = "OIDN_LIBRARY";

/// Names by which the system's loader finds an installed library.
const INSTALLED: &[&str] = if cfg!(windows) {
    &["OpenImageDenoise.dll"]
} else if cfg!(target_os = "macos") {
    &["libOpenImageDenoise.2.dylib", "libOpenImageDenoise.dylib"]
} else {
    &["libOpenImageDenoise.so.2", "libOpenImageDenoise.so"]
};

/// `oidn` where Open Image Denoise is found, else `guided`. It is looked for where the
/// environment variable `OIDN_LIBRARY` says, and where the system's loader finds installed libraries.
///
/// Images then depend on what a machine has; `denoiser` in the output names what was taken. Where the same images are
/// needed everywhere, name `guided` or `oidn`.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Auto {}

impl Config for Auto {
    type Stage = dyn Denoiser;
    const KIND: &'static str = "auto";
    const EXAMPLE: &'static str = "";
    fn build(self) -> Result<Box<dyn Denoiser>, ConfigError> {
        let named = std::env::var_os(LIBRARY).filter(|path| !path.is_empty()).map(PathBuf::from);
        Ok(Box::new(Finder {
            candidates: named.into_iter().chain(INSTALLED.iter().map(PathBuf::from)).collect(),
            ..Finder::default()
        }))
    }
}

/// The denoiser of [`Auto`].
#[derive(Default)]
struct Finder {
    candidates: Vec<PathBuf>,
    guided: Guided,
    /// The denoiser that was found, if any; looked for once.
    found: OnceLock<Option<OidnDenoiser>>,
}

impl Finder {
    fn taken(&self) -> &dyn Denoiser {
        let find = || {
            let made = self.candidates.iter().map(|library| OidnDenoiser::new(Oidn::with_library(library.clone())));
            made.into_iter().find(|denoiser| denoiser.ready().is_ok())
        };
        match self.found.get_or_init(find) {
            Some(oidn) => oidn,
            None => &self.guided,
        }
    }
}

impl Denoiser for Finder {
    fn reads(&self) -> Vec<KeyId> {
        // Those of both: `check` and `plan` open no library.
        let mut keys = self.guided.reads();
        let others = OidnDenoiser::new(Oidn::with_library(PathBuf::new())).reads();
        keys.extend(others.into_iter().filter(|key| !self.guided.reads().contains(key)));
        keys
    }

    fn ready(&self) -> Result<()> {
        self.taken().ready()
    }

    fn denoise(&self, cx: &ViewContext, products: &mut Products) -> Result<()> {
        self.taken().denoise(cx, products)
    }
}

register!(Auto);

#[cfg(test)]
mod tests {
    use super::*;
    use syntable_model::product::standard::DENOISER;

    #[test]
    fn without_a_library_it_is_guided() {
        let finder = Finder { candidates: vec!["/nowhere/library.so".into(), file!().into()], ..Finder::default() };
        assert!(finder.ready().is_ok());
        assert!(finder.found.get().is_some_and(Option::is_none));
        assert_eq!(finder.provides(), finder.guided.provides());
        assert!(finder.provides().contains(&DENOISER.id()));
    }

    #[test]
    fn the_library_that_is_there_is_taken() {
        let Some(library) = std::env::var_os("SYNTABLE_OIDN") else {
            assert!(std::env::var("SYNTABLE_REQUIRE_TOOLS").as_deref() != Ok("1"), "SYNTABLE_OIDN must be set");
            return eprintln!("SYNTABLE_OIDN is not set: `auto` is not tested with Open Image Denoise");
        };
        let candidates = vec!["/nowhere/library.so".into(), PathBuf::from(library)];
        let finder = Finder { candidates, ..Finder::default() };
        assert!(finder.ready().is_ok());
        assert!(finder.found.get().is_some_and(Option::is_some));
    }
}
