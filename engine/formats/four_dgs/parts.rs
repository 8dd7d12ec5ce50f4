use super::FourDgs;
use super::decode::{margin, not_read};
use crate::error::Result;
use crate::scene::{ALWAYS, Part, Parts, Splats};
use fourdgs::reader::OpenMode;
use fourdgs::{FileReadable, SceneReader};
use std::path::{Path, PathBuf};

/// Chunks are read one by one where no time needs more than this part of the Gaussians.
const FEW: f64 = 0.5;

/// A `.4dgs` that is read chunk by chunk.
pub struct FourDgsParts {
    path: PathBuf,
    file: FourDgs,
    reader: SceneReader<FileReadable>,
    /// Chunks that last the whole clip.
    lasting: Vec<u32>,
    /// The chunk of each part but the last, which is of those that last.
    brief: Vec<u32>,
    parts: Vec<Part>,
}

impl FourDgsParts {
    /// `None` where some time needs most of the Gaussians, or where the file has no index of its chunks.
    pub fn open(path: &Path) -> Result<Option<Self>> {
        let file = FourDgs::open(path)?;
        file.check_shown()?;
        let clock = file.clock();
        let seconds = clock.seconds();
        // Ends may be rounded to singles.
        let margin = margin(seconds, clock.frames);
        let is_begin = |time: f64| time <= margin;
        let is_end = |time: f64| time >= seconds - margin;
        let index = &file.scene.chunk_index;
        let (lasting, brief): (Vec<u32>, Vec<u32>) = (0..index.len() as u32).partition(|chunk| {
            let entry = &index[*chunk as usize];
            is_begin(entry.t0) && is_end(entry.t1)
        });
        let n = |chunk: &u32| index[*chunk as usize].gaussian_count as usize;
        let part = |chunk: &u32| {
            let entry = &index[*chunk as usize];
            // Rounded as the times of its Gaussians are.
            let [from, to] = [entry.t0, entry.t1].map(|time| f64::from((time / seconds) as f32));
            // What is there at an end of the clip is there beyond it, as it is where the file is read whole.
            let from = if is_begin(entry.t0) { f64::NEG_INFINITY } else { from };
            let to = if is_end(entry.t1) { f64::INFINITY } else { to };
            Part { from, to, n: n(chunk) }
        };
        let parts: Vec<Part> = brief.iter().map(part).collect();
        let always: usize = lasting.iter().map(n).sum();
        let total = always + parts.iter().map(|part| part.n).sum::<usize>();
        if (always + fullest(&parts)) as f64 > FEW * total as f64 {
            return Ok(None);
        }
        let reader = FileReadable::open(path).and_then(|file| SceneReader::open_with(file, OpenMode::Indexed));
        let reader = reader.map_err(|fault| not_read(path, &fault))?;
        let mut opened = FourDgsParts { path: path.to_owned(), file, reader, lasting, brief, parts };
        let n = opened.part(opened.brief.len())?.len();
        opened.parts.push(Part { from: f64::NEG_INFINITY, to: f64::INFINITY, n });
        Ok(Some(opened))
    }

    pub fn file(&self) -> &FourDgs {
        &self.file
    }

    /// The Gaussians of chunks that are static where `moving` is false, else the others.
    fn read(&mut self, chunks: &[u32], moving: bool) -> Result<Splats> {
        let mut splats = Splats::new(self.sh_degree());
        for chunk in chunks {
            let degree = self.file.scene.header.sh_degree;
            let set = self.reader.load_chunk(*chunk, degree).map_err(|fault| not_read(&self.path, &fault))?;
            let stored = self.file.stored(set);
            let is_brief = !self.lasting.contains(chunk);
            let (still, others) = stored.populations();
            // A Gaussian in a chunk that is not always there is not always there.
            let (still, others) = if is_brief { (Vec::new(), (0..set.count()).collect()) } else { (still, others) };
            stored.push_all(&mut splats, if moving { &others } else { &still }, moving);
        }
        if splats.span.iter().all(|span| *span == ALWAYS) {
            splats.span.clear();
        }
        Ok(splats)
    }
}

impl Parts for FourDgsParts {
    fn path(&self) -> &Path {
        &self.path
    }

    fn sh_degree(&self) -> u32 {
        u32::from(self.file.scene.header.sh_degree)
    }

    fn parts(&self) -> &[Part] {
        &self.parts
    }

    fn still(&mut self) -> Result<Splats> {
        self.read(&self.lasting.clone(), false)
    }

    fn part(&mut self, index: usize) -> Result<Splats> {
        let chunks = self.brief.get(index).map_or_else(|| self.lasting.clone(), |chunk| vec![*chunk]);
        self.read(&chunks, true)
    }
}

/// The most Gaussians that exist at one time.
fn fullest(parts: &[Part]) -> usize {
    let at = |time: f64| parts.iter().filter(|part| part.from <= time && time < part.to).map(|part| part.n).sum();
    parts.iter().map(|part| at(part.from)).max().unwrap_or(0)
}
