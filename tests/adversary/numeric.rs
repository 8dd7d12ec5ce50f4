//! Kernels with the roundings of another device. Of what Vulkan leaves to a driver ("Precision of Individual Operations", Vulkan
//! 1.3, appendix A) this takes what hurts most, and takes it differently in each kernel, by a salt made of its name:
//! products that are added and not `precise` are fused, most of them, and of two products either; denormal results become zero;
//! and what need not be rounded correctly, `precise` or not, is moved to the edge of its error, to the side that a hash of the
//! operand's bits says. The driver has errors of its own, so the moves leave it a part. A quotient by what is past 2^126 or below
//! 2^-126 is one by infinity or zero.

use super::edit::{Edit, glsl_of, hash, id_of, mixed};
use crate::common::prelude::*;
use rspirv::dr::{Instruction, Operand};
use rspirv::spirv::{GlslStd450Op as GLOp, Op, Word};

pub const REWRITE: Rewrite = Rewrite { subgroup_size: None, spirv: |kernel| rewritten(kernel) };

/// Whether each kernel has roundings of its own: in this lane, and on a GPU, whose compiler fuses as it suits it. A test that compares
/// the bits of two kernels, or has ties that one decides, then says `why` it does not run.
#[track_caller]
pub fn rounds_otherwise(why: &str) -> bool {
    let otherwise = rounds();
    if otherwise {
        skip(why);
    }
    otherwise
}

/// Ends the test, with a note, where each kernel [`rounds_otherwise`].
macro_rules! needs_roundings {
    ($why:literal) => {
        if crate::adversary::rounds_otherwise($why) {
            return;
        }
    };
}
pub(crate) use needs_roundings;

/// By how much errors may be greater than on a device that rounds well: `by` where [`rounds_otherwise`], 1 elsewhere.
pub fn slack(by: f64) -> f64 {
    if rounds() { by } else { 1.0 }
}

fn rounds() -> bool {
    static IS_GPU: OnceLock<bool> = OnceLock::new();
    std::env::var("IVV_TEST_REWRITE").is_ok_and(|name| name == "numeric")
        || *IS_GPU.get_or_init(|| gpu().caps().kind != DeviceKind::Cpu)
}

pub fn rewritten(kernel: &KernelInfo) -> Vec<u8> {
    let salt = hash(kernel.name);
    let mut edit = Edit::of(kernel.spirv);
    let products = products(&edit);
    let mut n_sites = 0;
    edit.rewrite(|edit, instruction, to| {
        n_sites += 1;
        let site = mixed(salt ^ n_sites);
        let floats = instruction.result_type.and_then(|of_type| edit.floats(of_type));
        let (Some(n), Some(result)) = (floats, instruction.result_id) else { return to.push(instruction) };
        let move_ = move_of(&instruction);
        let begin = to.len();
        let fused = fused(edit, &products, &instruction, site, to);
        if fused.is_none() && move_.is_none() && !is_rounded(&instruction) {
            return to.push(instruction);
        }
        let is_exact = edit.is_exact(result);
        let of_type = instruction.result_type.expect("a type");
        let operands = operands(edit, &instruction);
        let opcode = instruction.class.opcode;
        let raw = fused.unwrap_or_else(|| {
            let Instruction { class, operands, .. } = instruction;
            edit.put_raw(to, class.opcode, of_type, operands)
        });
        let mut moved = move_.map_or(raw, |move_| moved(edit, to, move_, (raw, n), &operands, salt));
        if let (Op::FDiv, [x, y]) = (opcode, operands.as_slice()) {
            moved = out_of_range(edit, to, moved, n, [*x, *y]);
        }
        let flushed = flushed(edit, to, moved, n);
        // The decoration allows nothing more where all is written out.
        if is_exact {
            let made: Vec<Word> = to[begin..].iter().filter(|i| is_rounded(i)).filter_map(|i| i.result_id).collect();
            made.into_iter().for_each(|id| edit.make_exact(id));
        }
        let last = to.last_mut().expect("the flush");
        assert_eq!(last.result_id, Some(flushed));
        last.result_id = Some(result);
    });
    edit.bytes()
}

/// How far a result may lie from the true one.
#[derive(Clone, Copy)]
enum Move {
    Ulps(u32),
    /// 3 + 2 |x| units in the last place, of which this takes 1 + |x|.
    Exponential,
    /// 2^-21 where x is in [0.5, 2], of which this takes half; elsewhere 3 units, of which it takes one.
    Logarithm,
}

