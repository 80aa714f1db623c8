//! Rules of the source tree: dependencies of the modules, import cycles, unique type names, file lengths, cited paths, sources
//! without a target.
//!
//! The sources are read as tokens: comments and texts are no code, code in macros is. Test modules are left out.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

use proc_macro2::{Delimiter, TokenStream, TokenTree};

/// Modules of the engine and the modules that each may use, itself always among them.
const ENGINE: [(&str, &[&str]); 14] = [
    ("robot", &[]),
    ("optimize", &[]),
    ("trial", &[]),
    ("printable", &[]),
    ("unfinished", &[]),
    ("telemetry", &["robot", "trial"]),
    ("realtime", &["telemetry", "robot"]),
    ("sim", &["robot"]),
    ("control", &["robot", "trial", "telemetry", "realtime"]),
    ("recording", &["telemetry", "trial", "robot", "optimize", "unfinished"]),
    ("report", &["recording", "optimize", "control", "telemetry", "robot", "trial", "printable"]),
    ("session", &["optimize", "recording", "control", "sim", "realtime", "telemetry", "trial", "robot"]),
    ("config", &["optimize", "recording", "control", "sim", "realtime", "telemetry", "trial", "robot", "unfinished"]),
    // The engine may use every module.
    ("engine", &[]),
];

/// Layers of the console, lowest first: a module uses modules of lower layers only.
const CONSOLE: [&[&str]; 12] = [
    &["action", "cell_encoder", "column", "series", "connection", "foreground", "whole_file", "wrap"],
    &["keymap", "output", "theme"],
    &["graphics"],
    &["settings", "message"],
    &["model"],
    &["layout", "text", "draw"],
    &["legal"],
    &["arming", "details", "help"],
    &["update", "view", "feed", "export", "terminal", "input"],
    &["picture", "leaving"],
    &["app", "screenshot"],
    &["subcommand"],
];

const LONGEST_FILE: usize = 500;

/// Folders at the beginning of a cited path.
const FOLDERS: &str =
    "src/ ui/ docs/ tests/ config/ robots/ proto/ recordings/ benches/ examples/ specs/ research/ .ci/";

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// Files below `folder` whose name ends in `.extension`, sorted.
fn files(folder: &Path, extension: &str) -> Vec<PathBuf> {
    let mut found = Vec::new();
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            found.extend(files(&path, extension));
        } else if path.extension().is_some_and(|known| known == extension) {
            found.push(path);
        }
    }
    found.sort();
    found
}

/// The path from the repository's root, with `/`.
fn short(path: &Path) -> String {
    path.strip_prefix(root()).unwrap().to_string_lossy().replace('\\', "/")
}

/// Fails with every violation and the remedy, if there is a violation.
fn assert_none(violations: &[String], remedy: &str) {
    assert!(violations.is_empty(), "{} violations:\n  {}\n{remedy}", violations.len(), violations.join("\n  "));
}

/// The code of a file as words: identifiers, `::`, and single characters; attributes left out.
fn words(file: &Path) -> Vec<String> {
    let text = fs::read_to_string(file).unwrap();
    let tokens: TokenStream = text.parse().unwrap_or_else(|error| panic!("{}: {error}", file.display()));
    let mut words = Vec::new();
    flatten(tokens, &mut words);
    words
}

fn flatten(tokens: TokenStream, words: &mut Vec<String>) {
    let tokens: Vec<TokenTree> = tokens.into_iter().collect();
    let mut at = 0;
    while let Some(token) = tokens.get(at) {
        match token {
            TokenTree::Punct(hash) if hash.as_char() == '#' => {
                // `#[...]` or `#![...]`
                let next = at + 1 + usize::from(matches!(&tokens.get(at + 1), Some(TokenTree::Punct(_))));
                if let Some(TokenTree::Group(_)) = tokens.get(next) {
                    at = next + 1;
                    continue;
                }
            }
            TokenTree::Ident(name) => words.push(name.to_string()),
            TokenTree::Punct(punct) => words.push(punct.as_char().to_string()),
            TokenTree::Literal(_) => words.push("\"\"".to_owned()),
            TokenTree::Group(group) => {
                let (open, close) = match group.delimiter() {
                    Delimiter::Brace => ("{", "}"),
                    Delimiter::Parenthesis => ("(", ")"),
                    Delimiter::Bracket => ("[", "]"),
                    Delimiter::None => ("", ""),
                };
                words.push(open.to_owned());
                flatten(group.stream(), words);
                words.push(close.to_owned());
            }
        }
        at += 1;
    }
}

