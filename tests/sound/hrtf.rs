//! Responses between the measured directions: T11, T12, T13.

use super::measure::{energy, itd, lsd_db};
use super::{db, head, horizon, noise, sadie, scene, sphere, track};
use crate::common::prelude::*;
use ivv::internals::sound::geometry::Mode;
use ivv::internals::sound::hrtf::degrees;
use ivv::internals::sound::hull::Hull;
use ivv::internals::sound::sphere::SPEED_OF_SOUND;
use ivv::internals::sound::wola::Baker;

fn directions(n: usize, seed: u64) -> Vec<DVec3> {
    noise(3 * n, seed).chunks(3).map(|v| DVec3::new(v[0].into(), v[1].into(), v[2].into()).normalize()).collect()
}

/// Rings as measurements have them, many points to a plane, and nothing below -40 degrees.
fn rings() -> Vec<DVec3> {
    let ring =
        |el: i32| (0..360).step_by(if el > 60 { 30 } else { 10 }).map(move |az| degrees(f64::from(az), f64::from(el)));
    (-4..9).flat_map(|k| ring(10 * k)).chain([DVec3::Z]).collect()
}

#[test]
fn t11_a_hull_is_closed_and_holds_every_direction_once() {
    for points in [rings(), directions(200, 11), sphere().directions.to_vec()] {
        let hull = Hull::new(&points).unwrap();
        let faces = hull.triangles.len();
        let mut edges: Vec<[usize; 2]> = hull
            .triangles
            .iter()
            .flat_map(|[a, b, c]| [[*a.min(b), *a.max(b)], [*b.min(c), *b.max(c)], [*c.min(a), *c.max(a)]])
            .collect();
        edges.sort_unstable();
        edges.dedup();
        assert_eq!(points.len() + faces, edges.len() + 2);
        for to in directions(300, 12) {
            let weights = hull.locate(to);
            let sum: f64 = weights.iter().map(|(_, weight)| weight).sum();
            assert!(weights.iter().all(|(_, weight)| *weight >= 0.0) && (sum - 1.0).abs() < 1e-6);
            // The weighted corners lie in the direction.
            let mixed: DVec3 = weights.iter().map(|(at, weight)| points[*at].normalize() * *weight).sum();
            assert!((mixed.normalize() - to).length() < 1e-6);
            let holds = |[a, b, c]: &[usize; 3]| {
                let [a, b, c] = [a, b, c].map(|at| points[*at].normalize());
                to.dot(b.cross(c)) > 0.0 && to.dot(c.cross(a)) > 0.0 && to.dot(a.cross(b)) > 0.0
            };
            assert_eq!(hull.triangles.iter().filter(|face| holds(face)).count(), 1);
        }
        let sees_itself =
            |at: usize| hull.locate(points[at]).iter().any(|(found, weight)| *found == at && *weight > 1.0 - 1e-5);
        assert!((0..points.len()).all(sees_itself));
    }
    assert!(Hull::new(&[DVec3::X, DVec3::Y, DVec3::Z]).is_none());
    assert!(Hull::new(&rings().into_iter().filter(|to| to.z == 0.0).collect::<Vec<_>>()).is_none());
}

#[test]
fn t11_responses_are_continuous_across_edges() {
    let set = sphere();
    let points = &set.directions;
    for [a, b, _] in set.hull.triangles.iter().step_by(7) {
        let on_edge = (points[*a] * 0.6 + points[*b] * 0.4).normalize();
        let across = on_edge.cross(points[*a] - points[*b]).normalize();
        let [one, other] = [1.0, -1.0].map(|side| set.filter(on_edge + side * 1e-6 * across, Lookup::Aligned));
        let worst = one.responses.iter().flatten().zip(other.responses.iter().flatten()).map(|(a, b)| (a - b).abs());
        assert!(worst.fold(0.0, f32::max) < 1e-5);
        assert!((0..2).all(|ear| (one.delays[ear] - other.delays[ear]).abs() < 1e-3));
    }
}

/// The response to an ear as it sounds, its onset where the set has it.
fn sounding(set: &HrtfSet, to: DVec3, ear: usize, lookup: Lookup) -> Vec<f32> {
    let baked = Baker::new(set.taps(lookup), set.max_delay()).bake(&set.filter(to, lookup));
    baked[ear][64 - set.latency..].to_vec()
}

