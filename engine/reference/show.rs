//! How a window shows an output.

const RAMP: [[f64; 3]; 5] =
    [[0.02, 0.02, 0.10], [0.30, 0.08, 0.50], [0.80, 0.20, 0.35], [0.98, 0.60, 0.15], [1.0, 1.0, 0.75]];

/// The colour of a pixel as shown, 0 to 255 each, before it is rounded. `image0` is colour and alpha, `image1` depth, inverse
/// depth and flow; `layer` counts from 0: colour, alpha, inverse depth, flow.
pub fn shown(image0: [f32; 4], image1: [f32; 4], layer: u32, high: f32) -> [f64; 3] {
    let [r, g, b, alpha] = image0.map(f64::from);
    let [_, inverse, x, y] = image1.map(f64::from);
    let high = f64::from(high);
    let color = match layer {
        0 => [r, g, b],
        1 => [alpha; 3],
        2 => ramp(inverse / high),
        _ => wheel([x, y], high),
    };
    color.map(|part| 255.0 * clamped(part))
}

/// A word of an overlay, bytes red, green, blue and alpha, over a pixel.
pub fn laid_over(word: u32, pixel: [u8; 3]) -> [u8; 3] {
    let [over @ .., alpha] = word.to_le_bytes();
    let mix =
        |k: usize| (u32::from(alpha) * u32::from(over[k]) + u32::from(255 - alpha) * u32::from(pixel[k]) + 127) / 255;
    [0, 1, 2].map(|k| mix(k) as u8)
}

fn clamped(x: f64) -> f64 {
    if x > 0.0 { x.min(1.0) } else { 0.0 }
}

fn mix(a: [f64; 3], b: [f64; 3], t: f64) -> [f64; 3] {
    [0, 1, 2].map(|k| a[k] + t * (b[k] - a[k]))
}

fn ramp(x: f64) -> [f64; 3] {
    let at = 4.0 * clamped(x);
    let k = (at as usize).min(3);
    mix(RAMP[k], RAMP[k + 1], at - k as f64)
}

fn wheel([x, y]: [f64; 2], high: f64) -> [f64; 3] {
    if !x.is_finite() || !y.is_finite() {
        return [0.0; 3];
    }
    let hue = y.atan2(x).to_degrees() / 60.0 + 6.0;
    let full = [0.0, 4.0, 2.0].map(|shift| (((hue + shift) % 6.0 - 3.0).abs() - 1.0).clamp(0.0, 1.0));
    mix([1.0; 3], full, clamped(x.hypot(y) / high))
}
