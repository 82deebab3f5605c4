//! The shape of the simulated skin: triangles in strips around a tapered half-cylinder.

use std::fmt::Write as _;
use taxel_skin::{Board, BoardAddress, BusIndex, LayoutError, Module, ModuleKind, Patch, SquareMillimetre};
use taxel_skin::{TaxelSite, VALUES_PER_MODULE};

/// Where the twelve values of a triangle lie in its plane, in millimetres about its centre: taxels 6.43 mm apart,
/// the thermal pads 6 and 10 between them. The layout of the robots' own drawing of the part.
const TRIANGLE_MM: [[f64; 2]; VALUES_PER_MODULE] = [
    [6.43, 0.0],
    [9.65, -5.57],
    [3.22, -5.57],
    [0.0, 0.0],
    [-3.22, -5.57],
    [-9.65, -5.57],
    [-6.41, -3.69],
    [-6.43, 0.0],
    [-3.22, 5.57],
    [0.0, 11.14],
    [0.0, 7.41],
    [3.22, 5.57],
];
/// Triangles side by side around the limb; with alternating orientation each adds half a base.
const TRIANGLES_PER_STRIP: usize = 8;
/// Radius at the middle of the first strip, the narrow end: eight triangles then go around half the limb.
const FIRST_RADIUS_MM: f64 = 38.0;
/// Growth of the radius per millimetre along the surface: sine of the cone's half angle.
const TAPER: f64 = 0.12;
/// Rows that iCub's position files give each board.
const PORT_ROWS_PER_BOARD: usize = 16 * VALUES_PER_MODULE;

/// One point of the skin.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pose {
    /// Position in metres; the limb's axis is z.
    pub position_m: [f64; 3],
    /// Unit normal, outward.
    pub normal: [f64; 3],
    /// Position on the unrolled surface in millimetres: around the limb, along the limb.
    ///
    /// The surface is a cone, which unrolls without stretch: areas and distances on it are the true ones.
    pub unrolled_mm: [f64; 2],
}

/// How triangles tile the unrolled surface: side by side in strips, every second one upside down, without holes.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Tiling {
    base_mm: f64,
    height_mm: f64,
}

impl Tiling {
    /// Triangles so close that each taxel of a module has the area that the triangle alone gives it.
    const WITHOUT_GAPS: Self = Self { base_mm: 27.5, height_mm: 23.9 };

    /// Equilateral triangles whose centres lie so far apart.
    fn spaced(module_spacing_mm: f64) -> Self {
        Self { base_mm: module_spacing_mm * 3_f64.sqrt(), height_mm: module_spacing_mm * 1.5 }
    }

    /// Where a point of the module at this place lies; `[x, y]` is about the module's centre.
    fn unrolled_mm(self, place: usize, [x, y]: [f64; 2]) -> [f64; 2] {
        let (strip, column) = (place / TRIANGLES_PER_STRIP, place % TRIANGLES_PER_STRIP);
        // The centre lies a third of the height above the base, so two thirds in a triangle that points down.
        let (x, y, centre) = if points_up(strip, column) { (x, y, 1.0 / 3.0) } else { (-x, -y, 2.0 / 3.0) };
        let middle = (TRIANGLES_PER_STRIP - 1) as f64 / 2.0;
        let around = (column as f64 - middle) * self.base_mm / 2.0 + x;
        let along = (strip as f64 + centre - 0.5) * self.height_mm + y;
        [around, along]
    }

    /// Whether a module at one of these places, which ascend, covers this point of the unrolled surface, its share of the
    /// gaps included.
    fn covers(self, places: &[usize], [around, along]: [f64; 2]) -> bool {
        let middle = (TRIANGLES_PER_STRIP - 1) as f64 / 2.0;
        let (height, column) = (along / self.height_mm + 0.5, around / (self.base_mm / 2.0) + middle);
        let (strip, above_base) = (height.floor(), height - height.floor());
        [column.floor(), column.ceil()].into_iter().any(|nearest| {
            if strip < 0.0 || !(0.0..TRIANGLES_PER_STRIP as f64).contains(&nearest) {
                return false;
            }
            let (strip, nearest_column) = (strip as usize, nearest as usize);
            let half_width = if points_up(strip, nearest_column) { 1.0 - above_base } else { above_base };
            let place = strip * TRIANGLES_PER_STRIP + nearest_column;
            (column - nearest).abs() <= half_width && places.binary_search(&place).is_ok()
        })
    }
}

