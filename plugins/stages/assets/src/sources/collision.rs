//! Identifies the collision meshes of a pool by their names and by the other meshes of the pool.
//!
//! Simulators keep a simplified mesh for physics next to the rendered one. No standard names it, so three rules decide,
//! in this order:
//!
//! 1. **Folder.** A folder named after collisions (`collision`, `collisions_mesh`, `vhacd`) has only collision meshes.
//!    A folder with an ambiguous name (`convex`, `physics`, `hulls`) has them only next to the rendered mesh. The rule
//!    does not apply if each sibling folder has an object under the same file name: `hull/model` next to `mug/model` and
//!    `cup/model`.
//! 2. **Sibling.** Without such a word, the name equals the name of another mesh of the same object: `cup_hull_0` next
//!    to `cup`, `collision_geometry` next to `visual_geometry`. A name with only such words belongs to the mesh of its
//!    folder: `collision` and `convex_hull` next to `textured`.
//! 3. **Name.** An unambiguous word occurs after the first word of the name: `mug_vhacd`, `part_collision_3`.
//!
//! So `convex_mirror`, `hull` and `collision_course_game` are objects unless rule 2 finds their objects.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt;
use std::path::{Path, PathBuf};

/// Words that only mean collision geometry.
const CERTAIN: [&str; 12] = [
    "collision",
    "collisions",
    // Spelling of a well-known data set.
    "collison", // typos: ignore
    "collider",
    "colliders",
    "vhacd",
    "hacd",
    "coacd",
    "colonly",
    "convcol",
    "convcolonly",
    "hitbox",
];

/// Words that mean collision geometry next to the rendered mesh, and may have another meaning alone. `nontextured` is
/// the scan of an object without its texture.
const LIKELY: [&str; 30] = [
    "col",
    "coll",
    "colls",
    "convex",
    "convexhull",
    "cvx",
    "cv",
    "ch",
    "hull",
    "hulls",
    "chull",
    "decomp",
    "decomposed",
    "decomposition",
    "acd",
    "phys",
    "physics",
    "physx",
    "collide",
    "ucx",
    "ubx",
    "usp",
    "ucp",
    "bbox",
    "obb",
    "aabb",
    "proxy",
    "cm",
    "nontextured",
    "untextured",
];

/// Words that only mean that a file is a mesh.
const GENERIC: [&str; 20] = [
    "mesh",
    "meshes",
    "model",
    "models",
    "geometry",
    "geom",
    "shape",
    "shapes",
    "part",
    "parts",
    "piece",
    "pieces",
    "obj",
    "objs",
    "object",
    "objects",
    "files",
    "simplified",
    "simple",
    "normalized",
];

/// Words of the rendered mesh.
const VISUAL: [&str; 9] = ["visual", "visuals", "vis", "render", "rendered", "textured", "graphics", "display", "vm"];

/// Words that are rarely the whole name of anything but a collision mesh.
const TELLING: [&str; 10] =
    ["coll", "colls", "cvx", "chull", "convexhull", "decomp", "decomposed", "decomposition", "acd", "physx"];

/// Extensions that tools leave inside names, such as `mug.obj.convex.stl`.
const EXTENSIONS: [&str; 7] = ["obj", "stl", "ply", "glb", "gltf", "dae", "off"];

/// The rule that identifies a collision mesh, with its word or folder.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub enum Rule {
    /// Its folder is named after collisions.
    Folder {
        /// The name.
        name: String,
        /// Whether the rendered mesh was not found.
        alone: bool,
    },
    /// Its name without this word is the name of another mesh of the object.
    Sibling(String),
    /// Its name has a word that only means collision geometry.
    Name {
        /// The word.
        word: String,
        /// Whether the rendered mesh was not found.
        alone: bool,
    },
}

impl Rule {
    /// Whether only a word identifies the mesh, which may be a separate object.
    pub fn is_alone(&self) -> bool {
        matches!(self, Self::Folder { alone: true, .. } | Self::Name { alone: true, .. })
    }
}

