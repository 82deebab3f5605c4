//! From a load to the taxels: which pressure each of them feels.

use crate::load::{LoadError, Mass};
use crate::skin::Skin;
use std::f64::consts::PI;
use std::sync::Arc;

/// How the pressure of a load reaches the taxels.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum LoadPath {
    /// Shared out over the taxels whose centres lie under it, so that pressures times taxel areas add up to its weight
    /// exactly. No real skin does that: a sum over taxels then has no error but that of the models.
    #[default]
    Shared,
    /// Through a soft layer to round pads, over gaps and all.
    Layer(Layer),
}

/// A soft layer over round pads. The pressure at the surface spreads in it as in a half-space (Boussinesq 1885): what a
/// point load gives at depth h and distance r is 3 h^3 / (2 pi (r^2 + h^2)^(5/2)) of it a square millimetre. A pad feels
/// the mean over its disc. The part of a load that hangs over the rim of the skin is carried by the rest of its footprint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Layer {
    /// Depth of the pads under the surface, mm.
    pub depth_mm: f64,
    /// Radius of a pad, mm.
    pub pad_radius_mm: f64,
    /// Share of a taxel's pressure that is the mean of its neighbours' instead of its own: fields between electrodes.
    pub crosstalk: f64,
}

impl Default for Layer {
    /// iCub's foam of 2 mm and pads of 4 mm. The crosstalk is a guess.
    fn default() -> Self {
        Self { depth_mm: 2.0, pad_radius_mm: 2.0, crosstalk: 0.03 }
    }
}

/// What a load does to the skin while all of its weight rests there: pressures on the taxels that feel it, kPa, with the
/// taxel's index, to be added up; never empty.
pub(crate) type Pressed = Vec<(usize, f64)>;

/// So much of the way from one to another, 0 to 1.
pub(crate) fn between(one: &Pressed, other: &Pressed, share: f64) -> Pressed {
    let weighted =
        |pressed: &Pressed, by: f64| pressed.iter().map(|&(taxel, kpa)| (taxel, by * kpa)).collect::<Vec<_>>();
    [weighted(one, 1.0 - share), weighted(other, share)].concat()
}

/// Beyond this distance a pad feels next to nothing of a point load, mm: 1 % of it under 2 mm of layer.
const REACH_MM: f64 = 9.0;
/// Distance of the points at which a pad is asked what it feels, mm.
const STEP_MM: f64 = 0.5;
/// Taxels within this distance are neighbours, mm.
const NEIGHBOUR_MM: f64 = 8.0;

/// Points of the skin where a pad feels a pressure at the surface, in mm about its centre, with the share of that; so many
/// at a time as a processor may take.
#[derive(Clone, Debug, Default)]
pub(crate) struct Felt {
    points: Vec<[[f64; 3]; LANES]>,
}

const LANES: usize = 8;

impl Felt {
    fn of(points: &[[f64; 3]]) -> Self {
        let some = |points: &[[f64; 3]]| std::array::from_fn(|lane| points.get(lane).copied().unwrap_or_default());
        Self { points: points.chunks(LANES).map(some).collect() }
    }

    /// The mean of this pressure over the pad.
    fn mean(&self, density: impl Fn(f64, f64) -> f64) -> f64 {
        let mut lanes = [0.0; LANES];
        for points in &self.points {
            for (sum, [x, y, share]) in lanes.iter_mut().zip(points) {
                *sum += share * density(*x, *y);
            }
        }
        lanes.iter().sum()
    }
}

/// [`LoadPath`] made ready: what is the same for all loads is worked out once.
#[derive(Clone, Debug)]
pub(crate) enum Path {
    Shared,
    Layer { felt: Arc<[Felt]>, crosstalk: f64, neighbours: Vec<Vec<usize>> },
}

impl Path {
    pub(crate) fn new(path: LoadPath, skin: &Skin) -> Self {
        match path {
            LoadPath::Shared => Self::Shared,
            LoadPath::Layer(layer) => {
                Self::Layer { felt: felt(layer, skin), crosstalk: layer.crosstalk, neighbours: neighbours(skin) }
            }
        }
    }

    /// The mass with the centre of its footprint at this place of the unrolled surface.
    ///
    /// # Errors
    /// [`LoadError::BesideTheSkin`] if nothing of it lies on the skin.
    pub(crate) fn press(&self, skin: &Skin, mass: &Mass, centre_mm: [f64; 2]) -> Result<Pressed, LoadError> {
        match self {
            Self::Shared => Ok(shared(skin, mass, centre_mm)),
            Self::Layer { felt, crosstalk, neighbours } => {
                let pressed = through_layer(felt, skin, mass, centre_mm)?;
                Ok(if *crosstalk > 0.0 { mixed(&pressed, *crosstalk, neighbours) } else { pressed })
            }
        }
    }
}