/// What Vulkan's table grants an instruction, less the driver's own error.
fn move_of(instruction: &Instruction) -> Option<Move> {
    if instruction.class.opcode == Op::FDiv {
        return Some(Move::Ulps(2));
    }
    match glsl_of(instruction)? {
        GLOp::Exp | GLOp::Exp2 => Some(Move::Exponential),
        GLOp::Log | GLOp::Log2 => Some(Move::Logarithm),
        GLOp::InverseSqrt => Some(Move::Ulps(1)),
        // 1 / inversesqrt(x): 2 + 2.5 units.
        GLOp::Sqrt | GLOp::Length | GLOp::Distance | GLOp::Normalize => Some(Move::Ulps(3)),
        GLOp::Atan | GLOp::Atan2 => Some(Move::Ulps(2048)),
        GLOp::Sin | GLOp::Cos | GLOp::Tan | GLOp::Pow => {
            panic!("no kernel had this function: say what Vulkan grants it")
        }
        _ => None,
    }
}

fn is_rounded(instruction: &Instruction) -> bool {
    let exact = [GLOp::Fma, GLOp::Exp, GLOp::Exp2];
    matches!(instruction.class.opcode, Op::FAdd | Op::FSub | Op::FMul | Op::FDiv | Op::VectorTimesScalar | Op::Dot)
        || glsl_of(instruction).is_some_and(|function| exact.contains(&function))
}

fn operands(edit: &Edit, instruction: &Instruction) -> Vec<Word> {
    let skipped = if instruction.class.opcode == Op::ExtInst { 2 } else { 0 };
    let ids = (skipped..instruction.operands.len()).map(|k| id_of(instruction, k));
    ids.filter(|id| edit.floats(edit.type_of(*id)).is_some()).collect()
}

/// Products that may be fused with the sums they go into, by their ids.
fn products(edit: &Edit) -> HashMap<Word, Instruction> {
    let all = edit.module.functions.iter().flat_map(|function| function.all_inst_iter());
    let is_product = |i: &&Instruction| matches!(i.class.opcode, Op::FMul | Op::VectorTimesScalar);
    let exact: Vec<_> = all.filter(is_product).filter_map(|i| Some((i.result_id?, i.clone()))).collect();
    exact.into_iter().filter(|(id, _)| !edit.is_exact(*id)).collect()
}

/// Puts the fused form of a sum or a dot product, where there is one.
fn fused(
    edit: &mut Edit,
    products: &HashMap<Word, Instruction>,
    instruction: &Instruction,
    site: u32,
    to: &mut Vec<Instruction>,
) -> Option<Word> {
    let (of_type, result) = (instruction.result_type?, instruction.result_id?);
    let n = edit.floats(of_type)?;
    if edit.is_exact(result) {
        return None;
    }
    match instruction.class.opcode {
        Op::Dot => {
            let [a, b] = [id_of(instruction, 0), id_of(instruction, 1)];
            let components = edit.floats(edit.type_of(a))?;
            let mut sum = None;
            for k in 0..components {
                // From either end.
                let k = if site & 1 == 0 { k } else { components - 1 - k };
                let [x, y] = [a, b].map(|v| {
                    let part = vec![Operand::IdRef(v), Operand::LiteralBit32(k)];
                    edit.put_raw(to, Op::CompositeExtract, of_type, part)
                });
                let next = match sum {
                    None => edit.put(to, Op::FMul, of_type, &[x, y]),
                    Some(sum) => fma(edit, to, 1, [x, y, sum]),
                };
                sum = Some(next);
            }
            sum
        }
        op @ (Op::FAdd | Op::FSub) => {
            let [a, b] = [id_of(instruction, 0), id_of(instruction, 1)];
            // A quarter stays as it is: compilers fuse as it suits them.
            if site & 6 == 6 {
                return None;
            }
            let first = if site & 1 == 0 { [(a, b), (b, a)] } else { [(b, a), (a, b)] };
            let (product, other) = first.into_iter().find(|(product, _)| products.contains_key(product))?;
            let factors = &products[&product];
            let [mut x, mut y] = [id_of(factors, 0), id_of(factors, 1)];
            if factors.class.opcode == Op::VectorTimesScalar {
                y = edit.put(to, Op::CompositeConstruct, of_type, &vec![y; n as usize]);
            }
            let mut z = other;
            if op == Op::FSub {
                let negated = if product == a { &mut z } else { &mut x };
                *negated = edit.put(to, Op::FNegate, of_type, &[*negated]);
            }
            Some(fma(edit, to, n, [x, y, z]))
        }
        _ => None,
    }
}