impl fmt::Display for Rule {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Folder { name, .. } => write!(f, "folder `{name}`"),
            Self::Sibling(word) => write!(f, "next to a mesh without `{word}`"),
            Self::Name { word, .. } => write!(f, "word `{word}`"),
        }
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum NameKind {
    Certain,
    Likely,
    Generic,
    Visual,
    Number,
    Other,
}

/// The kind of a word. Trailing numbers are ignored, as in `hull3`.
fn kind(word: &str) -> NameKind {
    let letters = word.trim_end_matches(|c: char| c.is_ascii_digit());
    match letters {
        "" => NameKind::Number,
        _ if CERTAIN.contains(&letters) => NameKind::Certain,
        _ if LIKELY.contains(&letters) => NameKind::Likely,
        _ if GENERIC.contains(&letters) => NameKind::Generic,
        _ if VISUAL.contains(&letters) => NameKind::Visual,
        _ => NameKind::Other,
    }
}

fn is_collision(kind: NameKind) -> bool {
    matches!(kind, NameKind::Certain | NameKind::Likely)
}

/// The words of a name in lower case: `MugCollision`, `mug-collision` and `mug.collision` have the same. Extensions
/// behind the first word are left out.
fn words(name: &str) -> Vec<String> {
    let mut words: Vec<String> = Vec::new();
    let mut open = false;
    let mut before = ' ';
    for c in name.chars() {
        if !c.is_alphanumeric() {
            open = false;
        } else {
            if !open || (before.is_lowercase() && c.is_uppercase()) {
                words.push(String::new());
            }
            open = true;
            if let Some(word) = words.last_mut() {
                word.extend(c.to_lowercase());
            }
        }
        before = c;
    }
    let mut at = 0;
    words.retain(|word| {
        at += 1;
        at == 1 || !EXTENSIONS.contains(&word.as_str())
    });
    words
}

/// A name without the numbers at its end.
fn without_number(name: &[String]) -> Vec<String> {
    let last = name.iter().rposition(|word| kind(word) != NameKind::Number);
    name[..last.map_or(0, |last| last + 1)].to_vec()
}

/// Meaning of a folder's name for its meshes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Says {
    /// Collision meshes; `certain` if the name has no other meaning.
    Collision { certain: bool },
    /// Rendered meshes, or any meshes: `visual`, `meshes`.
    Meshes { visual: bool },
    /// The name of an object or a category.
    Nothing,
}

fn says(folder: &str) -> Says {
    let kinds: Vec<NameKind> = words(folder).iter().map(|word| kind(word)).collect();
    let (only, any) = (
        |known: &dyn Fn(NameKind) -> bool| !kinds.is_empty() && kinds.iter().all(|&kind| known(kind)),
        |known: &dyn Fn(NameKind) -> bool| kinds.iter().any(|&kind| known(kind)),
    );
    let plain = |kind| matches!(kind, NameKind::Generic | NameKind::Number);
    if only(&|kind| is_collision(kind) || plain(kind)) && any(&is_collision) {
        Says::Collision { certain: any(&|kind| kind == NameKind::Certain) }
    } else if only(&|kind| kind == NameKind::Visual || plain(kind)) && !only(&|kind| kind == NameKind::Number) {
        Says::Meshes { visual: any(&|kind| kind == NameKind::Visual) }
    } else {
        Says::Nothing
    }
}

fn has_number(word: &str) -> bool {
    word.ends_with(|c: char| c.is_ascii_digit())
}