fn is_name(word: &str) -> bool {
    word.starts_with(|c: char| c.is_alphabetic() || c == '_')
}

/// A module's file: its imports, the names of its items, and the other paths in its code.
#[derive(Default)]
struct Module {
    file: PathBuf,
    /// Name in this module and the path that it stands for; `*` for everything in a module.
    imports: Vec<(String, Vec<String>)>,
    /// The paths of `use` that are not `pub use`.
    used: Vec<Vec<String>>,
    items: BTreeSet<String>,
    /// Paths of more than one name.
    paths: Vec<Vec<String>>,
    types: Vec<String>,
}

impl Module {
    fn read(file: &Path) -> Module {
        let words = words(file);
        let mut module = Module { file: file.to_owned(), ..Module::default() };
        let mut at = 0;
        while at < words.len() {
            let word = words[at].as_str();
            let public = at > 0 && matches!(words[at - 1].as_str(), "pub" | ")");
            match word {
                // `use<..>` in a type is no import.
                "use" if words.get(at + 1).is_some_and(|word| word != "<") => {
                    let mut found = Vec::new();
                    at = use_tree(&words, at + 1, &[], &mut found);
                    if !public {
                        module.used.extend(found.iter().map(|(_, path)| path.clone()));
                    }
                    module.imports.extend(found);
                    continue;
                }
                "struct" | "enum" | "trait" | "type" | "union" | "fn" | "const" | "static" | "macro_rules" | "mod" => {
                    let name = words[at + 1..].iter().find(|word| is_name(word)).cloned().unwrap_or_default();
                    // `mod name;` is a file of its own, which `resolve` finds first.
                    if matches!(word, "struct" | "enum" | "trait" | "type" | "union") && public {
                        module.types.push(name.clone());
                    }
                    module.items.insert(name);
                }
                word if is_name(word) && !(at > 1 && words[at - 1] == ":" && words[at - 2] == ":") => {
                    let mut path = vec![word.to_owned()];
                    while words.get(at + 1).is_some_and(|w| w == ":")
                        && words.get(at + 2).is_some_and(|w| w == ":")
                        && words.get(at + 3).is_some_and(|w| is_name(w))
                    {
                        path.push(words[at + 3].clone());
                        at += 3;
                    }
                    if path.len() > 1 {
                        module.paths.push(path);
                    }
                }
                _ => {}
            }
            at += 1;
        }
        module
    }
}

/// Reads `a::b::{c, d as e, f::*};` from `at`: pairs of the name in this module and the whole path. Returns the place
/// after it.
fn use_tree(words: &[String], mut at: usize, prefix: &[String], found: &mut Vec<(String, Vec<String>)>) -> usize {
    let mut path = prefix.to_vec();
    let mut name = None;
    let mut leaf = true;
    while let Some(word) = words.get(at) {
        match word.as_str() {
            ":" => {}
            "{" => {
                leaf = false;
                at += 1;
                while words[at] != "}" {
                    at = use_tree(words, at, &path, found);
                    at += usize::from(words[at] == ",");
                }
            }
            "as" => {
                name = words.get(at + 1).cloned();
                at += 1;
            }
            "," | "}" | ";" => break,
            "self" if path.len() > prefix.len() || !prefix.is_empty() => {}
            word => path.push(word.to_owned()),
        }
        at += 1;
    }
    if leaf && let Some(last) = path.last() {
        found.push((name.unwrap_or_else(|| last.clone()), path));
    }
    at
}

