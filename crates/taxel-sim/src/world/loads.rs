//! What lies on the skin of a world.

use super::World;
use crate::load::{LoadError, Mass};
use crate::loads::LoadId;
use std::time::Duration;
use taxel_skin::{Newton, TaxelIndex};

impl World {
    /// Lays a mass on the skin at once, beside those that lie there, until [`Self::clear`]; the force it adds.
    ///
    /// # Errors
    /// [`LoadError`] for a mass that cannot lie there; then nothing changes.
    pub fn lay(&mut self, mass: Mass) -> Result<Newton, LoadError> {
        self.loads.lay(&self.skin, &mass)?;
        Ok(mass.weight())
    }

    /// A mass comes to rest on the skin: from now on its weight grows linearly, until all of it rests there after
    /// `over`.
    ///
    /// # Errors
    /// [`LoadError`] for a mass that cannot lie there; then nothing changes.
    pub fn place(&mut self, mass: Mass, over: Duration) -> Result<LoadId, LoadError> {
        self.loads.place(self.now, &self.skin, mass, over)
    }

    /// A placed mass leaves: from now on what rests of it on the skin falls linearly, until it is gone after `over`.
    pub fn lift(&mut self, load: LoadId, over: Duration) {
        self.loads.lift(self.now, load, over);
    }

    /// A placed mass rolls in a straight line, until it lies about the taxel `to` after `over`. Its weight stays.
    ///
    /// # Errors
    /// [`LoadError`] for a taxel that does not exist; then nothing changes.
    pub fn roll(&mut self, load: LoadId, to: TaxelIndex, over: Duration) -> Result<(), LoadError> {
        self.loads.roll(self.now, &self.skin, load, to, over)
    }

    /// Takes all masses away at once.
    pub fn clear(&mut self) {
        self.loads.clear();
    }
}
