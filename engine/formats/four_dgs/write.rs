//! Writes a `.4dgs` part by part: what all Gaussians share is measured first, then each part becomes chunks of its own.
//!
//! The crate's writer holds a whole scene several times over. It makes the file's beginning here too; it is given a
//! scene without Gaussians for that.

use super::grades::Grades;
use crate::error::{Error, Result};
use fourdgs::opcode as op;
use fourdgs::quantization::{
    Bounds, Profile, Steps, life_class, morton_order, motion_step, mu_step, quantize_rotation, rct_forward, rint,
    sh_bound, sh_step, support_k,
};
use fourdgs::records::{ChunkIndexEntry, Footer, Header, Quantization, Statistics, WindowTable, encode_chunk};
use fourdgs::serialization::{MAGIC, Records, crc32, put_record};
use fourdgs::stream::encode_stream;
use fourdgs::{GaussianSet, SceneExtras, WriteOptions};
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

/// Chunks are at least this long, seconds, so that one is fetched in time; and hold at least so many Gaussians where they are
/// not whole parts, so that the description of a chunk costs little.
const SHORTEST_CHUNK: f64 = 0.5;
const LEAST_IN_CHUNK: usize = 256;
/// Players refuse chunks without bounds, and show what they have of a large scene.
const MOST_IN_CHUNK: usize = 1 << 19;
/// Bits of a standard deviation, as a single, by which they are counted to find the median: it is found to 0.05 %.
const COUNTED_BITS: u32 = 20;
/// Widening of the times of a Gaussian, for the rounding of readers.
const MARGIN: f64 = 1e-6;

/// The inputs of a file's grids.
#[derive(Clone, Debug)]
pub struct Measure {
    n: u64,
    lowest: [f64; 3],
    highest: [f64; 3],
    /// Histogram by the first bits.
    scales: Vec<u64>,
    /// Bits of the ends of windows, seconds, not negative.
    windows: BTreeSet<[u32; 2]>,
}

impl Measure {
    pub(super) fn new() -> Self {
        Measure {
            n: 0,
            lowest: [f64::INFINITY; 3],
            highest: [f64::NEG_INFINITY; 3],
            scales: vec![0; 1 << COUNTED_BITS],
            windows: BTreeSet::new(),
        }
    }

    pub(super) fn count(&mut self, set: &GaussianSet, grades: &Grades) {
        self.n += set.count() as u64;
        for place in set.positions.chunks_exact(3) {
            for (axis, x) in place.iter().map(|x| f64::from(*x)).enumerate() {
                self.lowest[axis] = self.lowest[axis].min(x);
                self.highest[axis] = self.highest[axis].max(x);
            }
        }
        set.scales.iter().for_each(|s| self.scales[(grades.scale(*s).to_bits() >> (32 - COUNTED_BITS)) as usize] += 1);
        let windows = set.win_lo.iter().zip(&set.win_hi);
        self.windows.extend(windows.map(|(from, to)| [from.to_bits(), to.to_bits()]));
    }

    fn median(&self) -> f64 {
        let half = self.scales.iter().sum::<u64>() / 2;
        let mut below = 0;
        let bin = self.scales.iter().position(|n| {
            below += n;
            below > half
        });
        bin.map_or(1e-3, |bin| f64::from(f32::from_bits((bin as u32) << (32 - COUNTED_BITS))).max(1e-30))
    }
}

pub(super) struct Writing<'a> {
    path: &'a Path,
    grades: Grades,
    cutoff: f64,
    level: u32,
    seconds: f64,
    bounds: Bounds,
    steps: Steps,
    origin: [f64; 3],
    windows: Vec<[u32; 2]>,
    bits: Vec<u8>,
    n: u64,
    corners: Vec<f64>,
    written: u64,
    index: Vec<ChunkIndexEntry>,
}

/// A stretch of a clip, seconds, and the Gaussians that are stored with it.
struct Node {
    stretch: [f64; 2],
    level: u32,
    members: Vec<usize>,
}

impl<'a> Writing<'a> {
    pub(super) fn new(
        path: &'a Path,
        measure: &Measure,
        grades: Grades,
        sh_degree: u8,
        seconds: f64,
        options: &WriteOptions,
    ) -> Self {
        let bounds = Bounds::for_profile(Profile::Fine, measure.median());
        let steps = Steps::of(&bounds);
        let (lowest, corners) = match measure.n {
            0 => ([0.0; 3], vec![0.0; 6]),
            _ => (measure.lowest, measure.lowest.into_iter().chain(measure.highest).collect()),
        };
        Writing {
            path,
            grades,
            cutoff: options.cutoff,
            level: options.level,
            seconds,
            // A place on a coarser grid must be on that which begins here.
            origin: lowest.map(|x| grades.place(x as f32, &steps).into()),
            bounds,
            steps,
            windows: measure.windows.iter().copied().collect(),
            bits: grades.bits(sh_degree),
            n: measure.n,
            corners,
            written: 0,
            index: Vec::new(),
        }
    }

