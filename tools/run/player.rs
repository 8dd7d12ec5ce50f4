//! The browser player with a scene: as a folder for any host of files, or as one HTML file.

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD as BASE64;
use ivv::Error;
use ivv::internals::files::write_atomic;
use sha2::{Digest, Sha256};
use std::path::Path;

pub struct PlayerFile {
    pub name: &'static str,
    pub text: &'static str,
}

impl PlayerFile {
    pub fn media_type(&self) -> &'static str {
        match self.name.rsplit('.').next() {
            Some("html") => "text/html; charset=utf-8",
            Some("css") => "text/css; charset=utf-8",
            Some("svg") => "image/svg+xml",
            _ => "text/javascript; charset=utf-8",
        }
    }
}

macro_rules! parts {
    ($folder:literal: $($name:literal)+) => {
        &[$(PlayerFile {
            name: $name,
            text: include_str!(concat!(env!("CARGO_MANIFEST_DIR"), "/assets/", $folder, "/", $name)),
        }),+]
    };
}

pub const PLAYER_FILES: &[PlayerFile] = parts! { "player":
    "index.html" "style.css" "icon.svg" "bench.js" "bytes.js" "camera.js" "chunks.js" "clock.js" "container.js" "controls.js"
    "decode.js" "ears.js" "gl.js" "main.js" "player.js" "shaders.js" "sorter.js" "sound.js" "source.js" "ui.js" "worker.js" "xr.js"
};

pub const LIVE_PAGE: &[PlayerFile] = parts! { "live": "index.html" "live.css" "live.js" };

/// The policy of the folder's page: it may load its own files.
pub const POLICY: &str =
    "default-src 'self'; worker-src 'self' blob:; style-src 'self'; connect-src 'self'; media-src 'self' blob:";

/// Bytes of the longest scene in a page. There it is text, four characters for three bytes, and of all browsers Chromium allows the
/// shortest strings: 2^29 - 24 characters.
const MOST_IN_PAGE: usize = ((1 << 29) - 24) / 4 * 3;

pub const SCENE: &str = "scene.4dgs";

fn player_file(name: &str) -> Option<&'static PlayerFile> {
    PLAYER_FILES.iter().find(|file| file.name == name)
}

/// Writes the player into `folder`, which exists and contains a scene. The page comes last, so that it is never incomplete.
pub fn write_player(folder: &Path) -> ivv::Result<()> {
    PLAYER_FILES
        .iter()
        .rev()
        .try_for_each(|file| write_atomic(&folder.join(file.name), |to| to.write_all(file.text.as_bytes())))
}

pub fn n_bytes() -> u64 {
    PLAYER_FILES.iter().map(|file| file.text.len() as u64).sum()
}

/// The player and a scene as one page, for the file `to`. It also opens without a server.
pub fn single_file(to: &Path, scene: &[u8]) -> ivv::Result<String> {
    check_length(to, scene.len())?;
    let text = |name: &str| player_file(name).map_or("", |file| file.text);
    let joined = |name: &str| {
        let mut modules = Vec::new();
        with_imports(name, &mut Vec::new(), &mut modules);
        modules.iter().map(|file| bare(file.text)).collect::<Vec<_>>().join("\n")
    };
    let (script, worker, style) = (joined("main.js"), joined("worker.js"), text("style.css"));
    let hash = |text: &str| format!("'sha256-{}'", BASE64.encode(Sha256::digest(text)));
    let policy = format!(
        "default-src 'none'; script-src {} blob:; style-src {}; worker-src blob:; img-src data:; media-src blob:",
        hash(&script),
        hash(style)
    );
    let charset = "<meta charset=\"utf-8\">";
    let scene = BASE64.encode(scene);
    let page = [
        (charset, format!("{charset}\n<meta http-equiv=\"Content-Security-Policy\" content=\"{policy}\">")),
        ("href=\"icon.svg\"", format!("href=\"data:image/svg+xml;base64,{}\"", BASE64.encode(text("icon.svg")))),
        ("<link rel=\"stylesheet\" href=\"style.css\">", format!("<style>{style}</style>")),
        (
            "<script type=\"module\" src=\"main.js\"></script>",
            format!(
                "<script type=\"text/plain\" id=\"worker\">{worker}</script>\n<script type=\"application/octet-stream;base64\" \
                 id=\"scene\">{scene}</script>\n<script type=\"module\">{script}</script>"
            ),
        ),
    ]
    .iter()
    .fold(text("index.html").to_owned(), |page, (from, to)| page.replacen(from, to, 1));
    Ok(page)
}

/// Refuses a scene whose text would be longer than the strings of a browser.
fn check_length(to: &Path, n_bytes: usize) -> ivv::Result<()> {
    if n_bytes <= MOST_IN_PAGE {
        return Ok(());
    }
    let [found, most] = [n_bytes, MOST_IN_PAGE].map(|bytes| bytes as f64 / 1e6);
    let reason = format!("expected a scene of at most {most:.1} MB, which a browser takes, found {found:.1} MB");
    let remedy = "give --target-size; or export a folder (`-o web/`), or a .4dgs for `ivv serve`";
    Err(Error::data(to, "", reason, remedy))
}

/// Appends the module `name` after all that it imports, each once.
fn with_imports(name: &str, met: &mut Vec<&'static str>, to: &mut Vec<&'static PlayerFile>) {
    let Some(module) = player_file(name).filter(|module| !met.contains(&module.name)) else { return };
    met.push(module.name);
    // Comments name types as `import('./x.js')`, which is not this.
    for import in module.text.split(" from './").skip(1) {
        with_imports(import.split('\'').next().unwrap_or_default(), met, to);
    }
    to.push(module);
}

/// A module without its imports and without the word `export`, both at the beginning of a line.
fn bare(module: &str) -> String {
    let mut text = String::with_capacity(module.len());
    let mut is_import = false;
    for line in module.split_inclusive('\n') {
        is_import |= line.starts_with("import ");
        if !is_import {
            text.push_str(line.strip_prefix("export ").unwrap_or(line));
        }
        is_import &= !line.trim_end().ends_with(';');
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_scene_that_no_browser_takes_from_a_page_is_refused() {
        let page = Path::new("page.html");
        check_length(page, 402_653_166).unwrap();
        let told = check_length(page, 402_653_167).unwrap_err().to_string();
        assert!(told.contains("402.7 MB") && told.contains("--target-size") && told.contains("ivv serve"), "{told}");
    }
}
