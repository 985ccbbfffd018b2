//! `auto`: the best available denoiser.

use crate::oidn::{self, Library, Oidn};
use syntable_guided::Guided;
use syntable_model::prelude::*;
use syntable_model::registry::{Choice, Choose};

/// `oidn` where Open Image Denoise is found, else `guided`. It is looked for where the environment variable `OIDN_LIBRARY`
/// says, or else where the system's loader finds installed libraries; one that the variable names must open.
///
/// The choice is made when a dataset begins: its recipe names the kind, and a resumed run uses no other. Where the same
/// images are needed everywhere, name `guided`, and `cpu_path` as the renderer.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Auto {}

impl Config for Auto {
    type Stage = dyn Denoiser;
    const KIND: &'static str = "auto";
    const EXAMPLE: &'static str = "";
    const CHOOSE: Option<Choose> = Some(|_| choose(&Library::of_machine()));
    fn build(self) -> Result<Box<dyn Denoiser>, ConfigError> {
        Ok(Box::new(Undecided::default()))
    }
}

fn choose(library: &Library) -> Result<Choice> {
    match (library.version(), library) {
        (Ok(version), _) => Ok(Choice { kind: Oidn::KIND, reason: format!("Open Image Denoise {version}") }),
        (Err(error), Library::Named(_)) => Err(error),
        (Err(error), Library::Installed(_)) => Ok(Choice { kind: Guided::KIND, reason: error.message().to_owned() }),
    }
}

/// The denoiser of [`Auto`] in a plan. It reads the products that either kind needs.
#[derive(Default)]
struct Undecided(Guided);

impl Denoiser for Undecided {
    fn reads(&self) -> Vec<KeyId> {
        let mut keys = self.0.reads();
        keys.extend(oidn::reads().into_iter().filter(|key| !self.0.reads().contains(key)));
        keys
    }

    fn denoise(&self, cx: &ViewContext, products: &mut Products) -> Result<()> {
        self.0.denoise(cx, products)
    }
}

register!(Auto);

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn without_a_library_it_is_guided_and_says_why() {
        let Choice { kind, reason } = choose(&Library::Installed(vec!["libnowhere.so.7"])).expect("guided");
        assert_eq!(kind, "guided");
        assert!(reason.contains("not installed") && reason.contains("libnowhere.so.7"), "{reason}");
    }

    #[test]
    fn a_library_that_is_named_must_open() {
        for path in ["/nowhere/library.so", file!()] {
            let error = choose(&Library::Named(path.into())).expect_err("named").to_string();
            assert!(error.contains(path) && error.contains("OIDN_LIBRARY"), "{error}");
        }
    }

    #[test]
    fn the_library_that_is_there_is_taken() {
        let Some(library) = std::env::var_os("SYNTABLE_OIDN") else {
            return syntable_testing::tools::skip("the path of Open Image Denoise in SYNTABLE_OIDN");
        };
        let Choice { kind, reason } = choose(&Library::Named(library.into())).expect("it opens");
        assert!(kind == "oidn" && reason.starts_with("Open Image Denoise "), "{kind}: {reason}");
    }
}
