//! Sets of responses: the sphere and its laws, files good and bad. T3, T14 to T17.

use super::measure::{ild_db, itd, lsd_db};
use super::{head, noise, scene, sphere, track};
use crate::common::prelude::*;
use ivv::Error;
use ivv::internals::sound::geometry::Mode;
use ivv::internals::sound::hrtf::{Measured, degrees};
use ivv::internals::sound::sinc::Resampler;
use ivv::internals::sound::sphere::icosphere;
use ivv::internals::sound::wav::{Depth, write};
use realfft::RealFftPlanner;

/// A sphere with its ears at the sides and sources far away, as the closed formulas have it.
fn far_sphere() -> Sphere {
    Sphere { ear: 90f64.to_radians(), distance: 30.0, ..Sphere::default() }
}

/// The phase of left against right at a frequency, as the time by which the left ear leads.
fn phase_lead(ears: &[Vec<f32>; 2], frequency: f64) -> f64 {
    let [left, right] = ears.each_ref().map(|response| {
        response.iter().enumerate().fold((0.0, 0.0), |(re, im), (n, value)| {
            let angle = std::f64::consts::TAU * frequency * n as f64 / 48_000.0;
            (re + f64::from(*value) * angle.cos(), im - f64::from(*value) * angle.sin())
        })
    });
    // Of left times the conjugate of right.
    let phase = f64::atan2(left.1 * right.0 - left.0 * right.1, left.0 * right.0 + left.1 * right.1);
    phase / (std::f64::consts::TAU * frequency)
}

/// By how much the ear in front leads, of a plane wave on a rigid sphere: Kuhn's series (JASA 62, 1977, equation 1), with
/// Bessel's functions from their own recurrences, so that it shares no code and no way of summing with the model.
fn kuhn_lead(model: &Sphere, frequency: f64, az: f64) -> f64 {
    const ORDERS: usize = 24;
    let x = std::f64::consts::TAU * frequency * model.radius / 343.0;
    // Those of the first kind downwards, from a start that does not matter; those of the second upwards.
    let mut j = [0.0; ORDERS + 20];
    j[ORDERS + 18] = 1e-280;
    for m in (1..ORDERS + 18).rev() {
        j[m] = (2 * m + 3) as f64 / x * j[m + 1] - j[m + 2];
    }
    let first = 3.0 / x * j[1] - j[2];
    let scale = (x.sin() / x) / first;
    j.iter_mut().for_each(|value| *value *= scale);
    j[0] = x.sin() / x;
    let mut y = [0.0; ORDERS + 2];
    (y[0], y[1]) = (-x.cos() / x, -x.cos() / (x * x) - x.sin() / x);
    for m in 1..=ORDERS {
        y[m + 1] = (2 * m + 1) as f64 / x * y[m] - y[m - 1];
    }
    let pressure = |cos: f64| {
        let (mut before, mut now) = (0.0, 1.0);
        let (mut re, mut im) = (0.0, 0.0);
        for m in 0..ORDERS {
            // i^m (2m + 1) P_m / h'_m, with h = j + i y and h'_m = m / x h_m - h_{m+1}.
            let slope = |h: &[f64]| m as f64 / x * h[m] - h[m + 1];
            let (a, b) = (slope(&j), slope(&y));
            let part = (2 * m + 1) as f64 * now / (a * a + b * b);
            let (c, d) = [(a, -b), (b, a), (-a, b), (-b, -a)][m % 4];
            (re, im) = (re + part * c, im + part * d);
            (before, now) = (now, ((2 * m + 1) as f64 * cos * now - m as f64 * before) / (m + 1) as f64);
        }
        im.atan2(re)
    };
    // With time as e^{-i w t} what comes later has the larger phase; incidence is counted from where the wave goes to.
    let (near, far) = (pressure(-az.sin()), pressure(az.sin()));
    (far - near).rem_euclid(std::f64::consts::TAU) / (std::f64::consts::TAU * frequency)
}

/// How long after its beginning the energy above 6 kHz of a response comes: the onset of its envelope.
fn high_onset(response: &[f32]) -> f64 {
    let n = 16 * response.len();
    let mut planner = RealFftPlanner::<f64>::new();
    let mut padded: Vec<f64> = response.iter().map(|value| f64::from(*value)).collect();
    let forward = planner.plan_fft_forward(response.len());
    let mut bins = forward.make_output_vec();
    forward.process(&mut padded, &mut bins).unwrap();
    let first = 6000 * response.len() / 48_000;
    bins[..first].fill(Default::default());
    bins.resize(n / 2 + 1, Default::default());
    let inverse = planner.plan_fft_inverse(n);
    let mut signal = inverse.make_output_vec();
    inverse.process(&mut bins, &mut signal).unwrap();
    let highest = (0..n).max_by(|a, b| signal[*a].abs().total_cmp(&signal[*b].abs())).unwrap();
    highest as f64 / 16.0 / 48_000.0
}

