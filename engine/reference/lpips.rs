//! LPIPS v0.1 (SPEC 4; Zhang et al. 2018) by the definition, channel by channel.

use super::real::Real;
use crate::files::Tensor;
use std::collections::BTreeMap;

/// Keeps the norm of dead features above 0; inside the root.
const EPS: f64 = 1e-10;
/// Mean and deviation of a colour of [-1, 1].
const SHIFT: [f64; 3] = [-0.030, -0.088, -0.188];
const SCALE: [f64; 3] = [0.458, 0.448, 0.450];

/// Tensors by name.
type Tensors = BTreeMap<String, Tensor>;

/// Feature maps: a plane `[height][width]` per channel.
#[derive(Clone, Debug)]
struct Maps<R> {
    planes: Vec<Vec<R>>,
    size: [usize; 2],
}

/// A convolution with bias and ReLU.
fn conv<R: Real>(tensors: &Tensors, name: &str, x: &Maps<R>, stride: usize, pad: usize) -> Maps<R> {
    let weight = &tensors[&format!("{name}.weight")];
    let bias = &tensors[&format!("{name}.bias")].data;
    let (channels, kernel) = (weight.shape[1], weight.shape[2]);
    let size = x.size.map(|n| (n + 2 * pad - kernel) / stride + 1);
    let value = |o: usize, (row, column): (usize, usize)| {
        let mut sum = R::from_f64(bias[o]);
        for (c, plane) in x.planes.iter().enumerate() {
            for (ky, kx) in places([kernel, kernel]) {
                let (y, x_at) = ((row * stride + ky).wrapping_sub(pad), (column * stride + kx).wrapping_sub(pad));
                if y < x.size[1] && x_at < x.size[0] {
                    let w = weight.data[((o * channels + c) * kernel + ky) * kernel + kx];
                    sum = sum + R::from_f64(w) * plane[y * x.size[0] + x_at];
                }
            }
        }
        if sum > R::zero() { sum } else { R::zero() }
    };
    let planes = (0..weight.shape[0]).map(|o| places(size).map(|at| value(o, at)).collect()).collect();
    Maps { planes, size }
}

/// SqueezeNet's module: the channels of a 1x1 and of a 3x3 layer over a common 1x1 layer.
fn fire<R: Real>(tensors: &Tensors, module: usize, x: &Maps<R>) -> Maps<R> {
    let squeezed = conv(tensors, &format!("features.{module}.squeeze"), x, 1, 0);
    let mut out = conv(tensors, &format!("features.{module}.expand1x1"), &squeezed, 1, 0);
    out.planes.extend(conv(tensors, &format!("features.{module}.expand3x3"), &squeezed, 1, 1).planes);
    out
}

/// The maps that are compared, first to last.
fn taps<R: Real>(tensors: &Tensors, input: &Maps<R>) -> Vec<Maps<R>> {
    let is_squeezenet = tensors.contains_key("features.3.squeeze.weight");
    if is_squeezenet {
        let mut taps = vec![conv(tensors, "features.0", input, 2, 0)];
        for modules in [&[3, 4][..], &[6, 7], &[9], &[10], &[11], &[12]] {
            let last = &taps[taps.len() - 1];
            let x = if modules[0] < 10 { pool(last, true) } else { last.clone() };
            taps.push(modules.iter().fold(x, |x, module| fire(tensors, *module, &x)));
        }
        taps
    } else {
        let mut taps = vec![conv(tensors, "features.0", input, 4, 2)];
        for (layer, pad) in [(3, 2), (6, 1), (8, 1), (10, 1)] {
            let last = &taps[taps.len() - 1];
            let x = if layer < 8 { pool(last, false) } else { last.clone() };
            taps.push(conv(tensors, &format!("features.{layer}"), &x, 1, pad));
        }
        taps
    }
}

/// LPIPS of `image` against `truth`, `[height][width]`, both at least as large as the trunk can see, with the weights of
/// AlexNet or SqueezeNet 1.1 and of LPIPS under their published names (`features.N...`, `linK.model.1.weight`). A word of
/// the truth holds RGB and the mask, 8 bits each from the least significant byte on; where the mask hides a pixel the
/// picture takes the truth's colour.
pub fn lpips<R: Real>(tensors: &Tensors, image: &[[R; 3]], truth: &[u32], size: [usize; 2]) -> R {
    let truth: Vec<[f64; 4]> = truth.iter().map(|word| word.to_le_bytes().map(|b| f64::from(b) / 255.0)).collect();
    let input = |color: &dyn Fn(usize, usize) -> R| {
        let scaled =
            |i, c: usize| (R::from_f64(2.0) * color(i, c) - R::from_f64(1.0 + SHIFT[c])) / R::from_f64(SCALE[c]);
        Maps { planes: (0..3).map(|c| (0..truth.len()).map(|i| scaled(i, c)).collect()).collect(), size }
    };
    let picture = input(&|i, c| {
        let visible = truth[i][3];
        image[i][c] * R::from_f64(visible) + R::from_f64(truth[i][c] * (1.0 - visible))
    });
    let [x, y] = [picture, input(&|i, c| R::from_f64(truth[i][c]))].map(|maps| taps(tensors, &maps));
    let mut total = R::zero();
    for (k, (x, y)) in x.iter().zip(&y).enumerate() {
        let linear = &tensors[&format!("lin{k}.model.1.weight")].data;
        let pixels = x.size[0] * x.size[1];
        let mut sum = R::zero();
        for pixel in 0..pixels {
            let [x, y] = [x, y].map(|maps| unit(maps.planes.iter().map(|plane| plane[pixel]).collect()));
            for ((x, y), w) in x.into_iter().zip(y).zip(linear) {
                sum = sum + R::from_f64(*w) * (x - y) * (x - y);
            }
        }
        total = total + sum / R::from_f64(pixels as f64);
    }
    total
}

/// `features` over their norm.
fn unit<R: Real>(features: Vec<R>) -> Vec<R> {
    let square = features.iter().fold(R::from_f64(EPS), |sum, f| sum + *f * *f);
    features.into_iter().map(|f| f / square.sqrt()).collect()
}

/// The greatest of 3 x 3, two pixels apart, the first of equals. With `ceil` the last window may stick out.
fn pool<R: Real>(x: &Maps<R>, ceil: bool) -> Maps<R> {
    let size = x.size.map(|n| if ceil { (n - 2) / 2 + 1 } else { (n - 3) / 2 + 1 });
    let greatest = |plane: &Vec<R>, (py, px): (usize, usize)| {
        let inside = places([3, 3]).map(|(ky, kx)| (2 * py + ky, 2 * px + kx));
        let inside = inside.filter(|(y, column)| *y < x.size[1] && *column < x.size[0]);
        let values = inside.map(|(y, column)| plane[y * x.size[0] + column]);
        values.reduce(|best, value| if value > best { value } else { best }).unwrap_or_default()
    };
    let planes = x.planes.iter().map(|plane| places(size).map(|at| greatest(plane, at)).collect()).collect();
    Maps { planes, size }
}

/// Row and column of every place of `[width, height]`, row by row.
fn places([width, height]: [usize; 2]) -> impl Iterator<Item = (usize, usize)> {
    (0..height).flat_map(move |y| (0..width).map(move |x| (y, x)))
}