    /// The bytes before the chunks.
    pub(super) fn front(&mut self, options: &WriteOptions, extras: &SceneExtras) -> Result<Vec<u8>> {
        let path = self.path;
        let fault = |fault: fourdgs::Error| {
            let remedy = "leave out the sound, or export the scene as PLY";
            Error::data(path, "", format!("cannot be stored: {fault}"), remedy)
        };
        let without = fourdgs::write_to_vec(&GaussianSet::default(), self.seconds, options, extras).map_err(fault)?;
        let mut bytes = MAGIC.to_vec();
        for record in Records::new(&without, MAGIC.len()) {
            let record = record.map_err(fault)?;
            match record.opcode {
                op::HEADER => {
                    let of_none = Header::parse(record.content).map_err(fault)?;
                    let sh_degree = self.bits.len() as u8;
                    let (gaussian_count, aabb) = (self.n, self.corners.clone());
                    bytes.extend(Header { gaussian_count, aabb, sh_degree, ..of_none }.encode(&[]));
                }
                op::QUANTIZATION => bytes.extend(self.quantization().encode(&[])),
                op::WINDOW_TABLE => {
                    let seconds = |bits: u32| f64::from(f32::from_bits(bits));
                    let windows = self.windows.iter().map(|[from, to]| (seconds(*from), seconds(*to)));
                    bytes.extend(WindowTable { windows: windows.collect() }.encode());
                }
                op::FOOTER => break,
                opcode => put_record(&mut bytes, opcode, record.content),
            }
        }
        self.written = bytes.len() as u64;
        Ok(bytes)
    }

    fn quantization(&self) -> Quantization {
        let (bounds, steps) = (&self.bounds, &self.steps);
        let is_coarse = self.bits.iter().any(|bits| *bits < 8);
        let worst = |of: fn(u8) -> u8| self.bits.iter().map(|bits| of(*bits)).max().unwrap_or(0);
        let told = [
            ("pos", bounds.pos),
            ("scale_rel", bounds.scale_rel),
            ("rot", bounds.rot),
            ("rgb", bounds.rgb),
            ("alpha", bounds.alpha),
            ("motion", bounds.motion),
            ("time", bounds.time),
            ("sigma_rel", bounds.sigma_rel),
        ];
        let mut told: BTreeMap<String, String> =
            told.map(|(name, bound)| (name.to_owned(), format!("{bound:?}"))).into();
        told.insert("sh".to_owned(), if is_coarse { worst(sh_bound) } else { bounds.sh }.to_string());
        let bands = self.bits.iter().enumerate().filter(|_| is_coarse);
        told.extend(bands.map(|(band, bits)| (format!("sh_band{}", band + 1), sh_bound(*bits).to_string())));
        Quantization {
            scheme: "uniform-v1".to_owned(),
            pos_origin: self.origin.to_vec(),
            step_pos: steps.pos,
            step_scale_log: steps.scale_log,
            step_rot: steps.rot,
            step_rgb: steps.rgb,
            step_alpha: steps.alpha,
            step_motion: steps.motion,
            step_time: steps.time,
            step_sigma_log: steps.sigma_log,
            step_sh: if is_coarse { worst(sh_step) } else { steps.sh },
            bounds: told,
            sh_bit_depths: if is_coarse { self.bits.clone() } else { Vec::new() },
        }
    }

