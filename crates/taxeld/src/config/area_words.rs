//! What the file may say of areas.

use serde::Deserialize;
use toml::Spanned;

/// `area`
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum AreaWord {
    /// The module's area is shared out as its taxels sample it, `area_mm2` in the mean of a module.
    #[default]
    Template,
    /// `area_mm2` for each, as in the paper.
    Equal,
    /// The cell of each taxel on the surface, `area_mm2` in the mean of a module.
    Voronoi,
}

/// `area_factor`
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum AreaFactorWord {
    /// Areas are used as configured.
    #[default]
    Off,
    /// Areas are multiplied by the factor that known loads give, once there are three.
    FromLoads,
}

/// The default of `area`, which is at no place in the file.
pub fn template() -> Spanned<AreaWord> {
    Spanned::new(0..0, AreaWord::Template)
}