/// Where the covered taxels bear all. Where it covers no taxel, the nearest one does.
fn shared(skin: &Skin, mass: &Mass, centre_mm: [f64; 2]) -> Pressed {
    let poses = skin.poses();
    let from_centre = |index: usize| {
        let [x, y] = poses[index].unrolled_mm;
        [x - centre_mm[0], y - centre_mm[1]]
    };
    let density = mass.footprint.density();
    let density = |index: usize| {
        let [dx, dy] = from_centre(index);
        (index, density(dx, dy))
    };
    let mut covered: Vec<(usize, f64)> = (0..poses.len()).map(density).filter(|(_, weight)| *weight > 0.0).collect();
    if covered.is_empty() {
        let distance = mass.footprint.distance();
        let distance = |index: &usize| {
            let [dx, dy] = from_centre(*index);
            distance(dx, dy)
        };
        let nearest = (0..poses.len()).min_by(|i, j| distance(i).total_cmp(&distance(j)));
        covered.extend(nearest.map(|index| (index, 1.0)));
    }
    let total: f64 = covered.iter().map(|(_, weight)| weight).sum();
    let kpa_per_weight = mass.weight().0 / (total * skin.taxel_area().0 * 1e-3);
    covered.into_iter().map(|(index, weight)| (index, weight * kpa_per_weight)).collect()
}

fn through_layer(felt: &[Felt], skin: &Skin, mass: &Mass, [x, y]: [f64; 2]) -> Result<Pressed, LoadError> {
    let footprint = &mass.footprint;
    let density = footprint.density();
    let on_skin = |[dx, dy]: [f64; 2]| {
        let density = density(dx, dy);
        (density > 0.0 && skin.covers([x + dx, y + dy])).then_some(density)
    };
    let total: f64 = footprint.grid().filter_map(on_skin).sum();
    if total <= 0.0 {
        return Err(LoadError::BesideTheSkin);
    }
    // N / mm2 is 1000 kPa.
    let kpa_per_density = 1000.0 * mass.weight().0 / (total * footprint.step_mm().powi(2));
    let far_mm = footprint.semi_axes_mm[0].max(footprint.semi_axes_mm[1]) + REACH_MM;
    let presses = |((index, pose), points): ((usize, &crate::skin::Pose), &Felt)| {
        let [dx, dy] = [pose.unrolled_mm[0] - x, pose.unrolled_mm[1] - y];
        if dx * dx + dy * dy > far_mm * far_mm {
            return None;
        }
        let mean = points.mean(|u, v| density(dx + u, dy + v));
        (mean > 0.0).then_some((index, mean * kpa_per_density))
    };
    Ok(skin.poses().iter().enumerate().zip(felt).filter_map(presses).collect())
}

/// What each taxel of a skin feels; the shares of a pad amid the skin add up to 1.
fn felt(layer: Layer, skin: &Skin) -> Arc<[Felt]> {
    let stencil = stencil(layer);
    let of = |pose: &crate::skin::Pose| {
        let [x, y] = pose.unrolled_mm;
        let on_skin = |[u, v, _]: &[f64; 3]| skin.covers([x + u, y + v]);
        Felt::of(&stencil.iter().copied().filter(on_skin).collect::<Vec<_>>())
    };
    skin.poses().iter().map(of).collect()
}

/// What a pad feels where skin lies all around: points as of [`Felt`], the shares of which add up to 1.
fn stencil(layer: Layer) -> Vec<[f64; 3]> {
    let grid = |reach_mm: f64| {
        let steps = (reach_mm / STEP_MM).floor() as i32;
        let along = move || (-steps..=steps).map(|n| f64::from(n) * STEP_MM);
        along().flat_map(move |x| along().map(move |y| [x, y])).filter(move |[x, y]| x.hypot(*y) <= reach_mm)
    };
    let h = layer.depth_mm;
    let point = |r2: f64| 3.0 * h.powi(3) / (2.0 * PI * (r2 + h * h).powf(2.5));
    let pad: Vec<[f64; 2]> = grid(layer.pad_radius_mm).collect();
    let felt = |[x, y]: [f64; 2]| {
        let share: f64 = pad.iter().map(|[u, v]| point((x - u).powi(2) + (y - v).powi(2))).sum();
        [x, y, share]
    };
    let mut stencil: Vec<_> = grid(REACH_MM).map(felt).collect();
    let total: f64 = stencil.iter().map(|[_, _, share]| share).sum();
    stencil.iter_mut().for_each(|[_, _, share]| *share /= total);
    stencil
}

