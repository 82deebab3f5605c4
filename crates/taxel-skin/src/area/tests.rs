use std::ops::Range;

use super::voronoi::{Board as Outline, Part};
use super::*;
use crate::polygon::{Convex, Point, length, minus};
use crate::{Board, BoardAddress, BusIndex, Geometry, Module, TaxelPose};
use nalgebra::{Rotation3, Unit, Vector3};
use proptest::prelude::*;

fn geometry(places_mm: &[[f64; 3]]) -> Geometry {
    let pose = |place: &[f64; 3]| Some(TaxelPose { position: place.map(|x| x * 1e-3), normal: [0.0, 0.0, 1.0] });
    Geometry::from_poses(places_mm.iter().map(pose).collect())
}

/// Mean area per taxel, mm2.
const MEAN: SquareMillimetre = SquareMillimetre::ICUB_TAXEL;

fn areas(places_mm: &[[f64; 3]], modules: impl IntoIterator<Item = Range<usize>>) -> Vec<f64> {
    let areas = voronoi(&geometry(places_mm), modules, MEAN);
    areas.into_iter().map(|area| area.map_or(0.0, |area| area.0)).collect()
}

/// Taxels of an iCub triangle, in mm about its centre.
const TRIANGLE_MM: [[f64; 2]; 10] = [
    [6.43, 0.0],
    [9.65, -5.57],
    [3.22, -5.57],
    [0.0, 0.0],
    [-3.22, -5.57],
    [-9.65, -5.57],
    [-6.43, 0.0],
    [-3.22, 5.57],
    [0.0, 11.14],
    [3.22, 5.57],
];

fn triangle() -> [[f64; 3]; 10] {
    TRIANGLE_MM.map(|[x, y]| [x, y, 0.0])
}

#[test]
fn a_uniform_lattice_has_equal_inner_cells() {
    let (pitch, row) = (6.5, 6.5 * 0.75_f64.sqrt());
    let shift = |y: usize| if y % 2 == 1 { pitch / 2.0 } else { 0.0 };
    let places: Vec<_> = (0..49).map(|i| [(i % 7) as f64 * pitch + shift(i / 7), (i / 7) as f64 * row, 0.0]).collect();
    let areas = areas(&places, Some(0..49));
    for taxel in (1..6).flat_map(|y| (1..6).map(move |x| y * 7 + x)) {
        assert!((areas[taxel] - pitch * row).abs() < 1e-9, "taxel {taxel}: {}", areas[taxel]);
    }
}

#[test]
fn an_icub_triangle_keeps_its_area_and_its_inner_cell_is_the_lattices() {
    let areas = areas(&triangle(), Some(0..10));
    let sum: f64 = areas.iter().sum();
    assert!((sum / 324.0 - 1.0).abs() < 2e-3, "{sum} mm2");
    assert!((areas[3] - 6.43 * 5.57).abs() < 0.1, "the middle: {}", areas[3]);
    assert!(areas.iter().all(|cell| (26.0..37.0).contains(cell)), "{areas:?}");
}

#[test]
fn touching_modules_share_the_gap() {
    let mut places = triangle().to_vec();
    // The neighbour beyond the lower edge, mirrored in it, 1.6 mm nearer than the areas ask for.
    places.extend(TRIANGLE_MM.iter().map(|&[x, y]| [x, -y - 2.0 * (23.9 / 3.0 - 0.8), 0.0]));
    let both = areas(&places, [0..10, 10..20]);
    let alone = areas(&triangle(), Some(0..10));
    assert!(both[2] < alone[2] - 4.0, "{} beside a neighbour, {} alone", both[2], alone[2]);
    assert!((both[8] - alone[8]).abs() < 1e-9, "far from the neighbour nothing changes");
    for (taxel, (one, other)) in both[..10].iter().zip(&both[10..]).enumerate() {
        assert!((one - other).abs() < 1e-9, "taxel {taxel} and its mirror image: {one} and {other}");
    }
}

