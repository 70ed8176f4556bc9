//! The plan of the house: who may import whom, read from the `use` lines of the sources.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

/// Modules with the modules they import, as paths such as `geometry::pose`; a `mod.rs` has its folder's path.
type Imports = BTreeMap<String, BTreeSet<String>>;

/// Most rooms at the top level.
const MOST_ROOMS: usize = 10;
/// The methods: none imports another.
const METHODS: [&str; 3] = ["shape_tensor", "surface_fit", "content"];

fn sources(folder: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder).into_iter().flatten().flatten().map(|entry| entry.path());
    let (folders, files): (Vec<_>, Vec<_>) = entries.partition(|path| path.is_dir());
    let files = files.into_iter().filter(|path| path.extension().is_some_and(|e| e == "rs"));
    files.chain(folders.iter().flat_map(|folder| sources(folder))).collect()
}

/// A module's path from its file; empty for the root.
fn module(root: &Path, file: &Path) -> String {
    let path = file.strip_prefix(root).unwrap_or(file).with_extension("");
    let parts = path.iter().map(|part| part.to_string_lossy()).filter(|part| part != "mod" && part != "lib");
    parts.collect::<Vec<_>>().join("::")
}

/// The code without its tests, which may import what they like.
fn code(file: &Path) -> String {
    let text = fs::read_to_string(file).unwrap_or_default();
    text.split("#[cfg(test)]").next().unwrap_or_default().to_string()
}

/// Every path that follows `crate::`, `super::` or `self::` in the code, with the names of a `{…}` list one by one.
fn paths(code: &str, module: &str) -> Vec<String> {
    let parent = module.rsplit_once("::").map_or("", |(parent, _)| parent);
    let mut found = Vec::new();
    let starts = [("crate::", String::new()), ("super::", format!("{parent}::")), ("self::", format!("{module}::"))];
    for (start, prefix) in starts {
        for after in code.split(start).skip(1) {
            let end = after.find(|c: char| !(c.is_alphanumeric() || "_:".contains(c))).unwrap_or(after.len());
            let path = format!("{prefix}{}", &after[..end]);
            let list = after[end..].strip_prefix('{').and_then(|list| list.split('}').next());
            match list.filter(|_| path.is_empty() || path.ends_with("::")) {
                Some(list) => found.extend(list.split(',').map(|name| format!("{path}{}", name.trim()))),
                None => found.push(path),
            }
        }
    }
    found
}

/// The longest module that a path begins with; None where the path names an item of the root.
fn target<'a>(path: &str, modules: &'a BTreeSet<String>) -> Option<&'a String> {
    let begins = |name: &&String| path == name.as_str() || path.starts_with(&format!("{name}::"));
    modules.iter().filter(|name| !name.is_empty()).filter(begins).max_by_key(|name| name.len())
}

fn imports(root: &Path) -> Imports {
    let files = sources(root);
    let modules: BTreeSet<String> = files.iter().map(|file| module(root, file)).collect();
    let imported = |file: &PathBuf| {
        let name = module(root, file);
        let paths = paths(&code(file), &name);
        let targets = paths.iter().filter_map(|path| target(path, &modules)).filter(|to| **to != name).cloned();
        (name.clone(), targets.collect())
    };
    files.iter().map(imported).collect()
}

/// The same between the top level's rooms.
fn rooms(imports: &Imports) -> Imports {
    let room = |name: &str| name.split("::").next().unwrap_or_default().to_string();
    let mut rooms = Imports::new();
    for (name, targets) in imports.iter().filter(|(name, _)| !name.is_empty()) {
        let of_room = rooms.entry(room(name)).or_default();
        of_room.extend(targets.iter().map(|to| room(to)).filter(|to| *to != room(name)));
    }
    rooms
}

/// What remains when modules that import nothing that remains are taken away again and again: circles, and who imports them.
fn circles(imports: &Imports) -> Imports {
    let mut left = imports.clone();
    loop {
        let before = left.len();
        let names: BTreeSet<String> = left.keys().cloned().collect();
        left.retain(|_, targets| targets.iter().any(|to| names.contains(to)));
        if left.len() == before {
            let imported: BTreeSet<String> = left.values().flatten().cloned().collect();
            left.retain(|name, _| imported.contains(name));
            return left;
        }
    }
}

fn source_of(package: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..").join(package).join("src")
}

#[test]
fn no_module_imports_itself_by_way_of_others() {
    for package in ["siloscope", "siloscope-scene"] {
        let imports = imports(&source_of(package));
        assert!(imports.len() > 9, "{package} has modules");
        assert_eq!(circles(&imports), Imports::new(), "{package}");
        assert_eq!(circles(&rooms(&imports)), Imports::new(), "{package}");
    }
}

#[test]
fn the_methods_are_siblings() {
    let rooms = rooms(&imports(&source_of("siloscope")));
    assert!(rooms.len() <= MOST_ROOMS, "{:?}", rooms.keys());
    for method in METHODS {
        let others = METHODS.iter().filter(|other| **other != method);
        let borrowed: Vec<_> = others.filter(|other| rooms[method].contains(**other)).collect();
        assert!(borrowed.is_empty(), "{method} imports {borrowed:?}");
    }
}

#[test]
fn a_circle_is_seen() {
    let set = |names: &[&str]| names.iter().map(ToString::to_string).collect::<BTreeSet<_>>();
    let mut imports = Imports::from([("a".into(), set(&["b"])), ("b".into(), set(&["c"])), ("c".into(), set(&[]))]);
    assert!(circles(&imports).is_empty());
    imports.insert("c".into(), set(&["a"]));
    assert_eq!(circles(&imports).len(), 3);
    assert_eq!(
        paths("use crate::a::{B, c};\nuse super::d::E;\ncrate::f::g(1)", "x::y"),
        ["a::B", "a::c", "f::g", "x::d::E"]
    );
}
