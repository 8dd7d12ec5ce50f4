//! The documents and the manual against the tree and the program: paths, links, verbs, options and settings exist.
//! `tools/test.sh --manual` runs the commands.

use super::{below_root, exists, files, marked, root, text};
use crate::common::prelude::*;
use std::path::Component;

/// Documents beside the code. The book includes most of them.
const DOCUMENTS: [&str; 6] = [
    "engine/ARCHITECTURE.md",
    "engine/RECIPES.md",
    "engine/TRAINING.md",
    "engine/sound/README.md",
    "shaders-glsl/README.md",
    "assets/README.md",
];
const BOOK: &str = "assets/manual/src";
/// Words of the book at most, without the documents that it includes.
const MOST_WORDS: usize = 12_000;
/// Pages that are numbers or generated. On others a twentieth of the words may be numbers.
const OF_NUMBERS: [&str; 4] = ["benchmarks.md", "commands.md", "method.md", "settings.md"];
/// Dated notes of measurements, and records of programs in folders.
const LAB: &str = "assets/lab";
const SETTINGS: &str = "assets/manual/src/settings.md";
/// What the sections of this page are called in comments of the code, with their number.
const METHOD: &str = "assets/manual/src/method.md";
const CITED: &str = "SPEC ";
/// Verbs that other builds give other options, and where these are.
const OF_OTHER_BUILDS: [(&str, &str); 1] = [("profile", "tools/verbs/profile/replay.rs")];
const FOLDERS: [&str; 6] = [".ci/", "assets/", "engine/", "shaders-glsl/", "tests/", "tools/"];

fn links(document: &str) -> impl Iterator<Item = &str> {
    document.split("](").skip(1).filter_map(|rest| rest.split_once(')')).map(|(target, _)| target)
}

/// The pages of the book, in its order, below the root.
fn pages() -> Vec<String> {
    links(&text(&format!("{BOOK}/SUMMARY.md"))).map(|page| format!("{BOOK}/{page}")).collect()
}

/// A page with the documents that it includes, and their names.
fn included(page: &str) -> (String, Vec<String>) {
    let (mut whole, mut names) = (String::new(), Vec::new());
    for line in text(page).lines() {
        let included = line.strip_prefix("{{#include ").and_then(|rest| rest.strip_suffix("}}"));
        match included.map(|range| range.split(':').next().unwrap_or_default()).filter(|path| path.ends_with(".md")) {
            Some(path) => {
                let path = beside(page, path);
                whole += &text(&path);
                names.push(path);
            }
            None => whole += line,
        }
        whole.push('\n');
    }
    (whole, names)
}

/// `path` as the file `of` means it, below the root.
fn beside(of: &str, path: &str) -> String {
    let mut found = PathBuf::from(of);
    found.pop();
    for part in Path::new(path).components() {
        match part {
            Component::ParentDir => assert!(found.pop(), "{of}: {path} leads out of the repository"),
            Component::CurDir => {}
            part => found.push(part),
        }
    }
    found.to_str().unwrap().to_owned()
}

/// The README and the pages, each as a reader sees it.
fn manual() -> Vec<(String, String)> {
    let pages = pages().into_iter().map(|page| (page.clone(), included(&page).0));
    [("README.md".to_owned(), text("README.md"))].into_iter().chain(pages).collect()
}

/// The inline code of a paragraph, whose spans may go over the ends of lines.
fn spans(paragraph: &str) -> impl Iterator<Item = String> {
    paragraph.split('`').skip(1).step_by(2).map(|span| span.replace('\n', " "))
}

