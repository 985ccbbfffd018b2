//! Names in recipes that have changed. A recipe that uses an old name gets an error that gives the new one.
//!
//! Options of kinds are not listed here: a kind lists its own, in
//! [`Config::RENAMED`](syntable_model::registry::Config::RENAMED).

use crate::tables::check;
use crate::text::code::Code;
use crate::text::diagnostic::DiagnosticBuilder;
use crate::text::fix::Change;
use crate::text::source::Span;
use syntable_model::product::standard::RENAMED as PRODUCTS;
use syntable_model::registry::Slot;

/// Old and new names.
pub(crate) struct RenamedNames<'r> {
    /// Options of every pool.
    pub pool: check::Renamed<'r>,
    /// Options of `[dataset]`.
    pub dataset: check::Renamed<'r>,
    /// Kinds of stages: slot, old name, new name.
    pub kinds: &'r [(Slot, &'r str, &'r str)],
    /// Products.
    pub products: &'r [(&'r str, &'r str)],
}

/// All names that have changed.
pub(crate) const RENAMED: RenamedNames<'static> = RenamedNames {
    pool: &[
        ("centre", "center"),   // typos: ignore
        ("licence", "license"), // typos: ignore
        ("longest_side_m", "scale.longest_side_m"),
        ("mass_kg", "mass.kg"),
        ("density_kg_m3", "mass.density_kg_m3"),
    ],
    dataset: &[],
    kinds: &[],
    products: PRODUCTS,
};

impl RenamedNames<'_> {
    /// The error for an old kind. `is_id` if the id of the table is the kind.
    pub fn kind(&self, slot: Slot, kind: &str, is_id: bool, span: &Span) -> Option<DiagnosticBuilder> {
        let (_, _, new) = self.kinds.iter().find(|(of, old, _)| *of == slot && *old == kind)?;
        let message = format!("the kind `{kind}` of `{slot}` is called `{new}` now");
        let diagnostic = DiagnosticBuilder::error(Code::Renamed, span.clone(), message).label(format!("write `{new}`"));
        Some(diagnostic.change(match is_id {
            // The id of the table names its folder and its random numbers, and stays.
            true => Change::LineBelow(format!("kind = \"{new}\"")),
            false => Change::Word { old: kind.to_owned(), new: (*new).to_owned() },
        }))
    }

    /// The error for an old product, and its new name.
    pub fn product(&self, name: &str, span: &Span) -> Option<(DiagnosticBuilder, String)> {
        let listed = self.products.iter().find(|(old, _)| *old == name).map(|(_, new)| (*new).to_owned());
        let new = listed.or_else(|| before_support(name))?;
        let message = format!("the product `{name}` is called `{new}` now");
        let diagnostic =
            DiagnosticBuilder::error(Code::Renamed, span.clone(), message).label(format!("write \"{new}\""));
        Some((diagnostic.change(Change::Word { old: name.to_owned(), new: new.clone() }), new))
    }
}

/// The present name of `coverage (before support, …)`, which was a framing and is a product.
fn before_support(name: &str) -> Option<String> {
    let framings = name.strip_prefix("coverage (")?.strip_suffix(')')?.split(", ");
    let (before, others): (Vec<&str>, Vec<&str>) = framings.partition(|framing| *framing == "before support");
    let product = "coverage_before_support";
    match others.as_slice() {
        _ if before.is_empty() => None,
        [] => Some(product.to_owned()),
        others => Some(format!("{product} ({})", others.join(", "))),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::load::load_with;
    use crate::merge::overrides::Overrides;
    use crate::text::origin::Source;
    use syntable_model::prelude::*;
    use syntable_model::registry::{Entry, Registry};

    /// Lists products.
    #[derive(Serialize, Deserialize, JsonSchema)]
    #[serde(deny_unknown_fields)]
    struct Ledger {
        /// Products to list.
        include: Vec<ProductName>,
    }

    impl Config for Ledger {
        type Stage = dyn Writer;
        const KIND: &'static str = "ledger";
        const EXAMPLE: &'static str = "include = []";
        const RENAMED: &'static [(&'static str, &'static str)] = &[("products", "include")];
        fn build(self) -> Result<Box<dyn Writer>, ConfigError> {
            Ok(Box::new(self))
        }
    }

    impl Writer for Ledger {
        fn reads(&self) -> Vec<Input> {
            Input::included(&self.include, Accepts::Any)
        }
        fn scene(&self, _: &ImagesContext, _: Output) -> Result<Box<dyn SceneWriter>> {
            Err(Error::new("this writer writes nothing"))
        }
    }

    #[test]
    fn every_old_name_gives_the_new_one() {
        let registry = Registry::new([Entry::of::<Ledger>("test", "0.0.0")]).expect("one kind");
        let renamed = RenamedNames {
            pool: &[],
            dataset: &[("count", "scenes")],
            kinds: &[(Slot::Write, "book", "ledger")],
            products: &[("glare", "radiance")],
        };
        let text = "[dataset]\ncount = 2\n[write.book]\n[write.a]\nkind = \"book\"\n[write.b]\nkind = \"ledger\"\n\
                    products = []\n[write.c]\nkind = \"ledger\"\ninclude = [\"glare\"]\n";
        let overrides = Overrides::of_process(Vec::new());
        let report = load_with(&registry, Source::embedded("r.toml", text), &overrides, &renamed);
        let report = report.err().expect("old names are errors");
        let found: Vec<(usize, &str)> = report
            .iter()
            // No stage provides a product here.
            .filter(|diagnostic| ![Code::MissingSection, Code::UnknownProduct].contains(&diagnostic.code))
            .inspect(|diagnostic| assert_eq!(diagnostic.code, Code::Renamed, "{diagnostic:?}"))
            .map(|diagnostic| (diagnostic.labels[0].line_column().0, diagnostic.message.as_str()))
            .collect();
        assert_eq!(
            found,
            [
                (2, "`count` of `dataset` is called `scenes` now"),
                (3, "the kind `book` of `write` is called `ledger` now"),
                (5, "the kind `book` of `write` is called `ledger` now"),
                (8, "`products` of `ledger` is called `include` now"),
                (11, "the product `glare` is called `radiance` now"),
            ]
        );
    }
}