#[test]
fn taxels_whose_cell_is_not_known_have_none() {
    let mut placed = geometry(&triangle());
    let mut doubled = triangle().map(|[x, y, z]| [x + 100.0, y, z]);
    doubled[4] = doubled[7];
    placed.poses.extend(geometry(&doubled).poses);
    placed.poses.extend(geometry(&[[50.0, 0.0, 0.0], [56.0, 0.0, 0.0], [62.0, 0.0, 0.0], [90.0, 0.0, 0.0]]).poses);
    let mut holed = geometry(&triangle().map(|[x, y, z]| [x, y + 100.0, z])).poses;
    holed[5] = None;
    placed.poses.extend(holed);
    let areas = voronoi(&placed, [0..10, 10..20, 20..23, 23..24, 24..34], MEAN);
    assert!(areas[..10].iter().all(Option::is_some));
    let without = &areas[10..];
    assert!(without.iter().all(Option::is_none), "two at one place, a line, a point, a hole: {without:?}");
    assert_eq!(voronoi(&placed, [], MEAN), vec![None; 34]);
    assert_eq!(voronoi(&placed, Some(30..40), MEAN), vec![None; 34], "a module beyond the geometry");
}

#[test]
fn icubs_own_forearm_files() {
    let local = concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/data");
    let dir = std::env::var("TAXELD_DATA").unwrap_or_else(|_| local.to_owned()) + "/icub_positions";
    let first: Vec<u8> = (0..16).collect();
    // In the second file taxels of most modules repeat a place.
    for (file, second, known) in [
        ("left_forearm_mesh.txt", &[1, 5, 8, 9, 10, 12, 13][..], 23),
        ("left_forearm_V2.txt", &[0, 1, 3, 6, 8, 9, 12, 13][..], 4),
    ] {
        let Ok(text) = std::fs::read_to_string(format!("{dir}/{file}")) else {
            eprintln!("SKIPPED icubs_own_forearm_files: no {dir}/{file}");
            return;
        };
        let board = |address: u8, modules: &[u8]| Board {
            bus: BusIndex(0),
            address: BoardAddress::new(address).unwrap(),
            modules: modules.iter().map(|&m| (Module::from_nibble(m), ModuleKind::Triangle)).collect(),
        };
        let patch = Patch::new("p", vec![board(13, &first), board(12, second)]).unwrap();
        let geometry = Geometry::parse(&text, &patch).unwrap();
        let areas = voronoi(&geometry, (0..patch.modules().len()).map(|m| 10 * m..10 * m + 10), MEAN);
        let triangles: Vec<Vec<f64>> =
            areas.chunks(10).filter_map(|cells| cells.iter().map(|cell| Some((*cell)?.0)).collect()).collect();
        let sums: Vec<f64> = triangles.iter().map(|cells| cells.iter().sum()).collect();
        let cells = triangles.concat();
        let (least, most) = cells.iter().fold((f64::MAX, 0.0_f64), |(a, b), x| (a.min(*x), b.max(*x)));
        eprintln!("{file}: taxels {least:.1} to {most:.1} mm2, triangles {sums:.0?} mm2");
        assert_eq!(triangles.len(), known, "{file}");
        // The places of the first file are corners of a mesh, up to 3 mm off, so that some of its triangles overlap.
        let off = |share: f64| sums.iter().filter(|sum| (*sum / 324.0 - 1.0).abs() > share).count();
        assert!(off(0.1) <= 3 && off(0.2) == 0, "{file}: {sums:.0?}");
        let mean = sums.iter().sum::<f64>() / sums.len() as f64;
        assert!((mean / 324.0 - 1.0).abs() < 0.05, "{file}: {mean} mm2 a triangle");
    }
}