/// Code of a document: each inline span, each command or line of a fenced block.
fn code(document: &str) -> Vec<String> {
    let mut found = Vec::new();
    let (mut paragraph, mut begun) = (String::new(), String::new());
    let mut fenced = false;
    for line in document.lines() {
        let is_fence = line.trim_start().starts_with("```");
        if is_fence || line.is_empty() || line.starts_with('|') {
            found.extend(spans(&std::mem::take(&mut paragraph)));
        }
        fenced ^= is_fence;
        if is_fence {
            continue;
        }
        if !fenced {
            paragraph += line;
            paragraph.push('\n');
        } else if let Some(part) = line.strip_suffix('\\') {
            begun += part;
        } else {
            found.push(std::mem::take(&mut begun) + line);
        }
    }
    assert!(!fenced, "a fence is not closed");
    found.extend(spans(&paragraph));
    found
}

/// Files and folders that a document names: in code, what begins with a folder of the root and, where it is `strict`, what
/// ends like a file or a folder; and the targets of links.
fn named_paths(document: &str, strict: bool) -> BTreeSet<String> {
    const ENDINGS: [&str; 11] = ["/", ".comp", ".exr", ".glsl", ".json", ".md", ".ply", ".png", ".py", ".rs", ".sh"];
    let is_path = |word: &&str| {
        word.chars().all(|c| c.is_ascii_alphanumeric() || "_./-".contains(c))
            && !["../", "/", "out/", "."].iter().any(|start| word.starts_with(start) && !word.starts_with(".ci/"))
            && (FOLDERS.iter().any(|f| word.starts_with(f)) || strict && ENDINGS.iter().any(|e| word.ends_with(e)))
    };
    let code = code(document);
    let in_code = code.iter().flat_map(|span| span.split_whitespace()).filter(is_path);
    let links = links(document).filter(|target| strict && !target.starts_with("http") && !target.starts_with('#'));
    in_code.chain(links).map(str::to_owned).collect()
}

/// A word of a command without what surrounds it in a sentence.
fn bare(word: &str) -> &str {
    word.trim_matches(|c: char| ",;:()\"'".contains(c)).trim_end_matches('.')
}

/// The commands of `ivv` in a document's code: the words from the verb on, up to a comment or the next command.
fn commands(document: &str) -> Vec<Vec<String>> {
    let is_verb = |word: &str| word.starts_with(|c: char| c.is_ascii_lowercase()) && !word.contains(['/', '.', '=']);
    let mut found = Vec::new();
    for span in code(document) {
        let mut words = span.split_whitespace().peekable();
        while let Some(word) = words.next() {
            if word.starts_with('#') && word.len() == 1 {
                break;
            }
            if !["ivv", "$(ivv"].contains(&word) || !words.peek().is_some_and(|verb| is_verb(bare(verb))) {
                continue;
            }
            let mut command = Vec::new();
            while let Some(word) = words.next_if(|word| !["|", "||", "&&", "#", "&"].contains(word)) {
                command.push(bare(word).to_owned());
                if word.ends_with(';') {
                    break;
                }
            }
            found.push(command);
        }
    }
    found
}

#[test]
fn documents_are_read_as_markdown() {
    let document = "See `tools/a.sh run`, `f32/f64` and `ivv\ny z`, [b](c/d.png).\n\
                    ```\nivv x engine/e y.ply out/z.png --q 1 # ivv v\n```\n`g/`";
    let named: Vec<String> = named_paths(document, true).into_iter().collect();
    assert_eq!(named, ["c/d.png", "engine/e", "g/", "tools/a.sh", "y.ply"]);
    assert_eq!(named_paths(document, false).into_iter().collect::<Vec<_>>(), ["engine/e", "tools/a.sh"]);
    let told: Vec<String> = commands(document).iter().map(|words| words.join(" ")).collect();
    assert_eq!(told, ["y z", "x engine/e y.ply out/z.png --q 1"]);
    assert_eq!(
        anchors("# A `b_c`, d\n```\n# e\n```\n## 2. F-g: h\n## A b\n## A b"),
        ["a-b_c-d", "2-f-g-h", "a-b", "a-b-1"]
    );
}

