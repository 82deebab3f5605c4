//! The area that each taxel stands for: its share of the module, equal for all, or its Voronoi cell.

use taxel_skin::{Geometry, Patch, SquareMillimetre, area};

use super::area_words::AreaWord;
use super::parts::PatchSection;

/// Where in the file, in bytes, and why the patch's area cannot be what it says.
pub fn problem(section: &PatchSection) -> Option<(usize, String)> {
    let lacks_geometry = *section.area.get_ref() == AreaWord::Voronoi && section.geometry.is_none();
    let text =
        || format!("patch `{}`: area = \"voronoi\" needs the positions of the taxels: set geometry", section.name);
    lacks_geometry.then(|| (section.area.span().start, text()))
}

/// Area of a taxel of an iCub triangle with its share of the gaps between modules 18 mm apart: a tenth of
/// (3 sqrt(3) / 4) (18 mm)^2. The soft layer carries load over the gaps, too.
const WITH_GAPS_MM2: f64 = 42.1;

/// The mean area of a taxel, mm2.
pub fn mean_mm2(section: &PatchSection) -> f64 {
    let default = match section.area.get_ref() {
        AreaWord::Template => WITH_GAPS_MM2,
        AreaWord::Equal | AreaWord::Voronoi => SquareMillimetre::ICUB_TAXEL.0,
    };
    section.area_mm2.unwrap_or(default)
}

/// Relative standard uncertainty of the areas. Without a known load nobody knows the spacing of the modules better than
/// by 0.8 mm in 18 mm, nor how much the gaps carry: a tenth. The triangles alone leave the gaps out, a quarter of the
/// area.
pub fn uncertainty(section: &PatchSection) -> f64 {
    let gaps_left_out = *section.area.get_ref() != AreaWord::Template && section.area_mm2.is_none();
    section.area_uncertainty.unwrap_or(if gaps_left_out { 0.2 } else { 0.1 })
}

/// The area of each taxel, and what a user should know of it.
pub fn areas(
    section: &PatchSection,
    patch: &Patch,
    geometry: Option<&Geometry>,
) -> (Vec<SquareMillimetre>, Option<String>) {
    let mean = SquareMillimetre(mean_mm2(section));
    let (geometry, word) = (geometry, *section.area.get_ref());
    let (Some(geometry), AreaWord::Voronoi) = (geometry, word) else {
        let areas =
            if word == AreaWord::Template { area::template(patch, mean) } else { vec![mean; patch.taxels().len()] };
        return (areas, None);
    };
    let modules = patch.modules().iter().map(|site| {
        let first = usize::from(site.first_taxel);
        first..first + site.kind.taxel_slots().len()
    });
    let cells = area::voronoi(geometry, modules, mean);
    let unknown = cells.iter().filter(|cell| cell.is_none()).count();
    let remark = (unknown > 0).then(|| {
        let (name, taxels, mm2) = (&section.name, cells.len(), mean.0);
        let why = "a taxel of their module has no place, or that of another";
        format!("{name}: area: {unknown} of {taxels} taxels have no cell of their own ({why}): {mm2} mm2 each")
    });
    (cells.into_iter().map(|cell| cell.unwrap_or(mean)).collect(), remark)
}

#[cfg(test)]
mod tests {
    use super::super::parse;
    #[cfg(feature = "sim")]
    use super::super::resolve;
    use std::path::Path;

    const EXAMPLE: &str = include_str!("../../../../deploy/taxeld.toml");

    #[test]
    fn voronoi_without_geometry_is_refused_with_its_line() {
        let text = EXAMPLE.replace("area = \"template\"", "area = \"voronoi\"");
        let line = 1 + text.lines().position(|l| l.starts_with("area = \"voronoi\"")).unwrap();
        let message = parse(Path::new("t.toml"), &text).unwrap_err().to_string();
        assert!(message.starts_with(&format!("t.toml:{line}: patch `left_forearm`: area")), "{message}");
        assert!(message.contains("set geometry"), "{message}");
    }

    #[test]
    fn the_two_words_are_closed_lists() {
        for (word, wrong) in
            [("area = \"template\"", "area = \"hexagons\""), ("area_factor = \"off\"", "area_factor = \"on\"")]
        {
            let text = EXAMPLE.replace(word, wrong);
            assert_ne!(text, EXAMPLE, "{word} is in the example");
            let message = parse(Path::new("t.toml"), &text).unwrap_err().to_string();
            assert!(message.contains("unknown variant"), "{message}");
        }
    }

    #[cfg(feature = "sim")]
    #[test]
    fn cells_of_the_simulated_forearm_are_about_equal() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("t.toml");
        let skin = taxel_sim::Skin::forearm().unwrap();
        std::fs::write(folder.path().join("skin.txt"), skin.positions_file()).unwrap();
        let text = EXAMPLE
            .replace("area = \"template\"", "area = \"voronoi\"")
            .replace("area_mm2 = 42.1", "area_mm2 = 32.4")
            .replace("modules = \"1, 5, 8-10, 12-13\"", "modules = \"0-6\"")
            .replace("# geometry = \"left_forearm_mesh.txt\"", "geometry = \"skin.txt\"")
            .replace("area_factor = \"off\"", "area_factor = \"from-loads\"");
        std::fs::write(&file, text).unwrap();
        let scene = resolve(&parse(&file, &std::fs::read_to_string(&file).unwrap()).unwrap(), &file).unwrap();
        let plan = &scene.plan.patches[0];
        assert!(plan.area_from_loads);
        let areas: Vec<f64> = plan.areas.iter().map(|area| area.0).collect();
        let mean = areas.iter().sum::<f64>() / 230.0;
        let (least, most) = areas.iter().fold((f64::MAX, 0.0_f64), |(a, b), x| (a.min(*x), b.max(*x)));
        assert!((31.0..32.6).contains(&mean) && least > 24.0 && most < 38.0, "{least} to {most}, mean {mean}");
    }
}
