//! Convex polygons in a plane: hull, growth, cut and area.

use std::f64::consts::{PI, TAU};

/// A point of the plane; the unit is the caller's.
pub type Point = [f64; 2];

/// A hull whose area is below this share of the square of its extent is a line.
const LINE_SHARE: f64 = 1e-6;

/// Round corners are drawn with chords over at most this angle, in radians: a full disc of them lacks 0.3 % of its area.
const ARC_STEP: f64 = TAU / 48.0;

/// A convex polygon, its corners counter-clockwise. Without corners it is empty.
#[derive(Clone, Debug, PartialEq)]
pub struct Convex(Vec<Point>);

impl Convex {
    /// The convex hull of `points` (monotone chain, Andrew 1979); `None` if they lie on a line.
    pub fn hull(points: &[Point]) -> Option<Self> {
        let mut sorted = points.to_vec();
        sorted.sort_by(|a, b| a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1])));
        sorted.dedup();
        let mut corners = half_hull(sorted.iter().copied());
        corners.extend(half_hull(sorted.iter().rev().copied()));
        let hull = Self(corners);
        let extent = hull.0.iter().flat_map(|a| hull.0.iter().map(|b| length(minus(*a, *b)))).fold(0.0, f64::max);
        (hull.0.len() >= 3 && hull.area() > LINE_SHARE * extent * extent).then_some(hull)
    }

    /// This polygon with a rim of equal width that brings it to `area`; itself if it is larger already.
    ///
    /// A rim of width r adds `perimeter r + pi r^2` (Steiner 1840).
    pub fn grown_to(&self, area: f64) -> Self {
        let (perimeter, lacking) = (self.perimeter(), area - self.area());
        if lacking > 0.0 {
            self.grown(2.0 * lacking / (perimeter + (perimeter * perimeter + 4.0 * PI * lacking).sqrt()))
        } else {
            self.clone()
        }
    }

    /// All points within `distance` of this polygon: straight along its sides, round at its corners.
    fn grown(&self, distance: f64) -> Self {
        let n = self.0.len();
        let mut corners = Vec::new();
        for (i, &corner) in self.0.iter().enumerate() {
            let (before, after) = (self.0[(i + n - 1) % n], self.0[(i + 1) % n]);
            let first = outward_angle(minus(corner, before));
            let turn = (outward_angle(minus(after, corner)) - first).rem_euclid(TAU);
            let steps = (turn / ARC_STEP).ceil().max(1.0);
            corners.extend((0..=steps as usize).map(|step| {
                let angle = first + turn * step as f64 / steps;
                [corner[0] + distance * angle.cos(), corner[1] + distance * angle.sin()]
            }));
        }
        Self(corners)
    }

    /// Cuts off all points whose component along `direction` is beyond `limit` (Sutherland and Hodgman 1974).
    pub fn cut(&mut self, direction: Point, limit: f64) {
        let excess = |p: Point| p[0] * direction[0] + p[1] * direction[1] - limit;
        let n = self.0.len();
        let mut kept = Vec::with_capacity(n + 1);
        for (i, &here) in self.0.iter().enumerate() {
            let next = self.0[(i + 1) % n];
            let (a, b) = (excess(here), excess(next));
            if a <= 0.0 {
                kept.push(here);
            }
            if (a < 0.0 && b > 0.0) || (a > 0.0 && b < 0.0) {
                let share = a / (a - b);
                kept.push([here[0] + share * (next[0] - here[0]), here[1] + share * (next[1] - here[1])]);
            }
        }
        self.0 = kept;
    }

    fn perimeter(&self) -> f64 {
        let n = self.0.len();
        (0..n).map(|i| length(minus(self.0[(i + 1) % n], self.0[i]))).sum()
    }

    /// Distance from `point` to the furthest corner.
    pub fn radius_about(&self, point: Point) -> f64 {
        self.0.iter().map(|corner| length(minus(*corner, point))).fold(0.0, f64::max)
    }

    /// Whether `point` lies inside or on the rim.
    #[cfg(test)]
    pub fn contains(&self, point: Point) -> bool {
        let n = self.0.len();
        (0..n).all(|i| cross(minus(self.0[(i + 1) % n], self.0[i]), minus(point, self.0[i])) >= 0.0)
    }

    /// Area in squared units, 0 or more.
    pub fn area(&self) -> f64 {
        let Some(&first) = self.0.first() else { return 0.0 };
        // Seen from a corner of its own, so that a polygon far from the origin loses no digits.
        let doubled: f64 = self.0.windows(2).map(|side| cross(minus(side[0], first), minus(side[1], first))).sum();
        (0.5 * doubled).max(0.0)
    }
}

/// The corners of the lower hull of sorted points, without the last one, which begins the upper hull.
fn half_hull(points: impl Iterator<Item = Point>) -> Vec<Point> {
    let mut corners: Vec<Point> = Vec::new();
    for point in points {
        while let [.., a, b] = corners[..]
            && cross(minus(b, a), minus(point, a)) <= 0.0
        {
            corners.pop();
        }
        corners.push(point);
    }
    corners.pop();
    corners
}

/// The angle of the normal that points out of a polygon with this side.
fn outward_angle(side: Point) -> f64 {
    (-side[0]).atan2(side[1])
}

/// The vector from `b` to `a`.
pub fn minus(a: Point, b: Point) -> Point {
    [a[0] - b[0], a[1] - b[1]]
}

/// Length of a vector.
pub fn length(v: Point) -> f64 {
    v[0].hypot(v[1])
}

fn cross(a: Point, b: Point) -> f64 {
    a[0] * b[1] - a[1] * b[0]
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn square() -> Convex {
        Convex::hull(&[[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0], [1.0, 1.0], [1.0, 0.0]]).unwrap()
    }

    #[test]
    fn a_grown_square_has_straight_sides_and_round_corners() {
        assert_eq!(square().0.len(), 4);
        let area = square().grown(1.0).area();
        let exact = 4.0 + 8.0 + PI;
        assert!(area < exact && area > exact - 0.003 * PI, "{area}, exactly {exact}");
    }

    #[test]
    fn a_rim_brings_the_area_that_is_asked_for() {
        let area = square().grown_to(15.0).area();
        assert!((area / 15.0 - 1.0).abs() < 2e-3, "{area}");
        assert_eq!(square().grown_to(3.0), square());
    }

    #[test]
    fn points_on_a_line_have_no_hull() {
        assert_eq!(Convex::hull(&[[0.0, 0.0], [1.0, 1.0], [2.0, 2.0]]), None);
        assert_eq!(Convex::hull(&[[0.0, 0.0], [1.0, 1.0]]), None);
        assert_eq!(Convex::hull(&[]), None);
    }

    #[test]
    fn a_cut_beyond_everything_leaves_nothing() {
        let mut gone = square();
        gone.cut([1.0, 0.0], -1.0);
        assert_eq!(gone.area().to_bits(), 0.0_f64.to_bits());
    }

    proptest! {
        #[test]
        fn both_sides_of_a_cut_add_up(
            points in proptest::collection::vec([-10.0_f64..10.0, -10.0_f64..10.0], 3..12),
            angle in 0.0_f64..TAU, limit in -10.0_f64..10.0,
        ) {
            let Some(whole) = Convex::hull(&points) else { return Ok(()) };
            let direction = [angle.cos(), angle.sin()];
            let (mut one, mut other) = (whole.clone(), whole.clone());
            one.cut(direction, limit);
            other.cut(direction.map(|c| -c), -limit);
            prop_assert!((one.area() + other.area() - whole.area()).abs() < 1e-9 * whole.area().max(1.0));
        }
    }
}