#[test]
fn every_file_and_folder_that_a_document_names_exists() {
    let tree = files("");
    for document in DOCUMENTS {
        let folder = below_root(root().join(document).parent().unwrap());
        let named = named_paths(&text(document), true);
        assert!(!named.is_empty(), "{document} names no file");
        for path in named {
            let beside = Path::new(&folder).join(&path);
            let bare = !path.contains('/') && tree.iter().any(|file| file.ends_with(&format!("/{path}")));
            assert!(bare || exists(&path) || exists(beside.to_str().unwrap()), "{document} names `{path}`");
        }
    }
    let (mut n_named, mut absent) = (0, Vec::new());
    for (page, whole) in manual() {
        let named = named_paths(&whole, false);
        n_named += named.len();
        absent.extend(named.into_iter().filter(|path| !exists(path)).map(|path| format!("{page} names `{path}`")));
    }
    assert_eq!(absent, Vec::<String>::new());
    assert!(n_named > 50, "only {n_named} paths were found");
}

fn anchors(page: &str) -> Vec<String> {
    let (mut found, mut seen) = (Vec::new(), BTreeMap::new());
    let mut fenced = false;
    for line in page.lines() {
        fenced ^= line.trim_start().starts_with("```");
        let title = line.trim_start_matches('#');
        if fenced || title.len() == line.len() || !title.starts_with(' ') {
            continue;
        }
        let letter = |c: char| match c {
            c if c.is_alphanumeric() || "_-".contains(c) => Some(c.to_ascii_lowercase()),
            c => c.is_whitespace().then_some('-'),
        };
        let name: String = title.trim().chars().filter_map(letter).collect();
        let n: &mut usize = seen.entry(name.clone()).or_default();
        found.push(if *n == 0 { name } else { format!("{name}-{n}") });
        *n += 1;
    }
    found
}

#[test]
fn every_link_of_the_manual_leads_somewhere() {
    let mut n_links = 0;
    for (page, whole) in manual() {
        for target in links(&whole).filter(|target| !target.starts_with("http")) {
            n_links += 1;
            let (path, anchor) = target.split_once('#').unwrap_or((target, ""));
            let path = if path.is_empty() { page.clone() } else { beside(&page, path) };
            assert!(exists(&path), "{page} links to {target}");
            if !anchor.is_empty() {
                let there = if path.starts_with(BOOK) { included(&path).0 } else { text(&path) };
                assert!(anchors(&there).iter().any(|name| name == anchor), "{page} links to {target}");
            }
        }
    }
    assert!(n_links > 40, "only {n_links} links were found");
}

#[test]
fn every_page_is_in_the_summary_and_what_is_included_has_no_link_that_breaks_there() {
    let listed: BTreeSet<String> = pages().into_iter().collect();
    let there = files(BOOK).into_iter().filter(|file| file.ends_with(".md") && !file.ends_with("/SUMMARY.md"));
    assert_eq!(listed, there.collect());
    let included: BTreeSet<String> = listed.iter().flat_map(|page| included(page).1).collect();
    assert!(included.len() > 3);
    for document in &included {
        let there = text(document);
        let relative = links(&there).find(|target| !target.starts_with("http") && !target.starts_with('#'));
        assert_eq!(relative, None, "{document} is a page of the book: name the path in code instead");
        // `tools/manual.sh` reads the pages alone.
        assert!(!there.contains("\n```sh\n"), "{document}: its commands are not run, so call the block `text`");
    }
}

#[test]
fn every_block_of_the_manual_is_run_or_says_that_it_is_no_command() {
    for page in pages().into_iter().chain(["README.md".to_owned()]) {
        let text = text(&page);
        let fences = text.lines().filter_map(|line| line.trim_start().strip_prefix("```"));
        let unknown = fences.step_by(2).find(|kind| !["sh", "text", "python", "yaml"].contains(kind));
        assert_eq!(unknown, None, "{page}: `tools/manual.sh` runs `sh` alone");
    }
}

fn ivv(arguments: &[&str]) -> String {
    let output = Command::new(env!("CARGO_BIN_EXE_ivv")).args(arguments).output().unwrap();
    String::from_utf8(output.stdout).unwrap()
}