#[test]
fn t14_the_sphere_follows_its_laws() {
    let model = far_sphere();
    let azimuths = [30.0, 60.0, 90.0f64];
    let set = model.responses(&azimuths.map(|az| degrees(az, 0.0)));
    let c = 343.0;
    for (az, ears) in azimuths.iter().zip(&set.irs) {
        let az = az.to_radians();
        // Towards low frequencies the lead is 3a/c sin(az), at high ones Woodworth's a/c (az + sin az). Between them it
        // is neither: the exact lead rises above the first by 2.7 % at 200 Hz, 5.5 % at 400 Hz and 4.3 % at 500 Hz (at 30
        // degrees; Kuhn 1977, figure 1, as a plane wave) before it falls to the second.
        let kuhn = 3.0 * model.radius / c * az.sin();
        let exact = |frequency: f64| kuhn_lead(&model, frequency, az);
        assert!((exact(20.0) / kuhn - 1.0).abs() < 1e-3, "{az}: {} {kuhn}", exact(20.0));
        for frequency in [187.5, 375.0, 500.0, 562.5] {
            let lead = phase_lead(ears, frequency);
            assert!((lead / exact(frequency) - 1.0).abs() < 3e-3, "{az}, {frequency}: {lead} {}", exact(frequency));
        }
        assert!((exact(200.0) / kuhn - 1.0).abs() < 0.03, "{az}: {} {kuhn}", exact(200.0));
        let (high, woodworth) = (high_onset(&ears[1]) - high_onset(&ears[0]), model.radius / c * (az + az.sin()));
        assert!((high / woodworth - 1.0).abs() < 0.04, "{az}: {high} {woodworth}");
    }
    // At the lowest frequencies the head is only a little way nearer or farther: 1 + 3/2 a/r cos of the incidence.
    for (az, ears) in azimuths.iter().zip(&set.irs) {
        for (ear, response) in [1.0, -1.0].iter().zip(ears) {
            let sum: f64 = response.iter().map(|value| f64::from(*value)).sum();
            let expected = 1.0 + ear * 1.5 * model.radius / model.distance * az.to_radians().sin();
            assert!((sum - expected).abs() < 1e-4, "{az}: {sum} {expected}");
        }
    }
}

#[test]
fn t14_the_sphere_is_symmetric_to_its_ears() {
    let to = [degrees(37.0, 21.0), degrees(-37.0, 21.0), degrees(37.0, -21.0)];
    let set = Sphere::default().responses(&to);
    let same = |a: &[f32], b: &[f32]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-6);
    assert!(same(&set.irs[0][0], &set.irs[1][1]) && same(&set.irs[0][1], &set.irs[1][0]));
    assert!(same(&set.irs[0][0], &set.irs[2][0]) && !same(&set.irs[0][0], &set.irs[0][1]));
}

#[test]
fn t3_a_mirrored_scene_swaps_the_ears() {
    let signal: Vec<f32> = noise(2048, 8).iter().map(|x| 0.1 * x).collect();
    for mode in [Mode::Paper2d, Mode::Paper3d, Mode::Physical] {
        let config = RenderConfig { mode, ..RenderConfig::default() };
        let heard = |side: f64| {
            let mirrored = |p: DVec3| DVec3::new(side * p.x, p.y, p.z);
            let way =
                track("a", &[(0.0, mirrored(DVec3::new(1.0, 1.5, 0.3))), (0.1, mirrored(DVec3::new(0.5, 2.0, 0.6)))]);
            let scene = scene(way);
            let head = head(mirrored(DVec3::new(0.3, 0.2, 0.0)), side * 25.0);
            render_signals(&scene, std::slice::from_ref(&signal), &head, sphere(), &config).unwrap()
        };
        let (right, left) = (heard(1.0), heard(-1.0));
        assert!(right.cues[0].iter().zip(&left.cues[0]).all(|(a, b)| (a.az + b.az).abs() < 1e-9 && a.az != 0.0));
        let worst = right.samples.iter().zip(&left.samples).map(|(a, b)| (a[0] - b[1]).abs().max((a[1] - b[0]).abs()));
        let worst = worst.fold(0.0, f32::max);
        assert!(worst <= 1e-6, "{mode:?}: {worst}");
    }
}

