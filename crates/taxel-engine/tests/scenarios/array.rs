//! 48 taxels that are no skin of iCub, in front of an engine, whichever way their scans come.

use taxel_engine::plan::Gauge;
use taxel_sim::GaugeConfig;
use taxel_skin::{BoardAddress, BusIndex, CountRange, Module};
use taxel_wire::signal::SignalSpec;

use crate::prelude::*;

pub const TAXELS: usize = 48;
pub const PERIOD: Duration = Duration::from_millis(20);
const AREA_MM2: f64 = 16.0;

/// A patch of these modules on one board, counts from 0 to `top`, without devices.
pub fn patch_of(name: &str, modules: u8, top: u16) -> PatchPlan {
    let kind = ModuleKind::Cells(TAXELS as u8 / modules);
    let modules = (0..modules).map(|module| (Module::from_nibble(module), kind)).collect();
    let board = Board { bus: BUS, address: BoardAddress::new(1).unwrap(), modules };
    let patch = Patch::new(name, vec![board]).unwrap().with_counts(CountRange::to(top).unwrap());
    PatchPlan { period: PERIOD, areas: vec![SquareMillimetre(AREA_MM2); TAXELS], ..PatchPlan::new(patch) }
}

/// A gauge that sends Pascals.
pub fn gauge(bus: BusIndex, id: CanId) -> Gauge {
    Gauge::new(bus, SignalSpec { id, ..GaugeConfig::default().signal })
}

/// What presses on the taxels, and what they make of it.
pub struct Skin {
    bits: u64,
    /// What the bag presses with.
    pub bag_kpa: f64,
    /// What presses on the first taxels beside it, kPa.
    pub load: (usize, f64),
    /// What the device has taken for nothing, units by taxel.
    pub taken: Vec<f64>,
}

impl Skin {
    pub fn new() -> Self {
        Self { bits: 0x9E37_79B9_7F4A_7C15, bag_kpa: 0.0, load: (0, 0.0), taken: vec![0.0; TAXELS] }
    }

    /// Units by which a taxel has moved.
    fn moved(&self, taxel: usize) -> f64 {
        let (loaded, kpa) = self.load;
        let kpa = self.bag_kpa + if taxel < loaded { kpa } else { 0.0 };
        (90.0 + taxel as f64) * kpa / (kpa + 60.0)
    }

    /// The device takes what lies on it for nothing, and leaves no residue that would show it.
    pub fn take_zero(&mut self) {
        self.taken = (0..TAXELS).map(|taxel| self.moved(taxel)).collect();
    }

    /// From -1 to 1, more often near 0.
    fn chance(&mut self) -> f64 {
        let mut one = || {
            self.bits ^= self.bits << 13;
            self.bits ^= self.bits >> 7;
            self.bits ^= self.bits << 17;
            (self.bits >> 11) as f64 / (1_u64 << 53) as f64
        };
        (0..4).map(|_| one()).sum::<f64>() - 2.0
    }

    /// A scan of so many counts a unit.
    pub fn counts(&mut self, per_unit: f64) -> Vec<u16> {
        let mut count = |taxel| (per_unit * (230.0 - self.moved(taxel) + self.taken[taxel] + self.chance())) as u16;
        (0..TAXELS).map(&mut count).collect()
    }

    pub fn pascal(&self) -> [u8; 4] {
        ((self.bag_kpa * 1e3).round() as i32).to_le_bytes()
    }
}

pub trait Scene: Sized {
    const PATCH: &str;
    fn host(&mut self) -> &mut Host;
    fn skin(&mut self) -> &mut Skin;
    fn scan(&mut self);

    fn seconds(&mut self, seconds: f64) {
        (0..(seconds / PERIOD.as_secs_f64()).round() as u32).for_each(|_| self.scan());
    }

    /// Gives a command that is not refused.
    fn ask(&mut self, command: Command) {
        let request = self.host().command(command);
        self.host().reply(request).expect("answered at once").expect("not refused");
    }

    /// Asks for a tare that is refused within three seconds; why.
    fn refused_tare(&mut self) -> String {
        let request = self.host().command(say::tare());
        self.seconds(3.0);
        self.host().reply(request).expect("answered").expect_err("refused").to_string()
    }

    fn is(&mut self, state: ForceState) {
        let host = self.host();
        assert_eq!(host.state(), state, "{}", host.reasons());
    }

    /// It is calibrated, its models are in use, and it has a force.
    fn calibrated(mut self) -> Self {
        self.seconds(1.0);
        self.ask(say::start_on(Self::PATCH, None, &[]));
        self.seconds(2.0);
        let state = |scene: &mut Self| scene.host().session().state;
        assert_eq!(state(&mut self), SessionState::Ramping, "{}", self.host().session().reason);
        while state(&mut self) == SessionState::Ramping && self.skin().bag_kpa < 80.0 {
            self.skin().bag_kpa += 0.05;
            self.scan();
        }
        self.skin().bag_kpa = 0.0;
        self.seconds(1.0);
        assert_eq!(state(&mut self), SessionState::Review, "{}", self.host().session().reason);
        let set = self.host().newest_set();
        let (patch, model_set) = (Self::PATCH.to_owned(), set.id.clone());
        self.ask(Command::Activate { patch, model_set, expected: None });
        self.seconds(3.0);
        self.is(ForceState::Ok);
        self
    }

    /// A load on a third of the taxels is read within its uncertainty.
    fn weighs(&mut self) {
        self.skin().load = (16, 25.0);
        self.seconds(1.0);
        let force = &self.host().snapshot().force;
        let (truth, total) = (16.0 * 25.0 * AREA_MM2 * 1e-3, force.total.unwrap().0);
        assert!((total / truth - 1.0).abs() < 0.03, "{total} N, not {truth}: {:?}", force.reasons);
        assert!((total - truth).abs() <= 2.0 * force.total_sigma.unwrap().0, "{force:?}");
    }
}
