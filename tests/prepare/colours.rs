//! Videos of high dynamic range, of wide gamuts and of fields become what the others are.

use super::coded::{ffmpeg, rig};
use super::{done, settings};
use crate::common::prelude::*;

/// Colours of every hue and lightness, smooth, so that codecs change little.
const PICTURE: &str = "nullsrc=s=64x48:r=10:d=1,format=gbrp,geq=r='X*4':g='Y*5':b='(X+Y)*2'";

fn has_zscale() -> bool {
    let listed = std::process::Command::new("ffmpeg").args(["-v", "error", "-filters"]).output();
    let has = listed.is_ok_and(|listed| String::from_utf8_lossy(&listed.stdout).contains(" zscale "));
    if !has {
        crate::common::notes::skip("this ffmpeg has no zscale");
    }
    has
}

/// A lossless video of the picture through `filter`, with these tags.
fn video(path: &Path, filter: &str, tags: &[&str]) {
    let source = format!("{PICTURE},{filter}");
    let mut arguments = vec!["-f", "lavfi", "-i", &source, "-frames:v", "2", "-c:v", "ffv1"];
    arguments.extend(tags);
    arguments.push(path.to_str().unwrap());
    ffmpeg(&arguments);
}

/// How far the colours of two cameras are apart, levels of 255: the mean and the most, over the channels of all pixels where the first is
/// at most `limit`.
fn apart(capture: &Capture, limit: u8) -> [f64; 2] {
    let [a, b] = [0, 1].map(|camera| capture.picture(camera, 1).unwrap().pixels);
    let channels = a.iter().zip(&b).flat_map(|(a, b)| {
        let (a, b) = (a.to_le_bytes(), b.to_le_bytes());
        let is_within = a[..3].iter().all(|level| *level <= limit);
        (0..3).filter(move |_| is_within).map(move |c| f64::from(a[c].abs_diff(b[c])))
    });
    let off: Vec<f64> = channels.collect();
    [off.iter().sum::<f64>() / off.len() as f64, off.iter().copied().fold(0.0, f64::max)]
}

#[test]
fn high_dynamic_range_and_wide_gamuts_become_bt_709() {
    needs!("ffmpeg");
    if !has_zscale() {
        return;
    }
    let plain = "zscale=m=bt709:r=tv,format=yuv444p";
    let of_709 = ["-color_primaries", "bt709", "-color_trc", "bt709", "-colorspace", "bt709"];
    let kinds = [
        ("arib-std-b67", "bt2020", "HLG, BT.2020: tone-mapped to BT.709"),
        ("smpte2084", "bt2020", "PQ, BT.2020: tone-mapped to BT.709"),
        ("bt709", "bt2020", "BT.2020: converted to BT.709"),
        ("bt709", "smpte432", "P3: converted to BT.709"),
    ];
    for (kind, (curve, primaries, says)) in kinds.into_iter().enumerate() {
        let folder = rig(&format!("prepare-colour-{kind}"), &["a", "b"]);
        video(&folder.0.join("source/a.mkv"), plain, &of_709);
        let matrix = if primaries == "bt2020" { "bt2020nc" } else { "bt709" };
        let filter = format!(
            "zscale=tin=bt709:pin=bt709:min=gbr:t=linear:npl=100:p={primaries}:m=gbr,format=gbrpf32le,\
             zscale=t={curve}:m={matrix}:r=tv:npl=100,format=yuv444p10le"
        );
        let tags = ["-color_primaries", primaries, "-color_trc", curve, "-colorspace", matrix, "-color_range", "tv"];
        video(&folder.0.join("source/b.mkv"), &filter, &tags);
        let settings = settings(&folder);
        let prepared = done(&settings);
        let notes = prepared.notes.join("\n");
        assert!(notes.contains(&format!("camera `b`: its video is {says}")), "{notes}");
        let capture = Capture::open(&settings.output).unwrap();
        // Up to half of white (188 of 255) light is as it was; from there it is compressed, so that what is brighter has room.
        let ([mean, most], [mean_of_all, _]) = (apart(&capture, 180), apart(&capture, 255));
        println!("{says}: off by {mean:.2} in the mean, {most} at most up to 180; {mean_of_all:.2} over all");
        assert!(mean < 1.5 && most <= 24.0 && mean_of_all < 5.0, "{says}: {mean} {most} {mean_of_all}");
    }
}

#[test]
fn fields_of_two_moments_become_whole_pictures() {
    needs!("ffmpeg");
    let folder = rig("prepare-fields", &["a", "b"]);
    // A bar that goes four pixels to the right from field to field; `a` has the whole pictures of the first fields.
    let bar = "nullsrc=s=64x48:r=20:d=1,format=gray,geq=lum='if(between(X-4*N,4,15),220,30)'";
    let [a, b] = ["a", "b"].map(|name| folder.0.join(format!("source/{name}.mkv")));
    let of_a = format!("{bar},select='not(mod(n,2))',setpts=N/10/TB");
    ffmpeg(&["-f", "lavfi", "-i", &of_a, "-r", "10", "-frames:v", "5", "-c:v", "ffv1", a.to_str().unwrap()]);
    let of_b = format!("{bar},tinterlace=interleave_top,setfield=tff");
    let fields = ["-field_order", "tt", "-c:v", "ffv1", b.to_str().unwrap()];
    ffmpeg(&[&["-f", "lavfi", "-i", &of_b, "-frames:v", "5"][..], &fields].concat());
    let settings = PrepareSettings { ..settings(&folder) };
    let prepared = done(&settings);
    let notes = prepared.notes.join("\n");
    assert!(notes.contains("camera `b`: its video is interlaced (top field first): de-interlaced"), "{notes}");
    let capture = Capture::open(&settings.output).unwrap();
    // Lines of a combed picture differ from the next by the bar's way; those of a whole one do not.
    let comb = |camera: usize, frame: u32| {
        let picture = capture.picture(camera, frame).unwrap().pixels;
        let level = |x: usize, y: usize| i32::from(picture[64 * y + x].to_le_bytes()[1]);
        let rows = (8..40).flat_map(|y| (0..64).map(move |x| (x, y)));
        rows.filter(|(x, y)| (level(*x, *y) - level(*x, y + 1)).abs() > 60).count()
    };
    for frame in 0..4 {
        assert_eq!((comb(0, frame), comb(1, frame)), (0, 0), "frame {frame}");
    }
    // A part has the pictures of the whole, though a field is made of those before it too.
    let part = PrepareSettings { frames: "3:5".parse().unwrap(), output: folder.0.join("part"), ..settings.clone() };
    done(&part);
    let part = Capture::open(&part.output).unwrap();
    assert_same("pixels", &part.picture(1, 0).unwrap().pixels, &capture.picture(1, 3).unwrap().pixels);
}