fn points_up(strip: usize, column: usize) -> bool {
    (strip + column).is_multiple_of(2)
}

/// A patch of skin with the place of every taxel.
#[derive(Clone, Debug, PartialEq)]
pub struct Skin {
    patch: Patch,
    poses: Vec<Pose>,
    /// Where each module lies, in the patch's order.
    places: Vec<usize>,
    /// The same, ascending.
    covered: Vec<usize>,
    tiling: Tiling,
    taxel_area: SquareMillimetre,
}

impl Skin {
    /// The forearm of the vacuum bag paper: 23 triangles, 230 taxels, board 13 full and seven modules on board 12.
    ///
    /// # Errors
    /// [`LayoutError`], which the fixed layout cannot cause.
    pub fn forearm() -> Result<Self, LayoutError> {
        Ok(Self::sleeve(Self::forearm_patch()?))
    }

    /// The same forearm with the gaps between its modules that the real part has: their centres lie
    /// `module_spacing_mm` apart (17.3 to 18.8 mm on the robots), and the soft layer over the gaps carries load, too.
    ///
    /// # Errors
    /// [`LayoutError`], which the fixed layout cannot cause.
    pub fn forearm_with_gaps(module_spacing_mm: f64) -> Result<Self, LayoutError> {
        let tiling = Tiling::spaced(module_spacing_mm);
        let taxel_mm2 = tiling.base_mm * tiling.height_mm / 2.0 / ModuleKind::Triangle.taxel_slots().len() as f64;
        let patch = Self::forearm_patch()?;
        let places = side_by_side(&patch);
        Ok(Self::tiled(patch, places, tiling, SquareMillimetre(taxel_mm2)))
    }

    fn forearm_patch() -> Result<Patch, LayoutError> {
        let boards = [(13, 16), (12, 7)].into_iter().filter_map(|(address, modules)| {
            let address = BoardAddress::new(address).ok()?;
            let modules = (0..modules).map(|m| (Module::from_nibble(m), ModuleKind::Triangle)).collect();
            Some(Board { bus: BusIndex(0), address, modules })
        });
        Patch::new("left_forearm", boards.collect())
    }

    /// Any patch of one bus, its modules laid in strips of eight around a limb that grows wider.
    ///
    /// Every module is drawn as a triangle, whatever its kind: the simulator needs a place for each taxel, not the
    /// true outline of a fingertip.
    #[must_use]
    pub fn sleeve(patch: Patch) -> Self {
        let places = side_by_side(&patch);
        Self::tiled(patch, places, Tiling::WITHOUT_GAPS, SquareMillimetre::ICUB_TAXEL)
    }

    /// The same with each module, in the patch's order, at a place of its own: place `8 n + c` is column `c` of strip `n`,
    /// and a strip is 23.9 mm wide. What lies between has no skin, so that a part of it may be far from another.
    ///
    /// # Panics
    /// Unless each module has one place, and no two have the same.
    #[must_use]
    pub fn sleeve_at(patch: Patch, places: Vec<usize>) -> Self {
        assert_eq!(places.len(), patch.modules().len(), "a place for each module");
        let skin = Self::tiled(patch, places, Tiling::WITHOUT_GAPS, SquareMillimetre::ICUB_TAXEL);
        assert!(skin.covered.is_sorted_by(|a, b| a < b), "two modules at one place: {:?}", skin.places);
        skin
    }

