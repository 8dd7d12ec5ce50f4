//! How hard the pixels of a picture pull each Gaussian's centre: what density control asks.

use super::blend::{blend, bounds};
use super::dual::Dual;
use super::input::{Camera, Params, Rules};
use super::project::{Projected, project};
use crate::scene::{Splats, View};
use crate::settings::Constants;

/// Of each Gaussian the length of the derivative of the sum of color . `d_color` over the pixels by its projected centre, in
/// halves of the picture's width and height, as 3DGS's threshold for density control has it; 0 for one that is not seen.
/// `d_color` is row-major, top first.
pub fn pull(splats: &Splats, view: &View, constants: &Constants, d_color: &[[f32; 3]]) -> Vec<f64> {
    let params = Params::<Dual>::new(splats, view);
    let (camera, rules) = (Camera::new(view), Rules::new(constants));
    let time = camera.shifted_time(params.time_offset);
    let mut seen: Vec<(usize, Projected<Dual>)> =
        (0..params.len()).filter_map(|i| Some((i, project(&params.gaussian(i), &camera, time, &rules)?))).collect();
    seen.sort_by(|a, b| a.1.z.value.total_cmp(&b.1.z.value));
    let (mut pulls, size) = (vec![0.0; splats.len()], [view.intrinsics.width, view.intrinsics.height]);
    for k in 0..seen.len() {
        let [x0, x1, y0, y1] = bounds(&seen[k].1);
        let mut along = [0.0; 2];
        for (pixel, d_color) in d_color.iter().enumerate() {
            let width = size[0] as usize;
            let at = [pixel % width, pixel / width].map(|x| x as f64 + 0.5);
            if at[0] < x0 || at[0] > x1 || at[1] < y0 || at[1] > y1 {
                continue;
            }
            for (axis, sum) in along.iter_mut().enumerate() {
                seen[k].1.xy[axis].tangent = 1.0;
                let shown = blend(at, seen.iter().map(|(_, splat)| splat), &camera, &rules);
                seen[k].1.xy[axis].tangent = 0.0;
                let color = |c: usize| (shown.color[c] + shown.transmittance * params.background[c]).tangent;
                *sum += (0..3).map(|c| color(c) * f64::from(d_color[c])).sum::<f64>();
            }
        }
        let [x, y] = [0, 1].map(|axis| 0.5 * f64::from(size[axis]) * along[axis]);
        pulls[seen[k].0] = x.hypot(y);
    }
    pulls
}