/// Folders that are named by a collision word but hold an object: `hull/model` next to `mug/model` and `cup/model`,
/// without a rendered mesh in the folder above or a folder of rendered meshes.
fn homes_with_such_names(meshes: &[&Path]) -> BTreeSet<PathBuf> {
    let such = |home: &&Path| {
        home.file_name().is_some_and(|name| matches!(says(&name.to_string_lossy()), Says::Collision { .. }))
    };
    let above: BTreeSet<&Path> =
        meshes.iter().flat_map(|mesh| mesh.ancestors().skip(1)).filter(such).filter_map(Path::parent).collect();
    // Plain meshes by the folder above, the folder, and the path below that.
    let mut trees: BTreeMap<&Path, BTreeMap<&str, BTreeSet<&Path>>> = BTreeMap::new();
    let mut in_folder: BTreeMap<&Path, Vec<PoolMesh>> = BTreeMap::new();
    for &mesh in meshes {
        let folder = mesh.parent().unwrap_or(Path::new(""));
        if above.contains(folder) {
            in_folder.entry(folder).or_default().push(PoolMesh::new(mesh, &BTreeSet::new()));
        }
        for home in folder.ancestors() {
            let (Some(parent), Some(name)) = (home.parent(), home.file_name().and_then(|name| name.to_str())) else {
                continue;
            };
            let Ok(below) = mesh.strip_prefix(home) else { continue };
            if above.contains(parent) && PoolMesh::new(below, &BTreeSet::new()).is_plain() {
                trees.entry(parent).or_default().entry(name).or_default().insert(below);
            }
        }
    }
    let all: BTreeSet<&Path> = meshes.iter().copied().collect();
    let mut found = BTreeSet::new();
    for (above, folders) in &trees {
        let own = above.file_name().map(|name| words(&name.to_string_lossy()));
        let is_object = |name: &str| match says(name) {
            Says::Collision { .. } => false,
            Says::Meshes { visual } => !visual && words(name).iter().any(|word| has_number(word)),
            Says::Nothing => own.as_ref() != Some(&words(name)),
        };
        let is_rendered = |name: &str| !is_object(name) && !matches!(says(name), Says::Collision { .. });
        if folders.keys().any(|name| is_rendered(name)) {
            continue;
        }
        let here = in_folder.get(above).map_or(&[][..], Vec::as_slice);
        for (name, own_meshes) in folders {
            let Says::Collision { certain } = says(name) else { continue };
            let mut shared: BTreeSet<&Path> = BTreeSet::new();
            let mut beside = 0;
            for (_, others) in folders.iter().filter(|(name, _)| is_object(name)) {
                let both: Vec<&Path> = others.intersection(own_meshes).copied().collect();
                beside += usize::from(!both.is_empty());
                shared.extend(both);
            }
            let names: Vec<PoolMesh> = shared.iter().map(|path| PoolMesh::new(path, &BTreeSet::new())).collect();
            let files: BTreeSet<Vec<String>> = names.iter().map(|name| without_number(&name.words)).collect();
            let in_folders: BTreeSet<_> = shared.iter().map(|path| path.parent()).collect();
            // Trees with the same objects, such as `original/a/model`, `original/b/model` and `collision/a/model`, are
            // not objects.
            let is_one =
                (files.len() == 1 || names.iter().any(PoolMesh::is_main)) && (!certain || in_folders.len() == 1);
            let of_above = |mesh: &PoolMesh| {
                let is_same = files.contains(&without_number(&mesh.words));
                is_same || (mesh.is_main() && !mesh.is_numbered()) || mesh.is_named_after_folder()
            };
            let is_above =
                here.iter().any(of_above) || shared.iter().any(|path| all.contains(above.join(path).as_path()));
            if beside > usize::from(certain) && is_one && !is_above {
                found.insert(above.join(name));
            }
        }
    }
    found
}

/// A mesh of the pool by its path without the extension.
struct PoolMesh {
    /// Folder of the object: the mesh's folder, without folders that name a kind of mesh.
    object: PathBuf,
    /// The first folder that is named after collisions, and whether its name has no other meaning.
    folder: Option<(String, bool)>,
    words: Vec<String>,
    kinds: Vec<NameKind>,
    /// Whether a folder is named after visual meshes.
    in_visual_folder: bool,
}

