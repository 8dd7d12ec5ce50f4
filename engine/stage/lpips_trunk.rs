//! The trunks of LPIPS v0.1 and their weights, laid out as the kernels read them.

use std::collections::BTreeMap;
use std::fmt;
use std::path::{Path, PathBuf};

use crate::error::{Error, Result};
use crate::files::{Tensor, read_tensors};
use crate::gpu::generated::{constants, lpips_tap};
use crate::gpu::{Buf, Gpu};

/// Channels that `lpips_conv` takes at a step.
const STEP: usize = 16;
/// Most channels of a layer. The published trunks have 512; a reduction stays far below what lavapipe's loops allow.
const MAX_CHANNELS: usize = 4096;
/// Pixels of a workgroup that compares features.
pub(super) const TAP_PIXELS: u32 = lpips_tap::INFO.local / constants::lpips_tap::TEAM;
pub(super) const COLORS: u32 = 3;

const REMEDY: &str = "make the file with tools/lpips_weights.py from the published weights of the trunk and of LPIPS";

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Trunk {
    AlexNet,
    SqueezeNet,
}

/// A module by its number in torchvision's `features`.
#[derive(Clone, Copy)]
enum Module {
    /// A convolution with bias and ReLU: kernel, stride and zero padding, pixels.
    Plain(u32, [u32; 3]),
    /// SqueezeNet's: a 1x1 layer, then a 1x1 and a 3x3 layer side by side.
    Fire(u32),
}
use Module::{Fire, Plain};

/// Modules up to where features are compared, and whether a pool comes before them: the greatest of 3 x 3, two pixels apart.
type Block = (bool, &'static [Module]);

const ALEXNET: &[Block] = &[
    (false, &[Plain(0, [11, 4, 2])]),
    (true, &[Plain(3, [5, 1, 2])]),
    (true, &[Plain(6, [3, 1, 1])]),
    (false, &[Plain(8, [3, 1, 1])]),
    (false, &[Plain(10, [3, 1, 1])]),
];

const SQUEEZENET: &[Block] = &[
    (false, &[Plain(0, [3, 2, 0])]),
    (true, &[Fire(3), Fire(4)]),
    (true, &[Fire(6), Fire(7)]),
    (true, &[Fire(9)]),
    (false, &[Fire(10)]),
    (false, &[Fire(11)]),
    (false, &[Fire(12)]),
];

impl fmt::Display for Trunk {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Trunk::AlexNet => "AlexNet",
            Trunk::SqueezeNet => "SqueezeNet 1.1",
        })
    }
}

/// A convolution with bias and ReLU between two sets of maps, with its weights on the device.
pub(super) struct Conv {
    pub from: usize,
    pub to: usize,
    pub first: u32,
    pub outputs: u32,
    pub kernel: u32,
    pub stride: u32,
    pub pad: u32,
    pub forward: Buf<[f32; 4]>,
    pub bias: Buf<f32>,
    pub backward: Buf<[f32; 4]>,
}

impl Conv {
    /// Blocks that lie wholly in the padding; the way back begins after them.
    pub fn blocks_before(&self) -> u32 {
        self.pad / self.stride
    }

    /// Blocks that cover `n` input pixels.
    pub fn blocks(&self, n: u32) -> u32 {
        (n - 1 + self.pad) / self.stride + 1 - self.blocks_before()
    }

    /// Multiply-adds of maps of `size` pixels from `channels` others, on either way.
    pub fn multiply_adds(&self, [width, height]: [u32; 2], channels: u32) -> f64 {
        f64::from(width * height) * f64::from(self.outputs * channels) * f64::from(self.kernel * self.kernel)
    }

    fn outputs_of(&self, n: u32) -> Option<u32> {
        Some((n + 2 * self.pad).checked_sub(self.kernel)? / self.stride + 1)
    }
}

/// An operation on maps, which are numbered in the order of their making; 0 is the picture.
pub(super) enum Layer {
    Conv(Conv),
    Pool { from: usize, to: usize, ceil: bool },
    Tap { of: usize, linear: Buf<[f32; 4]> },
}