/// The modules of one package by their path from its root.
struct Package {
    modules: BTreeMap<Vec<String>, Module>,
}

impl Package {
    fn read(folder: &str) -> Package {
        let folder = root().join(folder);
        let mut modules = BTreeMap::new();
        for file in files(&folder, "rs") {
            let mut path: Vec<String> = file
                .strip_prefix(&folder)
                .unwrap()
                .with_extension("")
                .iter()
                .map(|p| p.to_string_lossy().into())
                .collect();
            if path.last().is_some_and(|last| last == "mod" || last == "lib") {
                path.pop();
            }
            modules.insert(path, Module::read(&file));
        }
        assert!(modules.len() > 30, "only {} sources were found", modules.len());
        Package { modules }
    }

    /// The module that defines what `path` names when it is written in module `from`; re-exports are followed. None for a
    /// path into another package, and for a path that ends at a module.
    fn resolve(&self, from: &[String], path: &[String], depth: usize) -> Option<Vec<String>> {
        let mut module = from.to_vec();
        let mut rest = path;
        // `super` only at the beginning; `crate` is the root.
        let mut anchored = false;
        loop {
            match rest.first().map(String::as_str) {
                Some("crate") => module.clear(),
                Some("self") => {}
                Some("super") => drop(module.pop()),
                _ => break,
            }
            anchored = true;
            rest = &rest[1..];
        }
        while let [first, more @ ..] = rest {
            let child: Vec<_> = module.iter().chain([first]).cloned().collect();
            if self.modules.contains_key(&child) {
                (module, rest, anchored) = (child, more, true);
                continue;
            }
            let here = self.modules.get(&module)?;
            if here.items.contains(first) {
                return (anchored || more.is_empty() || module != from).then_some(module);
            }
            if depth > 8 {
                return None;
            }
            let named = here.imports.iter().find(|(name, target)| name == first && target != path);
            if let Some((_, target)) = named {
                let whole: Vec<_> = target.iter().chain(more).cloned().collect();
                return self.resolve(&module, &whole, depth + 1);
            }
            let globs = here.imports.iter().filter(|(name, _)| name == "*");
            for (_, glob) in globs {
                let whole: Vec<_> = glob[..glob.len() - 1].iter().chain(rest).cloned().collect();
                if let Some(found) = self.resolve(&module, &whole, depth + 1) {
                    return Some(found);
                }
            }
            return (anchored && first != "*").then_some(module);
        }
        None
    }

    fn graph(&self) -> BTreeMap<&[String], BTreeSet<Vec<String>>> {
        let uses = |(path, module): (&Vec<String>, &Module)| {
            let named = module.used.iter().chain(&module.paths);
            named.filter_map(|used| self.resolve(path, used, 0)).filter(|target| target != path).collect()
        };
        self.modules.iter().map(|module| (module.0.as_slice(), uses(module))).collect()
    }

    /// Groups of modules that use one another in a circle, as their files.
    fn cycles(&self) -> Vec<String> {
        let graph = self.graph();
        let reachable = |from: &[String]| {
            let mut seen = BTreeSet::new();
            let mut open: Vec<Vec<String>> = graph[from].iter().cloned().collect();
            while let Some(next) = open.pop() {
                if seen.insert(next.clone()) {
                    open.extend(graph[next.as_slice()].iter().cloned());
                }
            }
            seen
        };
        let all: BTreeMap<&[String], BTreeSet<Vec<String>>> =
            graph.keys().map(|from| (*from, reachable(from))).collect();
        let mut groups = BTreeSet::new();
        for (from, seen) in all.iter().filter(|(from, seen)| seen.contains(**from)) {
            let group: Vec<_> =
                seen.iter().filter(|other| all[other.as_slice()].contains(*from)).map(Vec::as_slice).collect();
            groups.insert(group);
        }
        let arrows = |group: &[&[String]]| {
            let mut text = format!("{} files in a circle:", group.len());
            for from in group {
                let to = graph[from].iter().filter(|to| group.contains(&to.as_slice()));
                let names: Vec<_> = to.map(|to| short(&self.modules[to].file)).collect();
                text += &format!("\n    {} -> {}", short(&self.modules[*from].file), names.join(", "));
            }
            text
        };
        groups.iter().map(|group| arrows(group)).collect()
    }