#[test]
fn the_manual_shows_the_verbs_that_ivv_has() {
    let help = ivv(&["--help"]);
    let listed = help.lines().skip_while(|line| *line != "Commands:").skip(1).take_while(|line| !line.is_empty());
    let mut has: BTreeSet<String> =
        listed.filter_map(|line| line.strip_prefix("  ")?.split(' ').next().map(str::to_owned)).collect();
    has.retain(|verb| !verb.is_empty() && verb != "help");
    // The list leaves it out.
    has.insert("debug".to_owned());
    assert!(has.len() > 2, "ivv --help says:\n{help}");
    let shown = |text: &str| commands(text).into_iter().map(|words| words[0].clone()).collect::<BTreeSet<_>>();
    assert_eq!(manual().iter().flat_map(|(_, text)| shown(text)).collect::<BTreeSet<_>>(), has);
    for document in DOCUMENTS {
        assert!(shown(&text(document)).is_subset(&has), "{document}");
    }
}

/// Whether `verb` takes `option`: by its help, or by its source where this build leaves the option out.
fn takes(help: &mut BTreeMap<String, String>, verb: &str, option: &str) -> bool {
    let told = help.entry(verb.to_owned()).or_insert_with(|| {
        let arguments: Vec<&str> = verb.split(' ').chain(["--help"]).collect();
        ivv(&arguments)
    });
    let is_option = |word: &str| word == option;
    if told.split(|c: char| !c.is_ascii_alphanumeric() && c != '-').any(is_option) {
        return true;
    }
    let field = format!("\n    {}:", option.trim_start_matches('-').replace('-', "_"));
    let source = OF_OTHER_BUILDS
        .iter()
        .find(|(of, _)| *of == verb)
        .map(|(_, source)| files("tools").into_iter().filter(move |file| file.starts_with(source)));
    source.into_iter().flatten().any(|file| text(&file).contains(&field))
}

#[test]
fn every_option_in_the_manual_is_one_of_its_verb() {
    let (mut help, mut n_options) = (BTreeMap::new(), 0);
    let documents = DOCUMENTS.iter().map(|document| ((*document).to_owned(), text(document)));
    for (page, whole) in manual().into_iter().chain(documents) {
        for command in commands(&whole) {
            let has_verbs = ["sound", "segments", "debug"].contains(&command[0].as_str()) && command.len() > 1;
            let verb = if has_verbs { command[..2].join(" ") } else { command[0].clone() };
            // Behind a lone `--` are options of another verb.
            for word in command.iter().take_while(|word| *word != "--") {
                let option = word.split('=').next().unwrap_or_default();
                let is_option = option.trim_start_matches('-').starts_with(|c: char| c.is_ascii_lowercase());
                if option.starts_with('-') && is_option {
                    n_options += 1;
                    assert!(takes(&mut help, &verb, option), "{page}: `{}` has {option}", command.join(" "));
                }
            }
        }
    }
    assert!(n_options > 100, "only {n_options} options were found");
}

#[test]
fn every_option_that_the_manual_names_alone_is_one_of_some_verb_or_script() {
    let verbs: BTreeSet<String> = manual().iter().flat_map(|(_, text)| commands(text)).map(|c| c[0].clone()).collect();
    let of_sound = ["localize", "render", "synth"].map(|verb| format!("sound {verb}"));
    let of_segments = ["plan", "run", "join"].map(|verb| format!("segments {verb}"));
    let of_debug = ["vjp", "demo", "completions", "man"].map(|verb| format!("debug {verb}"));
    let verbs: Vec<String> = verbs.into_iter().chain(of_sound).chain(of_segments).chain(of_debug).collect();
    let tools = files("tools");
    let scripts = tools.iter().filter(|file| [".sh", ".py"].iter().any(|ending| file.ends_with(ending)));
    let scripts: String = scripts.map(|file| text(file)).collect();
    let mut help = BTreeMap::new();
    for (page, whole) in manual() {
        for span in code(&whole).into_iter().filter(|span| span.starts_with("--")) {
            let option = bare(span.split([' ', '=']).next().unwrap_or_default());
            let known = scripts.contains(option) || verbs.iter().any(|verb| takes(&mut help, verb, option));
            assert!(known, "{page} names `{span}`");
        }
    }
}

