//! Reviews of what a scene requires, in words.

use ivv::internals::train::Review;

/// A review in one line, or two if it also tested the cameras' grids of colours.
pub fn describe(review: &Review) -> String {
    let Review { step, before, after, removed, merged, came_to_rest, began_to_move, lost_bands, grids, .. } = review;
    let mut lines = Vec::new();
    if !grids.is_empty() {
        let needing: Vec<&str> = grids.iter().filter(|check| check.is_needed).map(|check| &*check.camera).collect();
        let list = if needing.is_empty() { "none".to_owned() } else { needing.join(", ") };
        lines.push(format!("step {step}: of {} cameras without a colour grid, these need one: {list}", grids.len()));
    }
    if review.noise > 0.0 {
        let [one, two, three] = lost_bands;
        let Review { pictures, budget, unseen, left, .. } = review;
        lines.push(format!(
            "step {step}: reviewed {pictures} training images of {budget} allowed; {left} Gaussians are in too few of them and \
             stay unchanged, {unseen} of these are in none"
        ));
        lines.push(format!(
            "step {step}: {before} Gaussians, {after} required: {removed} removed, {merged} merged; {came_to_rest} became \
             static, {began_to_move} dynamic; bands 1 / 2 / 3 dropped from {one} / {two} / {three} Gaussians, because they \
             were worth less than they cost (colour error {:.3}, price {:.2})",
            review.noise, review.price
        ));
    }
    lines.join("\n")
}
