//! What the driver adds to the audit log's rows: their number and time, and which model set was active.

use std::collections::HashMap;

use taxel_engine::audit::{Answered, Asked};
use taxel_engine::command::{Reply, RequestId};
use taxel_engine::record::Record;
use taxel_engine::snapshot::Catalogue;

/// Longest reason of a refusal that is kept, in characters.
const RESULT_CHARS_MAX: usize = 500;

/// What is known for the rows.
pub struct Auditor {
    /// The active model set of each patch that has one.
    active: HashMap<String, String>,
    /// Why nothing can be written any more.
    failed: Option<String>,
}

impl Auditor {
    /// One that begins with these active model sets.
    pub fn new(active: Vec<(String, String)>) -> Self {
        Self { active: active.into_iter().collect(), failed: None }
    }

    /// The active model sets may have changed.
    pub fn catalogue(&mut self, catalogue: &Catalogue) {
        let active = catalogue.active.iter().filter_map(|(patch, set)| Some((patch.clone(), set.clone()?)));
        self.active = active.collect();
    }

    /// Nothing can be written any more.
    pub fn store_failed(&mut self, why: &str) {
        self.failed.get_or_insert_with(|| format!("nothing is stored until the daemon is restarted: {why}"));
    }

    /// The row of a request, and the patch that it is about; or why it cannot be written.
    pub fn asked(&self, request: RequestId, wall_ns: i64, asked: Asked) -> Result<(String, Record), String> {
        if let Some(why) = &self.failed {
            return Err(why.clone());
        }
        let patch = asked.patch.clone();
        let asked = Asked { request: request.0, wall_ns, before: self.active_of(&patch), ..asked };
        Ok((patch, Record::Asked(Box::new(asked))))
    }

    /// The row of what came of it.
    pub fn answered(&self, request: RequestId, wall_ns: i64, patch: &str, reply: &Reply) -> Record {
        let result = match reply {
            Ok(_) => "done".to_owned(),
            // Part of it is what the client sent.
            Err(rejection) => {
                let said = format!("refused: {rejection}").chars().take(RESULT_CHARS_MAX).collect::<String>();
                taxel_skin::printable(&said)
            }
        };
        Record::Answered(Box::new(Answered { request: request.0, wall_ns, result, after: self.active_of(patch) }))
    }

    fn active_of(&self, patch: &str) -> String {
        self.active.get(patch).cloned().unwrap_or_default()
    }
}
