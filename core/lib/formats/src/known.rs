//! The products that a dataset may hold: the products of linked crates, and the products that the dataset declares.

use crate::decode::FileContent;
use crate::json;
use std::collections::BTreeMap;
use std::sync::Arc;
use syntable_model::error::Result;
use syntable_model::files::DatasetFolder;
use syntable_model::limits::DECLARED_BYTES;
use syntable_model::product::{DeclaredProduct, Form, KeyId, linked};

/// The file of the products that a dataset declares, next to their values: a [`DeclaredProduct`] by name.
pub const PRODUCTS: &str = "products.json";

/// Keys of products by name. A copy shares the list.
#[derive(Debug, Clone)]
pub struct KnownProducts(Arc<Vec<KeyId>>);

impl Default for KnownProducts {
    fn default() -> Self {
        Self(Arc::new(linked().to_vec()))
    }
}

impl KnownProducts {
    /// The products of linked crates, and the products in the folder's [file of products](PRODUCTS) if it exists.
    ///
    /// # Errors
    /// If the file cannot be read, or contradicts a linked crate.
    pub fn of(folder: &DatasetFolder) -> Result<Self> {
        let path = folder.file(PRODUCTS)?;
        if !path.is_file() {
            return Ok(Self::default());
        }
        let content = FileContent::read(&path)?;
        Self::declared_in(content.bytes()).map_err(|error| error.in_file(&path).of_request())
    }

    /// The products of linked crates, and the products that a JSON text declares.
    ///
    /// # Errors
    /// If the text is longer than the limit, is not JSON of this form, or contradicts a linked crate.
    pub fn declared_in(text: &[u8]) -> Result<Self> {
        DECLARED_BYTES.check(text.len() as u64)?;
        let declared: BTreeMap<String, DeclaredProduct> =
            serde_json::from_slice(text).map_err(|error| json::located(&error, None, text))?;
        let declared = declared.iter().map(|(name, product)| product.key(name)).collect::<Result<Vec<_>>>()?;
        let mut all = Self::default();
        all.extend(&Self(Arc::new(declared)));
        Ok(all)
    }

    /// Adds other products, except for names that are known already.
    pub fn extend(&mut self, others: &Self) {
        let new = others.iter().filter(|key| self.named(key.product).is_none()).copied().collect::<Vec<_>>();
        Arc::make_mut(&mut self.0).extend(new);
    }

    /// The key of a product.
    pub fn named(&self, product: &str) -> Option<&KeyId> {
        self.0.iter().find(|key| key.is(product))
    }

    /// Whether a product has a value for each instance.
    pub fn is_per_instance(&self, product: &str) -> bool {
        self.named(product).is_some_and(|key| matches!(key.form(), Form::PerInstance(_)))
    }

    /// The keys.
    pub fn iter(&self) -> impl Iterator<Item = &KeyId> {
        self.0.iter()
    }
}

/// The declarations of the products that no linked crate defines; none without such products.
pub fn declared(keys: &[KeyId]) -> Option<BTreeMap<&'static str, DeclaredProduct>> {
    let of = |key: &KeyId| Some((key.product, DeclaredProduct::of(key)?));
    let declared: BTreeMap<&str, DeclaredProduct> = keys.iter().filter_map(of).collect();
    Some(declared).filter(|declared| !declared.is_empty())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn declarations_of_strangers_are_checked() {
        let known = |text: &str| KnownProducts::declared_in(text.as_bytes());
        let heat = r#"{ "heat": { "form": "float per object", "unit": "K" } }"#;
        let products = known(heat).expect("declared");
        assert!(products.is_per_instance("heat") && products.named("rgb").is_some());
        let keys = [*products.named("heat").expect("declared")];
        assert_eq!(
            serde_json::to_string(&declared(&keys)).expect("JSON"),
            heat.replace(' ', "").replace("floatperobject", "float per object")
        );
        let long = format!(r#"{{ "heat": {{ "form": "int", "doc": "{}" }} }}"#, "x".repeat(1 << 16));
        for (wrong, says) in [
            (long.as_str(), "bytes"),
            (r#"{ "a/b": { "form": "int" } }"#, "lower-case"),
            (r#"{ "heat": { "form": "image" } }"#, "dtype"),
            (r#"{ "rgb": { "form": "int" } }"#, "another name"),
            (r#"{ "heat": 3 }"#, "integer `3`"),
            ("[]", "map"),
        ] {
            let error = known(wrong).expect_err("refused").to_string();
            assert!(error.contains(says), "{error}");
        }
    }
}
