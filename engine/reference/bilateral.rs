//! Bilateral grids of affine colour maps (SPEC 7; Wang et al. 2024), by the definition, a pixel at a time.

use super::real::Real;

/// Cells across, down, and along the luma.
const SIZE: [usize; 3] = [16, 16, 8];
/// Luma of Rec. 601.
const LUMA: [f64; 3] = [0.299, 0.587, 0.114];

/// Affine map of colours: rows of (red, green, blue, constant).
type Map<R> = [[R; 4]; 3];

/// A camera's grid: 16 x 16 x 8 affine maps of colours, over the picture and the luma; x runs fastest, then y.
#[derive(Clone, Debug, PartialEq)]
pub struct BilateralGrid<R> {
    pub cells: Vec<Map<R>>,
}

/// The numbers of all cameras' grids without the mean deviation from the identity of those that film, the first `n_filming`: a tint of all
/// these is one of the scene.
pub fn centred(grids: &[Vec<f64>], n_filming: usize) -> Vec<Vec<f64>> {
    let filming = &grids[..n_filming];
    // Of a map's 12 numbers, row by row.
    let identity = |i: usize| f64::from(u8::from([0, 5, 10].contains(&(i % 12))));
    let mean = |i: usize| filming.iter().map(|grid| grid[i] - identity(i)).sum::<f64>() / n_filming as f64;
    grids.iter().map(|grid| grid.iter().enumerate().map(|(i, x)| x - mean(i)).collect()).collect()
}

/// The gradient of a grid whose cells are one map: that of the map, in every cell.
pub fn pooled(d_grid: &[f64]) -> Vec<f64> {
    let sum = |i: usize| d_grid.iter().skip(i).step_by(12).sum::<f64>();
    let of_map: [f64; 12] = std::array::from_fn(sum);
    of_map.into_iter().cycle().take(d_grid.len()).collect()
}

impl<R: Real> BilateralGrid<R> {
    /// From 12 numbers for each cell.
    pub fn new(numbers: &[R]) -> Self {
        let cell = |n: &[R; 12]| std::array::from_fn(|row| std::array::from_fn(|k| n[4 * row + k]));
        BilateralGrid { cells: numbers.as_chunks().0.iter().map(cell).collect() }
    }

    /// `color` as the camera shows it at `uv`, in units of the picture from its upper left corner: the trilinear mean of
    /// the maps around (15 u, 15 v, 7 luma), each clamped to the grid with no derivative outside. A luma that is not a
    /// number counts as 0.
    pub fn map(&self, uv: [f64; 2], color: [R; 3]) -> [R; 3] {
        let luma = (0..3).fold(R::zero(), |sum, k| sum + R::from_f64(LUMA[k]) * color[k]);
        let luma = match luma.to_f64() {
            l if l > 0.0 && l < 1.0 => luma,
            l if l >= 1.0 => R::one(),
            _ => R::zero(),
        };
        let last = |axis: usize| R::from_f64((SIZE[axis] - 1) as f64);
        let [x, y] = std::array::from_fn(|axis| R::from_f64(uv[axis].clamp(0.0, 1.0)) * last(axis));
        let mut map = [[R::zero(); 4]; 3];
        for (cell, weight) in weights([x, y, luma * last(2)]) {
            for (sum, entry) in map.as_flattened_mut().iter_mut().zip(self.cells[cell].as_flattened()) {
                *sum = *sum + weight * *entry;
            }
        }
        map.map(|[r, g, b, constant]| r * color[0] + g * color[1] + b * color[2] + constant)
    }

    /// A picture, `[height][width]`, as the camera shows it.
    pub fn slice(&self, image: &[[R; 3]], [width, height]: [usize; 2]) -> Vec<[R; 3]> {
        let center = |at: usize, n: usize| (at as f64 + 0.5) / n as f64;
        let pixels = image.iter().enumerate();
        pixels.map(|(i, color)| self.map([center(i % width, width), center(i / width, height)], *color)).collect()
    }

    /// Total variation: over the three axes, the sum of the mean squared differences of neighbours.
    pub fn total_variation(&self) -> R {
        let strides = [1, SIZE[0], SIZE[0] * SIZE[1]];
        let mut total = R::zero();
        for (stride, n) in strides.into_iter().zip(SIZE) {
            let has_next = |cell: &usize| cell / stride % n + 1 < n;
            let (mut sum, mut count) = (R::zero(), 0);
            for cell in (0..self.cells.len()).filter(has_next) {
                let both = self.cells[cell].as_flattened().iter().zip(self.cells[cell + stride].as_flattened());
                sum = both.fold(sum, |sum, (a, b)| sum + (*b - *a) * (*b - *a));
                count += 12;
            }
            total = total + sum / R::from_f64(f64::from(count));
        }
        total
    }
}

/// The eight cells around a place in the grid with their trilinear weights.
fn weights<R: Real>(place: [R; 3]) -> impl Iterator<Item = (usize, R)> {
    let low: [usize; 3] = std::array::from_fn(|axis| (place[axis].to_f64() as usize).min(SIZE[axis] - 2));
    (0..8).map(move |corner| {
        let is_high = [corner & 1, corner >> 1 & 1, corner >> 2];
        let weight = (0..3).fold(R::one(), |product, axis| {
            let way = place[axis] - R::from_f64(low[axis] as f64);
            product * if is_high[axis] == 1 { way } else { R::one() - way }
        });
        let [x, y, z] = std::array::from_fn(|axis| low[axis] + is_high[axis]);
        ((z * SIZE[1] + y) * SIZE[0] + x, weight)
    })
}
