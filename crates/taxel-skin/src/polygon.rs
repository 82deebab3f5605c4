//! Convex polygons in a plane: hull, growth, cut and area.

use std::f64::consts::TAU;

/// A point of the plane; the unit is the caller's.
pub type Point = [f64; 2];

/// A hull whose area is below this share of the square of its extent is a line.
const LINE_SHARE: f64 = 1e-6;

/// No corner of a grown polygon is further from that of the original than so many times the distance by which it grew.
/// At the corner of a triangle of equal sides it is 2.
const SPIKE: f64 = 3.0;

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

    /// The distance by which all sides must move out for this polygon to have `area`; 0 if it is larger already.
    ///
    /// Sides that move out by r add `perimeter r`, corners `c r^2` each; see [`Self::grown`].
    pub fn rim_to(&self, area: f64) -> f64 {
        let (perimeter, lacking) = (self.perimeter(), (area - self.area()).max(0.0));
        let corners: f64 = self.turns().map(|(_, _, turn)| corner_share(turn)).sum();
        2.0 * lacking / (perimeter + (perimeter * perimeter + 4.0 * corners * lacking).sqrt())
    }

    /// This polygon with all sides moved out by `distance`. Corners stay sharp, but for those that would come to lie
    /// further out than [`SPIKE`] times the distance: these are cut off there.
    pub fn grown(&self, distance: f64) -> Self {
        let mut corners = Vec::new();
        for (corner, first, turn) in self.turns() {
            let at = |angle: f64, far: f64| {
                [corner[0] + distance * far * angle.cos(), corner[1] + distance * far * angle.sin()]
            };
            let (half, middle) = (0.5 * turn, first + 0.5 * turn);
            if half.cos() * SPIKE >= 1.0 {
                corners.push(at(middle, 1.0 / half.cos()));
            } else {
                // Where the side at `first`, one away from the corner, is SPIKE away along the middle.
                let along = (SPIKE - half.cos()) / half.sin();
                let (far, aside) = (along.hypot(1.0), along.atan());
                corners.extend([at(first + aside, far), at(first + turn - aside, far)]);
            }
        }
        Self(corners)
    }

    /// Each corner with the angle at which the side before it faces outwards, and the angle from there to the next.
    fn turns(&self) -> impl Iterator<Item = (Point, f64, f64)> + '_ {
        let n = self.0.len();
        (0..n).map(move |i| {
            let (before, corner, after) = (self.0[(i + n - 1) % n], self.0[i], self.0[(i + 1) % n]);
            let first = outward_angle(minus(corner, before));
            (corner, first, (outward_angle(minus(after, corner)) - first).rem_euclid(TAU))
        })
    }

    /// The sides, counter-clockwise.
    pub fn sides(&self) -> impl Iterator<Item = [Point; 2]> + '_ {
        let n = self.0.len();
        (0..n).map(move |i| [self.0[i], self.0[(i + 1) % n]])
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
        self.sides().map(|[from, to]| length(minus(to, from))).sum()
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

/// What a corner adds to the area of a polygon whose sides move out by 1, where the direction turns by `turn`: two right
/// triangles, without the tip beyond [`SPIKE`].
fn corner_share(turn: f64) -> f64 {
    let (sine, cosine) = (0.5 * turn).sin_cos();
    let tip = (1.0 / cosine - SPIKE).max(0.0);
    if tip > 0.0 { sine / cosine - tip * tip * cosine / sine } else { sine / cosine }
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
    fn a_grown_square_is_a_square() {
        assert_eq!(square().0.len(), 4);
        let grown = square().grown(1.0);
        assert_eq!(grown.0.len(), 4);
        assert!((grown.area() - 16.0).abs() < 1e-12 && grown.contains([-0.999, 2.999]), "{grown:?}");
        assert!((square().rim_to(16.0) - 1.0).abs() < 1e-12);
        assert_eq!(square().rim_to(3.0).to_bits(), 0.0_f64.to_bits());
    }

    #[test]
    fn a_sharp_corner_does_not_become_a_spike() {
        let needle = Convex::hull(&[[0.0, 0.0], [20.0, -1.0], [20.0, 1.0]]).unwrap();
        let grown = needle.grown(2.0);
        assert_eq!(grown.0.len(), 4, "the tip is cut off");
        let tip = grown.0.iter().map(|corner| corner[0]).fold(f64::MAX, f64::min);
        assert!((tip + 2.0 * SPIKE).abs() < 1e-9, "{grown:?}");
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
        fn a_rim_brings_the_area_that_is_asked_for(
            points in proptest::collection::vec([-10.0_f64..10.0, -10.0_f64..10.0], 3..12), more in 0.0_f64..300.0,
        ) {
            let Some(hull) = Convex::hull(&points) else { return Ok(()) };
            let wanted = hull.area() + more;
            let grown = hull.grown(hull.rim_to(wanted)).area();
            prop_assert!((grown / wanted - 1.0).abs() < 1e-9, "{grown} mm2, wanted {wanted}");
        }

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