    fn tiled(patch: Patch, places: Vec<usize>, tiling: Tiling, taxel_area: SquareMillimetre) -> Self {
        let pose = |site: &TaxelSite| pose_of(tiling, places[site.module as usize], site.slot as usize);
        let poses = patch.taxels().iter().map(pose).collect();
        let mut covered = places.clone();
        covered.sort_unstable();
        Self { patch, poses, places, covered, tiling, taxel_area }
    }

    /// Boards, modules and the numbering of the taxels.
    #[must_use]
    pub const fn patch(&self) -> &Patch {
        &self.patch
    }

    /// The place of every taxel, in the patch's order.
    #[must_use]
    pub fn poses(&self) -> &[Pose] {
        &self.poses
    }

    /// The area that every taxel stands for in the mean: a tenth of its module's share of the skin.
    #[must_use]
    pub const fn taxel_area(&self) -> SquareMillimetre {
        self.taxel_area
    }

    /// Whether there is skin at this point of the unrolled surface, in millimetres. Gaps between modules are skin.
    #[must_use]
    pub fn covers(&self, unrolled_mm: [f64; 2]) -> bool {
        self.tiling.covers(&self.covered, unrolled_mm)
    }

    /// The skin as an iCub position file: a row `x y z nx ny nz` per port index, in metres. Like the files of the robots it
    /// gives thermal pads a place and absent modules six zeros.
    #[must_use]
    pub fn positions_file(&self) -> String {
        let rows = self.patch.boards().len() * PORT_ROWS_PER_BOARD;
        let mut pose = vec![None; rows];
        for (index, site) in self.patch.modules().iter().enumerate() {
            let first = PORT_ROWS_PER_BOARD * site.board as usize + VALUES_PER_MODULE * site.module.get() as usize;
            for slot in 0..VALUES_PER_MODULE {
                pose[first + slot] = Some(pose_of(self.tiling, self.places[index], slot));
            }
        }
        let mut text = format!("name {}\nspatial_sampling taxel\n[calibration]\n", self.patch.name());
        for row in pose {
            let numbers =
                row.map_or([0.0; 6], |Pose { position_m: [x, y, z], normal: [a, b, c], .. }| [x, y, z, a, b, c]);
            let words: Vec<String> = numbers.iter().map(|x| format!("{x:.6}")).collect();
            // Writing to a String cannot fail.
            let _ = writeln!(text, "{}", words.join(" "));
        }
        text
    }
}

/// One module after the other, strip by strip.
fn side_by_side(patch: &Patch) -> Vec<usize> {
    (0..patch.modules().len()).collect()
}

/// Where value `slot` of the module at this place lies.
fn pose_of(tiling: Tiling, place: usize, slot: usize) -> Pose {
    rolled(tiling.unrolled_mm(place, TRIANGLE_MM[slot]))
}

