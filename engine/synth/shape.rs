//! Rays against analytic surfaces, in each surface's own frame.

use glam::DVec3;

#[derive(Clone, Copy, Debug)]
pub(super) enum Shape {
    Block(DVec3),
    /// The inside of a box of these half sides.
    Room(DVec3),
    Sphere(f64),
    /// All points at `radius` from the segment of half length `half` along y.
    Capsule {
        half: f64,
        radius: f64,
    },
}

#[derive(Clone, Copy, Debug)]
pub(super) struct Touch {
    /// Along the ray, in lengths of its direction; positive.
    pub t: f64,
    /// Unit, against the ray's side.
    pub normal: DVec3,
    /// Of a box: twice the axis the face is perpendicular to, plus one for the positive side. Otherwise 0.
    pub face: usize,
}

impl Shape {
    /// The first point of the ray `origin + t * direction`, t > 0, seen from outside (a room: from inside).
    pub fn touch(&self, origin: DVec3, direction: DVec3) -> Option<Touch> {
        match *self {
            Shape::Block(half) => block(origin, direction, half),
            Shape::Room(half) => room(origin, direction, half),
            Shape::Sphere(radius) => sphere(origin, direction, radius),
            Shape::Capsule { half, radius } => capsule(origin, direction, half, radius),
        }
    }

    pub fn bound(&self) -> f64 {
        match *self {
            Shape::Block(half) | Shape::Room(half) => half.length(),
            Shape::Sphere(radius) => radius,
            Shape::Capsule { half, radius } => half + radius,
        }
    }
}

/// Entry and exit of the slabs of a box: (t, axis) each.
fn slabs(origin: DVec3, direction: DVec3, half: DVec3) -> [(f64, usize); 2] {
    let (mut enter, mut exit) = ((f64::NEG_INFINITY, 0), (f64::INFINITY, 0));
    for axis in 0..3 {
        // A ray along the slab gives infinities of the right signs.
        let inverse = 1.0 / direction[axis];
        let (a, b) = ((-half[axis] - origin[axis]) * inverse, (half[axis] - origin[axis]) * inverse);
        let (near, far) = if a < b { (a, b) } else { (b, a) };
        if near > enter.0 {
            enter = (near, axis);
        }
        if far < exit.0 {
            exit = (far, axis);
        }
    }
    [enter, exit]
}

fn face_normal(axis: usize, positive: bool) -> DVec3 {
    DVec3::AXES[axis] * if positive { 1.0 } else { -1.0 }
}

fn block(origin: DVec3, direction: DVec3, half: DVec3) -> Option<Touch> {
    let [(t, axis), (exit, _)] = slabs(origin, direction, half);
    if !(t > 0.0 && t <= exit) {
        return None;
    }
    let positive = direction[axis] < 0.0;
    Some(Touch { t, normal: face_normal(axis, positive), face: 2 * axis + usize::from(positive) })
}

fn room(origin: DVec3, direction: DVec3, half: DVec3) -> Option<Touch> {
    let [_, (t, axis)] = slabs(origin, direction, half);
    let positive = direction[axis] > 0.0;
    (t > 0.0).then(|| Touch { t, normal: face_normal(axis, !positive), face: 2 * axis + usize::from(positive) })
}

fn sphere(origin: DVec3, direction: DVec3, radius: f64) -> Option<Touch> {
    let (a, b) = (direction.length_squared(), origin.dot(direction));
    let discriminant = b * b - a * (origin.length_squared() - radius * radius);
    if discriminant < 0.0 {
        return None;
    }
    let t = (-b - discriminant.sqrt()) / a;
    (t > 0.0).then(|| Touch { t, normal: (origin + t * direction) / radius, face: 0 })
}

fn capsule(origin: DVec3, direction: DVec3, half: f64, radius: f64) -> Option<Touch> {
    let flat = DVec3::new(1.0, 0.0, 1.0);
    let (o, d) = (origin * flat, direction * flat);
    let (a, b) = (d.length_squared(), o.dot(d));
    let discriminant = b * b - a * (o.length_squared() - radius * radius);
    let side = (a > 0.0 && discriminant >= 0.0).then(|| (-b - discriminant.sqrt()) / a);
    if let Some(t) = side.filter(|t| *t > 0.0 && (origin.y + t * direction.y).abs() <= half) {
        return Some(Touch { t, normal: (o + t * d) / radius, face: 0 });
    }
    // Off the side, the ray can only meet a cap; what it meets there is in front of everything else.
    let caps = [half, -half].map(|y| sphere(origin - DVec3::Y * y, direction, radius));
    caps.into_iter().flatten().min_by(|a, b| a.t.total_cmp(&b.t))
}