impl PoolMesh {
    /// Folders among `homes` hold an object, whatever their names.
    fn new(stem: &Path, homes: &BTreeSet<PathBuf>) -> Self {
        let mut named = Self {
            object: PathBuf::new(),
            folder: None,
            words: words(&stem.file_name().unwrap_or_default().to_string_lossy()),
            kinds: Vec::new(),
            in_visual_folder: false,
        };
        named.kinds = named.words.iter().map(|word| kind(word)).collect();
        let mut path = PathBuf::new();
        for folder in stem.parent().into_iter().flatten() {
            path.push(folder);
            let name = folder.to_string_lossy();
            match says(&name) {
                _ if homes.contains(&path) => named.object.push(folder),
                Says::Collision { certain } => {
                    if named.folder.as_ref().is_none_or(|(_, known)| certain && !known) {
                        named.folder = Some((name.into_owned(), certain));
                    }
                }
                Says::Meshes { visual } => named.in_visual_folder |= visual,
                Says::Nothing => named.object.push(folder),
            }
        }
        named
    }

    /// Whether neither name nor folder indicates a collision mesh.
    fn is_plain(&self) -> bool {
        self.folder.is_none() && !self.kinds.iter().any(|&kind| is_collision(kind))
    }

    /// Whether the name only means the mesh of its folder: `model`, `textured`, `visual_geometry`.
    fn is_main(&self) -> bool {
        let says_nothing = |kind: &NameKind| matches!(kind, NameKind::Generic | NameKind::Visual | NameKind::Number);
        self.is_plain()
            && self.kinds.iter().all(says_nothing)
            && self.kinds.iter().any(|kind| *kind != NameKind::Number)
    }

    /// Whether its name has a number, as a word or at the end of one.
    fn is_numbered(&self) -> bool {
        self.words.iter().any(|word| has_number(word))
    }

    /// Whether it is named after the folder of its object.
    fn is_named_after_folder(&self) -> bool {
        let folder = self.object.file_name().map(|name| words(&name.to_string_lossy()));
        self.is_plain() && folder.is_some_and(|folder| folder == self.without(|kind| kind == NameKind::Visual))
    }

    fn without(&self, dropped: impl Fn(NameKind) -> bool) -> Vec<String> {
        let words = self.words.iter().zip(&self.kinds).filter(|(_, kind)| !dropped(**kind));
        words.map(|(word, _)| word.clone()).collect()
    }

    /// Candidates for the name without collision words: also without the numbers and generic words after them, without
    /// trailing numbers, and with only the last of these words removed.
    fn bases(&self) -> Vec<Vec<String>> {
        let mut without_tail = Vec::new();
        let mut behind = false;
        for (word, &kind) in self.words.iter().zip(&self.kinds) {
            behind = is_collision(kind) || (behind && matches!(kind, NameKind::Generic | NameKind::Number));
            if !behind {
                without_tail.push(word.clone());
            }
        }
        let plain = self.without(is_collision);
        let mut bases = vec![without_tail, without_number(&plain), plain];
        if let Some(last) = self.kinds.iter().rposition(|&kind| is_collision(kind)) {
            let mut words = self.words.clone();
            words.remove(last);
            bases.push(words);
        }
        bases.retain(|base| !base.is_empty());
        bases
    }
}

/// Content of an object's folder in the pool.
#[derive(Default)]
struct ObjectFolder {
    /// Names of its meshes, also without their visual words and the numbers of their parts, and the meshes that have
    /// them.
    names: BTreeMap<Vec<String>, BTreeSet<usize>>,
    /// Number of meshes that neither their names nor their folders mark as collision meshes.
    plain: usize,
    /// Number of meshes with purely generic names.
    mains: usize,
    /// Whether such a name has a number: `object_01` is one of several objects, or of several parts.
    is_series: bool,
    has_named_after: bool,
    has_visual_folder: bool,
}

impl ObjectFolder {
    /// Whether the folder has the mesh of an object under a purely generic name.
    fn has_main(&self) -> bool {
        self.mains > 0 && !self.is_series
    }

    /// Whether it only holds the mesh of one object, under such names: `textured` and `model`.
    fn is_one_object(&self) -> bool {
        self.has_main() && self.mains == self.plain
    }
}

/// The folders that are named after an object and hold its mesh: by the folder above and the words of their names.
type Homes<'a> = BTreeSet<(&'a Path, Vec<String>)>;