fn neighbours(skin: &Skin) -> Vec<Vec<usize>> {
    let place = |index: usize| skin.poses()[index].unrolled_mm;
    let near = |i: usize, j: usize| {
        let ([ax, ay], [bx, by]) = (place(i), place(j));
        i != j && (ax - bx).hypot(ay - by) <= NEIGHBOUR_MM
    };
    let taxels = skin.poses().len();
    (0..taxels).map(|i| (0..taxels).filter(|&j| near(i, j)).collect()).collect()
}

/// Every taxel takes a share of what it feels from its neighbours' mean.
fn mixed(kpa: &[(usize, f64)], crosstalk: f64, neighbours: &[Vec<usize>]) -> Vec<(usize, f64)> {
    let mut own = vec![0.0; neighbours.len()];
    for &(index, pressure) in kpa {
        own[index] = pressure;
    }
    let mix = |index: usize| {
        let beside = &neighbours[index];
        let mean = beside.iter().map(|&other| own[other]).sum::<f64>() / beside.len().max(1) as f64;
        (1.0 - crosstalk) * own[index] + crosstalk * mean
    };
    (0..own.len()).map(|index| (index, mix(index))).filter(|(_, pressure)| *pressure > 0.0).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::load::{Footprint, Profile, STANDARD_GRAVITY};
    use proptest::prelude::*;
    use taxel_skin::{Kilopascal, Newton, TaxelIndex};

    fn press(path: LoadPath, skin: &Skin, mass: &Mass) -> Result<Pressed, LoadError> {
        Path::new(path, skin).press(skin, mass, mass.footprint.centre_mm(skin)?)
    }

    fn force_n(skin: &Skin, pressed: &Pressed) -> f64 {
        pressed.iter().map(|(_, p)| Kilopascal(*p).on(skin.taxel_area())).sum::<Newton>().0
    }

    proptest! {
        #[test]
        fn shared_pressures_add_up_to_the_weight(
            kilogram in 0.05_f64..5.0, taxel in 0_u16..230, area in 40.0_f64..2500.0, stretch in 0.4_f64..2.5, turn in -3.0_f64..3.0,
        ) {
            let skin = Skin::forearm().unwrap();
            let mut mass = Mass::on_disc(kilogram, TaxelIndex(taxel), area);
            mass.footprint.semi_axes_mm[0] *= stretch;
            mass.footprint.turn = turn;
            let pressed = press(LoadPath::Shared, &skin, &mass).unwrap();
            let force = force_n(&skin, &pressed);
            prop_assert!((force - kilogram * STANDARD_GRAVITY).abs() < 1e-9 * force);
            prop_assert!(pressed.iter().all(|(_, p)| *p > 0.0));
        }
    }

    #[test]
    fn through_the_layer_a_wide_flat_load_is_felt_as_it_is_and_a_small_one_is_blurred() {
        let skin = Skin::forearm_with_gaps(18.0).unwrap();
        let layer = LoadPath::Layer(Layer { crosstalk: 0.0, ..Layer::default() });
        let centre = TaxelIndex(103); // the centre of a module in the middle
        let mut mass = Mass::on_disc(1.0, centre, PI * 400.0);
        mass.footprint.profile = Profile::Flat;
        let pressed = press(layer, &skin, &mass).unwrap();
        let mean_kpa = 1000.0 * mass.weight().0 / (PI * 400.0);
        let under = pressed.iter().find(|(index, _)| *index == 103).unwrap().1;
        assert!((under / mean_kpa - 1.0).abs() < 0.01, "{under} kPa in the middle of {mean_kpa} kPa");
        let point = Mass::on_disc(0.1, centre, PI);
        let felt = press(layer, &skin, &point).unwrap();
        let under = felt.iter().find(|(index, _)| *index == 103).unwrap().1;
        let surface_kpa = 1000.0 * point.weight().0 / PI;
        assert!(under < 0.2 * surface_kpa, "{under} kPa of {surface_kpa} kPa at the surface");
    }

    #[test]
    fn impossible_loads_are_refused() {
        let skin = Skin::forearm().unwrap();
        let refused = |mass: Mass| press(LoadPath::Layer(Layer::default()), &skin, &mass).unwrap_err();
        assert!(matches!(refused(Mass::on_disc(1.0, TaxelIndex(230), 100.0)), LoadError::Taxel { .. }));
        let beside = Footprint { offset_mm: [500.0, 0.0], ..Footprint::disc(TaxelIndex(0), 100.0) };
        assert_eq!(refused(Mass { kilogram: 1.0, footprint: beside }), LoadError::BesideTheSkin);
    }
}