/// Triangles whose centres lie `spacing_mm` apart and that fill a hexagon with sides of `rings` triangles: their taxels,
/// and whether each triangle has a neighbour on all sides.
fn tiling(spacing_mm: f64, rings: i32) -> (Vec<[f64; 2]>, Vec<bool>) {
    let side = spacing_mm * 3.0_f64.sqrt();
    let mut taxels = Vec::new();
    let mut there = std::collections::HashSet::new();
    // A triangle by its corner of the lattice, and whether it points up; the hexagon is |a|, |b|, |a + b| <= rings.
    let inside = |a: i32, b: i32| a.abs().max(b.abs()).max((a + b).abs()) <= rings;
    for (a, b) in (-rings..=rings).flat_map(|a| (-rings..=rings).map(move |b| (a, b))) {
        for up in [true, false] {
            let corners = if up { [(a, b), (a + 1, b), (a, b + 1)] } else { [(a + 1, b), (a, b + 1), (a + 1, b + 1)] };
            if corners.iter().all(|&(a, b)| inside(a, b)) {
                there.insert((a, b, up));
            }
        }
    }
    let mut all: Vec<(i32, i32, bool)> = there.iter().copied().collect();
    all.sort_unstable();
    let mut inner = Vec::new();
    for (a, b, up) in all {
        let third = if up { 1.0 / 3.0 } else { 2.0 / 3.0 };
        let (u, v) = (f64::from(a) + third, f64::from(b) + third);
        let centre = [side * (u + 0.5 * v), side * 0.75_f64.sqrt() * v];
        let turn = if up { 1.0 } else { -1.0 };
        taxels.extend(TRIANGLE_MM.map(|[x, y]| [centre[0] + turn * x, centre[1] + turn * y]));
        let beside = if up { [(a, b), (a - 1, b), (a, b - 1)] } else { [(a, b), (a + 1, b), (a, b + 1)] };
        inner.push(beside.iter().all(|&(a, b)| there.contains(&(a, b, !up))));
    }
    (taxels, inner)
}

/// Cells of a tiling of modules 18 mm apart, placed by `place`, in mm2, and which modules have neighbours all round.
fn cells_of_a_tiling(place: impl Fn([f64; 2]) -> [f64; 3]) -> (Vec<f64>, Vec<bool>) {
    let (taxels, inner) = tiling(18.0, 2);
    let places: Vec<[f64; 3]> = taxels.into_iter().map(place).collect();
    let modules = (0..inner.len()).map(|module| 10 * module..10 * module + 10);
    let areas = voronoi(&geometry(&places), modules, TILING_MEAN);
    (areas.into_iter().map(|area| area.unwrap().0).collect(), inner)
}

/// Mean area of a taxel in a tiling of triangles 18 mm apart.
const TILING_MEAN: SquareMillimetre = SquareMillimetre(42.088_8);

#[test]
fn a_tiling_of_triangles_keeps_its_area_and_gives_each_taxel_its_share() {
    let (cells, inner) = cells_of_a_tiling(|[x, y]| [x, y, 0.0]);
    assert_eq!((inner.len(), inner.iter().filter(|inner| **inner).count()), (24, 12));
    for (module, cells) in cells.chunks(10).enumerate() {
        let sum: f64 = cells.iter().sum();
        // At the edge of the part as within it; the pattern is known to 0.01 mm.
        assert!((sum / (10.0 * TILING_MEAN.0) - 1.0).abs() < 1e-4, "module {module}: {sum} mm2");
        for (slot, cell) in cells.iter().enumerate() {
            // As the template has it.
            let share = [0.095, 0.115, 0.085][if slot == 3 { 2 } else { usize::from([1, 5, 8].contains(&slot)) }];
            let wanted = share * 10.0 * TILING_MEAN.0;
            assert!((cell - wanted).abs() < 0.15, "module {module}, taxel {slot}: {cell} mm2, wanted {wanted}");
        }
    }
}