    /// The chunks of Gaussians that exist within `stretch`, seconds.
    pub(super) fn chunks(&mut self, part: &GaussianSet, stretch: [f64; 2]) -> Result<Vec<u8>> {
        let set = self.grades.on(part, &self.steps, self.cutoff);
        let all = [&set.positions, &set.scales, &set.rotations, &set.colors, &set.motions, &set.mu_t];
        if all.iter().any(|values| values.iter().any(|x| !x.is_finite())) {
            return Err(self.too_far("a number is too large for single precision"));
        }
        let bins = self.bins(&set);
        let supports: Vec<[f64; 2]> = (0..set.count()).map(|i| self.support(&bins, i)).collect();
        let depth = ((stretch[1] - stretch[0]) / SHORTEST_CHUNK).max(1.0).log2().floor() as u32;
        let mut nodes = Vec::new();
        settle(&supports, Node { stretch, level: 0, members: (0..set.count()).collect() }, depth, &mut nodes);
        let mut bytes = Vec::new();
        for Node { stretch: [t0, t1], level, members } in &nodes {
            let places: Vec<f32> = members.iter().flat_map(|i| set.positions[3 * i..3 * i + 3].to_vec()).collect();
            let members: Vec<usize> =
                morton_order(&places, members.len()).into_iter().map(|rank| members[rank]).collect();
            for members in members.chunks(MOST_IN_CHUNK) {
                let chunk = encode_chunk(*t0, *t1, *level, members.len() as u32, &self.streams(&bins, members)?);
                let mut entry = ChunkIndexEntry {
                    t0: *t0,
                    t1: *t1,
                    chunk_offset: self.written + bytes.len() as u64,
                    chunk_length: chunk.len() as u64,
                    gaussian_count: members.len() as u32,
                    ..ChunkIndexEntry::default()
                };
                bytes.extend(chunk);
                for (band, record) in self.bands(&set, members)? {
                    entry.bands.push((band, self.written + bytes.len() as u64, record.len() as u64));
                    bytes.extend(record);
                }
                self.index.push(entry);
            }
        }
        self.written += bytes.len() as u64;
        Ok(bytes)
    }

    /// The bytes after the chunks.
    pub(super) fn end(self) -> Vec<u8> {
        let mut bytes: Vec<u8> = self.index.iter().flat_map(ChunkIndexEntry::encode).collect();
        let mut footer = Footer::default();
        if !self.index.is_empty() {
            let (gaussian_count, chunk_count) = (self.n, self.index.len() as u32);
            let statistics = Statistics { gaussian_count, chunk_count, duration_sec: self.seconds, aabb: self.corners };
            bytes.extend(statistics.encode());
            footer = Footer { summary_start: self.written, summary_crc: crc32(&bytes), ..footer };
        }
        bytes.extend(footer.encode());
        bytes.extend(MAGIC);
        bytes
    }

    /// When Gaussian `i` may be seen, seconds, with a margin.
    fn support(&self, bins: &Bins, i: usize) -> [f64; 2] {
        let [from, to] = self.windows[bins.window[i] as usize].map(|bits| f64::from(f32::from_bits(bits)));
        let is_lasting = bins.flags[i] & op::FLAG_NEVER_FADES != 0;
        let sigma = if is_lasting { f64::INFINITY } else { (bins.sigma[i] as f64 * self.steps.sigma_log).exp() };
        let step = mu_step(bins.sigma[i], self.steps.sigma_log, is_lasting, self.steps.time);
        let (mu, half) = (bins.mu[i] as f64 * step, sigma * support_k(self.cutoff));
        let margin = MARGIN * (mu.abs() + half);
        let [first, last] = if is_lasting { [from, to] } else { [mu - half - margin, mu + half + margin] };
        [first.max(from).max(0.0), last.min(to).min(self.seconds)]
    }

    fn streams(&self, bins: &Bins, members: &[usize]) -> Result<Vec<u8>> {
        let mut bytes = Vec::new();
        for (attribute, values, n) in [
            (op::A_POSITION, &bins.place, 3),
            (op::A_SCALE, &bins.scale, 3),
            (op::A_ROTATION_INDEX, &bins.largest, 1),
            (op::A_ROTATION, &bins.rotation, 3),
            (op::A_COLOR, &bins.color, 3),
            (op::A_OPACITY, &bins.opacity, 1),
            (op::A_MOTION, &bins.motion, 3),
            (op::A_MU_T, &bins.mu, 1),
            (op::A_SIGMA_T, &bins.sigma, 1),
            (op::A_FLAGS, &bins.flags, 1),
            (op::A_WINDOW_INDEX, &bins.window, 1),
        ] {
            let values: Vec<i64> = members.iter().flat_map(|i| values[n * i..n * (i + 1)].iter().copied()).collect();
            bytes.extend(self.stream(attribute, &values, n)?);
        }
        Ok(bytes)
    }

    /// Bands of harmonics, a record each.
    fn bands(&self, set: &GaussianSet, members: &[usize]) -> Result<Vec<(u8, Vec<u8>)>> {
        let (row, Some(harmonics)) = (3 * set.sh_coefficients, &set.sh) else { return Ok(Vec::new()) };
        let mut records = Vec::new();
        for band in 1..=self.bits.len() {
            // One channel after the other.
            let columns = band * band - 1..(band + 1) * (band + 1) - 1;
            let mut values = Vec::with_capacity(3 * columns.len() * members.len());
            for i in members {
                for channel in harmonics[row * i..row * (i + 1)].chunks_exact(set.sh_coefficients) {
                    values.extend(channel[columns.clone()].iter().map(|byte| i64::from(*byte)));
                }
            }
            let mut content = vec![band as u8];
            content.extend(self.stream(op::SH_BAND_STREAM, &values, 3 * columns.len())?);
            let mut record = Vec::new();
            put_record(&mut record, op::SH_BAND_STREAM, &content);
            records.push((band as u8, record));
        }
        Ok(records)
    }

