//! Where the taxels of a patch are and which way they face.

use std::collections::HashMap;

use crate::layout::Patch;
use crate::positions::{GeometryError, PositionFile, TaxelPose};

/// Whether directions can be served.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NormalsVerdict {
    /// Every positioned taxel has a normal and they differ as those of a surface do.
    Usable,
    /// All normals are the same: the file's author filled the columns in.
    Placeholder,
    /// Some or all normals are zero.
    Missing,
}

/// The geometry of a patch.
#[derive(Clone, Debug, PartialEq)]
pub struct Geometry {
    /// One per taxel of the patch; `None` where the file has no position.
    pub poses: Vec<Option<TaxelPose>>,
    /// Whether directions can be served.
    pub normals: NormalsVerdict,
    /// What the file has that a user should know, a line each.
    pub remarks: Vec<String>,
}

impl Geometry {
    /// Reads an iCub position file for `patch`, as leniently as [`PositionFile::parse`]; normals are renormalised.
    ///
    /// # Errors
    /// [`GeometryError`] with the line.
    pub fn parse(text: &str, patch: &Patch) -> Result<Self, GeometryError> {
        let file = PositionFile::parse(text)?;
        let rows = file.rows();
        let mut poses = Vec::with_capacity(patch.taxels().len());
        for taxel in 0..patch.taxels().len() {
            let row = patch.port_index(taxel).unwrap_or(usize::MAX);
            let pose = rows.get(row).ok_or(GeometryError::TooFewRows { rows: rows.len(), taxel, row })?;
            poses.push(*pose);
        }
        if poses.iter().all(Option::is_none) {
            return Err(GeometryError::NothingPlaced { taxels: poses.len() });
        }
        Ok(Self::from_poses(poses))
    }

    /// A geometry from poses made elsewhere; normals are renormalised.
    #[must_use]
    pub fn from_poses(mut poses: Vec<Option<TaxelPose>>) -> Self {
        let mut furthest = 0.0_f64;
        for pose in poses.iter_mut().flatten() {
            let (normal, norm) = normalised(pose.normal);
            if norm > 0.0 {
                furthest = furthest.max((norm - 1.0).abs());
                pose.normal = normal;
            }
        }
        let normals = judge_normals(&poses);
        let remarks = remarks(&poses, normals, furthest);
        Self { poses, normals, remarks }
    }

    /// That of a flat array: the first taxel is the origin, columns go along x, rows along y, normals along z.
    #[must_use]
    pub fn grid(rows: u16, columns: u16, pitch_mm: f64) -> Self {
        let metres = |number: u16| f64::from(number) * pitch_mm * 1e-3;
        let pose = |row, column| TaxelPose { position: [metres(column), metres(row), 0.0], normal: [0.0, 0.0, 1.0] };
        let poses = (0..rows).flat_map(|row| (0..columns).map(move |column| Some(pose(row, column)))).collect();
        // Equal normals are a placeholder in a file of positions; here somebody says that the array is flat.
        Self { poses, normals: NormalsVerdict::Usable, remarks: Vec::new() }
    }
}

fn judge_normals(poses: &[Option<TaxelPose>]) -> NormalsVerdict {
    let mut placed = poses.iter().flatten();
    let Some(first) = placed.clone().next() else { return NormalsVerdict::Missing };
    if placed.clone().any(|p| p.normal == [0.0; 3]) {
        return NormalsVerdict::Missing;
    }
    // A single module may well be flat; a whole patch of more than one module whose normals all agree to the last
    // digit is a column that somebody filled in.
    let many = poses.len() > 12;
    if many && placed.all(|p| p.normal == first.normal) { NormalsVerdict::Placeholder } else { NormalsVerdict::Usable }
}

fn remarks(poses: &[Option<TaxelPose>], normals: NormalsVerdict, furthest: f64) -> Vec<String> {
    let mut remarks = Vec::new();
    let missing = poses.iter().filter(|p| p.is_none()).count();
    if missing > 0 {
        remarks.push(format!("{missing} of {} taxels have no position", poses.len()));
    }
    let mut places: HashMap<[u64; 3], usize> = HashMap::new();
    for pose in poses.iter().flatten() {
        *places.entry(pose.position.map(f64::to_bits)).or_default() += 1;
    }
    let repeated: usize = places.values().map(|n| n - 1).sum();
    if repeated > 0 {
        remarks.push(format!("{repeated} taxels repeat the position of another"));
    }
    match normals {
        NormalsVerdict::Usable => {}
        NormalsVerdict::Placeholder => remarks.push("all normals are equal, a placeholder: no vector is served".into()),
        NormalsVerdict::Missing => remarks.push("normals are zero or missing: no vector is served".into()),
    }
    if furthest > 0.01 {
        let off = if furthest > 10.0 { "more than 1000".into() } else { format!("up to {:.0}", furthest * 100.0) };
        remarks.push(format!("normals were {off} % off unit length and have been renormalised"));
    }
    remarks
}