#[test]
fn a_tiling_round_a_limb_keeps_its_area() {
    // The modules are flat and touch the cylinder: about 26 degrees lie between two of them.
    let radius = 40.0;
    let (centres, _) = tiling(18.0, 2);
    let centre_of = |at: [f64; 2]| {
        let of = centres.chunks(10).find(|module| module.contains(&at)).unwrap();
        [0, 1].map(|axis| of.iter().map(|taxel| taxel[axis]).sum::<f64>() / 10.0)
    };
    let (cells, _) = cells_of_a_tiling(|at| {
        let [x, y] = centre_of(at);
        let (sine, cosine) = (x / radius).sin_cos();
        let (aside, along) = (at[0] - x, at[1] - y);
        [radius * sine + aside * cosine, y + along, radius * cosine - aside * sine]
    });
    let sum: f64 = cells.iter().sum();
    assert!((sum / (240.0 * TILING_MEAN.0) - 1.0).abs() < 2e-3, "{sum} mm2");
}

#[test]
fn positions_rounded_to_a_millimetre_lose_no_area_and_do_not_inflate_the_edge() {
    for shift in [0.0, 0.37, 0.71] {
        let (cells, inner) = cells_of_a_tiling(|[x, y]| [(x + shift).round(), (y - shift).round(), 0.0]);
        let sum: f64 = cells.iter().sum();
        eprintln!("shift {shift}: {sum:.1} mm2 of {:.1}", 240.0 * TILING_MEAN.0);
        assert!((sum / (240.0 * TILING_MEAN.0) - 1.0).abs() < 2e-3, "{sum} mm2");
        let mean = |wanted: bool| {
            let modules = cells.chunks(10).zip(&inner).filter(|(_, inner)| **inner == wanted);
            modules.map(|(cells, _)| cells.iter().sum::<f64>()).sum::<f64>() / 12.0
        };
        let [edge, within] = [mean(false), mean(true)];
        eprintln!("{edge:.1} mm2 a module at the edge, {within:.1} within");
        assert!((edge / within - 1.0).abs() < 0.01, "{edge} mm2 at the edge, {within} within");
    }
}

/// Places at least 2 mm apart in a square of 30 mm.
fn scattered() -> impl Strategy<Value = Vec<[f64; 2]>> {
    proptest::collection::vec([0.0_f64..30.0, 0.0_f64..30.0], 4..25).prop_map(|points| {
        let mut kept: Vec<[f64; 2]> = Vec::new();
        for point in points {
            if kept.iter().all(|other| length(minus(*other, point)) > 2.0) {
                kept.push(point);
            }
        }
        kept
    })
}

