//! YUV4MPEG2: pictures one after another, by planes of Y, Cb and Cr in full resolution, BT.709 in the narrow range.

/// Of red, green and blue in the luma (BT.709).
const LUMA: [f64; 3] = [0.2126, 0.7152, 0.0722];

/// The line that begins a file of pictures of so many pixels, so many of them a second.
pub(super) fn header([width, height]: [u32; 2], fps: f64) -> String {
    let (above, below) = rate(fps);
    format!("YUV4MPEG2 W{width} H{height} F{above}:{below} Ip A1:1 C444 XCOLORRANGE=LIMITED\n")
}

/// A rate as a fraction: whole numbers, NTSC's (24000/1001 and the like), else in thousandths.
fn rate(fps: f64) -> (u32, u32) {
    let near = |value: f64| (value - value.round()).abs() < 1e-3;
    if near(fps) {
        (fps.round() as u32, 1)
    } else if near(fps * 1.001) {
        ((fps * 1.001).round() as u32 * 1000, 1001)
    } else {
        ((fps * 1000.0).round() as u32, 1000)
    }
}

/// A frame; colours are clamped to [0, 1], NaN is 0.
pub(super) fn frame(color: &[[f32; 3]]) -> Vec<u8> {
    const MARK: &[u8] = b"FRAME\n";
    let n = color.len();
    let mut bytes = vec![0; MARK.len() + 3 * n];
    bytes[..MARK.len()].copy_from_slice(MARK);
    let (luma, chroma) = bytes[MARK.len()..].split_at_mut(n);
    let (blue, red) = chroma.split_at_mut(n);
    for (((color, y_out), b_out), r_out) in color.iter().zip(luma).zip(blue).zip(red) {
        let [r, g, b] = color.map(|c| if c > 0.0 { f64::from(c.min(1.0)) } else { 0.0 });
        let y = LUMA[0] * r + LUMA[1] * g + LUMA[2] * b;
        *y_out = (16.0 + 219.0 * y).round() as u8;
        *b_out = (128.0 + 112.0 * (b - y) / (1.0 - LUMA[2])).round() as u8;
        *r_out = (128.0 + 112.0 * (r - y) / (1.0 - LUMA[0])).round() as u8;
    }
    bytes
}