    fn stream(&self, attribute: u8, values: &[i64], n: usize) -> Result<Vec<u8>> {
        let deflate = WriteOptions::default().codec;
        encode_stream(attribute, values, n, deflate, self.level, true).map_err(|fault| self.too_far(&fault.to_string()))
    }

    fn too_far(&self, fault: &str) -> Error {
        let remedy = "a Gaussian lies or reaches too far for the format: leave it out, or export the scene as PLY";
        Error::data(self.path, "", format!("cannot be stored: {fault}"), remedy)
    }

    fn bins(&self, set: &GaussianSet) -> Bins {
        let steps = &self.steps;
        let mut bins = Bins::default();
        for i in 0..set.count() {
            let three = |values: &[f32]| [0, 1, 2].map(|axis: usize| f64::from(values[3 * i + axis]));
            let place = three(&set.positions);
            bins.place.extend((0..3).map(|axis| rint((place[axis] - self.origin[axis]) / steps.pos)));
            bins.scale.extend(three(&set.scales).map(|s| rint(s.max(1e-30).ln() / steps.scale_log)));
            let quaternion = [0, 1, 2, 3].map(|k: usize| f64::from(set.rotations[4 * i + k]));
            let (largest, others) = quantize_rotation(quaternion, steps.rot);
            bins.largest.push(largest);
            bins.rotation.extend(others);
            let [r, g, b, opacity] = [0, 1, 2, 3].map(|k: usize| f64::from(set.colors[4 * i + k]));
            bins.color.extend(rct_forward([r, g, b].map(|c| rint(c / steps.rgb))));
            bins.opacity.push(rint(opacity / steps.alpha));
            let is_lasting = set.sigma_t[i].is_infinite();
            let sigma = if is_lasting { 0 } else { rint(f64::from(set.sigma_t[i]).max(1e-30).ln() / steps.sigma_log) };
            bins.sigma.push(sigma);
            bins.flags.push(if is_lasting { op::FLAG_NEVER_FADES } else { 0 });
            let window = [set.win_lo[i].to_bits(), set.win_hi[i].to_bits()];
            bins.window.push(self.windows.binary_search(&window).unwrap_or(0) as i64);
            let length = f64::from(set.win_hi[i]) - f64::from(set.win_lo[i]);
            let class = life_class(sigma, steps.sigma_log, is_lasting, length, support_k(self.cutoff));
            bins.motion.extend(three(&set.motions).map(|v| rint(v / motion_step(class, steps.motion))));
            let step = mu_step(sigma, steps.sigma_log, is_lasting, steps.time);
            bins.mu.push(rint(f64::from(set.mu_t[i]) / step));
        }
        bins
    }
}

/// Steps of the grids, by attribute.
#[derive(Default)]
struct Bins {
    place: Vec<i64>,
    scale: Vec<i64>,
    largest: Vec<i64>,
    rotation: Vec<i64>,
    color: Vec<i64>,
    opacity: Vec<i64>,
    motion: Vec<i64>,
    mu: Vec<i64>,
    sigma: Vec<i64>,
    flags: Vec<i64>,
    window: Vec<i64>,
}

/// Gives each Gaussian of `node` to the shortest stretch that holds all of its life, halving up to `depth` times. A half with
/// too few Gaussians gives them back.
fn settle(supports: &[[f64; 2]], node: Node, depth: u32, nodes: &mut Vec<Node>) {
    let Node { stretch: [from, to], level, members: mut rest } = node;
    let middle = 0.5 * (from + to);
    let mut deeper = Vec::new();
    for [from, to] in [[from, middle], [middle, to]] {
        if level < depth {
            let is_within = |i: &usize| supports[*i][0] >= from && supports[*i][1] <= to;
            let (within, others): (Vec<usize>, Vec<usize>) = rest.iter().partition(|i| is_within(i));
            if within.len() >= LEAST_IN_CHUNK {
                rest = others;
                deeper.push(Node { stretch: [from, to], level: level + 1, members: within });
            }
        }
    }
    if !rest.is_empty() {
        nodes.push(Node { stretch: [from, to], level, members: rest });
    }
    deeper.into_iter().for_each(|node| settle(supports, node, depth, nodes));
}
