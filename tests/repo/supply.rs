//! What the engine is built of: licences, sources and duplicates of its dependencies, as far as they can be checked without the
//! network. `.ci/deny.toml` holds the policy, and `cargo deny` checks it in CI with the advisories.

use super::{root, text};
use crate::common::prelude::*;

fn policy() -> toml::Table {
    text(".ci/deny.toml").parse().unwrap()
}

fn list(policy: &toml::Table, part: &str, name: &str) -> BTreeSet<String> {
    policy[part][name].as_array().unwrap().iter().map(|word| word.as_str().unwrap().to_owned()).collect()
}

/// Name, version and source of every package of Cargo.lock but those of the workspace.
fn locked() -> Vec<(String, String, String)> {
    let lock: toml::Table = text("Cargo.lock").parse().unwrap();
    let is_own =
        |package: &&toml::Value| package["name"].as_str().is_some_and(|name| name == "ivv" || name.starts_with("ivv-"));
    let packages = lock["package"].as_array().unwrap().iter().filter(|package| !is_own(package));
    let field = |package: &toml::Value, name: &str| {
        package.get(name).and_then(toml::Value::as_str).unwrap_or_default().to_owned()
    };
    packages.map(|package| (field(package, "name"), field(package, "version"), field(package, "source"))).collect()
}

/// The version up to its first number that is not 0, by which Cargo tells what fits together.
fn line_of(version: &str) -> String {
    let numbers: Vec<&str> = version.split(['.', '+', '-']).collect();
    if numbers[0] == "0" { format!("0.{}", numbers[1]) } else { numbers[0].to_owned() }
}

#[test]
fn every_dependency_comes_from_the_registry() {
    let locked = locked();
    assert!(locked.len() > 50);
    for (name, version, source) in locked {
        assert_eq!(source, "registry+https://github.com/rust-lang/crates.io-index", "{name} {version}");
    }
    assert_eq!(policy()["sources"]["unknown-git"].as_str(), Some("deny"));
}

#[test]
fn every_duplicate_is_known_with_its_reason_and_no_known_one_is_gone() {
    let mut versions: BTreeMap<String, BTreeSet<String>> = BTreeMap::new();
    for (name, version, _) in locked() {
        versions.entry(name).or_default().insert(version);
    }
    let several = versions.iter().filter(|(_, versions)| versions.len() > 1);
    let mut known: BTreeSet<String> = BTreeSet::new();
    let policy = policy();
    for entry in policy["bans"]["skip"].as_array().unwrap() {
        assert!(entry["reason"].as_str().is_some_and(|reason| !reason.is_empty()), "{entry}");
        known.insert(entry["crate"].as_str().unwrap().to_owned());
    }
    let mut met = BTreeSet::new();
    for (name, versions) in several {
        let lines = versions.iter().map(|version| format!("{name}@{}", line_of(version)));
        let unknown: Vec<String> = lines.filter(|line| !met.insert(line.clone()) || !known.contains(line)).collect();
        // The newest of them needs no reason; target-only crates are not compiled here.
        let is_windows = name.starts_with("windows");
        assert!(is_windows || unknown.len() == 1, "{name} has the versions {versions:?}: see .ci/deny.toml");
    }
    let gone: Vec<&String> = known.iter().filter(|line| !met.contains(*line)).collect();
    assert!(gone.is_empty(), "no duplicates any more: {gone:?}");
}

/// Whether a licence expression can be met by allowed licences: one side of every OR, both of every AND.
fn is_allowed(expression: &str, allowed: &BTreeSet<String>) -> bool {
    let expression = expression.replace('/', " OR ");
    let mut words = expression.replace('(', " ( ").replace(')', " ) ");
    words.push_str(" )");
    let mut words = words.split_whitespace();
    fn any<'a>(words: &mut impl Iterator<Item = &'a str>, allowed: &BTreeSet<String>) -> bool {
        let (mut met, mut all) = (false, true);
        loop {
            match words.next() {
                None | Some(")") => return met || all,
                Some("OR") => (met, all) = (met || all, true),
                Some("AND") => {}
                Some("WITH") => all &= words.next() == Some("LLVM-exception"),
                Some("(") => all &= any(words, allowed),
                Some(name) => all &= allowed.contains(name),
            }
        }
    }
    any(&mut words, allowed)
}

#[test]
fn licence_expressions_are_understood() {
    let allowed: BTreeSet<String> = ["MIT", "Zlib"].map(String::from).into();
    for (expression, expected) in [
        ("MIT", true),
        ("GPL-3.0", false),
        ("GPL-3.0 OR MIT", true),
        ("GPL-3.0/MIT", true),
        ("MIT AND GPL-3.0", false),
        ("(GPL-3.0 OR MIT) AND Zlib", true),
        ("(GPL-3.0 OR MIT) AND ISC", false),
        ("Zlib AND (ISC AND MIT)", false),
    ] {
        assert_eq!(is_allowed(expression, &allowed), expected, "{expression}");
    }
}

#[test]
fn every_dependency_has_an_allowed_licence() {
    let allowed = list(&policy(), "licenses", "allow");
    let triple = format!("{}-unknown-linux-gnu", std::env::consts::ARCH);
    let mut command = Command::new(env!("CARGO"));
    command.args(["metadata", "--locked", "--offline", "--format-version", "1", "--filter-platform", &triple]);
    let output = command.current_dir(root()).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let metadata: Value = serde_json::from_slice(&output.stdout).unwrap();
    let packages = metadata["packages"].as_array().unwrap();
    assert!(packages.len() > 50);
    for package in packages {
        let licence = package["license"].as_str().unwrap_or("none");
        assert!(is_allowed(licence, &allowed), "{} {}: {licence}", package["name"], package["version"]);
    }
}

/// A file of weights is data; without this torch runs what it says.
#[test]
fn weights_are_loaded_as_weights() {
    let script = text("tools/priors.py");
    let calls: Vec<&str> = script.lines().filter(|line| line.contains("torch.load(")).collect();
    assert!(calls.len() == 3 && calls.iter().all(|call| call.contains("weights_only=True")), "{calls:?}");
}