    /// Uses of a top-level module by another for which `allowed` is false, and unknown modules.
    fn forbidden(&self, known: impl Fn(&str) -> bool, allowed: impl Fn(&str, &str) -> bool) -> Vec<String> {
        let mut violations = Vec::new();
        for (from, targets) in self.graph() {
            let Some(module) = from.first().filter(|module| *module != "main") else { continue };
            if !known(module) {
                violations.push(format!("{}: module `{module}` has no rule", short(&self.modules[from].file)));
                continue;
            }
            let tops: BTreeSet<_> = targets.iter().filter_map(|target| target.first()).collect();
            for used in tops.into_iter().filter(|used| *used != module && known(used) && !allowed(module, used)) {
                violations.push(format!("{}: `{module}` may not use `{used}`", short(&self.modules[from].file)));
            }
        }
        violations
    }
}

#[test]
fn every_module_of_the_engine_uses_only_what_it_may() {
    let rule = |module: &str| ENGINE.iter().find(|(name, _)| *name == module).map(|(_, uses)| uses);
    let violations = Package::read("src").forbidden(
        |module| rule(module).is_some(),
        |module, used| module == "engine" || rule(module).is_some_and(|uses| uses.contains(&used)),
    );
    assert_none(
        &violations,
        "Move the item to a lower module, or pass it in from above; the rules are in src/lib.rs and in ENGINE.",
    );
}

#[test]
fn every_module_of_the_console_uses_only_lower_layers() {
    let layer = |module: &str| CONSOLE.iter().position(|layer| layer.contains(&module));
    let violations =
        Package::read("ui/src").forbidden(|module| layer(module).is_some(), |module, used| layer(used) < layer(module));
    assert_none(
        &violations,
        "Move the item to a lower layer, or return an effect; the layers are in ui/src/lib.rs and in CONSOLE.",
    );
}

#[test]
fn no_file_is_in_an_import_cycle() {
    let cycles: Vec<_> = ["src", "ui/src"].into_iter().flat_map(|folder| Package::read(folder).cycles()).collect();
    assert_none(&cycles, "Move what both sides need to a file that both may import.");
}

#[test]
fn names_of_public_types_are_unique() {
    let mut homes: BTreeMap<String, Vec<String>> = BTreeMap::new();
    for folder in ["src", "ui/src"] {
        for module in Package::read(folder).modules.into_values() {
            for name in module.types {
                homes.entry(name).or_default().push(short(&module.file));
            }
        }
    }
    let several = homes.iter().filter(|(_, homes)| homes.len() > 1);
    let violations: Vec<_> = several.map(|(name, homes)| format!("`{name}`: {}", homes.join(", "))).collect();
    assert_none(
        &violations,
        "Rename all but one; where they are one idea at two borders, put the border into the name.",
    );
}

