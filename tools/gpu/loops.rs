//! The loops of a kernel, by its SPIR-V: what a compiler's count of instructions comes to where each loop goes round as often
//! as the work makes it.

use super::statistics::instructions;
use std::collections::{HashMap, HashSet};

/// Rounds up to which compilers are taken to unroll a loop that says how often it goes round.
const UNROLLED: f64 = 32.0;
// What an instruction of SPIR-V becomes, on average. RADV's program of `blend_fwd_train_p4` for navi31 has 159 instructions in the
// loop over hits, that of `blend_bwd_p4` 305; with these numbers shares of the whole come to 149 and 338.
/// Memory: an address, and a wait.
const ACCESS: f64 = 5.0;
/// Sums and products: many become one.
const SUM: f64 = 0.6;
/// Conditional branches: many become selections.
const BRANCH: f64 = 0.5;
/// The counting of a loop that is unrolled: an addition, a comparison, a branch.
const COUNTING: f64 = 2.0 + BRANCH;

/// Opcodes that become no instruction: of the structure, of addresses, of parts of vectors.
const FREE: [u32; 16] = [59, 65, 79, 80, 81, 82, 83, 124, 245, 246, 247, 248, 249, 253, 254, 255];
const LOAD: u32 = 61;
const STORE: u32 = 62;
const CONDITIONAL: u32 = 250;
const BRANCHES: [u32; 6] = [249, 250, 251, 252, 253, 254];
/// The storage class of variables that a compiler keeps in registers.
const FUNCTION: u32 = 7;

#[derive(Clone, Debug)]
pub(super) struct Loops {
    /// The first is the program itself.
    bodies: Vec<Body>,
}

/// The body of a loop, without those of the loops inside it.
#[derive(Clone, Debug, PartialEq)]
struct Body {
    /// Instructions; one for each component of a vector.
    weight: f64,
    around: usize,
    /// Rounds, where the program itself says how many.
    times: Option<f64>,
    /// True if it is written out as often as it goes round.
    is_unrolled: bool,
    /// Of the loops around it, those whose rounds the data decide.
    depth: usize,
}

impl Loops {
    pub fn of(spirv: &[u8]) -> Self {
        let all = instructions(spirv);
        let module = Module::of(&all);
        let loops = module.loops();
        let inside = |a: usize, b: usize| a != b && loops[b].blocks.contains(&loops[a].header);
        let times: Vec<Option<f64>> = loops.iter().map(|one| module.times(one.header)).collect();
        let among = |at: usize, of: &dyn Fn(usize) -> bool| (0..loops.len()).filter(|k| inside(*k, at)).any(of);
        let mut bodies = vec![Body { weight: 0.0, around: 0, times: Some(1.0), is_unrolled: true, depth: 0 }];
        for (at, &of_loop) in times.iter().enumerate() {
            // Of the loops around it the smallest; `loops` has outer ones first.
            let around = (0..loops.len()).rev().find(|k| inside(at, *k));
            let is_unrolled = of_loop.is_some_and(|n| n <= UNROLLED) && !among(at, &|k| times[k].is_none());
            bodies.push(Body {
                weight: if is_unrolled { -COUNTING } else { 0.0 },
                around: around.map_or(0, |k| k + 1),
                times: of_loop,
                is_unrolled,
                depth: (0..loops.len()).filter(|k| inside(at, *k) && times[*k].is_none()).count(),
            });
        }
        for (block, code) in module.blocks.iter().enumerate() {
            let innermost = (0..loops.len()).rev().find(|k| loops[*k].blocks.contains(&block));
            bodies[innermost.map_or(0, |k| k + 1)].weight += code.iter().map(|one| module.weight(one)).sum::<f64>();
        }
        bodies.iter_mut().for_each(|body| body.weight = body.weight.max(0.0));
        Loops { bodies }
    }

    /// Instructions of the program as a compiler writes it.
    pub fn written(&self) -> f64 {
        self.sum(1.0, |body, around| around * body.times.filter(|_| body.is_unrolled).unwrap_or(1.0))
    }