pub(super) struct Network {
    pub trunk: Trunk,
    pub file: PathBuf,
    pub channels: Vec<u32>,
    pub layers: Vec<Layer>,
}

impl Network {
    /// Reads and uploads torchvision's `features.N...` and LPIPS's `linK.model.1.weight`, as wide as the file has them.
    pub fn load(gpu: &Gpu, path: &Path) -> Result<Self> {
        let tensors = read_tensors(path)?;
        let (trunk, blocks) = if tensors.contains_key("features.3.squeeze.weight") {
            (Trunk::SqueezeNet, SQUEEZENET)
        } else if tensors.contains_key("features.3.weight") {
            (Trunk::AlexNet, ALEXNET)
        } else {
            let reason = "holds the trunk of neither AlexNet nor SqueezeNet 1.1 (`features.3...`)";
            return Err(Error::data(path, "", reason, REMEDY));
        };
        let file = File { gpu, path, trunk, tensors };
        let mut net = Network { trunk, file: path.to_owned(), channels: vec![COLORS], layers: Vec::new() };
        for (tap, (is_pooled, modules)) in blocks.iter().enumerate() {
            if *is_pooled {
                let (from, channels) = net.last();
                net.channels.push(channels);
                // A window that sticks out counts.
                let ceil = trunk == Trunk::SqueezeNet;
                net.layers.push(Layer::Pool { from, to: from + 1, ceil });
            }
            for module in *modules {
                let (from, _) = net.last();
                match *module {
                    Plain(i, shape) => net.add_conv(&file, &[(format!("features.{i}"), shape)], from)?,
                    Fire(i) => {
                        let name = |part| format!("features.{i}.{part}");
                        net.add_conv(&file, &[(name("squeeze"), [1, 1, 0])], from)?;
                        let expand = [(name("expand1x1"), [1, 1, 0]), (name("expand3x3"), [3, 1, 1])];
                        net.add_conv(&file, &expand, from + 1)?;
                    }
                }
            }
            let (of, channels) = net.last();
            net.layers.push(Layer::Tap { of, linear: file.linear(tap, channels as usize)? });
        }
        Ok(net)
    }

    fn last(&self) -> (usize, u32) {
        let last = self.channels.len() - 1;
        (last, self.channels[last])
    }

    /// Appends convolutions of the same maps, whose channels follow one another in the new maps.
    fn add_conv(&mut self, file: &File<'_>, convs: &[(String, [u32; 3])], from: usize) -> Result<()> {
        let to = self.channels.len();
        let mut first = 0;
        for (name, shape) in convs {
            let conv = file.conv(name, *shape, self.channels[from], from, to, first)?;
            first += conv.outputs;
            self.layers.push(Layer::Conv(conv));
        }
        self.channels.push(first);
        Ok(())
    }

    pub fn planes(&self, maps: usize) -> u32 {
        self.channels[maps].div_ceil(4)
    }

    /// Width and height of all maps of a picture of `size`; none when it is too small for the trunk.
    pub fn sizes(&self, size: [u32; 2]) -> Option<Vec<[u32; 2]>> {
        let pooled = |n: u32, ceil| match (n, ceil) {
            (2.., true) => Some(n / 2),
            (3.., false) => Some((n - 1) / 2),
            _ => None,
        };
        let mut sizes = vec![[0; 2]; self.channels.len()];
        sizes[0] = size;
        for layer in &self.layers {
            match layer {
                Layer::Conv(conv) => {
                    let [w, h] = sizes[conv.from].map(|n| conv.outputs_of(n));
                    sizes[conv.to] = [w?, h?];
                }
                Layer::Pool { from, to, ceil } => {
                    let [w, h] = sizes[*from].map(|n| pooled(n, *ceil));
                    sizes[*to] = [w?, h?];
                }
                Layer::Tap { .. } => {}
            }
        }
        Some(sizes)
    }