/// The libraries are not compiled for tests (`test = false` in their manifests), so a test in their sources would not run.
#[test]
fn no_source_of_a_library_has_a_test() {
    let mut violations = Vec::new();
    for file in ["src", "ui/src"].into_iter().flat_map(|folder| files(&root().join(folder), "rs")) {
        let text = fs::read_to_string(&file).unwrap();
        for (number, line) in (1..).zip(text.lines().map(str::trim)) {
            let attribute = line.strip_prefix("#[").or_else(|| line.strip_prefix("#![")).unwrap_or_default();
            // Before a text in quotes.
            let code = attribute.split('"').next().unwrap_or_default();
            if code.split(|c: char| !(c.is_alphanumeric() || c == '_')).any(|word| word == "test") {
                violations.push(format!("{}:{number}: {line}", short(&file)));
            }
        }
    }
    assert_none(&violations, "Test it through the public interface, in the program of its area in tests/.");
    for manifest in ["Cargo.toml", "ui/Cargo.toml"] {
        let text = fs::read_to_string(root().join(manifest)).unwrap();
        let library = text.split("[lib]").nth(1).and_then(|rest| rest.split("\n[").next()).unwrap_or_default();
        assert!(
            library.lines().any(|line| line.starts_with("test = false")),
            "{manifest}: [lib] has no `test = false`"
        );
    }
}

/// Adds the file of a module and those of its modules (`mod name;`, with or without `#[path]`). `owns_folder`: its modules are
/// beside it, as those of a root, of a `mod.rs` and of a file named by `#[path]`.
fn add_modules(file: &Path, owns_folder: bool, found: &mut BTreeSet<PathBuf>) {
    let file = file.canonicalize().unwrap_or_else(|error| panic!("{}: {error}", file.display()));
    let text = fs::read_to_string(&file).unwrap();
    let folder = if owns_folder { file.parent().unwrap().to_owned() } else { file.with_extension("") };
    let mut named = None;
    for line in text.lines().map(str::trim) {
        if let Some(path) = line.strip_prefix("#[path = \"").and_then(|rest| rest.strip_suffix("\"]")) {
            named = Some(file.with_file_name(path));
        }
        let Some((before, name)) = line.strip_suffix(';').and_then(|line| line.split_once("mod ")) else { continue };
        if before.is_empty() || before.starts_with("pub") {
            let [beside, below] = [folder.join(format!("{name}.rs")), folder.join(name).join("mod.rs")];
            match named.take() {
                Some(path) => add_modules(&path, true, found),
                None if beside.exists() => add_modules(&beside, false, found),
                None => add_modules(&below, true, found),
            }
        }
    }
    found.insert(file);
}

/// A file that no target includes is neither compiled nor run. Roots are those that cargo finds by itself, and those of the manifests.
#[test]
fn every_source_of_tests_benches_and_examples_belongs_to_a_target() {
    let folders = ["tests", "benches", "examples", "ui/benches"];
    let sources: Vec<PathBuf> = folders.iter().flat_map(|folder| files(&root().join(folder), "rs")).collect();
    let is_folder = |folder: Option<&Path>| folders.iter().any(|known| folder == Some(&root().join(known)));
    let is_found = |file: &PathBuf| {
        is_folder(file.parent()) || file.ends_with("main.rs") && is_folder(file.parent().unwrap().parent())
    };
    let mut roots: Vec<PathBuf> = sources.iter().filter(|file| is_found(file)).cloned().collect();
    for package in ["", "ui"] {
        let folder = root().join(package);
        let manifest = fs::read_to_string(folder.join("Cargo.toml")).unwrap();
        assert!(!manifest.contains("\nauto"), "{package}: cargo finds no target by itself");
        let paths = manifest.lines().filter_map(|line| line.strip_prefix("path = \"")?.strip_suffix('"'));
        roots.extend(paths.filter(|path| !path.starts_with("src/")).map(|path| folder.join(path)));
    }
    let mut compiled = BTreeSet::new();
    roots.iter().for_each(|file| add_modules(file, true, &mut compiled));
    let is_lost = |file: &&PathBuf| !compiled.contains(&file.canonicalize().unwrap());
    let lost: Vec<String> = sources.iter().filter(is_lost).map(|file| short(file)).collect();
    assert_none(&lost, "Name it with `mod` in a file of a target, or as `path` of a [[test]] in ui/Cargo.toml.");
}