proptest! {
    #[test]
    fn cells_fill_the_modules_outline_and_move_with_it(
        points in scattered(), axis in [-1.0_f64..1.0, -1.0_f64..1.0, -1.0_f64..1.0], angle in 0.0_f64..6.0,
        shift in [-300.0_f64..300.0, -300.0_f64..300.0, -300.0_f64..300.0],
    ) {
        let Some(hull) = Convex::hull(&points) else { return Ok(()) };
        let flat: Vec<[f64; 3]> = points.iter().map(|&[x, y]| [x, y, 0.0]).collect();
        let module = 0..flat.len();
        let outline = hull.grown(hull.rim_to(MEAN.0 * flat.len() as f64)).area();
        let still = areas(&flat, Some(module.clone()));
        let sum: f64 = still.iter().sum();
        prop_assert!((sum / outline - 1.0).abs() < 1e-9, "{sum} mm2 of {outline}");
        let axis = Vector3::from(axis);
        prop_assume!(axis.norm() > 0.1);
        let turn = Rotation3::from_axis_angle(&Unit::new_normalize(axis), angle);
        let moved: Vec<[f64; 3]> = flat.iter().map(|p| (turn * Vector3::from(*p) + Vector3::from(shift)).into()).collect();
        for (taxel, (a, b)) in still.iter().zip(areas(&moved, Some(module.clone()))).enumerate() {
            prop_assert!((a - b).abs() < 1e-6 * outline, "taxel {taxel}: {a} mm2, moved {b} mm2");
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(12))]

    /// The definition itself, before anything is refilled: a point belongs to the nearest taxel of all, if it lies in
    /// that taxel's module.
    #[test]
    fn cells_of_two_modules_are_what_a_fine_grid_finds(one in scattered(), two in scattered(), gap in 0.0_f64..8.0) {
        let beside = two.iter().map(|&[x, y]| [x + 30.0 + gap, y, 0.0]);
        let places: Vec<[f64; 3]> = one.iter().map(|&[x, y]| [x, y, 0.0]).chain(beside).collect();
        let modules = [0..one.len(), one.len()..places.len()];
        let outline = |module: &Range<usize>| {
            let flat: Vec<Point> = places[module.clone()].iter().map(|p| [p[0], p[1]]).collect();
            let hull = Convex::hull(&flat)?;
            Some(hull.grown(hull.rim_to(MEAN.0 * flat.len() as f64)))
        };
        let (Some(left), Some(right)) = (outline(&modules[0]), outline(&modules[1])) else { return Ok(()) };
        let all: Vec<_> = places.iter().map(|place| Some(Vector3::from(*place))).collect();
        let boards: Vec<Outline> = modules.iter().filter_map(|own| Outline::new(own.clone(), &all, MEAN)).collect();
        let found: Vec<f64> =
            boards.iter().flat_map(|board| Part::new(board, &boards, &all).cells(0.0).collect::<Vec<_>>()).collect();
        // A side of a cell that happens to lie along the grid is off by half a step over its whole length, and so may be
        // the opposite one: cells are at least 2 mm wide, so that this stays below the tolerance up to a length of 20 mm.
        let step = 0.2;
        let mut counted = vec![0_u32; places.len()];
        for point in (-80..440).flat_map(|x| (-80..240).map(move |y| [f64::from(x) * step, f64::from(y) * step])) {
            let distance = |taxel: &usize| length(minus([places[*taxel][0], places[*taxel][1]], point));
            let nearest = (0..places.len()).min_by(|a, b| distance(a).total_cmp(&distance(b))).unwrap();
            let module = if nearest < one.len() { &left } else { &right };
            counted[nearest] += u32::from(module.contains(point));
        }
        for (taxel, count) in counted.into_iter().enumerate() {
            let (grid, exact) = (f64::from(count) * step * step, found[taxel]);
            prop_assert!((grid - exact).abs() < 0.05 * exact + 2.0, "taxel {taxel}: {exact} mm2, on a grid {grid} mm2");
        }
    }
}

#[test]
fn a_template_shares_out_the_whole_module_and_gives_corners_most() {
    let module = |number, kind| (Module::from_nibble(number), kind);
    let modules = vec![module(0, ModuleKind::Triangle), module(1, ModuleKind::PalmPad7)];
    let board = Board { bus: BusIndex(0), address: BoardAddress::new(13).unwrap(), modules };
    let patch = Patch::new("p", vec![board]).unwrap();
    for mean in [30.0, 32.4, 39.0, 42.1, 45.0, 60.0] {
        let areas: Vec<f64> = template(&patch, SquareMillimetre(mean)).iter().map(|a| a.0).collect();
        assert!((areas[..10].iter().sum::<f64>() - 10.0 * mean).abs() < 1e-9, "{areas:?}");
        let (corner, edge, centre) = (areas[1], areas[0], areas[3]);
        assert!(corner > edge && edge > centre, "{areas:?}");
        assert_eq!([areas[5], areas[8]], [corner; 2], "the corners are values 1, 5 and 9");
        assert!(areas[10..].iter().all(|area| (area - mean).abs() < 1e-12), "other modules: equal");
    }
    let [corner, edge, centre] = [1, 0, 3].map(|t| template(&patch, SquareMillimetre(42.1))[t].0);
    assert!((corner - 48.4).abs() < 0.1 && (edge - 40.0).abs() < 0.1 && (centre - 35.8).abs() < 0.1);
}
