//! From the pressures of one scan to a force: which taxels are touched, their sum, its uncertainty, and what else the plan asks for.

use nalgebra::Vector3;
use std::ops::Range;
use taxel_skin::{Geometry, Newton, NormalsVerdict, SquareMillimetre};

use crate::counts::Counts;
use crate::force::budget::{Budget, Term};
use crate::force::contacts::{Placed, apart, together};
use crate::force::coverage::{self, Unread};
use crate::force::evaluator::Evaluator;
use crate::force::fill::{MadeUp, near, of_unread};
use crate::force::neighbours::Neighbours;
use crate::force::offsets::Offsets;
use crate::force::place::Places;
use crate::force::sample::ForceSample;
use crate::force::sampling::{Contact, Pressed};
use crate::force::unloading::still_there_n;
use crate::force::untouched::SHARED_NOISE;
use crate::model_set::GAIN_OF_DAY_REL;

/// Which parts of a force sample are computed beside the total.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Outputs {
    /// Resultant force vector; needs usable normals.
    pub resultant: bool,
    /// Moment about the patch origin and centre of pressure; needs usable normals.
    pub moment: bool,
    /// Contacts of touched taxels; needs positions.
    pub contacts: bool,
    /// The total includes pressures of unread taxels, taken from those beside them; needs positions.
    pub fill: bool,
    /// Contacts are read by where they lie between the pads; needs positions, of iCub's triangles.
    pub place: bool,
}

/// What the force of a patch is worked out with.
#[derive(Clone, Debug)]
pub struct Layout {
    /// The area that each taxel stands for, one per taxel.
    pub areas: Vec<SquareMillimetre>,
    /// Relative standard uncertainty of the area that all taxels share.
    pub area_uncertainty: f64,
    /// Which parts of a sample are asked for.
    pub outputs: Outputs,
    /// Positions and normals, where the plan has them.
    pub geometry: Option<Geometry>,
    /// Which taxels form each module, ascending.
    pub modules: Vec<Range<usize>>,
}

/// The fixed part of a patch's force: its layout, with no outputs that geometry does not allow, and which taxels lie beside which.
#[derive(Clone, Debug)]
pub struct ForceModel {
    layout: Layout,
    neighbours: Option<Neighbours>,
    /// Where unread taxels are filled.
    made_up: Option<MadeUp>,
    /// Where contacts are read by their places.
    places: Option<Places>,
}

/// What a scan touches. Its owner keeps it from scan to scan, so that a scan seldom has to ask for memory.
#[derive(Clone, Debug, Default)]
pub struct Touch {
    /// Taxel and force in N, those beyond the activation threshold first.
    pub active: Vec<(usize, f64)>,
    /// Unread taxels under or beside them that others tell of.
    pub unread: Vec<Unread>,
    /// Taxels beside active ones that are not selected, ascending.
    pub missing: Vec<usize>,
    /// Taxels beside active ones that are not active themselves, each with an active one; none without positions.
    pub ring: Vec<(usize, usize)>,
    /// What is added to the force of each active taxel, by taxel, N: what those of the ring beside it read, less the offset.
    added_n: Vec<f64>,
    /// The contact that each taxel belongs to, and the sums of each; the first is of taxels without a position.
    labels: Vec<u16>,
    contacts: Vec<Contact>,
    /// How many times its sum each of them is.
    factors: Vec<f64>,
}

/// What the uncertainty of a force depends on beside its scan.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Present<'a> {
    /// Standard uncertainty of the zero that all taxels share, counts.
    pub zero_sigma_counts: f64,
    /// The same that each taxel has of its own.
    pub missed_counts: f64,
    /// How far all taxels lie from their zero, counts towards load.
    pub off_counts: f64,
    /// Standard uncertainty because a touch may be noise, N.
    pub choice_n: f64,
    /// By how many counts the taxels of each module jump together.
    pub jumps: &'a [f32],
    /// By how much the load has decreased, N.
    pub gone_n: f64,
}

/// Sums over the touched taxels that the uncertainty follows from, N unless they say otherwise.
#[derive(Clone, Copy, Debug, Default)]
struct Sums {
    own_n2: f64,
    dead_n2: f64,
    curve_n: f64,
    beyond_n: f64,
    /// Histories that are not known.
    history_n: f64,
    /// Change of the force if all counts change by one.
    per_count_n: f64,
    /// Sum of the squares of that of each taxel, N squared per count squared.
    per_count_n2: f64,
    /// N per kPa.
    area: f64,
    /// Taxels beyond the calibrated range.
    above: u32,
}