    /// Instructions of `subgroups` subgroups. A loop whose rounds the data decide goes round `rounds` times in all of them together, given
    /// the number of such loops around it; at least once each time.
    pub fn run(&self, subgroups: f64, rounds: impl Fn(usize) -> f64) -> f64 {
        self.sum(subgroups, |body, around| {
            body.times.map_or_else(|| rounds(body.depth).max(around), |times| around * times)
        })
    }

    /// The weights times how often each body runs, given how often the body around it does.
    fn sum(&self, program: f64, runs: impl Fn(&Body, f64) -> f64) -> f64 {
        let mut all: Vec<f64> = Vec::with_capacity(self.bodies.len());
        for body in &self.bodies {
            all.push(runs(body, all.get(body.around).copied().unwrap_or(program)));
        }
        self.bodies.iter().zip(&all).map(|(body, runs)| body.weight * runs).sum()
    }
}

struct Loop {
    header: usize,
    blocks: HashSet<usize>,
}

#[derive(Default)]
struct Module<'a> {
    blocks: Vec<Vec<&'a [u32]>>,
    numbers: HashMap<u32, usize>,
    /// By result: constants, variables, places in them, sums, comparisons, values of several blocks.
    made: HashMap<u32, &'a [u32]>,
    /// By type: components of vectors, storage classes of pointers.
    components: HashMap<u32, u32>,
    classes: HashMap<u32, u32>,
}

impl<'a> Module<'a> {
    fn of(all: &'a [Vec<u32>]) -> Self {
        let mut module = Module::default();
        let mut is_open = false;
        for one in all {
            match one.as_slice() {
                // OpTypeVector, OpTypePointer, OpLabel.
                [23, id, _, n] => drop(module.components.insert(*id, *n)),
                [32, id, class, _] => drop(module.classes.insert(*id, *class)),
                [248, label] => {
                    module.numbers.insert(*label, module.blocks.len());
                    module.blocks.push(Vec::new());
                    is_open = true;
                    continue;
                }
                // OpConstant, OpVariable, OpAccessChain, OpIAdd, OpULessThan, OpSLessThan, OpPhi.
                [43 | 59 | 65 | 128 | 176 | 177 | 245, _, id, ..] => drop(module.made.insert(*id, one)),
                _ => {}
            }
            if let (true, Some(block)) = (is_open, module.blocks.last_mut()) {
                block.push(one);
                is_open = !BRANCHES.contains(&one[0]);
            }
        }
        module
    }

    /// The loops, outer ones before those inside them.
    fn loops(&self) -> Vec<Loop> {
        let merge = |header: &Vec<&[u32]>| {
            let found = header.iter().find(|one| one[0] == 246)?;
            self.numbers.get(found.get(1)?).copied()
        };
        let found = self.blocks.iter().enumerate().filter_map(|(header, block)| {
            let merge = merge(block)?;
            let (mut blocks, mut open) = (HashSet::from([header]), vec![header]);
            while let Some(block) = open.pop() {
                let next = self.next(block).into_iter().filter(|next| *next != merge);
                open.extend(next.filter(|next| blocks.insert(*next)));
            }
            Some(Loop { header, blocks })
        });
        let mut loops: Vec<Loop> = found.collect();
        loops.sort_by_key(|one| std::cmp::Reverse(one.blocks.len()));
        loops
    }

    fn next(&self, block: usize) -> Vec<usize> {
        let labels: Vec<u32> = match self.blocks[block].last() {
            Some([249, to]) => vec![*to],
            Some([CONDITIONAL, _, yes, no, ..]) => vec![*yes, *no],
            Some([251, _, rest @ ..]) => rest.iter().step_by(2).copied().collect(),
            _ => Vec::new(),
        };
        labels.iter().filter_map(|label| self.numbers.get(label).copied()).collect()
    }

    fn constant(&self, id: u32) -> Option<u32> {
        if let [43, _, _, value] = self.made.get(&id)? { Some(*value) } else { None }
    }