/// The folder of each mesh's object: the mesh's folder, or the folder above folders such as `visual` and `meshes`.
pub fn object_folders<'a>(stems: impl Iterator<Item = &'a Path>) -> Vec<PathBuf> {
    let paths: Vec<&Path> = stems.collect();
    let homes = homes_with_such_names(&paths);
    paths.iter().map(|path| PoolMesh::new(path, &homes).object).collect()
}

/// The rule that identifies each collision mesh, by the meshes' paths without extensions and relative to the root of
/// the pool; `None` for all other meshes. `others` are meshes in unsupported formats: they are siblings, too.
pub fn rules<'a>(stems: impl Iterator<Item = &'a Path>, others: impl Iterator<Item = &'a Path>) -> Vec<Option<Rule>> {
    let mut paths: Vec<&Path> = stems.collect();
    let count = paths.len();
    paths.extend(others);
    let such_homes = homes_with_such_names(&paths);
    let meshes: Vec<PoolMesh> = paths.iter().map(|path| PoolMesh::new(path, &such_homes)).collect();
    let mut folders: BTreeMap<&Path, ObjectFolder> = BTreeMap::new();
    for (at, mesh) in meshes.iter().enumerate() {
        let folder = folders.entry(&mesh.object).or_default();
        let mut names = vec![mesh.words.clone(), mesh.without(|kind| kind == NameKind::Visual)];
        // Parts of one rendered mesh are numbered.
        if mesh.is_plain() {
            let without: Vec<_> = names.iter().map(|name| without_number(name)).collect();
            names.extend(without);
        }
        // Files in a folder named after collisions are not rendered.
        for name in names.into_iter().filter(|_| mesh.folder.is_none()) {
            folder.names.entry(name).or_default().insert(at);
        }
        folder.plain += usize::from(mesh.is_plain());
        folder.mains += usize::from(mesh.is_main());
        folder.is_series |= mesh.is_main() && mesh.is_numbered();
        folder.has_named_after |= mesh.is_named_after_folder();
        folder.has_visual_folder |= mesh.is_plain() && mesh.in_visual_folder;
    }
    let homes: Homes<'_> = folders
        .iter()
        .filter(|(_, folder)| folder.mains > 0 || folder.has_named_after)
        .filter_map(|(path, _)| Some((path.parent()?, words(&path.file_name()?.to_string_lossy()))))
        .collect();
    // The names of objects anywhere in the pool.
    let mut objects: BTreeSet<Vec<String>> = BTreeSet::new();
    for mesh in meshes.iter().filter(|mesh| mesh.is_plain()) {
        objects.extend(mesh.object.iter().map(|folder| words(&folder.to_string_lossy())));
        if !mesh.is_main() {
            objects.insert(mesh.without(|kind| kind == NameKind::Visual));
        }
    }
    let meshes = meshes.iter().enumerate().take(count);
    meshes.map(|(at, mesh)| rule(at, mesh, &folders, &homes, &objects)).collect()
}

