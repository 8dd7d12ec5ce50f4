//! Who speaks.

use std::f64::consts::TAU;

use ivv::internals::sound::speaker::gates;

const FPS: f64 = 30.0;

/// Lips at 4 Hz from the frame `from` to `to`, elsewhere slightly and slowly open.
fn lips(from: usize, to: usize) -> Vec<f64> {
    let opening = |frame: usize| {
        let t = frame as f64 / FPS;
        0.1 + 0.05 * (TAU * 0.1 * t).sin() + if (from..to).contains(&frame) { 0.2 * (TAU * 4.0 * t).sin() } else { 0.0 }
    };
    (0..180).map(opening).collect()
}

#[test]
fn the_one_whose_lips_move_has_the_word() {
    let loud = vec![0.1; 180];
    // The second speaks from 2 to 4 s.
    let mut first = lips(0, 60);
    first[120..].copy_from_slice(&lips(120, 180)[120..]);
    let found = gates(&[first.clone(), lips(60, 120)], &loud, FPS);
    assert_eq!(found, [vec![(0.0, 2.0), (4.0, 6.0)], vec![(2.0, 4.0)]]);
    // Chewing in silence is no speech.
    let mut silent = loud.clone();
    silent[60..120].fill(0.0);
    assert_eq!(gates(&[first, lips(60, 120)], &silent, FPS), [vec![(0.0, 6.0)], vec![]]);
}

#[test]
fn lips_that_are_not_seen_decide_nothing() {
    let unseen = vec![f64::NAN; 180];
    assert_eq!(gates(&[unseen.clone(), unseen.clone()], &[0.1; 180], FPS), [vec![(0.0, 6.0)], vec![]]);
    assert_eq!(gates(&[unseen, lips(0, 180)], &[0.1; 180], FPS)[1], [(0.0, 6.0)]);
    // The last window is shorter.
    assert_eq!(gates(&[lips(0, 180)], &[0.1; 40], FPS), [vec![(0.0, 40.0 / FPS)]]);
    assert!(gates(&[], &[0.1; 40], FPS).is_empty());
}