fn settings() -> Vec<Value> {
    serde_json::from_str(&ivv(&["train", "--list-settings", "--json"])).unwrap()
}

#[test]
fn every_setting_that_a_document_names_is_one() {
    let listed = settings();
    let names: BTreeSet<&str> = listed.iter().filter_map(|setting| setting["name"].as_str()).collect();
    let groups: BTreeSet<&str> = names.iter().filter_map(|name| Some(name.split_once('.')?.0)).collect();
    let known = |name: &str| {
        let whole = name.strip_suffix(".start").or(name.strip_suffix(".end")).unwrap_or(name);
        names.contains(name)
            || names.contains(whole)
            || names.iter().any(|other| other.starts_with(&format!("{name}.")))
    };
    let documents = DOCUMENTS.iter().map(|document| ((*document).to_owned(), text(document)));
    let mut n_named = 0;
    for (page, whole) in manual().into_iter().chain(documents) {
        for span in code(&whole) {
            let words: Vec<&str> = span.split_whitespace().map(bare).collect();
            for (at, word) in words.iter().enumerate() {
                let name = word.split('=').next().unwrap_or_default();
                let is_set = at > 0 && words[at - 1] == "--set";
                let first = name.split_once('.').map_or("", |(first, _)| first);
                let is_file = [".rs", ".comp", ".md", ".json", ".svg"].iter().any(|ending| name.ends_with(ending));
                // NAME stands for any.
                let is_name = !name.chars().any(|c| c.is_ascii_uppercase()) && name.starts_with(char::is_alphabetic);
                if is_name && (is_set || groups.contains(first) && !is_file) {
                    n_named += 1;
                    assert!(known(name), "{page} names the setting `{name}`");
                }
            }
        }
    }
    assert!(n_named > 50, "only {n_named} settings were found");
}

/// A value of a setting as a reader writes it.
fn told(value: &Value) -> String {
    match value {
        Value::String(word) => word.clone(),
        Value::Object(ends) if ends.contains_key("start") => format!("{} to {}", ends["start"], ends["end"]),
        Value::Null => "none".to_owned(),
        value => value.to_string(),
    }
}

fn settings_tables() -> String {
    let (mut page, mut group) = (String::new(), None);
    for setting in settings() {
        let field = |key: &str| setting[key].as_str().unwrap().replace('|', "\\|");
        let name = field("name");
        let of = name.split_once('.').map_or("Run", |(group, _)| group).to_owned();
        if group.as_ref() != Some(&of) {
            page += &format!("{}## {of}\n\n", if group.is_some() { "\n" } else { "" });
            page += "| setting | default | meaning |\n| --- | --- | --- |\n";
            group = Some(of);
        }
        let default = format!("{} {}", told(&setting["default"]), field("unit"));
        let presets = setting["presets"].as_object().unwrap();
        let presets: Vec<String> = presets.iter().map(|(preset, value)| format!("{preset} {}", told(value))).collect();
        let presets = if presets.is_empty() { String::new() } else { format!(" *Presets*: {}.", presets.join(", ")) };
        let meaning = format!("{} *Expected*: {}.{presets}", field("meaning"), field("range"));
        page += &format!("| `{name}` | {} | {meaning} |\n", default.trim());
    }
    page
}

#[test]
fn the_settings_page_is_the_table_of_settings() {
    let page = text(SETTINGS);
    let ((before, written, after), generated) = (marked(&page, "settings"), settings_tables());
    if written != generated {
        assert!(std::env::var_os("IVV_BLESS").is_some(), "mend it with: IVV_BLESS=1 cargo test --test it repo::manual");
        std::fs::write(root().join(SETTINGS), format!("{before}{generated}{after}")).unwrap();
    }
}