/// x y + z in one rounding, or nearly: a driver's own Fma may round twice, as lavapipe's does. The error of the product by Dekker's
/// halves, that of the sum by Knuth; where a half overflows, the product is rounded.
fn fma(edit: &mut Edit, to: &mut Vec<Instruction>, n: u32, [x, y, z]: [Word; 3]) -> Word {
    let (float, uint, boolean) = (edit.float(n), edit.uint(n), edit.boolean(n));
    let (splitter, exponents) = (edit.float_constant(n, 4097.0), edit.uint_constant(n, 0x7f80_0000));
    let mut exact = |edit: &mut Edit, op, a, b| {
        let made = edit.put(to, op, float, &[a, b]);
        edit.make_exact(made);
        made
    };
    let [(x_high, x_low), (y_high, y_low)] = [x, y].map(|v| {
        let wide = exact(edit, Op::FMul, v, splitter);
        let rest = exact(edit, Op::FSub, wide, v);
        let high = exact(edit, Op::FSub, wide, rest);
        (high, exact(edit, Op::FSub, v, high))
    });
    let product = exact(edit, Op::FMul, x, y);
    let mut error = exact(edit, Op::FMul, x_high, y_high);
    error = exact(edit, Op::FSub, error, product);
    for (a, b) in [(x_high, y_low), (x_low, y_high), (x_low, y_low)] {
        let part = exact(edit, Op::FMul, a, b);
        error = exact(edit, Op::FAdd, error, part);
    }
    let sum = exact(edit, Op::FAdd, product, z);
    let of_z = exact(edit, Op::FSub, sum, product);
    let of_product = exact(edit, Op::FSub, sum, of_z);
    let lost_z = exact(edit, Op::FSub, z, of_z);
    let lost_product = exact(edit, Op::FSub, product, of_product);
    let lost = exact(edit, Op::FAdd, lost_z, lost_product);
    let all = exact(edit, Op::FAdd, lost, error);
    let better = exact(edit, Op::FAdd, sum, all);
    // By the exponent's bits: a driver may take it that no number is infinite.
    let bits = edit.put(to, Op::Bitcast, uint, &[all]);
    let exponent = edit.put(to, Op::BitwiseAnd, uint, &[bits, exponents]);
    let finite = edit.put(to, Op::INotEqual, boolean, &[exponent, exponents]);
    edit.put(to, Op::Select, float, &[finite, better, sum])
}