/// Functions of the C library have other bits on another machine; those of the crate libm have not, and `robot::rotation` has the
/// rotations.
#[test]
fn jumps_and_proposals_use_no_function_of_the_c_library() {
    let methods = "sin cos tan sin_cos asin acos atan atan2 sinh cosh tanh exp exp2 exp_m1 ln ln_1p log10 log2 powf hypot cbrt mul_add \
                   euler_angles scaled_axis";
    let calls = methods.split_whitespace().map(|method| format!(".{method}("));
    let rotations = ["new", "from_scaled_axis", "from_axis_angle", "from_euler_angles"];
    let rotations =
        rotations.iter().flat_map(|name| ["UnitQuaternion", "Rotation3"].map(|of| format!("{of}::{name}(")));
    let calls: Vec<String> = calls.chain(rotations).collect();
    let mut violations = Vec::new();
    for folder in ["robot", "sim", "control", "session", "optimize", "telemetry", "trial"] {
        // The sine of the lanes is their own.
        let sources =
            files(&root().join("src").join(folder), "rs").into_iter().filter(|file| !file.ends_with("sim/lanes.rs"));
        for file in sources {
            let text = fs::read_to_string(&file).unwrap();
            let called = |line: &str| calls.iter().find(|call| line.contains(*call));
            let lines = text.lines().enumerate().filter_map(|(i, line)| Some((i, called(line.split("//").next()?)?)));
            violations.extend(lines.map(|(i, call)| format!("{}:{}: {call})", short(&file), i + 1)));
        }
    }
    assert_none(&violations, "Call the crate libm, or a function of `robot::rotation`.");
}

/// Regression: the report of a panic took the arguments by a function that panics at one that is not UTF-8, which ended the process at
/// once: without damped motors, a restored terminal and the report.
#[test]
fn no_argument_of_the_program_is_taken_for_utf_8() {
    let takes = |file: &PathBuf| fs::read_to_string(file).unwrap().contains("env::args()");
    let sources = ["src", "ui/src"].into_iter().flat_map(|folder| files(&root().join(folder), "rs"));
    let violations: Vec<String> = sources.filter(takes).map(|file| short(&file)).collect();
    assert_none(&violations, "Take `std::env::args_os`.");
}

#[test]
fn no_file_is_longer_than_500_lines() {
    let mut violations = Vec::new();
    for folder in ["src", "ui/src", "benches", "ui/benches", "examples"] {
        for file in files(&root().join(folder), "rs") {
            let lines = fs::read_to_string(&file).unwrap().lines().count();
            if lines > LONGEST_FILE {
                violations.push(format!("{}: {lines} lines", short(&file)));
            }
        }
    }
    assert_none(&violations, "Split the file by topic.");
}

/// The paths in a line of prose that begin with one of [`FOLDERS`], without the punctuation behind them.
fn cited(prose: &str) -> impl Iterator<Item = &str> {
    let words = prose.split(|c: char| !(c.is_ascii_alphanumeric() || "_-./*<>{}".contains(c)));
    let begins = |word: &&str| FOLDERS.split(' ').any(|folder| word.starts_with(folder));
    // Before a placeholder (`*`, `<name>`, `{a,b}`) the folder counts.
    words.filter(begins).map(|word| {
        let placeholder = word.find(['*', '<', '{', '>', '}']);
        let fixed = placeholder.map_or(word, |at| &word[..word[..at].rfind('/').map_or(0, |slash| slash + 1)]);
        fixed.trim_end_matches(['.', '-', '/'])
    })
}