impl Touch {
    /// How many times its sum the contact of this label is.
    fn factor(&self, contact: u16) -> f64 {
        self.factors.get(usize::from(contact)).copied().unwrap_or(1.0)
    }

    /// What the touched taxels read together with those beside them, as a sum and with each contact read by its place, N, not negative.
    fn sums_n(&self) -> [f64; 2] {
        let of_taxel = |&(taxel, newton): &(usize, f64)| {
            let newton = newton + self.added_n[taxel];
            [newton, self.factor(self.labels.get(taxel).copied().unwrap_or_default()) * newton]
        };
        let both = self.active.iter().map(of_taxel).fold([0.0; 2], |sum, of| [sum[0] + of[0], sum[1] + of[1]]);
        both.map(|newton: f64| newton.max(0.0))
    }

    /// What a taxel of the ring bears of its dead zone: such a share as of those beside it are touched, in the mean over made-up
    /// contacts (`tests/physics/contacts.py --edge`).
    fn dead_share(&self, neighbours: &Neighbours, taxel: usize) -> f64 {
        let is_touched = |other: &usize| ![0, Neighbours::BESIDE].contains(&self.labels[*other]);
        let (touched, all) = (neighbours.of(taxel).filter(is_touched).count(), neighbours.of(taxel).count());
        touched as f64 / all as f64
    }
}

impl ForceModel {
    /// Of a patch that is laid out so.
    pub fn new(mut layout: Layout) -> Self {
        let geometry = layout.geometry.as_ref();
        let directed = geometry.is_some_and(|g| g.normals == NormalsVerdict::Usable);
        let neighbours = geometry.map(Neighbours::new);
        layout.outputs.resultant &= directed;
        layout.outputs.moment &= directed;
        layout.outputs.contacts &= neighbours.is_some();
        layout.outputs.fill &= neighbours.is_some();
        let made_up = layout.outputs.fill.then(MadeUp::new);
        let placed = layout.geometry.as_ref().filter(|_| layout.outputs.place);
        let places = placed.map(|geometry| Places::new(geometry, &layout.areas));
        Self { layout, neighbours, made_up, places }
    }

    /// How the patch is laid out.
    pub const fn layout(&self) -> &Layout {
        &self.layout
    }

    /// Which taxels are touched, those at the rim of a contact with them, and what lies on unread ones beside them.
    pub fn touch(&self, evaluator: &Evaluator, counts: Counts<'_>, touch: &mut Touch) {
        touch.active.clear();
        touch.unread.clear();
        touch.contacts.clear();
        touch.missing.clear();
        touch.ring.clear();
        evaluator.find_active(counts, &mut touch.active);
        if touch.active.is_empty() {
            return;
        }
        let low = |taxel: usize| counts.raw(taxel).map_or(0.0, |count| evaluator.low_n(taxel, count));
        let Touch { active, labels, ring, .. } = touch;
        let contacts = self.neighbours.as_ref().map_or(0, |all| all.grow(active, labels, ring, low));
        self.find_unread(evaluator.selection(), low, touch);
        if let (Some(made_up), false) = (&self.made_up, touch.unread.is_empty()) {
            self.fill(made_up, evaluator.selection(), low, touch);
        }
        touch.contacts.resize(contacts + 1, Contact::default());
        for &(taxel, newton) in &touch.active {
            let contact = touch.labels.get(taxel).filter(|_| contacts > 0).map_or(0, |&label| usize::from(label));
            touch.contacts[contact].add(self.pressed(taxel, newton));
        }
        self.find_factors(touch);
    }

    /// How many times its sum each contact is, by its place. What lies on unread taxels belongs to its shape, where that is known.
    fn find_factors(&self, touch: &mut Touch) {
        let Touch { unread, missing, contacts, factors, .. } = touch;
        factors.clear();
        let Some(places) = self.places.as_ref().filter(|_| self.layout.outputs.fill || missing.is_empty()) else {
            return factors.resize(contacts.len(), 1.0);
        };
        let of_contact = |(label, contact): (usize, &Contact)| {
            let mut shape = *contact;
            let filled = unread.iter().filter(|one| usize::from(one.contact) == label);
            filled.for_each(|one| shape.add(self.pressed(one.taxel, one.kpa * self.newton_per_kpa(one.taxel))));
            places.factor(&shape)
        };
        factors.extend(contacts.iter().enumerate().map(of_contact));
    }