    pub fn extent(&self, size: [u32; 2], with_cotangent: bool) -> Result<Extent> {
        let Some(sizes) = self.sizes(size) else {
            let (place, smallest) = (format!("a crop of {}x{} pixels", size[0], size[1]), self.smallest());
            let reason = format!("{} sees no less than {smallest}x{smallest} pixels", self.trunk);
            return Err(Error::data(&self.file, place, reason, "take a larger crop, or do without LPIPS"));
        };
        let pixels = |maps: usize| sizes[maps][0] as usize * sizes[maps][1] as usize;
        let planes = |maps: usize| pixels(maps) * self.planes(maps) as usize;
        let mut maps: Vec<MapsLen> = (0..sizes.len())
            .map(|i| {
                let cotangent = if with_cotangent && i > 0 { planes(i) } else { 0 };
                MapsLen { features: planes(i), choices: 0, cotangent }
            })
            .collect();
        let (mut d_blocks, mut sums) = (0, 0);
        for layer in &self.layers {
            match layer {
                Layer::Conv(conv) if conv.from == 0 && with_cotangent => {
                    let [across, down] = size.map(|n| conv.blocks(n) as usize * conv.stride as usize);
                    d_blocks = across * down * COLORS as usize;
                }
                Layer::Conv(_) => {}
                Layer::Pool { to, .. } => maps[*to].choices = planes(*to),
                Layer::Tap { of, .. } => sums += pixels(*of).div_ceil(TAP_PIXELS as usize),
            }
        }
        Ok(Extent { sizes, maps, d_blocks, sums })
    }

    /// Pixels a side of the smallest picture that the trunk can see.
    pub fn smallest(&self) -> u32 {
        (1..).find(|n| self.sizes([*n, *n]).is_some()).unwrap_or(u32::MAX)
    }
}

pub(super) struct Extent {
    pub sizes: Vec<[u32; 2]>,
    pub maps: Vec<MapsLen>,
    /// Items of the cotangent of the picture, in blocks of the first layer's stride.
    pub d_blocks: usize,
    pub sums: usize,
}

pub(super) struct MapsLen {
    pub features: usize,
    pub choices: usize,
    pub cotangent: usize,
}

impl Extent {
    pub fn bytes(&self) -> u64 {
        let of_maps = |len: &MapsLen| 32 * len.features + 8 * len.choices + 16 * len.cotangent;
        (self.maps.iter().map(of_maps).sum::<usize>() + 4 * self.d_blocks + 16 * self.sums) as u64
    }

    pub fn largest(&self) -> u64 {
        let of_maps = self.maps.iter().map(|len| 16 * len.features.max(len.cotangent));
        of_maps.max().unwrap_or(0).max(4 * self.d_blocks) as u64
    }
}

struct File<'a> {
    gpu: &'a Gpu,
    path: &'a Path,
    trunk: Trunk,
    tensors: BTreeMap<String, Tensor>,
}