/// What differs at most between the responses of some directions and what the set gives in them, decibels.
fn error_db(set: &HrtfSet, directions: impl Iterator<Item = usize>, lookup: Lookup) -> f64 {
    let mut baker = Baker::new(set.taps(lookup), set.max_delay());
    let errors = directions.flat_map(|at| {
        let baked = baker.bake(&set.filter(set.directions[at], lookup));
        [0, 1].map(|ear| {
            let (raw, given) = (set.raw(at, ear), &baked[ear][64 - set.latency..]);
            let differences: Vec<f32> = raw.iter().zip(given).map(|(a, b)| a - b).collect();
            energy(&differences) / energy(raw)
        })
    });
    db(errors.fold(0.0, f64::max))
}

#[test]
fn t12_in_a_measured_direction_the_measured_response_sounds() {
    let check = |name: &str, set: &HrtfSet| {
        let all = 0..set.directions.len();
        let aligned = error_db(set, all.clone(), Lookup::Aligned);
        let nearest = error_db(set, all.step_by(9), Lookup::Nearest);
        println!("{name}: aligned {aligned:.1} dB, nearest {nearest:.1} dB, cut off {:.1} dB", set.alignment_db);
        assert!(aligned < -70.0 && nearest < -110.0 && set.alignment_db < -70.0, "{name}: {aligned} {nearest} dB");
    };
    check("sphere", sphere());
    if let Some(set) = kemar() {
        check("KEMAR", set);
    }
    if let Some(set) = sadie() {
        check("SADIE 002", set);
    }
}

/// MIT's KEMAR, where it is there.
#[track_caller]
fn kemar() -> Option<&'static HrtfSet> {
    static SET: OnceLock<HrtfSet> = OnceLock::new();
    let file = shared("data/hrtf_sofa/share/MIT_KEMAR_normal_pinna.sofa")?;
    Some(SET.get_or_init(|| HrtfSet::open(&file).unwrap()))
}

/// Errors of a set in directions that were left out of it: mean and 95th percentile of time between the ears in
/// microseconds, mean spectral distance, and that of mixing without alignment.
fn left_out(set: &HrtfSet, without: &HrtfSet, left_out: &[usize]) -> [f64; 4] {
    let (mut times, mut aligned, mut unaligned) = (Vec::new(), Vec::new(), Vec::new());
    for at in left_out {
        let to = set.directions[*at];
        let ears = [0, 1].map(|ear| sounding(without, to, ear, Lookup::Aligned));
        times.push(1e6 * (itd(&ears[0], &ears[1]) - itd(set.raw(*at, 0), set.raw(*at, 1))).abs());
        let corners = without.hull.locate(to);
        for (ear, given) in ears.iter().enumerate() {
            let mut mixed = vec![0.0; set.raw(*at, ear).len()];
            for (corner, weight) in corners {
                mixed.iter_mut().zip(without.raw(corner, ear)).for_each(|(to, from)| *to += weight as f32 * from);
            }
            aligned.push(lsd_db(&given[..mixed.len()], set.raw(*at, ear)));
            unaligned.push(lsd_db(&mixed, set.raw(*at, ear)));
        }
    }
    times.sort_by(f64::total_cmp);
    let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
    [mean(&times), times[times.len() * 95 / 100], mean(&aligned), mean(&unaligned)]
}

/// T13's bound of the 95th percentile, seconds.
const TIME_95: f64 = 12e-6;

/// How far the corners around a direction may be, radians, so that T13 can be met at all. The time between a sphere's ears is
/// 3a/c sin(azimuth) at most (Kuhn 1977), so a straight line between corners a distance `d` to either side is off by up to
/// 3a/c d^2 / 2, which is the bound where `d` is 10 degrees. Farther apart a set is too coarse for it, or ends there.
fn widest_gap() -> f64 {
    (2.0 * TIME_95 / (3.0 * Sphere::default().radius / SPEED_OF_SOUND)).sqrt()
}

