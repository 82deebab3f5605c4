//! Modules in planes of their own, and the surface around a module unfolded into its plane.

use nalgebra::{Matrix3, Vector3};

use crate::polygon::Point;

/// Planes that are less apart than this, as the sine of the angle between them, are one.
const SAME_PLANE: f64 = 1e-9;

/// The plane that fits the taxels of a module best: a module is a small flexible board and nearly flat.
pub struct Plane {
    centre: Vector3<f64>,
    axes: [Vector3<f64>; 2],
    normal: Vector3<f64>,
}

impl Plane {
    /// The plane with the least sum of squared distances: its normal is the direction of the least spread.
    pub fn fit(places: &[Vector3<f64>]) -> Self {
        let centre = places.iter().sum::<Vector3<f64>>() / places.len().max(1) as f64;
        let spread: Matrix3<f64> = places.iter().map(|place| (place - centre) * (place - centre).transpose()).sum();
        let eigen = spread.symmetric_eigen();
        let normal: Vector3<f64> = eigen.eigenvectors.column(eigen.eigenvalues.imin()).into();
        let first: Vector3<f64> = eigen.eigenvectors.column(eigen.eigenvalues.imax()).into();
        Self { centre, axes: [first, normal.cross(&first)], normal }
    }

    /// Where a place is in this plane, seen along the normal.
    pub fn project(&self, place: Vector3<f64>) -> Point {
        self.flat(place - self.centre)
    }

    /// Where a place on the plane `other` comes to lie when that is folded down into this one, about the line in which
    /// the two meet.
    ///
    /// A step along the surface is a part along that line, which stays, and one across it: h1 in this plane and h2 in the
    /// other. Both are at half the angle between the planes from the direction across in the middle, so that the
    /// component of the step in this direction is (h1 + h2) times the cosine of that half. Folded down, the step across
    /// is h1 + h2.
    pub fn unfold(&self, place: Vector3<f64>, other: &Self) -> Point {
        // Which side of a plane is its front nobody said: a surface bends by less than a right angle between modules.
        let normal = if self.normal.dot(&other.normal) < 0.0 { -other.normal } else { other.normal };
        let line = self.normal.cross(&normal);
        if line.norm() < SAME_PLANE {
            return self.project(place);
        }
        let line = line.normalize();
        let [across_here, across_there] = [self.normal, normal].map(|normal| line.cross(&normal));
        let middle = (across_here + across_there).normalize();
        let step = place - self.centre;
        let across = step.dot(&middle) / middle.dot(&across_here);
        self.flat(line * step.dot(&line) + across_here * across)
    }

    fn flat(&self, step: Vector3<f64>) -> Point {
        self.axes.map(|axis| axis.dot(&step))
    }
}