/// The vector at unit length, and its length.
fn normalised(v: [f64; 3]) -> ([f64; 3], f64) {
    let norm = length(v);
    if (1e-100..=1e100).contains(&norm) {
        return (v.map(|n| n / norm), norm);
    }
    // Scaled by its largest component first, so that no square is lost or infinite.
    let largest = v.iter().fold(0.0_f64, |largest, n| largest.max(n.abs()));
    if largest == 0.0 {
        return (v, 0.0);
    }
    let scaled = v.map(|n| n / largest);
    let norm = length(scaled);
    (scaled.map(|n| n / norm), norm * largest)
}

fn length(v: [f64; 3]) -> f64 {
    v.iter().map(|x| x * x).sum::<f64>().sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Board, BoardAddress, BusIndex, Module, ModuleKind};

    fn patch(boards: &[(u8, &[u8])]) -> Patch {
        let boards = boards
            .iter()
            .map(|&(address, modules)| Board {
                bus: BusIndex(0),
                address: BoardAddress::new(address).unwrap(),
                modules: modules.iter().map(|&m| (Module::from_nibble(m), ModuleKind::Triangle)).collect(),
            })
            .collect();
        Patch::new("p", boards).unwrap()
    }

    fn file(rows: &[&str]) -> String {
        format!("name p\nspatial_sampling taxel\ntaxel2Repr ( 3 3 -1 )\n[calibration]\n{}\n", rows.join("\n"))
    }

    #[test]
    fn rows_are_found_by_port_index_and_normals_renormalised() {
        let mut rows = vec!["0 0 0 0 0 0"; 24];
        rows[12] = "0.01\t0.02 0.03  0 0 -0.61";
        rows[13] = "0.01 0.03 0.03 0 0.5 0 # trailing words";
        rows[14] = "0.01 0.03 0.03 0 0 1";
        let geometry = Geometry::parse(&file(&rows), &patch(&[(13, &[0, 1])])).unwrap();
        assert_eq!(geometry.poses[0], None);
        assert_eq!(geometry.poses[10].unwrap().normal, [0.0, 0.0, -1.0]);
        assert_eq!(geometry.normals, NormalsVerdict::Usable);
        assert!(geometry.remarks.iter().any(|r| r.contains("17 of 20 taxels have no position")));
        assert!(geometry.remarks.iter().any(|r| r.contains("50 % off unit length")));
        assert!(geometry.remarks.iter().any(|r| r.contains("1 taxels repeat the position")));
    }

    #[test]
    fn placeholder_and_missing_normals_are_recognised() {
        let rows: Vec<String> = (0..24).map(|i| format!("0.01 {} 0.03 1 0 0", 0.001 * f64::from(i))).collect();
        let rows: Vec<&str> = rows.iter().map(String::as_str).collect();
        let patch = patch(&[(13, &[0, 1])]);
        assert_eq!(Geometry::parse(&file(&rows), &patch).unwrap().normals, NormalsVerdict::Placeholder);
        let bare = file(&rows).replace("1 0 0", "0 0 0");
        assert_eq!(Geometry::parse(&bare, &patch).unwrap().normals, NormalsVerdict::Missing);
    }

    #[test]
    fn errors_name_the_line() {
        let patch = patch(&[(13, &[0])]);
        let text = file(&["1 2 3 4 5"]);
        assert!(Geometry::parse(&text, &patch).unwrap_err().to_string().starts_with("line 5: `1 2 3 4 5`"));
        assert!(matches!(Geometry::parse(&file(&["nan 0 0 0 0 0"]), &patch), Err(GeometryError::Row { .. })));
        assert!(matches!(Geometry::parse(&file(&["30.8 0 0 0 0 1"]), &patch), Err(GeometryError::NotMetres { .. })));
        assert!(matches!(Geometry::parse(&file(&["0 0 1 0 0 1"]), &patch), Err(GeometryError::TooFewRows { .. })));
        assert_eq!(Geometry::parse("name x", &patch), Err(GeometryError::NoSection));
    }
}
