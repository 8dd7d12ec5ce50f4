// The parts of generated bindings that are read from the shaders' text: purposes, comments and constants.

use std::collections::BTreeMap;
use std::fmt::Write as _;

/// The purpose in a shader's header, as a sentence.
pub fn purpose(text: &str) -> Option<String> {
    let mut lines = text.lines().skip_while(|line| !line.starts_with("// Purpose   "));
    let first = lines.next()?.strip_prefix("// Purpose   ")?;
    let rest = lines.map_while(|line| line.strip_prefix("//           "));
    let purpose = std::iter::once(first).chain(rest).collect::<Vec<_>>().join(" ");
    let mut letters = purpose.chars();
    letters.next().map(|letter| letter.to_uppercase().chain(letters).collect())
}

/// The shaders' own comments: by struct (`Push` too) and member, by "" and buffer, by struct and "" on the struct.
#[derive(Default)]
pub struct Comments(BTreeMap<(String, String), String>);

impl Comments {
    pub fn read(&mut self, text: &str) {
        let (mut above, mut scope) = (Vec::new(), "");
        for line in text.lines().map(str::trim) {
            if let Some(comment) = line.strip_prefix("// ") {
                above.push(comment);
                continue;
            }
            let (code, comment) = line.split_once("// ").map_or((line, ""), |(code, comment)| (code.trim(), comment));
            let opened = code.strip_prefix("struct ").map(|rest| rest.trim_end_matches(" {"));
            let opened = opened.or_else(|| code.contains("uniform Push {").then_some("Push"));
            if let Some(name) = opened {
                self.add(name, "", &above.join(" "));
                scope = if code.contains('}') { "" } else { name };
            } else if code.starts_with('}') {
                scope = "";
            } else if let Some((declared, _)) = code.rsplit_once(';').filter(|_| !scope.is_empty()) {
                self.add(scope, declared, comment);
            } else if let Some((declared, _)) = code.strip_suffix("; };").zip(code.strip_prefix("layout(")) {
                self.add("", declared, comment);
            }
            above.clear();
        }
    }

    fn add(&mut self, scope: &str, declared: &str, comment: &str) {
        let name = declared.rsplit(' ').next().unwrap_or_default().trim_end_matches("[]");
        if !comment.is_empty() {
            self.0.insert((scope.to_owned(), name.to_owned()), comment.to_owned());
        }
    }

    /// The comment as a line of documentation; nothing where the shader has none.
    pub fn doc(&self, scope: &str, name: &str) -> String {
        let comment = self.0.get(&(scope.to_owned(), name.to_owned()));
        comment.map_or_else(String::new, |comment| format!("/// {}.\n", comment.trim_end_matches('.')))
    }
}

pub fn constants_of(text: &str) -> String {
    let (mut found, mut known) = (String::new(), Vec::<String>::new());
    for line in text.lines() {
        let Some((declared, rest)) = line.strip_prefix("const ").and_then(|rest| rest.split_once(" = ")) else {
            continue;
        };
        let Some((kind, name)) = declared.split_once(' ') else { continue };
        let kind = match kind {
            "uint" => "u32",
            "int" => "i32",
            "float" => "f32",
            _ => continue,
        };
        let value = rest.split_once(';').map_or("", |(value, _)| value);
        let words: Vec<&str> = value.split(|c: char| !c.is_ascii_alphanumeric() && c != '_' && c != '.').collect();
        let is_known = |word: &&str| {
            word.is_empty() || known.iter().any(|name| name == word) || word.starts_with(|c: char| c.is_ascii_digit())
        };
        let is_scalar = name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_') && !value.contains('(');
        // What differs between kernels has one name and several values.
        let is_one = text.matches(&format!("const {declared} = ")).count() == 1;
        if !is_one || !is_scalar || !words.iter().all(is_known) {
            continue;
        }
        let value: String = value
            .split(' ')
            .map(|word| if word.starts_with(|c: char| c.is_ascii_digit()) { word.trim_end_matches('u') } else { word })
            .collect::<Vec<&str>>()
            .join(" ");
        let comment = line.split_once("// ").map_or("", |(_, comment)| comment);
        let doc = if comment.is_empty() { String::new() } else { format!("/// {}.\n", comment.trim_end_matches('.')) };
        writeln!(found, "{doc}pub const {name}: {kind} = {value};").ok();
        known.push(name.to_owned());
    }
    found
}
