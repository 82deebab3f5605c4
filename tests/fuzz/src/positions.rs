//! iCub's position files.

use std::fmt::Write as _;

use taxel_skin::{
    Board, BoardAddress, BusIndex, Geometry, GeometryError, Module, ModuleKind, Patch, PositionFile, TaxelPose,
};

/// A text, read as a position file and as the geometry of patches.
pub fn run(data: &[u8]) {
    let Ok(text) = std::str::from_utf8(data) else { return };
    match PositionFile::parse(text) {
        Ok(file) => check(&file, text),
        Err(error) => check_error(&error, text),
    }
    for patch in [patch(&[ModuleKind::Cells(1)]), patch(&[ModuleKind::Triangle, ModuleKind::PalmPad7])] {
        check_geometry(&Geometry::parse(text, &patch), &patch, text);
    }
}

fn check(file: &PositionFile, text: &str) {
    let rows = file.rows();
    assert!(rows.len() <= text.lines().count(), "a row has a line");
    assert!(file.modules().len() <= rows.len().div_ceil(12));
    let placed = rows.iter().flatten().flat_map(|pose| pose.position);
    assert!(placed.into_iter().all(|metres| metres.abs() <= 10.0));
    if rows.is_empty() {
        return; // of a file that has but a section nothing can be read again without it
    }
    assert_eq!(PositionFile::parse(&written(file)).as_ref(), Ok(file));
}

fn written(file: &PositionFile) -> String {
    let mut text = file.name().map_or_else(String::new, |name| format!("name {name}\n"));
    text += "[calibration]\n";
    for row in file.rows() {
        let TaxelPose { position: [x, y, z], normal: [nx, ny, nz] } =
            row.unwrap_or(TaxelPose { position: [0.0; 3], normal: [0.0; 3] });
        writeln!(text, "{x:?} {y:?} {z:?} {nx:?} {ny:?} {nz:?}").expect("a string takes any text");
    }
    text
}

/// One board with these modules.
fn patch(kinds: &[ModuleKind]) -> Patch {
    let address = BoardAddress::new(13).expect("an address");
    let modules = kinds.iter().zip(0..).map(|(kind, module)| (Module::from_nibble(module), *kind)).collect();
    Patch::new("p", vec![Board { bus: BusIndex(0), address, modules }]).expect("modules in order")
}

fn check_geometry(geometry: &Result<Geometry, GeometryError>, patch: &Patch, text: &str) {
    let geometry = match geometry {
        Ok(geometry) => geometry,
        Err(error) => return check_error(error, text),
    };
    assert_eq!(geometry.poses.len(), patch.taxels().len());
    assert!(geometry.poses.iter().any(Option::is_some));
    let file = PositionFile::parse(text).expect("its geometry was read");
    for (taxel, pose) in geometry.poses.iter().enumerate() {
        let row = patch.port_index(taxel).and_then(|row| file.rows()[row]);
        assert_eq!(row.map(|row| row.position), pose.map(|pose| pose.position));
        let (Some(row), Some(pose)) = (row, pose) else { continue };
        let length = pose.normal.iter().map(|n| n * n).sum::<f64>().sqrt();
        let expected = if row.normal == [0.0; 3] { 0.0 } else { 1.0 };
        assert!((length - expected).abs() < 1e-9, "{row:?} became {pose:?}");
    }
    assert!(geometry.remarks.iter().all(|remark| !remark.is_empty() && remark.len() < 200));
}

fn check_error(error: &GeometryError, text: &str) {
    let said = error.to_string();
    assert!(!said.is_empty() && said.len() < 500, "{said}");
    if let GeometryError::Row { line, .. } | GeometryError::NotMetres { line, .. } = error {
        assert!((1..=text.lines().count()).contains(line), "{said}");
    }
}
