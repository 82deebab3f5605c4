//! What makes a real skin's force worse than that of an ideal one, each switchable.

use crate::config::Config;
use crate::path::{Layer, LoadPath};
use crate::skin::Skin;
use taxel_skin::LayoutError;

/// Distance of the modules' centres on a skin with gaps, mm: within what is seen on the robots, 17.3 to 18.8.
const MODULE_SPACING_MM: f64 = 18.0;

/// One thing that a plain simulated skin leaves out. Friction, one creep of 15 s, noise, rounding, drift of temperature and
/// the residues of a tare are always there.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Effect {
    /// Gaps between the modules, a soft layer of 2 mm and pads of 4 mm (iCub's foam): a sum over taxels samples a load.
    GapsAndLayer,
    /// A taxel takes 3 % of its pressure from its neighbours. A guess. Part of [`Effect::GapsAndLayer`]'s path.
    Crosstalk,
    /// Creep of 0.3, 60 and 300 s beside that of 15 s, 1 to 2 % each: recordings of insoles creep over minutes; the shares
    /// are guesses.
    SlowCreep,
    /// The bag's foil presses 2 % more or less on each taxel. A guess.
    Wrinkles,
    /// One end of the limb warms a third more than the other. A guess.
    Gradient,
    /// On another day the gain of the whole skin is 3 % off and that of each taxel another 2 %: two recordings of one
    /// insole differ by 4 %.
    Ageing,
    /// The gauge follows within 50 ms, as cheap ones do. A guess.
    GaugeLag,
}

impl Effect {
    /// All of them.
    pub const ALL: [Self; 7] = [
        Self::GapsAndLayer,
        Self::Crosstalk,
        Self::SlowCreep,
        Self::Wrinkles,
        Self::Gradient,
        Self::Ageing,
        Self::GaugeLag,
    ];

    /// A forearm and its world with these effects, and no others.
    ///
    /// # Errors
    /// [`LayoutError`], which the fixed layout cannot cause.
    pub fn forearm(effects: &[Self], seed: u64) -> Result<(Skin, Config), LayoutError> {
        let mut config = Config::seeded(seed);
        effects.iter().for_each(|effect| effect.apply(&mut config));
        let skin = match config.loads {
            LoadPath::Shared => Skin::forearm()?,
            LoadPath::Layer(_) => Skin::forearm_with_gaps(MODULE_SPACING_MM)?,
        };
        Ok((skin, config))
    }

    fn apply(self, config: &mut Config) {
        let layer = match config.loads {
            LoadPath::Shared => Layer { crosstalk: 0.0, ..Layer::default() },
            LoadPath::Layer(layer) => layer,
        };
        match self {
            Self::GapsAndLayer => config.loads = LoadPath::Layer(layer),
            Self::Crosstalk => {
                let crosstalk = Layer::default().crosstalk;
                config.loads = LoadPath::Layer(Layer { crosstalk, ..layer });
            }
            Self::SlowCreep => config.dielectric.more_creep = [(0.01, 0.3), (0.02, 60.0), (0.01, 300.0)],
            Self::Wrinkles => config.bag.wrinkle_sd = 0.02,
            Self::Gradient => config.dielectric.thermal_gradient = 0.3,
            Self::Ageing => config.dielectric.day_gain_sd = [0.03, 0.02],
            Self::GaugeLag => config.gauge.lag_s = 0.05,
        }
    }
}