#[test]
fn every_cited_path_exists() {
    let mut prose: Vec<(PathBuf, &str)> = Vec::new();
    for folder in ["src", "ui", "tests", "benches", "examples"] {
        prose.extend(files(&root().join(folder), "rs").into_iter().map(|file| (file, "//")));
    }
    prose.extend(files(&root().join("config"), "toml").into_iter().map(|file| (file, "#")));
    prose.extend(files(&root().join("proto"), "proto").into_iter().map(|file| (file, "//")));
    for folder in ["docs", "recordings", "robots"] {
        prose.extend(files(&root().join(folder), "md").into_iter().map(|file| (file, "")));
    }
    let others = [("README.md", ""), ("Cargo.toml", "#"), ("ui/Cargo.toml", "#")];
    prose.extend(others.map(|(name, comment)| (root().join(name), comment)));
    let (mut violations, mut checked) = (Vec::new(), 0);
    for (file, comment) in prose {
        for (line, text) in (1..).zip(fs::read_to_string(&file).unwrap().lines()) {
            let Some((_, text)) = text.split_once(comment) else { continue };
            for path in cited(text) {
                checked += 1;
                if !root().join(path).exists() && !root().join("ui").join(path).exists() {
                    violations.push(format!("{}:{line}: {path}", short(&file)));
                }
            }
        }
    }
    assert!(checked > 30, "only {checked} cited paths were found");
    assert_none(
        &violations,
        "Cite the file's present path, a page of docs/, or a published source; name another project's file with the project first.",
    );
}

/// The engine has no terminal: its manifest has no such crate.
/// `docs/style.md`, Sentences, rule 2.
#[test]
fn no_doc_comment_begins_with_a_question_word() {
    let folders = ["src", "ui/src", "examples", "tests", "benches"];
    let mut violations = Vec::new();
    for file in folders.iter().flat_map(|folder| files(&root().join(folder), "rs")) {
        let text = fs::read_to_string(&file).unwrap();
        let mut inside = false;
        for (at, line) in text.lines().enumerate() {
            let line = line.trim_start();
            let comment = line.strip_prefix("///").or_else(|| line.strip_prefix("//!"));
            let asks =
                |comment: &str| ["What ", "How ", "Who "].iter().any(|word| comment.trim_start().starts_with(word));
            if !inside && comment.is_some_and(asks) {
                violations.push(format!("{}:{}: {line}", short(&file), at + 1));
            }
            inside = comment.is_some();
        }
    }
    assert_none(&violations, "A doc comment begins with a noun phrase or a third-person verb (docs/style.md).");
}

#[test]
fn the_engine_depends_on_no_terminal() {
    let manifest = fs::read_to_string(root().join("Cargo.toml")).unwrap();
    for name in ["ratatui", "crossterm", "clap", "indicatif", "tokio"] {
        let depends =
            manifest.lines().any(|line| line.starts_with(&format!("{name} ")) || line.starts_with(&format!("{name}=")));
        assert!(!depends, "the engine depends on {name}: move what needs it to ui");
    }
}

/// Every block, function, implementation or trait that begins with `unsafe` has a row in docs/safety.md, and no row is left over.
#[test]
fn unsafe_code_is_that_of_the_table_in_the_safety_document() {
    let safety = fs::read_to_string(root().join("docs/safety.md")).unwrap();
    let rows = safety.lines().filter_map(|line| line.strip_prefix("| `")?.split_once("` | `unsafe "));
    let code = |rest: &str| {
        let mut words = Vec::new();
        flatten(rest.split('`').next().unwrap().parse().unwrap(), &mut words);
        words.concat()
    };
    let mut documented: Vec<String> = rows.map(|(file, rest)| format!("{file} unsafe{}", code(rest))).collect();
    let mut found = Vec::new();
    for file in ["src", "ui/src"].into_iter().flat_map(|folder| files(&root().join(folder), "rs")) {
        let words = words(&file);
        for (at, _) in words.iter().enumerate().filter(|(_, word)| *word == "unsafe") {
            let end = words[at..].iter().position(|word| word == "}").map_or(words.len(), |end| at + end + 1);
            found.push(format!("{} {}", short(&file), words[at..end].concat()));
        }
    }
    documented.sort();
    found.sort();
    assert!(!found.is_empty() && found.iter().all(|use_| use_.starts_with("src/realtime/")), "{found:?}");
    assert_eq!(
        found, documented,
        "left: the sources; right: the table under \"Real-time code and `unsafe`\" of docs/safety.md"
    );
}
