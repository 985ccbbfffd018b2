//! Names and paths that a recipe refers to, as types: the program knows from the type what a text must name, checks it
//! before anything runs, and suggests the nearest name when it is wrong.

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::{Deserialize, Serialize};
use std::borrow::Cow;
use std::path::{Path, PathBuf};

/// A type of names of pools.
pub trait PoolName: From<String> + JsonSchema {
    /// The kind of reference, such as `pool:object`.
    const REFERENCE: &'static str;

    /// The name.
    fn as_str(&self) -> &str;
}

macro_rules! name {
    ($(#[$doc:meta])* $name:ident, $reference:literal, $description:literal) => {
        $(#[$doc])*
        #[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
        #[serde(transparent)]
        pub struct $name(pub String);

        impl $name {
            /// The name.
            pub fn as_str(&self) -> &str {
                &self.0
            }
        }

        impl From<&str> for $name {
            fn from(name: &str) -> Self {
                Self(name.to_owned())
            }
        }

        impl JsonSchema for $name {
            fn schema_name() -> Cow<'static, str> {
                stringify!($name).into()
            }
            fn json_schema(_: &mut SchemaGenerator) -> Schema {
                json_schema!({ "type": "string", "description": $description, "x-syntable-ref": $reference })
            }
        }
    };
}

macro_rules! pool {
    ($(#[$doc:meta])* $name:ident, $reference:literal, $description:literal) => {
        name!($(#[$doc])* $name, $reference, $description);

        impl From<String> for $name {
            fn from(name: String) -> Self {
                Self(name)
            }
        }

        impl PoolName for $name {
            const REFERENCE: &'static str = $reference;

            fn as_str(&self) -> &str {
                &self.0
            }
        }
    };
}

name!(
    /// Name of a product that a writer wants.
    ProductName,
    "product",
    "Name of a product; `syntable list products` shows them."
);
pool!(
    /// Id of an `[assets.<id>]` table that gives objects.
    ObjectPool,
    "pool:object",
    "Id of an [assets.<id>] table that gives objects."
);
pool!(
    /// Id of an `[assets.<id>]` table that gives materials.
    MaterialPool,
    "pool:material",
    "Id of an [assets.<id>] table that gives materials."
);
pool!(
    /// Id of an `[assets.<id>]` table that gives environment maps.
    EnvironmentPool,
    "pool:environment",
    "Id of an [assets.<id>] table that gives environment maps."
);
name!(
    /// Name of a [support](crate::scene::Support) that a step of `[[place]]` sets.
    SupportName,
    "support",
    "Name of a support, a place that carries objects: a step of [[place]] sets it, such as `table` by the kind `table`."
);

impl SupportName {
    /// The kind of reference.
    pub const REFERENCE: &'static str = "support";
}

/// A file or folder named in a recipe. `${NAME}` is replaced by the environment variable; a relative path counts from
/// the recipe file that names it. By the time a stage sees it, it is a path that can be opened.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct AssetPath(pub PathBuf);

impl AssetPath {
    /// The path.
    pub fn path(&self) -> &Path {
        &self.0
    }
}

impl JsonSchema for AssetPath {
    fn schema_name() -> Cow<'static, str> {
        "AssetPath".into()
    }
    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({
            "type": "string", "minLength": 1, "x-syntable-ref": "path",
            "description": "A path; ${NAME} is replaced by the environment variable, relative paths count from this recipe's folder."
        })
    }
}