fn moved(
    edit: &mut Edit,
    to: &mut Vec<Instruction>,
    move_: Move,
    raw: (Word, u32),
    operands: &[Word],
    salt: u32,
) -> Word {
    let (raw, n) = raw;
    let (float, uint, boolean) = (edit.float(n), edit.uint(n), edit.boolean(n));
    let c = |edit: &mut Edit, value| edit.uint_constant(n, value);
    // Of the whole vector where the function makes one number of it.
    let mut h = c(edit, mixed(salt));
    for operand in operands {
        let m = edit.floats(edit.type_of(*operand)).expect("floats");
        let words = edit.uint(m);
        let mut bits = edit.put(to, Op::Bitcast, words, &[*operand]);
        if m != n {
            let part = vec![Operand::IdRef(bits), Operand::LiteralBit32(0)];
            let scalar = edit.uint(1);
            bits = edit.put_raw(to, Op::CompositeExtract, scalar, part);
        }
        h = edit.put(to, Op::BitwiseXor, uint, &[h, bits]);
        let odd = c(edit, 0x7feb_352d);
        h = edit.put(to, Op::IMul, uint, &[h, odd]);
        let half = c(edit, 15);
        let high = edit.put(to, Op::ShiftRightLogical, uint, &[h, half]);
        h = edit.put(to, Op::BitwiseXor, uint, &[h, high]);
        let odd = c(edit, 0x846c_a68b);
        h = edit.put(to, Op::IMul, uint, &[h, odd]);
    }
    let (zero, sign) = (c(edit, 0), c(edit, 0x8000_0000));
    let sign = edit.put(to, Op::BitwiseAnd, uint, &[h, sign]);
    let up = edit.put(to, Op::IEqual, boolean, &[sign, zero]);
    let mut ulps = match move_ {
        Move::Ulps(ulps) => c(edit, ulps),
        Move::Logarithm => c(edit, 1),
        Move::Exponential => {
            let size = edit.put_glsl(to, GLOp::FAbs, float, &[operands[0]]);
            let most = edit.float_constant(n, 150.0);
            let size = edit.put_glsl(to, GLOp::NMin, float, &[size, most]);
            let size = edit.put(to, Op::ConvertFToU, uint, &[size]);
            let one = c(edit, 1);
            edit.put(to, Op::IAdd, uint, &[size, one])
        }
    };
    let down = edit.put(to, Op::ISub, uint, &[zero, ulps]);
    ulps = edit.put(to, Op::Select, uint, &[up, ulps, down]);
    let bits = edit.put(to, Op::Bitcast, uint, &[raw]);
    let shifted = edit.put(to, Op::IAdd, uint, &[bits, ulps]);
    // Neither zeros nor denormals, nor what is not finite or near it.
    let magnitude = c(edit, 0x7fff_ffff);
    let size = edit.put(to, Op::BitwiseAnd, uint, &[bits, magnitude]);
    let (low, range) = (c(edit, 0x0100_0000), c(edit, 0x7f7f_0000 - 0x0100_0000));
    let above = edit.put(to, Op::ISub, uint, &[size, low]);
    let ordinary = edit.put(to, Op::ULessThan, boolean, &[above, range]);
    let shifted = edit.put(to, Op::Select, uint, &[ordinary, shifted, bits]);
    let shifted = edit.put(to, Op::Bitcast, float, &[shifted]);
    if !matches!(move_, Move::Logarithm) {
        return shifted;
    }
    let [half, two] = [0.5, 2.0].map(|x| edit.float_constant(n, x));
    let above = edit.put(to, Op::FOrdGreaterThanEqual, boolean, &[operands[0], half]);
    let below = edit.put(to, Op::FOrdLessThanEqual, boolean, &[operands[0], two]);
    let inside = edit.put(to, Op::LogicalAnd, boolean, &[above, below]);
    let [plus, minus] = [1.0, -1.0].map(|x| edit.float_constant(n, x * 2f32.powi(-22)));
    let offset = edit.put(to, Op::Select, float, &[up, plus, minus]);
    let offset = edit.put(to, Op::FAdd, float, &[raw, offset]);
    edit.put(to, Op::Select, float, &[inside, offset, shifted])
}

/// `quotient` of x and y, or, where y is so large or so small that Vulkan grants nothing, what is left of it where the inverse of y is
/// rounded to 0 and y itself to 0, as NVIDIA does.
fn out_of_range(edit: &mut Edit, to: &mut Vec<Instruction>, quotient: Word, n: u32, [x, y]: [Word; 2]) -> Word {
    let (float, uint, boolean) = (edit.float(n), edit.uint(n), edit.boolean(n));
    let (least, most) = (edit.float_constant(n, 2f32.powi(-126)), edit.float_constant(n, 2f32.powi(126)));
    let (sign, infinity) = (edit.uint_constant(n, 0x8000_0000), edit.uint_constant(n, 0x7f80_0000));
    let size = edit.put_glsl(to, GLOp::FAbs, float, &[y]);
    let is_large = edit.put(to, Op::FOrdGreaterThan, boolean, &[size, most]);
    let is_small = edit.put(to, Op::FOrdLessThan, boolean, &[size, least]);
    let bits = edit.put(to, Op::Bitcast, uint, &[y]);
    let zero = edit.put(to, Op::BitwiseAnd, uint, &[bits, sign]);
    let infinite = edit.put(to, Op::BitwiseOr, uint, &[zero, infinity]);
    let inverse = edit.put(to, Op::Select, uint, &[is_large, zero, infinite]);
    let inverse = edit.put(to, Op::Bitcast, float, &[inverse]);
    let product = edit.put(to, Op::FMul, float, &[x, inverse]);
    let outside = edit.put(to, Op::LogicalOr, boolean, &[is_large, is_small]);
    edit.put(to, Op::Select, float, &[outside, product, quotient])
}

/// `value`, or zero where it is denormal.
fn flushed(edit: &mut Edit, to: &mut Vec<Instruction>, value: Word, n: u32) -> Word {
    let (float, boolean) = (edit.float(n), edit.boolean(n));
    let (zero, least) = (edit.float_constant(n, 0.0), edit.float_constant(n, f32::MIN_POSITIVE));
    let size = edit.put_glsl(to, GLOp::FAbs, float, &[value]);
    let small = edit.put(to, Op::FOrdLessThan, boolean, &[size, least]);
    edit.put(to, Op::Select, float, &[small, zero, value])
}
