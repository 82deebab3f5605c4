//! What is true of a world, to judge others by.

use super::World;
use taxel_skin::{Kilopascal, Newton, SquareMillimetre, TaxelIndex};

impl World {
    /// Frames that went over the wire and were lost at the receiver ([`crate::Fault::FramesLost`]).
    #[must_use]
    pub const fn frames_lost(&self) -> u64 {
        self.receiver.frames_lost
    }

    /// The true differential pressure of the bag.
    #[must_use]
    pub fn true_pressure(&self) -> Kilopascal {
        Kilopascal(self.bag_kpa(self.now))
    }

    /// The true pressure on every taxel, bag and masses together, in the patch's order.
    pub fn true_taxel_pressures(&self) -> impl Iterator<Item = Kilopascal> {
        let bag = self.true_pressure().0;
        let mut loads_kpa = Vec::new();
        self.loads.write(self.now, &self.skin, &mut loads_kpa);
        loads_kpa.into_iter().zip(&self.bag_share).map(move |(load, share)| Kilopascal(bag * share + load))
    }

    /// The true normal force on the skin, bag and masses together. Without vacuum it is the weight of the masses.
    #[must_use]
    pub fn true_force(&self) -> Newton {
        self.true_force_about(|_| true)
    }

    /// The same of a part of the skin that lies apart from the rest: the bag on these taxels, and the masses that lie about,
    /// or roll to, one of them.
    #[must_use]
    pub fn true_force_about(&self, these: impl Fn(TaxelIndex) -> bool) -> Newton {
        let taxels = (0..self.skin.poses().len()).filter(|taxel| these(TaxelIndex(*taxel as u16))).count();
        let bag = self.true_pressure().on(SquareMillimetre(self.skin.taxel_area().0 * taxels as f64));
        bag + Newton(self.loads.force_about_n(self.now, &these))
    }
}