#[test]
fn the_icosphere_is_symmetric_and_holds_the_axes() {
    let all = icosphere(4);
    assert_eq!(all.len(), 162);
    for mirror in [DVec3::new(-1.0, 1.0, 1.0), DVec3::new(1.0, -1.0, 1.0), DVec3::new(1.0, 1.0, -1.0)] {
        assert!(all.iter().all(|a| all.iter().any(|b| (*a * mirror - *b).length() < 1e-9)));
    }
    for axis in [DVec3::X, DVec3::Y, DVec3::Z] {
        assert!(all.iter().any(|a| (*a - axis).length() < 1e-9));
    }
}

fn magnitude(response: &[f32], frequency: f64) -> f64 {
    let turn = |n: usize| std::f64::consts::TAU * frequency * n as f64 / 48_000.0;
    let sum = |part: fn(f64) -> f64| -> f64 {
        response.iter().enumerate().map(|(n, value)| f64::from(*value) * part(turn(n))).sum()
    };
    sum(f64::cos).hypot(sum(f64::sin))
}

#[test]
fn t15_another_rate_keeps_times_and_magnitudes() {
    // A response at 44.1 kHz: two bursts, band-limited to 16 kHz by the change from 32 kHz.
    let narrow: Vec<f32> =
        (0..256).map(|n| (-(0.3 * (n as f32 - 60.0)).powi(2)).exp() * (1.9 * n as f32).cos()).collect();
    let at_44 = Resampler::new(32_000, 44_100, 0.0).apply(&narrow);
    let direct = Resampler::new(32_000, 48_000, 0.0).apply(&narrow);
    let twice = Resampler::new(44_100, 48_000, 0.0).apply(&at_44);
    // The sums of samples differ by the ratio of rates only through the samples' distance.
    let n = direct.len().min(twice.len());
    assert!(lsd_db(&direct[..n], &twice[..n]) < 0.2, "{}", lsd_db(&direct[..n], &twice[..n]));
    for k in 1..80 {
        let [a, b] = [&direct, &twice].map(|response| magnitude(response, 200.0 * f64::from(k)));
        assert!((20.0 * (a / b).log10()).abs() < 0.2, "{} Hz: {a} {b}", 200 * k);
    }
    assert!(itd(&direct[..n], &twice[..n]).abs() < 5e-6);
    // A set keeps the time between its ears.
    let set = Sphere::default().responses(&[degrees(60.0, 0.0)]);
    let there = Resampler::new(48_000, 44_100, 0.0);
    let back = Resampler::new(44_100, 48_000, 0.0);
    let [left, right] = set.irs[0].each_ref().map(|response| back.apply(&there.apply(response)));
    let expected = itd(&set.irs[0][0], &set.irs[0][1]);
    assert!((itd(&left, &right) - expected).abs() < 5e-6 && expected > 4e-4);
    // Moved by a time that is no whole sample, and a rate that stays.
    let moved = Resampler::new(48_000, 48_000, 0.25e-3).apply(&left);
    assert!((itd(&left, &moved) - 0.25e-3).abs() < 1e-6);
    assert_eq!(Resampler::new(48_000, 48_000, 0.0).apply(&left), left);
}

/// A coarse sphere, as a file would give it.
fn measured() -> Measured {
    Sphere::default().measured(2)
}

fn refused(measured: Measured) -> String {
    match HrtfSet::new(measured, Path::new("test set")) {
        Err(error @ Error::Data { .. }) => error.to_string(),
        Err(error) => panic!("{error}"),
        Ok(_) => panic!("it was taken"),
    }
}

#[test]
fn t16_a_set_that_counts_azimuth_the_other_way_is_refused() {
    let mut mirrored = measured();
    mirrored.directions.iter_mut().for_each(|to| to.y = -to.y);
    assert!(refused(mirrored).contains("left ear hears"));
    let mut swapped = measured();
    swapped.irs.iter_mut().for_each(|ears| ears.swap(0, 1));
    assert!(refused(swapped).contains("counter-clockwise"));
}