    /// Rounds of a loop that counts from a constant, or from the number of a lane, by a constant up to a constant.
    fn times(&self, header: usize) -> Option<f64> {
        let [CONDITIONAL, condition, ..] = self.blocks[header].last()? else { return None };
        let [176 | 177, _, _, counter, end] = self.made.get(condition)? else { return None };
        let (end, [245, _, _, values @ ..]) = (self.constant(*end)?, self.made.get(counter)?) else { return None };
        let (mut first, mut step) = (0, None);
        for value in values.iter().step_by(2) {
            match self.made.get(value) {
                Some([128, _, _, a, b]) if a == counter || b == counter => {
                    step = self.constant(if a == counter { *b } else { *a });
                }
                _ => first = self.constant(*value).unwrap_or(0),
            }
        }
        let step = step.filter(|step| *step > 0)?;
        Some(f64::from(end.saturating_sub(first).div_ceil(step)))
    }

    fn weight(&self, one: &[u32]) -> f64 {
        let is_register = |pointer: &u32| {
            let class = self.made.get(pointer).and_then(|made| self.classes.get(&made[1]));
            class == Some(&FUNCTION)
        };
        let components = |of_type: &u32| f64::from(self.components.get(of_type).copied().unwrap_or(1));
        match one {
            [op, ..] if FREE.contains(op) => 0.0,
            [LOAD, _, _, pointer, ..] | [STORE, pointer, ..] if is_register(pointer) => 0.0,
            // Atomic operations among them; a vector comes in one load.
            [STORE | LOAD | 227..=242, ..] => ACCESS,
            // OpFAdd, OpFSub, OpFMul, OpVectorTimesScalar.
            [129 | 131 | 133 | 142, of_type, ..] => SUM * components(of_type),
            [CONDITIONAL, ..] => BRANCH,
            [_, of_type, ..] => components(of_type),
            _ => 1.0,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ivv::internals::gpu::kernel_named;

    fn of(kernel: &str) -> Loops {
        Loops::of(kernel_named(kernel).unwrap().spirv)
    }

    #[test]
    fn a_kernel_without_loops_runs_what_is_written() {
        let loops = of("gather");
        assert_eq!((loops.bodies.len(), loops.run(1.0, |_| 9.0)), (1, loops.written()));
        assert!((loops.run(7.0, |_| 9.0) - 7.0 * loops.written()).abs() < 1e-9);
    }

    /// The batches of the forward blend, in them two halves of a mask, in each what it hits, and four pixels of that.
    #[test]
    fn the_blend_walks_batches_and_what_they_hit() {
        let loops = of("blend_fwd_train_p4");
        let find = |depth, times| loops.bodies.iter().position(|body| (body.depth, body.times) == (depth, times));
        let (batches, halves) = (find(0, None).unwrap(), find(1, Some(2.0)).unwrap());
        let hits = find(1, None).unwrap();
        let pixels = find(2, Some(4.0)).unwrap();
        let around = |at: usize| loops.bodies[at].around;
        assert_eq!([around(batches), around(halves), around(hits), around(pixels)], [0, batches, halves, hits]);
        assert!(loops.bodies[pixels].is_unrolled && !loops.bodies[halves].is_unrolled);
        // Another hit costs the body of the hits and four pixels; another batch costs no hit.
        let cost = |batches: f64, hits: f64| loops.run(1.0, |depth| if depth == 0 { batches } else { hits });
        let hit = cost(1.0, 11.0) - cost(1.0, 10.0);
        let expected = loops.bodies[hits].weight + 4.0 * loops.bodies[pixels].weight;
        assert!((hit - expected).abs() < 1e-6, "{hit} {expected}");
        assert!(cost(2.0, 11.0) - cost(1.0, 11.0) > 0.0);
    }

    #[test]
    fn rounds_that_the_program_says_are_known_and_long_loops_are_not_unrolled() {
        let times = |kernel: &str| of(kernel).bodies[1..].iter().map(|body| body.times).collect::<Vec<_>>();
        assert_eq!(times("probe_atomic"), [Some(8.0)]);
        // As many rounds as a push constant says, of 16 steps each.
        assert_eq!(times("probe_fma"), [None, Some(16.0)]);
        let long = of("camera_total");
        assert_eq!((long.bodies[1].times, long.bodies[1].is_unrolled), (Some(64.0), false));
        let more = long.run(1.0, |_| 0.0) - long.written();
        assert!((more - 63.0 * long.bodies[1].weight).abs() < 1e-6, "{more}");
    }
}
