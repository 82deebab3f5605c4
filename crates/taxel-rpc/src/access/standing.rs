//! Whether a call that goes on for long would still be let through.

use std::sync::Arc;

use taxel_proto::refusal::Refusal;
use tonic::{Request, Status};

use crate::access::rules::{Access, Rules};

/// Asks the gate about a call once more.
type Judge = dyn Fn() -> Result<(), Status> + Send + Sync;

/// A call that was let through, by extension from the gate to the service. Once the rules are replaced it is judged anew.
#[derive(Clone)]
pub(crate) struct Standing {
    access: Access,
    judge: Arc<Judge>,
    /// By which it was last let through; absent at first, since the rules may have been replaced after the gate looked.
    rules: Option<Arc<Rules>>,
}

impl Standing {
    pub(crate) fn new(access: Access, judge: impl Fn() -> Result<(), Status> + Send + Sync + 'static) -> Self {
        Self { access, judge: Arc::new(judge), rules: None }
    }

    /// Takes it from a request that came through the gate.
    pub(crate) fn take<T>(request: &mut Request<T>) -> Result<Self, Status> {
        let unknown =
            || Refusal::fault("nobody has noted how this call was let through, which is a fault of this program");
        Ok(request.extensions_mut().remove().ok_or_else(unknown)?)
    }

    /// What a new call would be refused with by the present rules, which are replaced and never changed.
    pub(crate) fn check(&mut self) -> Result<(), Status> {
        let rules = self.access.rules();
        if self.rules.as_ref().is_some_and(|last| Arc::ptr_eq(last, &rules)) {
            return Ok(());
        }
        (self.judge)()?;
        self.rules = Some(rules); // or newer ones, by which it is judged once more
        Ok(())
    }
}
