//! The reference's bilateral grid against tent functions over all cells, and its derivatives against finite differences.

use crate::common::prelude::*;
use ivv::internals::reference::{BilateralGrid, Dual};

const N: usize = 12 * 16 * 16 * 8;

fn numbers(seed: u64) -> Vec<f64> {
    let mut random = Random::new(seed);
    (0..N).map(|_| random.uniform(-1.0, 1.0)).collect()
}

#[test]
fn a_slice_is_the_sum_of_all_cells_under_their_tents() {
    let numbers = numbers(1);
    let grid = BilateralGrid::new(&numbers);
    let mut random = Random::new(2);
    for _ in 0..20 {
        let [u, v, r, g, b] = std::array::from_fn(|_| random.uniform(0.0, 1.0));
        let place = [15.0 * u, 15.0 * v, 7.0 * (0.299 * r + 0.587 * g + 0.114 * b)];
        let mut expected = [0.0; 3];
        for cell in 0..16 * 16 * 8 {
            let at = [cell % 16, cell / 16 % 16, cell / 256].map(|at| at as f64);
            let weight: f64 = (0..3).map(|axis| (1.0 - (place[axis] - at[axis]).abs()).max(0.0)).product();
            for (row, sum) in expected.iter_mut().enumerate() {
                let map = &numbers[12 * cell + 4 * row..][..4];
                *sum += weight * (map[0] * r + map[1] * g + map[2] * b + map[3]);
            }
        }
        let found = grid.map([u, v], [r, g, b]);
        assert!(found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-13), "{found:?} for {expected:?}");
    }
}

#[test]
fn derivatives_are_finite_differences() {
    let numbers = numbers(3);
    let mut random = Random::new(4);
    let plain = BilateralGrid::new(&numbers);
    for _ in 0..10 {
        let uv = [random.uniform(0.0, 1.0), random.uniform(0.0, 1.0)];
        let color: [f64; 3] = std::array::from_fn(|_| random.uniform(0.1, 0.9));
        let way: [f64; 3] = std::array::from_fn(|_| random.uniform(-1.0, 1.0));
        let constant: Vec<Dual> = numbers.iter().map(|x| Dual::new(*x, 0.0)).collect();
        let exact = BilateralGrid::new(&constant).map(uv, std::array::from_fn(|k| Dual::new(color[k], way[k])));
        let h = 1e-7;
        let [after, before] = [h, -h].map(|h| plain.map(uv, std::array::from_fn(|k| color[k] + h * way[k])));
        for k in 0..3 {
            let difference = (after[k] - before[k]) / (2.0 * h);
            assert!((exact[k].tangent - difference).abs() < 1e-5, "{:?} for {difference}", exact[k]);
        }
    }
}