/// Rolls a point of the plane onto the cone. In the plane the cone is a sector about its apex: the distance from the
/// apex stays, and the angle about it grows by 1 / sin(half angle).
fn rolled(unrolled_mm: [f64; 2]) -> Pose {
    let [around, along] = unrolled_mm;
    let apex = FIRST_RADIUS_MM / TAPER;
    let slant = around.hypot(apex + along);
    let angle = around.atan2(apex + along) / TAPER;
    let cosine = (1.0 - TAPER * TAPER).sqrt();
    let radius = slant * TAPER;
    let position_mm = [radius * angle.cos(), radius * angle.sin(), (slant - apex) * cosine];
    Pose {
        position_m: position_mm.map(|x| x * 1e-3),
        normal: [cosine * angle.cos(), cosine * angle.sin(), -TAPER],
        unrolled_mm,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use taxel_skin::{Geometry, NormalsVerdict};

    #[test]
    fn the_forearm_has_230_taxels_at_the_pitch_of_the_real_part() {
        let skin = Skin::forearm().unwrap();
        let poses = skin.poses();
        assert_eq!((poses.len(), skin.patch().modules().len()), (230, 23));
        for (i, a) in poses.iter().enumerate() {
            let off_m = |b: &Pose| (0..3).map(|k| (a.position_m[k] - b.position_m[k]).powi(2)).sum::<f64>().sqrt();
            let others = poses.iter().enumerate().filter(|(j, _)| *j != i);
            let nearest = others.map(|(_, b)| off_m(b) * 1e3).fold(f64::INFINITY, f64::min);
            // Across the edge of a module its neighbour's taxels are nearer than the module's own.
            assert!((4.7..6.5).contains(&nearest), "taxel {i}: nearest neighbour at {nearest} mm");
            let ([x, y, _], normal) = (a.position_m, a.normal);
            assert!(x * normal[0] + y * normal[1] > 0.9 * x.hypot(y), "taxel {i}: {normal:?} does not point outward");
        }
    }

    #[test]
    fn with_gaps_the_skin_covers_a_tenth_of_a_module_for_each_taxel() {
        let skin = Skin::forearm_with_gaps(18.0).unwrap();
        assert!((skin.taxel_area().0 - 42.09).abs() < 0.01, "(3 sqrt(3) / 4) (18 mm)^2 / 10");
        assert!(skin.poses().iter().all(|pose| skin.covers(pose.unrolled_mm)));
        let step_mm = 0.5;
        let points = (0..400).flat_map(|x| (0..300).map(move |y| [x as f64, y as f64]));
        let covered = points.filter(|[x, y]| skin.covers([x * step_mm - 100.0, y * step_mm - 40.0])).count();
        let area_mm2 = covered as f64 * step_mm * step_mm;
        assert!((area_mm2 / (230.0 * skin.taxel_area().0) - 1.0).abs() < 0.005, "{area_mm2} mm2");
    }

    #[test]
    fn parts_of_a_skin_may_lie_apart_with_nothing_between() {
        let forearm = Skin::forearm_patch().unwrap();
        let places = (0..16).chain(64..71).collect();
        let skin = Skin::sleeve_at(forearm.clone(), places);
        let together = Skin::sleeve(forearm);
        assert_eq!(skin.poses()[..160], together.poses()[..160]);
        let [near, far] = [skin.poses()[0], skin.poses()[160]].map(|pose| pose.unrolled_mm);
        let moved = far[1] - together.poses()[160].unrolled_mm[1];
        assert!((moved - 6.0 * 23.9).abs() < 1e-9, "six strips further along: {moved} mm");
        assert!(skin.covers(near) && skin.covers(far));
        assert!(!skin.covers([far[0], far[1] - 2.0 * 23.9]) && together.covers(together.poses()[160].unrolled_mm));
        let geometry = Geometry::parse(&skin.positions_file(), skin.patch()).unwrap();
        let of_file = geometry.poses[160].unwrap().position;
        assert!(of_file.iter().zip(skin.poses()[160].position_m).all(|(a, b)| (a - b).abs() < 2e-6), "{of_file:?}");
    }

    #[test]
    fn the_position_file_has_a_row_for_every_port_index() {
        let skin = Skin::forearm().unwrap();
        let text = skin.positions_file();
        let rows: Vec<&str> = text.lines().skip_while(|line| *line != "[calibration]").skip(1).collect();
        assert_eq!(rows.len(), 384);
        let geometry = Geometry::parse(&text, skin.patch()).unwrap();
        assert_eq!(geometry.normals, NormalsVerdict::Usable, "{:?}", geometry.remarks);
        for (taxel, (parsed, pose)) in geometry.poses.iter().zip(skin.poses()).enumerate() {
            let parsed = parsed.unwrap();
            let found = parsed.position.iter().chain(&parsed.normal);
            for (found, expected) in found.zip(pose.position_m.iter().chain(&pose.normal)) {
                assert!((found - expected).abs() < 2e-6, "taxel {taxel}: {parsed:?}");
            }
        }
        assert!(rows[383].split_whitespace().all(|word| word.parse() == Ok(0.0)), "module 15 of board 12 is absent");
    }
}
