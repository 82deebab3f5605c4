//! The area that each taxel stands for: equal, or its Voronoi cell.

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

/// The area of each taxel, and what a user should know of it.
pub fn areas(
    section: &PatchSection,
    patch: &Patch,
    geometry: Option<&Geometry>,
) -> (Vec<SquareMillimetre>, Option<String>) {
    let mean = SquareMillimetre(section.area_mm2);
    let (Some(geometry), AreaWord::Voronoi) = (geometry, *section.area.get_ref()) else {
        return (vec![mean; patch.taxels().len()], None);
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
    use super::super::{load, resolve};
    use std::path::Path;

    const EXAMPLE: &str = include_str!("../../../../deploy/taxeld.toml");

    #[test]
    fn voronoi_without_geometry_is_refused_with_its_line() {
        let text = EXAMPLE.replace("area = \"equal\"", "area = \"voronoi\"");
        let line = 1 + text.lines().position(|l| l.starts_with("area = \"voronoi\"")).unwrap();
        let message = parse(Path::new("t.toml"), &text).unwrap_err().to_string();
        assert!(message.starts_with(&format!("t.toml:{line}: patch `left_forearm`: area")), "{message}");
        assert!(message.contains("set geometry"), "{message}");
    }

    #[test]
    fn the_two_words_are_closed_lists() {
        for (word, wrong) in
            [("area = \"equal\"", "area = \"hexagons\""), ("area_factor = \"off\"", "area_factor = \"on\"")]
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
            .replace("area = \"equal\"", "area = \"voronoi\"")
            .replace("# geometry = \"left_forearm_mesh.txt\"", "geometry = \"skin.txt\"")
            .replace("area_factor = \"off\"", "area_factor = \"from-loads\"");
        std::fs::write(&file, text).unwrap();
        let scene = resolve(&load(&file).unwrap(), &file).unwrap();
        let plan = &scene.plan.patches[0];
        assert!(plan.area_from_loads);
        let areas: Vec<f64> = plan.areas.iter().map(|area| area.0).collect();
        let mean = areas.iter().sum::<f64>() / 230.0;
        let (least, most) = areas.iter().fold((f64::MAX, 0.0_f64), |(a, b), x| (a.min(*x), b.max(*x)));
        assert!((31.0..32.6).contains(&mean) && least > 24.0 && most < 38.0, "{least} to {most}, mean {mean}");
    }
}