fn rule(
    at: usize,
    mesh: &PoolMesh,
    folders: &BTreeMap<&Path, ObjectFolder>,
    homes: &Homes<'_>,
    objects: &BTreeSet<Vec<String>>,
) -> Option<Rule> {
    let none = ObjectFolder::default();
    let folder = folders.get(mesh.object.as_path()).unwrap_or(&none);
    let has = |folder: &Path, name: &[String]| {
        let meshes = folders.get(folder).and_then(|folder| folder.names.get(name));
        meshes.is_some_and(|meshes| meshes.iter().any(|&other| other != at))
    };
    // The rendered mesh is in the folder of the object, or one folder above or below that is named after it.
    let has_sibling = |name: &[String]| {
        let above = || {
            let own = mesh.object.file_name().map(|own| words(&own.to_string_lossy()));
            own.as_deref() == Some(name) && mesh.object.parent().is_some_and(|above| has(above, name))
        };
        let below = || homes.contains(&(mesh.object.as_path(), name.to_vec()));
        has(&mesh.object, name) || above() || below()
    };
    if let Some((name, certain)) = &mesh.folder {
        let bases = mesh.bases().into_iter().chain([mesh.words.clone()]);
        let beside = folder.has_main()
            || folder.has_named_after
            || folder.has_visual_folder
            || bases.into_iter().any(|name| has_sibling(&name));
        if *certain || beside {
            let is_known = || mesh.bases().iter().chain([&mesh.words]).any(|name| objects.contains(name));
            let alone = !beside && folder.plain == 0 && !is_known();
            return Some(Rule::Folder { name: name.clone(), alone });
        }
    }
    let first = mesh.kinds.iter().position(|&kind| is_collision(kind))?;
    let word = mesh.words[first].clone();
    if mesh.bases().iter().any(|base| has_sibling(base)) {
        return Some(Rule::Sibling(word));
    }
    let certain = mesh.kinds.iter().position(|&kind| kind == NameKind::Certain);
    let says_nothing_else =
        mesh.kinds.iter().all(|&kind| is_collision(kind) || matches!(kind, NameKind::Generic | NameKind::Number));
    if says_nothing_else {
        if certain.is_some() {
            return Some(if folder.plain > 0 { Rule::Sibling(word) } else { Rule::Name { word, alone: true } });
        }
        // `boat/hull` next to `boat/boat` may be a part of the boat, and `lens/convex` next to `lens/concave` a lens.
        let after_folder = folder.has_named_after && mesh.words != ["hull"];
        let is_numbered = mesh.kinds.contains(&NameKind::Number) || has_number(&word);
        let telling = mesh.words.iter().any(|word| TELLING.contains(&word.as_str()));
        let several = mesh.kinds.iter().filter(|&&kind| is_collision(kind)).count() > 1;
        let of_the_only_one = folder.plain == 1 && (is_numbered || telling || several);
        return (folder.is_one_object() || after_folder || of_the_only_one).then_some(Rule::Sibling(word));
    }
    if mesh.kinds.iter().skip(1).any(|&kind| kind == NameKind::Certain) {
        let is_beside = folder.is_one_object() || folder.has_named_after || folder.has_visual_folder;
        let alone = !is_beside && !mesh.bases().iter().any(|name| objects.contains(name));
        return certain.map(|at| Rule::Name { word: mesh.words[at].clone(), alone });
    }
    // In the folder of one object, whose mesh has no specific name.
    (first > 0 && folder.is_one_object()).then_some(Rule::Sibling(word))
}

