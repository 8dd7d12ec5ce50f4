//! Completions and manual pages know every command and its options.

use super::{Folder, ivv};
use crate::common::prelude::*;

fn verbs() -> Vec<String> {
    let help = works(&["--help"]);
    let listed = help.lines().skip_while(|line| *line != "Commands:").skip(1).take_while(|line| !line.is_empty());
    let names = listed.filter(|line| !line.starts_with("   ")).filter_map(|line| line.split_whitespace().next());
    names.filter(|name| *name != "help").map(str::to_owned).collect()
}

#[test]
fn every_shell_completes_every_command() {
    let verbs = verbs();
    assert!(verbs.len() > 10 && verbs.contains(&"train".to_owned()), "{verbs:?}");
    for shell in ["bash", "zsh", "fish", "elvish", "powershell"] {
        let script = works(&["debug", "completions", shell]);
        assert!(verbs.iter().all(|verb| script.contains(verb.as_str())), "{shell}");
        assert!(script.contains("max-gaussians"), "{shell}");
    }
    assert_eq!(ivv(&["debug", "completions", "dos"]).output().unwrap().status.code(), Some(2));
}

#[test]
fn every_command_has_a_manual_page_with_its_options() {
    let folder = Folder::new("man");
    let pages = folder.path("pages");
    works(&["debug", "man", "-o", &pages]);
    let read = |name: &str| std::fs::read_to_string(format!("{pages}/{name}.1")).unwrap();
    for verb in verbs() {
        assert!(read(&format!("ivv-{verb}")).contains(".SH SYNOPSIS"), "{verb}");
        assert!(read("ivv").contains(&format!("ivv\\-{verb}(1)")), "{verb}");
    }
    assert!(read("ivv-train").contains("max\\-gaussians"));
    assert!(read("ivv-sound-render").contains("ivv sound render"));
    assert!(read("ivv-debug-vjp").contains("ivv debug vjp"));
}