    fn pressed(&self, taxel: usize, newton: f64) -> Pressed {
        let pose = self.layout.geometry.as_ref().and_then(|geometry| geometry.poses[taxel]);
        Pressed {
            kpa: newton / self.newton_per_kpa(taxel),
            newton,
            area_mm2: self.layout.areas[taxel].0,
            place_mm: pose.map(|pose| 1e3 * Vector3::from(pose.position)),
            at_rim: self.is_at_rim(taxel),
        }
    }

    /// Finds the unread taxels beside touched ones; `low` is what a read one bears, N.
    fn find_unread(&self, selected: &[bool], low: impl Fn(usize) -> f64, touch: &mut Touch) {
        let kpa = |taxel: usize| low(taxel) / self.newton_per_kpa(taxel);
        let Touch { active, unread, missing, .. } = touch;
        match &self.neighbours {
            Some(neighbours) => {
                neighbours.missing_beside(active, |taxel| selected[taxel], missing);
                unread.extend(missing.iter().filter_map(|&taxel| {
                    let beside = || neighbours.of(taxel).filter(|&other| selected[other]).map(kpa);
                    Unread::by(taxel, neighbours.is_at_rim(taxel), beside)
                }));
            }
            None => {
                let is_touched = |range: &&Range<usize>| active.iter().any(|(taxel, _)| range.contains(taxel));
                for range in self.layout.modules.iter().filter(is_touched) {
                    let read = || range.clone().filter(|&taxel| selected[taxel]).map(kpa);
                    let of_module = range.clone().filter(|&taxel| !selected[taxel]);
                    missing.extend(of_module.clone());
                    unread.extend(of_module.filter_map(|taxel| Unread::by(taxel, false, read)));
                }
            }
        }
    }

    /// What lies on the unread taxels of each contact, by made-up ones that fit it; `low` is what a read one bears, N.
    fn fill(&self, made_up: &MadeUp, selected: &[bool], low: impl Fn(usize) -> f64, touch: &mut Touch) {
        let (Some(neighbours), Some(geometry)) = (&self.neighbours, &self.layout.geometry) else { return };
        let Touch { active, unread, labels, .. } = touch;
        let kpa = |taxel: usize| low(taxel) / self.newton_per_kpa(taxel);
        let beside = |taxel: usize| neighbours.of(taxel).filter(move |&other| selected[other]);
        for one in unread.iter_mut() {
            let most = beside(one.taxel).max_by(|a, b| kpa(*a).total_cmp(&kpa(*b)));
            one.contact = most.map_or(0, |other| labels[other]);
        }
        for place in 0..unread.len() {
            let contact = unread[place].contact;
            if unread[..place].iter().any(|one| one.contact == contact) {
                continue; // it was its turn
            }
            let pressed = active.iter().filter(|(taxel, _)| labels[*taxel] == contact);
            let pressed = pressed.map(|&(taxel, newton)| (taxel, newton / self.newton_per_kpa(taxel)));
            let is_of_another = |taxel: usize| ![0, contact, Neighbours::BESIDE].contains(&labels[taxel]);
            let read = |taxel: usize| selected[taxel].then(|| kpa(taxel));
            let Some((taxels, near)) = near(geometry, pressed, is_of_another, read) else { continue };
            let fit = made_up.fit(&near);
            let at = |taxel: usize| taxels.binary_search(&taxel).ok();
            for one in unread.iter_mut().filter(|one| one.contact == contact) {
                let Some(own) = at(one.taxel) else { continue };
                let beside = beside(one.taxel).filter_map(|other| Some([kpa(other), fit[at(other)?][0]]));
                (one.kpa, one.sigma_kpa) = of_unread(fit[own], beside);
            }
        }
    }

