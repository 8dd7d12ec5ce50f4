//! The frames of a clip that are used.

use std::fmt;
use std::str::FromStr;

/// Frames of a clip. As text `A:B:S`: every `S`-th frame from `A` up to, but not including, `B`; also `A:B`, `A:` and `:B`, and a number
/// of first frames.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(into = "Option<String>", try_from = "Option<String>")]
pub struct Frames {
    /// The first.
    pub from: u32,
    /// None is at or after this one; `None` goes to the end of the clip.
    pub to: Option<u32>,
    /// Every n-th is used, at least 1.
    pub every: u32,
}

impl Default for Frames {
    fn default() -> Self {
        Frames { from: 0, to: None, every: 1 }
    }
}

impl Frames {
    /// The first `n` of a clip.
    pub fn first(n: u32) -> Self {
        Frames { to: Some(n), ..Frames::default() }
    }

    /// Those of a clip of `n` frames, by their numbers there.
    #[doc(hidden)]
    pub fn of(&self, n: u32) -> impl ExactSizeIterator<Item = u32> + Clone + use<> {
        (self.from..self.end(n).max(self.from)).step_by(self.every.max(1) as usize)
    }

    /// The frame of a clip of `n` where they end.
    #[doc(hidden)]
    pub fn end(&self, n: u32) -> u32 {
        self.to.map_or(n, |to| to.min(n))
    }

    /// The number of a frame of the clip among these, if it is one.
    #[doc(hidden)]
    pub fn index(&self, frame: u32, n: u32) -> Option<u32> {
        let past = frame.checked_sub(self.from).filter(|_| frame < self.end(n))?;
        past.is_multiple_of(self.every.max(1)).then_some(past / self.every.max(1))
    }

    /// True for all frames of every clip.
    pub fn are_all(&self) -> bool {
        *self == Frames::default()
    }
}

impl fmt::Display for Frames {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}:", self.from)?;
        self.to.map_or(Ok(()), |to| write!(f, "{to}"))?;
        if self.every == 1 { Ok(()) } else { write!(f, ":{}", self.every) }
    }
}

impl FromStr for Frames {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let fault =
            || format!("expected a number of frames, A:B or A:B:S, with A below B and S at least 1, found {text}");
        let number = |part: &str| part.parse::<u32>().map_err(|_| fault());
        let frames = match text.split(':').collect::<Vec<_>>().as_slice() {
            [n] => Frames::first(number(n)?),
            [from, to, every @ ..] if every.len() <= 1 => Frames {
                from: if from.is_empty() { 0 } else { number(from)? },
                to: if to.is_empty() { None } else { Some(number(to)?) },
                every: every.first().map_or(Ok(1), |every| number(every))?,
            },
            _ => return Err(fault()),
        };
        let is_empty = frames.to.is_some_and(|to| to <= frames.from) || frames.every == 0;
        if is_empty { Err(fault()) } else { Ok(frames) }
    }
}

impl From<Frames> for Option<String> {
    fn from(frames: Frames) -> Self {
        (!frames.are_all()).then(|| frames.to_string())
    }
}

impl TryFrom<Option<String>> for Frames {
    type Error = String;

    fn try_from(written: Option<String>) -> Result<Self, String> {
        written.map_or(Ok(Frames::default()), |text| text.parse())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_gives_frames_and_frames_the_text() {
        for (text, n, expected) in [
            ("3", 10, vec![0, 1, 2]),
            ("3", 2, vec![0, 1]),
            ("2:5", 10, vec![2, 3, 4]),
            ("8:", 10, vec![8, 9]),
            (":2", 10, vec![0, 1]),
            ("1:9:3", 10, vec![1, 4, 7]),
            ("12:20", 10, vec![]),
        ] {
            let frames: Frames = text.parse().unwrap();
            assert_eq!(frames.of(n).collect::<Vec<_>>(), expected, "{text}");
            assert_eq!(frames.to_string().parse(), Ok(frames), "{text}");
            let indexed: Vec<u32> = (0..n).filter(|frame| frames.index(*frame, n).is_some()).collect();
            assert_eq!(indexed, expected, "{text}");
            assert!(expected.iter().zip(0..).all(|(frame, index)| frames.index(*frame, n) == Some(index)), "{text}");
        }
        for text in ["", "0", "a", "5:5", "6:5", "1:2:0", "1:2:3:4", "-1:3", "1:b"] {
            assert!(text.parse::<Frames>().unwrap_err().contains("expected a number of frames"), "{text}");
        }
    }

    #[test]
    fn run_folders_have_the_text() {
        let read = |text: &str| serde_json::from_str::<Frames>(text).unwrap();
        assert_eq!(read("null"), Frames::default());
        let frames = Frames { from: 3, to: Some(9), every: 2 };
        assert_eq!(read(&serde_json::to_string(&frames).unwrap()), frames);
        assert!(serde_json::from_str::<Frames>("\"9:3\"").is_err());
    }
}