fn check_left_out(name: &str, set: &HrtfSet, every: usize) {
    let gap = widest_gap();
    let all: Vec<usize> = (0..set.directions.len()).step_by(every).collect();
    let without = set.without(&all).unwrap();
    let is_near = |at: &usize| {
        let to = set.directions[*at];
        without
            .hull
            .locate(to)
            .iter()
            .all(|(corner, weight)| *weight < 1e-6 || without.directions[*corner].angle_between(to) < gap)
    };
    let n_all = all.len();
    let some: Vec<usize> = all.into_iter().filter(is_near).collect();
    // Most of a set is dense enough.
    assert!(some.len() > 8 && 5 * some.len() > 3 * n_all, "{name}: {} of {n_all}", some.len());
    let [time, time_95, aligned, unaligned] = left_out(set, &without, &some);
    println!(
        "{name}: {} of {n_all} directions left out: {time:.1} us, p95 {time_95:.1} us, {aligned:.2} dB, unaligned {unaligned:.2} dB",
        some.len()
    );
    assert!(time <= 5.0 && time_95 <= 1e6 * TIME_95, "{name}: {time} us, p95 {time_95} us");
    assert!(aligned <= 2.5 && aligned <= 0.6 * unaligned, "{name}: {aligned} dB, unaligned {unaligned} dB");
}

#[test]
fn t13_directions_left_out_are_met_on_the_sphere() {
    check_left_out("sphere", horizon(), 7);
}

#[test]
fn t13_directions_left_out_are_met_on_the_kemar() {
    let Some(set) = kemar() else { return };
    assert_eq!(set.directions.len(), 710);
    check_left_out("KEMAR", set, 29);
}

#[test]
fn t13_directions_left_out_are_met_on_sadie() {
    let Some(set) = sadie() else { return };
    assert_eq!((set.directions.len(), set.meta.licence.as_str()), (1550, "Apache License"));
    check_left_out("SADIE 002", set, 19);
}

#[test]
fn a_set_of_a_human_is_taken() {
    let Some(path) = shared("data/hrtf_sofa/tests/LISTEN_1002_IRC_1002_C_HRIR.sofa") else { return };
    let set = HrtfSet::open(&path).unwrap();
    assert_eq!(set.directions.len(), 187);
    let left = set.filter(DVec3::Y, Lookup::Aligned);
    assert!(left.delays[1] - left.delays[0] > 20.0, "{:?}", left.delays);
}

/// The coarse sphere with the responses of each ear `earlier` by samples that are told as delays beside them, cut to `taps`.
fn told_apart(earlier: [usize; 2], taps: usize) -> HrtfSet {
    let mut measured = Sphere::default().measured(3);
    for (ears, delays) in measured.irs.iter_mut().zip(&mut measured.delays) {
        for (ear, response) in ears.iter_mut().enumerate() {
            response.drain(..earlier[ear]);
            response.resize(taps, 0.0);
            delays[ear] = earlier[ear] as f64;
        }
    }
    HrtfSet::new(measured, Path::new("told apart")).unwrap()
}

#[test]
fn delays_beside_the_responses_are_heard_with_either_lookup() {
    let (whole, apart) = (sphere(), told_apart([0, 12], 256));
    for (lookup, most) in [(Lookup::Aligned, -50.0), (Lookup::Nearest, -50.0)] {
        for to in [DVec3::X, DVec3::Y, -DVec3::Y] {
            for ear in 0..2 {
                let [a, b] = [whole, &apart].map(|set| sounding(set, to, ear, lookup));
                let differences: Vec<f32> = a.iter().zip(&b).map(|(a, b)| a - b).collect();
                let error = db(energy(&differences) / energy(&a));
                assert!(error < most, "{lookup:?}, {to}, ear {ear}: {error:.0} dB");
            }
        }
    }
}

#[test]
fn close_to_the_head_short_responses_are_heard_too() {
    let set = told_apart([30, 30], 62);
    let way = scene(track("a", &[(0.0, DVec3::new(0.0, 0.1, 0.0))]));
    let config = RenderConfig { mode: Mode::Physical, lookup: Lookup::Nearest, ..RenderConfig::default() };
    let heard = render_signals(&way, &[noise(2000, 3)], &head(DVec3::ZERO, 0.0), &set, &config).unwrap();
    assert!(heard.samples.iter().any(|[left, right]| left.abs() > 0.01 && right.abs() > 0.01));
}
