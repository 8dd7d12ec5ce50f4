//! Videos of other colours than BT.709: high dynamic range and wide gamuts, as phones record them.

use std::path::Path;

use crate::error::Result;
use crate::prepare::program::FFMPEG;

/// Candelas per square metre of what becomes white in a video of high dynamic range; as bright as a white of SDR is.
const WHITE: u32 = 100;
/// The brightest that is told from white, in whites: what phones and most films stay below.
const BRIGHTEST: u32 = 10;
/// Up to this part of white nothing changes; from there to the brightest, light is compressed.
const KNEE: f64 = 0.5;

/// How pictures become BT.709: the same for every picture and every camera, so that none is brighter than another.
#[derive(Clone, Debug, PartialEq)]
pub(in crate::internals::prepare) struct Conversion {
    pub name: String,
    /// True if light beyond white is compressed.
    pub tone_maps: bool,
    pub filter: String,
}

/// A video's colours by ffprobe; `unknown` or nothing where it does not tell.
pub(super) struct Tags<'a> {
    pub transfer: Option<&'a str>,
    pub primaries: Option<&'a str>,
    pub matrix: Option<&'a str>,
    pub range: Option<&'a str>,
}

impl Tags<'_> {
    /// The filter that makes pictures BT.709; nothing where they are, or are as close as BT.601.
    pub fn conversion(&self) -> Option<Conversion> {
        let curve = match self.transfer {
            Some("smpte2084") => Some("PQ"),
            Some("arib-std-b67") => Some("HLG"),
            _ => None,
        };
        let wide = match self.primaries {
            Some("bt2020") => Some("BT.2020"),
            Some("smpte431" | "smpte432") => Some("P3"),
            _ => None,
        };
        if curve.is_none() && wide.is_none() {
            return None;
        }
        let name = [curve, wide].into_iter().flatten().collect::<Vec<_>>().join(", ");
        let transfer = one_of(self.transfer, &["smpte2084", "arib-std-b67", "iec61966-2-1"]).unwrap_or("bt709");
        let primaries = one_of(self.primaries, &["bt709", "smpte431", "smpte432"]).unwrap_or("bt2020");
        let is_2020 = primaries == "bt2020";
        let matrices = ["bt709", "bt470bg", "smpte170m", "bt2020nc", "bt2020c", "gbr"];
        let matrix = one_of(self.matrix, &matrices).unwrap_or(if is_2020 { "bt2020nc" } else { "bt709" });
        let range = if self.range == Some("pc") { "pc" } else { "tv" };
        let tone_map = format!(",tonemap=mobius:param={KNEE}:desat=0:peak={BRIGHTEST}");
        let tone_map = if curve.is_some() { tone_map.as_str() } else { "" };
        let filter = format!(
            "zscale=tin={transfer}:pin={primaries}:min={matrix}:rin={range}:t=linear:p=bt709:m=gbr:npl={WHITE},\
             format=gbrpf32le{tone_map},zscale=t=bt709:m=gbr:r=pc,format=gbrp"
        );
        Some(Conversion { name, tone_maps: curve.is_some(), filter })
    }
}

fn one_of(tag: Option<&str>, known: &[&'static str]) -> Option<&'static str> {
    known.iter().find(|known| tag == Some(**known)).copied()
}

pub(in crate::internals::prepare) fn can_convert(about: &Path) -> Result<bool> {
    let listed = FFMPEG.run(["-v", "error", "-filters"], about)?;
    let listed = String::from_utf8_lossy(&listed);
    let has = |filter: &str| listed.lines().any(|line| line.split_whitespace().nth(1) == Some(filter));
    Ok(has("zscale") && has("tonemap"))
}

#[cfg(test)]
mod tests {
    use super::Tags;

    fn name(transfer: &str, primaries: &str) -> Option<(String, bool)> {
        let tags = Tags { transfer: Some(transfer), primaries: Some(primaries), matrix: None, range: None };
        tags.conversion().map(|conversion| (conversion.name, conversion.tone_maps))
    }

    #[test]
    fn what_is_not_bt_709_is_named() {
        assert_eq!(name("arib-std-b67", "bt2020"), Some(("HLG, BT.2020".to_owned(), true)));
        assert_eq!(name("smpte2084", "unknown"), Some(("PQ".to_owned(), true)));
        assert_eq!(name("bt709", "smpte432"), Some(("P3".to_owned(), false)));
        for plain in ["bt709", "unknown", "smpte170m", "bt470bg"] {
            assert_eq!(name(plain, plain), None, "{plain}");
        }
    }
}