    /// The force of one scan, which is `touch`, without its state, its reasons and what may be there undetected.
    pub fn measure(
        &self,
        evaluator: &Evaluator,
        counts: Counts<'_>,
        touch: &mut Touch,
        present: Present<'_>,
    ) -> ForceSample {
        let mut sums = self.sums(evaluator, counts, &touch.active);
        self.add_ring(evaluator, counts, touch, present.off_counts, &mut sums);
        let touched = &*touch;
        let Touch { active, unread, contacts, .. } = touched;
        let [summed_n, read_n] = touched.sums_n();
        let unread_n = |kpa: fn(&Unread) -> f64| {
            unread.iter().map(move |one| touched.factor(one.contact) * kpa(one) * self.newton_per_kpa(one.taxel))
        };
        // Filled taxels err independently; what is left out is too little of all of them.
        let (filled_n, missing_n) = if self.layout.outputs.fill {
            let squares: f64 = unread_n(|one| one.sigma_kpa).map(|newton| newton * newton).sum();
            (unread_n(|one| one.kpa).sum(), squares.sqrt())
        } else {
            (0.0, unread_n(Unread::missing_kpa).fold(0.0, |sum, newton| sum + newton))
        };
        let total_n = read_n + filled_n;
        // What all touched taxels share those have, too, that are filled from them.
        let [placed, scale] = [read_n, total_n].map(|newton| if summed_n > 0.0 { newton / summed_n } else { 1.0 });
        let set = evaluator.tables().set();
        let zero_n = scale * (present.zero_sigma_counts * sums.per_count_n);
        let missed_n = scale * present.missed_counts * sums.per_count_n2.sqrt();
        let sampling_n2: f64 = contacts.iter().map(|contact| contact.sigma_n().powi(2)).sum();
        let budget = Budget::default()
            .with(Term::Readings, placed * sums.own_n2.sqrt())
            .with(Term::Choice, present.choice_n)
            .with(Term::Zero, zero_n.hypot(missed_n))
            .with(Term::Hysteresis, scale * sums.history_n)
            .with(Term::Unloading, still_there_n(set.unloading_share(), present.gone_n, total_n))
            .with(Term::Curve, scale * sums.curve_n)
            .with(Term::BeyondRange, scale * sums.beyond_n)
            .with(Term::Gauge, (set.gauge_gain_rel * total_n).hypot(scale * set.gauge_offset_kpa * sums.area))
            .with(Term::GainOfDay, GAIN_OF_DAY_REL * total_n)
            .with(Term::Area, self.layout.area_uncertainty * total_n)
            .with(Term::Sampling, scale * sampling_n2.sqrt())
            .with(Term::Rim, scale * contacts.iter().map(Contact::rim_sigma_n).sum::<f64>())
            .with(Term::DeadZone, scale * sums.dead_n2.sqrt())
            .with(Term::Unread, missing_n)
            .with(Term::Flicker, scale * self.flicker_n(evaluator, counts, active, present.jumps));
        let mut sample = ForceSample {
            total: Some(Newton(total_n)),
            total_sigma: Some(budget.sigma()),
            budget,
            active: active.len() as u32,
            out_of_range: sums.above,
            ..ForceSample::default()
        };
        if self.layout.outputs.fill {
            let Touch { active, unread, labels, .. } = &mut *touch;
            active.extend(unread.iter().map(|one| (one.taxel, one.kpa * self.newton_per_kpa(one.taxel))));
            unread.iter().for_each(|one| labels[one.taxel] = one.contact);
        }
        if let Some(geometry) = &self.layout.geometry {
            self.add_geometry(&mut sample, geometry, touch);
        }
        sample
    }

    /// What may lie at most on the unread taxels of a touch, N.
    pub fn unread_at_most_n(&self, touch: &Touch) -> f64 {
        touch.unread.iter().map(|one| one.at_most_kpa * self.newton_per_kpa(one.taxel)).sum()
    }

    /// The taxels that are neither selected nor beside two that are, ascending.
    pub fn uncovered(&self, selected: &[bool]) -> Vec<u16> {
        coverage::uncovered(self.neighbours.as_ref(), &self.layout.modules, selected)
    }

    /// 1 kPa on 1 mm2 is 1e-3 N.
    fn newton_per_kpa(&self, taxel: usize) -> f64 {
        self.layout.areas[taxel].0 * 1e-3
    }

    /// Without positions any taxel may lie there.
    fn is_at_rim(&self, taxel: usize) -> bool {
        self.neighbours.as_ref().is_none_or(|neighbours| neighbours.is_at_rim(taxel))
    }

