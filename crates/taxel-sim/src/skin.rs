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
/// Base and height of a triangle's outline in millimetres.
const TRIANGLE_BASE_MM: f64 = 27.5;
const TRIANGLE_HEIGHT_MM: f64 = 23.9;
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

/// A patch of skin with the place of every taxel.
#[derive(Clone, Debug, PartialEq)]
pub struct Skin {
    patch: Patch,
    poses: Vec<Pose>,
}

impl Skin {
    /// The forearm of the vacuum bag paper: 23 triangles, 230 taxels, board 13 full and seven modules on board 12.
    ///
    /// # Errors
    /// [`LayoutError`], which the fixed layout cannot cause.
    pub fn forearm() -> Result<Self, LayoutError> {
        let boards = [(13, 16), (12, 7)].into_iter().filter_map(|(address, modules)| {
            let address = BoardAddress::new(address).ok()?;
            let modules = (0..modules).map(|m| (Module::from_nibble(m), ModuleKind::Triangle)).collect();
            Some(Board { bus: BusIndex(0), address, modules })
        });
        Ok(Self::sleeve(Patch::new("left_forearm", boards.collect())?))
    }

    /// Any patch of one bus, its modules laid in strips of eight around a limb that grows wider.
    ///
    /// Every module is drawn as a triangle, whatever its kind: the simulator needs a place for each taxel, not the
    /// true outline of a fingertip.
    #[must_use]
    pub fn sleeve(patch: Patch) -> Self {
        let poses = patch.taxels().iter().map(|site| pose_of(site.module as usize, site.slot as usize)).collect();
        Self { patch, poses }
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

    /// Positions in metres, in the patch's order.
    #[must_use]
    pub fn positions_m(&self) -> Vec<[f64; 3]> {
        self.poses.iter().map(|pose| pose.position_m).collect()
    }

    /// Outward unit normals, in the patch's order.
    #[must_use]
    pub fn normals(&self) -> Vec<[f64; 3]> {
        self.poses.iter().map(|pose| pose.normal).collect()
    }

    /// The area that every taxel stands for.
    #[must_use]
    pub const fn taxel_area(&self) -> SquareMillimetre {
        SquareMillimetre::ICUB_TAXEL
    }

    /// The skin as an iCub position file: `taxel2Repr`, then a row `x y z nx ny nz` per port index, in metres.
    ///
    /// Like the files of the robots it gives thermal pads a place (their representative is -2) and absent modules six
    /// zeros (their representative is -1).
    #[must_use]
    pub fn positions_file(&self) -> String {
        let rows = self.patch.boards().len() * PORT_ROWS_PER_BOARD;
        let mut representative = vec![-1_i64; rows];
        let mut pose = vec![None; rows];
        for (index, site) in self.patch.modules().iter().enumerate() {
            let first = PORT_ROWS_PER_BOARD * site.board as usize + VALUES_PER_MODULE * site.module.get() as usize;
            for slot in 0..VALUES_PER_MODULE {
                let is_pad = site.kind.thermal_slots().contains(&(slot as u8));
                representative[first + slot] = if is_pad { -2 } else { first as i64 + 3 };
                pose[first + slot] = Some(pose_of(index, slot));
            }
        }
        let mut text =
            format!("name                {}\nspatial_sampling    taxel\ntaxel2Repr          (", self.patch.name());
        let words: Vec<String> = representative.iter().map(i64::to_string).collect();
        text.push_str(&words.join(" "));
        text.push_str(")\n[calibration]\n");
        for row in pose {
            let numbers =
                row.map_or([0.0; 6], |Pose { position_m: [x, y, z], normal: [a, b, c], .. }| [x, y, z, a, b, c]);
            let words: Vec<String> = numbers.iter().map(|x| format!("{x:.6}")).collect();
            // Writing to a String cannot fail.
            let _ = writeln!(text, "{}", words.join(" "));
        }
        text
    }

    pub(crate) fn sites(&self) -> &[TaxelSite] {
        self.patch.taxels()
    }
}

/// The place of value `slot` of the module that is laid as number `module`.
fn pose_of(module: usize, slot: usize) -> Pose {
    let (strip, column) = (module / TRIANGLES_PER_STRIP, module % TRIANGLES_PER_STRIP);
    let points_up = (strip + column).is_multiple_of(2);
    let [x, y] = TRIANGLE_MM[slot];
    // The centre lies a third of the height above the base, so two thirds in a triangle that points down.
    let (x, y, centre) = if points_up { (x, y, 1.0 / 3.0) } else { (-x, -y, 2.0 / 3.0) };
    let middle = (TRIANGLES_PER_STRIP - 1) as f64 / 2.0;
    let around = (column as f64 - middle) * TRIANGLE_BASE_MM / 2.0 + x;
    let along = (strip as f64 + centre - 0.5) * TRIANGLE_HEIGHT_MM + y;
    rolled([around, along])
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

    fn distance_mm(a: &Pose, b: &Pose) -> f64 {
        (0..3).map(|k| (a.position_m[k] - b.position_m[k]).powi(2)).sum::<f64>().sqrt() * 1e3
    }

    #[test]
    fn the_forearm_has_230_taxels_at_the_pitch_of_the_real_part() {
        let skin = Skin::forearm().unwrap();
        let poses = skin.poses();
        assert_eq!((poses.len(), skin.patch().modules().len()), (230, 23));
        for (i, a) in poses.iter().enumerate() {
            let nearest = poses.iter().enumerate().filter(|(j, _)| *j != i).map(|(_, b)| distance_mm(a, b));
            let nearest = nearest.fold(f64::INFINITY, f64::min);
            // Across the edge of a module its neighbour's taxels are nearer than the module's own.
            assert!((4.7..6.5).contains(&nearest), "taxel {i}: nearest neighbour at {nearest} mm");
        }
    }

    #[test]
    fn normals_are_unit_outward_and_stay_on_one_half() {
        for pose in Skin::forearm().unwrap().poses() {
            let [x, y, _] = pose.position_m;
            let n = pose.normal;
            assert!((n.iter().map(|c| c * c).sum::<f64>() - 1.0).abs() < 1e-12);
            assert!(x * n[0] + y * n[1] > 0.9 * x.hypot(y), "outward");
            assert!(x > -0.01, "about half a turn: x = {x} m");
        }
    }

    #[test]
    fn unrolling_keeps_distances() {
        let skin = Skin::forearm().unwrap();
        let module = &skin.poses()[..10];
        for a in module {
            for b in module {
                let flat = (a.unrolled_mm[0] - b.unrolled_mm[0]).hypot(a.unrolled_mm[1] - b.unrolled_mm[1]);
                assert!((flat - distance_mm(a, b)).abs() < 0.02 * flat + 1e-9, "{flat} mm");
            }
        }
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
        let repr = text.lines().find(|line| line.starts_with("taxel2Repr")).unwrap();
        assert_eq!(repr.matches("-2").count(), 46, "two thermal pads a module");
    }
}