impl File<'_> {
    fn fault(&self, name: &str, reason: String) -> Error {
        Error::data(self.path, format!("tensor `{name}`"), reason, REMEDY)
    }

    /// A tensor of finite values; its shape must be `shape` but for the first extent where that is `None`.
    fn tensor(&self, name: &str, first: Option<usize>, rest: &[usize]) -> Result<&Tensor> {
        let tensor =
            self.tensors.get(name).ok_or_else(|| self.fault(name, format!("is missing; {} has it", self.trunk)))?;
        let is_same = match tensor.shape.split_first() {
            Some((found, others)) => first.is_none_or(|first| first == *found) && others == rest,
            None => false,
        };
        if !is_same {
            let first = first.map_or("n".to_owned(), |n| n.to_string());
            let wanted =
                format!("{}'s is [{first}{}]", self.trunk, rest.iter().map(|n| format!(", {n}")).collect::<String>());
            return Err(self.fault(name, format!("has the shape {:?}, {wanted}", tensor.shape)));
        }
        // The device computes in f32.
        match tensor.data.iter().position(|x| !(*x as f32).is_finite()) {
            Some(at) => Err(self.fault(name, format!("its value {at} is not finite"))),
            None => Ok(tensor),
        }
    }

    /// A convolution of `inputs` channels; `shape` is kernel, stride and padding.
    fn conv(
        &self,
        name: &str,
        [kernel, stride, pad]: [u32; 3],
        inputs: u32,
        from: usize,
        to: usize,
        first: u32,
    ) -> Result<Conv> {
        let (k, s, c) = (kernel as usize, stride as usize, inputs as usize);
        let weight = self.tensor(&format!("{name}.weight"), None, &[c, k, k])?;
        let n = weight.shape[0];
        if n == 0 || n > MAX_CHANNELS || !n.is_multiple_of(4) {
            let reason = format!("{n} channels: a multiple of 4 up to {MAX_CHANNELS} is possible");
            return Err(self.fault(&format!("{name}.weight"), reason));
        }
        let bias = self.tensor(&format!("{name}.bias"), Some(n), &[])?;
        let at = |o: usize, i: usize, ky: usize, kx: usize| {
            if i < c && ky < k && kx < k { weight.data[((o * c + i) * k + ky) * k + kx] } else { 0.0 }
        };
        // The taps of a row follow one another in memory, pixel by pixel: one long tap.
        let padded = c.next_multiple_of(4);
        let forward = pack(k, k * padded, n, |ky, along, o| at(o, along % padded, ky, along / padded));
        // Output o saw pixel p of its kernel; so block b sees, at tap t of T, output b - (T - 1 - t).
        let taps = k.div_ceil(s);
        let backward = pack(taps * taps, n, s * s * c, |tap, o, place| {
            let [ty, tx] = [tap / taps, tap % taps].map(|t| s * (taps - 1 - t));
            at(o, place % c, ty + place / c / s, tx + place / c % s)
        });
        let bias: Vec<f32> = bias.data.iter().map(|x| *x as f32).collect();
        Ok(Conv {
            from,
            to,
            first,
            outputs: n as u32,
            kernel,
            stride,
            pad,
            forward: self.gpu.upload("lpips weights", &forward)?,
            bias: self.gpu.upload("lpips bias", &bias)?,
            backward: self.gpu.upload("lpips weights", &backward)?,
        })
    }

    /// The weights of a tap's channels, which are not negative.
    fn linear(&self, tap: usize, channels: usize) -> Result<Buf<[f32; 4]>> {
        let name = format!("lin{tap}.model.1.weight");
        let tensor = self.tensor(&name, Some(1), &[channels, 1, 1])?;
        if let Some(at) = tensor.data.iter().position(|x| *x < 0.0) {
            return Err(self.fault(&name, format!("its value {at} is negative, which no weight of LPIPS is")));
        }
        let values: Vec<f32> = tensor.data.iter().map(|x| *x as f32).collect();
        self.gpu.upload("lpips linear", values.as_chunks().0)
    }
}

/// Weights as `lpips_conv` reads them: tap by tap its channels, padded with zeros, four of them for each output.
fn pack(taps: usize, channels: usize, outputs: usize, value: impl Fn(usize, usize, usize) -> f64) -> Vec<[f32; 4]> {
    let planes = channels.next_multiple_of(STEP) / 4;
    let mut packed = Vec::with_capacity(taps * planes * outputs);
    for tap in 0..taps {
        for plane in 0..planes {
            for output in 0..outputs {
                packed.push(std::array::from_fn(|c| {
                    let channel = 4 * plane + c;
                    if channel < channels { value(tap, channel, output) as f32 } else { 0.0 }
                }));
            }
        }
    }
    packed
}

/// vec4 of a tap of `channels` channels, in whole steps.
pub(super) fn tap_planes(channels: u32) -> u32 {
    channels.next_multiple_of(STEP as u32) / 4
}