/// Number of meshes that each rule left out, for a message: `3 in the folder …, 2 by …`.
pub fn describe(rules: &[Rule]) -> String {
    let of = |matches: fn(&Rule) -> Option<&String>| -> (usize, String) {
        let names: Vec<&String> = rules.iter().filter_map(matches).collect();
        let mut known = names.clone();
        known.sort();
        known.dedup();
        let shown: Vec<String> = known.iter().take(4).map(|name| format!("`{name}`")).collect();
        let more = if known.len() > shown.len() { ", …" } else { "" };
        (names.len(), shown.join(", ") + more)
    };
    let parts = [
        (
            "next to a mesh of the same name without",
            of(|rule| if let Rule::Sibling(word) = rule { Some(word) } else { None }),
        ),
        ("in folders named", of(|rule| if let Rule::Folder { name, .. } = rule { Some(name) } else { None })),
        ("by the word", of(|rule| if let Rule::Name { word, .. } = rule { Some(word) } else { None })),
    ];
    let parts = parts.iter().filter(|(_, (count, _))| *count > 0);
    parts.map(|(what, (count, names))| format!("{count} {what} {names}")).collect::<Vec<_>>().join("; ")
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Checks which meshes of a pool are left out.
    fn check(kept: &[&str], left_out: &[&str]) {
        let mut stems: Vec<&str> = kept.iter().chain(left_out).copied().collect();
        stems.sort_unstable();
        let rules = rules(stems.iter().map(Path::new), std::iter::empty());
        for (stem, rule) in stems.iter().zip(rules) {
            assert_eq!(rule.is_some(), left_out.contains(stem), "{stem}: {rule:?}");
        }
    }

    #[test]
    fn layouts_of_simulators() {
        // Kubric.
        check(&["mug/visual_geometry"], &["mug/collision_geometry"]);
        // ManiSkill, YCB as downloaded, GraspNet.
        check(&["a/textured"], &["a/collision", "a/nontextured", "a/nontextured_simplified"]);
        check(&["a/google_16k/textured"], &["a/google_16k/nontextured"]);
        // SAPIEN's caches beside the mesh.
        check(
            &["x/textured_objs/original-1", "x/textured_objs/new-0"],
            &["x/textured_objs/original-1.obj.convex", "x/textured_objs/new-0.obj.coacd"],
        );
        // robosuite, RoboCasa, LIBERO.
        check(
            &["can/visual/model_normalized_0", "can/visual/model_normalized_1"],
            &["can/collision/model_normalized_collision_0", "can/collision/model_normalized_collision_12"],
        );
        check(&["bowl/bowl", "bowl/visual/bowl_vis"], &["bowl/collision/bowl_ch_0", "bowl/collision/bowl_ch1"]);
        // Drake, MuJoCo Menagerie, scanned objects for MuJoCo.
        check(&["box/cracker_box"], &["box/cracker_box_col", "box/cracker_box_collision"]);
        check(
            &["assets/link0_0", "assets/link0_1", "assets/finger_visual"],
            &["assets/link0_coll", "assets/finger_collision_2", "assets/link0_0_collision"],
        );
        check(&["m/model"], &["m/model_collision_0", "m/model_collision_31", "m/coarse-col"]);
        // PyBullet.
        check(&["duck", "textured"], &["duck_vhacd", "textured_vhacd", "duck_coacd"]);
        // Habitat, ReplicaCAD, HSSD, YCB in Habitat.
        check(&["o/frl_basket"], &["o/convex/frl_basket_cv_decomp", "o/frl_basket.collision", "o/frl_basket_cvx"]);
        check(&["0/abc"], &["0/abc.collider"]);
        check(&["meshes/002_can/google_16k/textured"], &["collison_meshes/002_can"]); // typos: ignore
        // ROS, Isaac, iGibson and BEHAVIOR.
        check(&["meshes/visual/mug", "arm/visuals/a"], &["meshes/collision/mug", "arm/collisions/a"]);
        check(&["m/shape/visual/a_vm"], &["m/shape/collision/a_cm"]);
        // Game engines.
        check(&["Mug"], &["UCX_Mug_00", "Mug-convcolonly", "MugCollider"]);
        check(&["cup", "cup_3"], &["cup_hull_0", "cup_convex_hull_12", "cup_3_coll", "cup-decomp", "hulls/cup"]);
        // The folder is named after the object.
        check(&["mug"], &["mug/mug_hull_0", "mug/mug_hull_1"]);
        check(&["mug/model"], &["mug_coll"]);
        check(&["mug/mug"], &["mug/convex", "mug/hull_0", "mug/physics"]);
        check(&["obj_01/bunny"], &["obj_01/convex_hull", "obj_01/hull_3", "obj_01/decomp"]);
    }

    #[test]
    fn meshes_that_are_not_read_are_siblings() {
        let stems = ["mug_convex", "cup_convex"];
        let [mug, cup] = &rules(stems.iter().map(Path::new), ["mug"].iter().map(Path::new))[..] else { panic!("two") };
        assert_eq!((mug.as_ref(), cup.as_ref()), (Some(&Rule::Sibling("convex".into())), None));
    }

    #[test]
    fn honest_names_are_objects() {
        check(
            &[
                "convex_mirror",
                "hull",
                "collision_course_game",
                "phys_book",
                "physics",
                "brass_col",
                "col",
                "collie",
                "cola_can",
                "convexity",
                "ch",
                "hull_of_a_boat",
                "proxy",
                "nontextured",
                "cup_hull_0",
            ],
            &[],
        );
        // Parts of a boat, and folders that are categories.
        check(&["boat/boat", "boat/hull", "boat/mast"], &[]);
        check(&["lens/convex", "lens/concave"], &[]);
        check(&["physics/pendulum", "hulls/tanker", "mugs/a", "x"], &[]);
        // A purely generic name does not make the pool one object: neither a numbered name nor one among others.
        check(&["object_01", "ship_hull", "lens_convex", "hull", "physics"], &[]);
        check(&["obj_000001", "brass_col"], &[]);
        check(&["obj_000001", "obj_000002", "obj3", "physics/pendulum", "lens_convex"], &[]);
        check(&["model", "cup", "ship_hull", "physics"], &[]);
        // The same name in another category is another object.
        check(&["bowl/a", "cup/a_convex"], &[]);
    }

    #[test]
    fn one_folder_per_object_with_a_generic_file_name() {
        let names = [
            "mug",
            "hull",
            "physics",
            "convex",
            "decomp",
            "phys",
            "book",
            "cup",
            "collider",
            "hull_toy",
            "convex_mirror",
            "phys_book",
            "decomposition",
        ];
        for file in ["model", "meshes/model", "google_16k/textured", "visual/scan_0", "scan"] {
            let paths: Vec<String> = names.iter().map(|name| format!("{name}/{file}")).collect();
            let mut kept: Vec<&str> = paths.iter().map(String::as_str).collect();
            check(&kept, &[]);
            kept.retain(|path| !path.starts_with("mug/"));
            check(&kept, &[]);
        }
        // Such an object with its own collision meshes.
        check(
            &["a/model", "b/model", "hull/model", "s/a/visual/m", "s/b/visual/m", "s/hull/visual/m"],
            &["a/collision/model", "hull/collision/model", "hull/model_collision_0", "s/hull/collision/m"],
        );
        check(&["boat/deck/model", "boat/mast/model", "boat/hull/model"], &[]);
        check(&["object_01/model", "object_02/model", "hull/model"], &[]);
        check(&["hull/scan", "physics/scan"], &[]);
        // The rendered mesh is in the folder above, in a folder of rendered meshes, or in a folder named after the
        // object.
        check(&["pan/model", "pan/lod/model", "pan/low/model"], &["pan/hull/model", "pan/collision/model"]);
        check(&["pan/pan", "pan/lod/model"], &["pan/hull/model"]);
        check(&["mug/model", "original/mug/model"], &["hulls/mug/model"]);
        check(&["pan/visual/pan"], &["pan/collisions_mesh/pan", "pan/hulls/pan"]);
        check(&["pan/meshes/pan", "pan/lod/pan", "pan/low/pan"], &["pan/collision/pan", "pan/hull/pan"]);
        check(&["pan/pan/model", "pan/lod/model", "pan/low/model"], &["pan/collision/model"]);
        // A single other folder, or the same objects in each folder, do not make objects of folders with purely
        // collision names.
        check(&["a/original/model"], &["a/collision/model"]);
        check(&["original/a/m", "original/b/m", "low/a/m", "low/b/m"], &["collision/a/m", "collision/b/m"]);
    }

    #[test]
    fn meshes_that_only_a_word_leaves_out_are_told_apart() {
        let is_alone = |stems: &[&str]| -> Vec<bool> {
            let rules = rules(stems.iter().map(Path::new), std::iter::empty());
            rules.iter().flatten().map(Rule::is_alone).collect()
        };
        assert_eq!(is_alone(&["brand/collision/game_box", "large_hadron_collider", "mug"]), [true, true]);
        assert_eq!(is_alone(&["a/part_collision", "b/collision"]), [true, true]);
        assert_eq!(is_alone(&["a/part_collision", "a/textured"]), [false]);
        assert_eq!(is_alone(&["collison_meshes/002_can", "meshes/002_can/google_16k/textured"]), [false]); // typos: ignore
        assert_eq!(is_alone(&["jar/collision/part", "jar/visual/jar", "x/vhacd/0", "x/x"]), [false, false]);
    }

    #[test]
    fn the_message_counts_by_rule() {
        let stems = ["cup", "cup_hull_0", "cup_hull_1", "jar/collision/a", "mug_vhacd"];
        let rules: Vec<Rule> = rules(stems.iter().map(Path::new), std::iter::empty()).into_iter().flatten().collect();
        assert_eq!(
            describe(&rules),
            "2 next to a mesh of the same name without `hull`; 1 in folders named `collision`; 1 by the word `vhacd`"
        );
    }
}