    /// What the taxels beside a touch read goes to the touched ones that they lie beside, and the offset of all is taken off.
    fn add_ring(&self, evaluator: &Evaluator, counts: Counts<'_>, touch: &mut Touch, off_counts: f64, sums: &mut Sums) {
        let (tables, selected) = (evaluator.tables(), evaluator.selection());
        touch.added_n.clear();
        touch.added_n.resize(selected.len(), 0.0);
        for &(taxel, _) in &touch.active {
            let Some(share) = counts.raw(taxel).and_then(|count| tables.share(taxel, count)) else { continue };
            touch.added_n[taxel] -= off_counts * f64::from(share.per_count_n);
        }
        for &(taxel, beside) in &touch.ring {
            let Some(count) = counts.units(taxel).filter(|_| selected[taxel]) else { continue };
            let light = tables.light(taxel);
            let pressed = light.pressed(count) - off_counts;
            let has_dead = self.neighbours.as_ref().filter(|_| light.dead_n > 0.0);
            let dead_share = has_dead.map_or(0.0, |neighbours| touch.dead_share(neighbours, taxel));
            touch.added_n[beside] += light.newton_per_count * pressed + light.dead_n * dead_share;
            sums.own_n2 += SHARED_NOISE * light.noise_n().powi(2);
            sums.dead_n2 += light.dead_n.powi(2) * dead_share * (1.0 - dead_share);
            sums.per_count_n += light.newton_per_count;
            sums.per_count_n2 += light.newton_per_count.powi(2);
        }
    }

    fn sums(&self, evaluator: &Evaluator, counts: Counts<'_>, active: &[(usize, f64)]) -> Sums {
        let (tables, mut sums) = (evaluator.tables(), Sums::default());
        for &(taxel, _) in active {
            let Some(share) = counts.raw(taxel).and_then(|count| tables.share(taxel, count)) else { continue };
            sums.own_n2 += f64::from(share.own_n2);
            sums.per_count_n += f64::from(share.per_count_n);
            sums.per_count_n2 += f64::from(share.per_count_n).powi(2);
            sums.above += u32::from(share.is_above);
            sums.curve_n += f64::from(share.curve_n);
            sums.beyond_n += f64::from(share.beyond_n);
            sums.area += self.newton_per_kpa(taxel);
        }
        if let Some(offsets) = unknown_histories(evaluator) {
            let of_one = |&(taxel, _): &(usize, f64)| self.newton_per_kpa(taxel) * offsets.sigma_kpa(taxel);
            sums.history_n = active.iter().map(of_one).sum();
        }
        sums
    }

    /// A reading is on one end of its module's jump or on the other, of which the standard deviation is half of the jump at most.
    fn flicker_n(&self, evaluator: &Evaluator, counts: Counts<'_>, active: &[(usize, f64)], jumps: &[f32]) -> f64 {
        if jumps.iter().all(|jump| *jump <= 0.0) {
            return 0.0; // nearly always
        }
        let per_count_n = |&(taxel, _): &(usize, f64)| {
            let share = counts.raw(taxel).and_then(|count| evaluator.tables().share(taxel, count));
            share.map_or(0.0, |share| f64::from(share.per_count_n))
        };
        let of_module = |(range, jump): (&Range<usize>, &f32)| {
            let touched = active.iter().filter(|(taxel, _)| range.contains(taxel));
            0.5 * f64::from(jump.max(0.0)) * touched.map(per_count_n).sum::<f64>()
        };
        self.layout.modules.iter().zip(jumps).map(of_module).map(|newton| newton * newton).sum::<f64>().sqrt()
    }

    fn add_geometry(&self, sample: &mut ForceSample, geometry: &Geometry, touch: &Touch) {
        let outputs = self.layout.outputs;
        if !(outputs.resultant || outputs.moment || outputs.contacts) {
            return; // nobody asks for any of it
        }
        let placed = touch.active.iter().filter_map(|&(taxel, newton)| {
            let (pose, area_mm2) = (geometry.poses.get(taxel).copied().flatten()?, self.layout.areas[taxel].0);
            let (contact, kpa) = (touch.labels.get(taxel).copied().unwrap_or_default(), 1e3 * newton / area_mm2);
            let force_n = touch.factor(contact) * (newton + touch.added_n.get(taxel).copied().unwrap_or(0.0));
            Some(Placed { taxel: taxel as u16, contact, pose, force_n, area_mm2, kpa }) // 1 N on 1 mm2 is 1,000 kPa
        });
        let placed = placed.collect::<Vec<_>>();
        let all = together(placed.iter().copied());
        sample.resultant = outputs.resultant.then_some(all.resultant);
        sample.moment = outputs.moment.then_some(all.moment);
        sample.centre_of_pressure = (outputs.moment && all.force_n > 0.0).then_some(all.centre);
        if outputs.contacts {
            sample.contacts = apart(placed);
        }
    }
}

/// What the histories add, if some of them are not known.
fn unknown_histories(evaluator: &Evaluator) -> Option<&Offsets> {
    evaluator.hysteresis().filter(|offsets| !offsets.are_known())
}