#[test]
fn t17_what_is_no_set_of_responses_is_refused() {
    let mut broken = measured();
    broken.irs[7][1][30] = f32::NAN;
    assert!(refused(broken).contains("direction 7"));
    let mut silent = measured();
    silent.irs[3][0].fill(0.0);
    assert!(refused(silent).contains("silent"));
    let mut uneven = measured();
    uneven.irs[3][0].pop();
    assert!(refused(uneven).contains("direction 3"));
    let mut late = measured();
    late.delays[5][0] = f64::INFINITY;
    assert!(refused(late).contains("delay"));
    let mut half = measured();
    let keep: Vec<bool> = half.directions.iter().map(|to| to.z > 0.1).collect();
    let mut kept = keep.iter();
    half.directions.retain(|_| *kept.next().unwrap());
    half.irs.truncate(half.directions.len());
    half.delays.truncate(half.directions.len());
    assert!(refused(half).contains("surround"));
    let mut slow = measured();
    slow.fs = 0.0;
    assert!(refused(slow).contains("sample rate"));
}

#[test]
fn t17_damaged_sofa_files_are_refused() {
    let Some(folder) = shared("data/hrtf_sofa/tests") else { return };
    let mut n = 0;
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let name = path.file_name().unwrap().to_str().unwrap();
        if name.starts_with("fail-issue-") || name == "testfile.sofa" {
            let error = HrtfSet::open(&path).err().unwrap_or_else(|| panic!("{name} was taken"));
            assert!(matches!(error, Error::Data { .. }) && error.to_string().contains(name), "{error}");
            n += 1;
        }
    }
    assert_eq!(n, 8);
}

#[test]
fn t17_a_cut_sofa_file_is_refused() {
    let Some(path) = shared("data/hrtf_sofa/tests/Pulse.sofa") else { return };
    let bytes = fs::read(path).unwrap();
    let folder = Folder::new("sofa");
    for part in [0, 1, 100, bytes.len() / 2, bytes.len() - 1] {
        let cut = folder.write("cut.sofa", &bytes[..part]);
        assert!(HrtfSet::open(&cut).is_err(), "{part} bytes were taken");
    }
    assert!(HrtfSet::open(folder.file("absent.sofa")).is_err());
}

/// Lists of lists of lists: the parser of HDF5 calls itself for each.
#[test]
fn t17_a_sofa_file_of_deeply_nested_types_is_refused() {
    let folder = Folder::new("nested");
    for (n, told) in [(5000, "it is no HDF5 file that can be read"), (100_000, "may be nested")] {
        // The superblock, whose root follows it: an object with one message, a type.
        let header = [b"OHDR\x02\x02".as_slice(), &1000u32.to_le_bytes(), &[3], &900u16.to_le_bytes(), &[0]].concat();
        let types = [0x39, 0, 0, 0, 4, 0, 0, 0].repeat(n);
        let length = (48 + header.len() + types.len()) as u64;
        let addresses = [[0; 8], [0xff; 8], length.to_le_bytes(), 48u64.to_le_bytes()].concat();
        let start = [b"\x89HDF\r\n\x1a\n\x02\x08\x08\x00".as_slice(), &addresses, &[0; 4]].concat();
        let file = folder.write("nested.sofa", [start, header, types].concat());
        let error = HrtfSet::open(&file).err().expect("it is no set of responses");
        assert!(matches!(error, Error::Data { .. }) && error.to_string().contains(told), "{error}");
    }
}

#[test]
fn a_folder_of_wav_files_is_read_by_their_names() {
    let folder = Folder::new("sadie");
    fs::create_dir_all(folder.file("deep")).unwrap();
    folder.write("LICENSE", "\n\nFree of all\nterms");
    let model = measured();
    for (index, (to, ears)) in model.directions.iter().zip(&model.irs).enumerate() {
        let (az, el) = ivv::internals::sound::geometry::angles(*to);
        let [az, el] = [az, el].map(|angle| format!("{:.5}", angle.to_degrees()));
        // Both of the database's spellings.
        let name = if index % 2 == 0 {
            format!("azi_{az}_ele_{el}_DFC.wav")
        } else {
            format!("azi_{}_ele_{}.wav", az.replace('.', ","), el.replace('.', ","))
        };
        let frames: Vec<[f32; 2]> = ears[0].iter().zip(&ears[1]).map(|(l, r)| [0.1 * l, 0.1 * r]).collect();
        write(folder.file("deep").join(name), &frames, Depth::Float32).unwrap();
    }
    let set = HrtfSet::open(folder.file("deep")).unwrap();
    assert_eq!(set.directions.len(), model.directions.len());
    assert_eq!((set.meta.licence.as_str(), set.meta.sha256.len()), ("Free of all", 64));
    let left = set.filter(DVec3::Y, Lookup::Aligned);
    assert!(left.delays[0] < left.delays[1] && ild_db(&left.responses[0], &left.responses[1]) > 3.0);
    assert!(HrtfSet::open(&folder.0).is_err(), "the folder above holds no responses");
}