#[test]
fn what_code_and_documents_cite_is_in_the_repository() {
    let method = text(METHOD);
    let endings = [".rs", ".comp", ".glsl", ".mjs", ".js", ".md"];
    let is_source =
        |file: &String| endings.iter().any(|ending| file.ends_with(ending)) && file != "tests/repo/manual.rs";
    let mut n_cited = 0;
    for file in files("").into_iter().filter(is_source) {
        let text = text(&file);
        for cited in text.split(CITED).skip(1) {
            let number: String = cited.chars().take_while(char::is_ascii_digit).collect();
            n_cited += usize::from(!number.is_empty());
            let is_there = number.is_empty() || method.contains(&format!("\n## {number}. "));
            assert!(is_there, "{file} cites section {number}, which {METHOD} does not have");
        }
        let outside = ["research/", "research, "];
        assert!(!outside.iter().any(|word| text.contains(word)), "{file} cites what is not in the repository");
    }
    assert!(n_cited > 50, "only {n_cited} citations were found");
    let explained = [METHOD, "engine/ARCHITECTURE.md"];
    let documents = DOCUMENTS.into_iter().map(str::to_owned).chain(pages()).chain(["README.md".to_owned()]);
    for document in documents.filter(|document| !explained.contains(&document.as_str())) {
        assert!(!text(&document).contains(CITED), "{document}: link to the page of the method");
    }
}

/// The words of a page, and how many of them are numbers: digits without a letter but the x of a size.
fn words_and_numbers(page: &str) -> (usize, usize) {
    let is_word = |word: &&str| word.chars().any(char::is_alphanumeric);
    let is_number =
        |word: &&str| word.chars().any(|c| c.is_ascii_digit()) && !word.chars().any(|c| c.is_alphabetic() && c != 'x');
    let words: Vec<&str> = page.split_whitespace().filter(is_word).collect();
    (words.len(), words.into_iter().filter(is_number).count())
}

#[test]
fn the_book_is_short_and_leaves_measurements_to_the_lab() {
    assert_eq!(words_and_numbers("| `-3.5` | 128x96 of 3D, 24. | --- |"), (5, 3));
    let mut n_words = 0;
    for page in pages() {
        let (words, numbers) = words_and_numbers(&text(&page));
        n_words += words;
        let is_of_numbers = OF_NUMBERS.iter().any(|name| page.ends_with(&format!("/{name}")));
        let are_few = is_of_numbers || 20 * numbers <= words;
        assert!(are_few, "{page}: {numbers} numbers in {words} words; measurements belong to {LAB}");
    }
    assert!((5_000..=MOST_WORDS).contains(&n_words), "the book has {n_words} words");
    let n_lines = text("README.md").lines().count();
    assert!((50..=100).contains(&n_lines), "README.md has {n_lines} lines");
}

#[test]
fn every_note_of_the_lab_is_in_its_index_and_answers_a_question() {
    let index = text(&format!("{LAB}/README.md"));
    let listed: BTreeSet<String> = links(&index).map(|note| format!("{LAB}/{note}")).collect();
    let is_note = |file: &String| {
        let name = &file[LAB.len() + 1..];
        name.ends_with(".md") && !name.contains('/') && name != "README.md"
    };
    let there: BTreeSet<String> = files(LAB).into_iter().filter(is_note).collect();
    assert_eq!(listed, there);
    let is_dated = |note: &&String| note[LAB.len() + 1..].starts_with(|c: char| c.is_ascii_digit());
    for note in there.iter().filter(is_dated) {
        let text = text(note);
        for part in ["Question", "Command", "Commit", "Verdict"] {
            assert!(text.contains(&format!("\n- **{part}**: ")), "{note} has no {}", part.to_lowercase());
        }
    }
}
