//! What a command is about, in words: for the logs and for refusals.

use taxel_engine::audit::Asked;
use taxel_engine::command::Command;
use taxel_engine::loads::Weight;

use crate::access::caller::Caller;
use crate::service::Service;

/// Longest account of a request that is kept, in characters.
const SAID_CHARS_MAX: usize = 256;

/// What a command is about.
pub(crate) struct About {
    /// Empty if it cannot be told.
    patch: String,
    /// The kind of thing beside the patch that it names, and which of them.
    thing: Option<(&'static str, String)>,
    /// Its other arguments.
    said: String,
    /// The name that it claims.
    claimed: String,
}

impl About {
    /// The kinds of things that a command names, and which of them; the narrowest last.
    pub(crate) fn things(&self) -> Vec<(&'static str, String)> {
        let patch = Some(("patch", self.patch.clone())).filter(|(_, patch)| !patch.is_empty());
        patch.into_iter().chain(self.thing.clone()).collect()
    }

    /// What the audit log says of it; who answers the command adds number, time and model set.
    pub(crate) fn asked(self, caller: &Caller, method: &'static str) -> Asked {
        Asked {
            who: caller.who(),
            role: caller.role.map_or("", |role| role.name()).to_owned(),
            transport: caller.origin.transport().to_owned(),
            place: caller.origin.place(),
            method: method.to_owned(),
            what: self.said,
            claimed: self.claimed,
            patch: self.patch,
            ..Asked::default()
        }
    }
}

impl Service {
    /// What a command is about.
    pub(crate) fn about(&self, command: &Command) -> About {
        let of_set = |id: &String| Some(("model_set", id.clone()));
        let nobody = None;
        let (patch, thing, said, claimed) = match command {
            Command::Tare { patch, confirmed_by } | Command::BringUp { patch, confirmed_by } => {
                (patch.clone(), None, Vec::new(), confirmed_by.as_ref())
            }
            Command::BeginPush { patch } => (patch.clone(), None, Vec::new(), nobody),
            Command::StartSession { patch, target, branches, confirmed_by, leave_out } => {
                let target = target.map(|target| format!("target {} kPa", target.0));
                let branches = branches.map(|branches| format!("branches {branches:?}").to_lowercase());
                let without = leave_out.iter().map(|(board, module)| format!("without board {board} module {module}"));
                (
                    patch.clone(),
                    None,
                    target.into_iter().chain(branches).chain(without).collect(),
                    confirmed_by.as_ref(),
                )
            }
            Command::StartRamp { session } => self.of_session(*session, "another ramp"),
            Command::FinishRamp { session } => self.of_session(*session, "its ramp ends"),
            Command::AbortSession { session } => self.of_session(*session, "it stops"),
            Command::DiscardSession { session } => self.of_session(*session, "it is laid aside"),
            Command::DeleteSession { session } => self.of_session(*session, ""),
            Command::Activate { patch, model_set, expected } => {
                let expected = expected.as_ref().map(|expected| format!("expected `{expected}`"));
                let said = [format!("model set {model_set}")].into_iter().chain(expected);
                (patch.clone(), of_set(model_set), said.collect(), nobody)
            }
            Command::RecordLoad { patch, load } => {
                let laid = match load.weight {
                    Weight::Kilogram(kilogram) => format!("{kilogram} kg"),
                    Weight::Force(force) => format!("{} N", force.0),
                };
                let replaces = load.replaces.map(|number| format!("replaces load {number}"));
                let note = (!load.note.is_empty()).then(|| format!("`{}`", load.note));
                let said = [laid, format!("relative uncertainty {}", load.relative_sigma)];
                (patch.clone(), None, said.into_iter().chain(replaces).chain(note).collect(), Some(&load.by))
            }
            Command::DeleteModelSet { model_set } => {
                let patch = self.known_set(model_set).map(|set| set.patch.clone()).unwrap_or_default();
                (patch, of_set(model_set), vec![format!("model set {model_set}")], nobody)
            }
            Command::Import { model_set, insist } => {
                let insists = insist.then(|| "whose curves do not look like the patch's".to_owned());
                let said = [format!("model set {}", model_set.id)].into_iter().chain(insists);
                (model_set.patch.clone(), of_set(&model_set.id), said.collect(), nobody)
            }
            Command::KeepRecalibration { model_set } => {
                let of = model_set.recalibrated.as_ref();
                let loads = of.iter().flat_map(|of| &of.points).map(|point| point.number.to_string());
                let loads = loads.collect::<Vec<_>>().join(", ");
                let (source, gain) = (model_set.derived_from().unwrap_or_default(), of.map_or(1.0, |of| of.gain));
                let said = format!("model set {} from {source} times {gain:.4} by loads {loads}", model_set.id);
                (model_set.patch.clone(), of_set(&model_set.id), vec![said], nobody)
            }
            Command::KeepRefit { model_set, sessions } => {
                let numbers = sessions.iter().map(u64::to_string).collect::<Vec<_>>().join(", ");
                let said = format!("model set {} from session {numbers}, {}", model_set.id, model_set.method);
                (model_set.patch.clone(), of_set(&model_set.id), vec![said], nobody)
            }
        };
        // An empty name stands for the only patch.
        let named = self.patch(&patch).map(|index| self.plan(index).patch.name().to_owned());
        let claimed = claimed.map(|name| short(name)).unwrap_or_default();
        About { patch: named.unwrap_or(patch), thing, said: short(&said.join(", ")), claimed }
    }

    fn of_session(&self, session: u64, step: &str) -> Parts<'static> {
        let patch = self.session(session).map(|view| view.patch.clone()).unwrap_or_default();
        let said = [format!("session {session}"), step.to_owned()].into_iter().filter(|text| !text.is_empty());
        (patch, Some(("session", session.to_string())), said.collect(), None)
    }
}

/// Patch, thing, arguments, claimed name.
type Parts<'a> = (String, Option<(&'static str, String)>, Vec<String>, Option<&'a String>);

/// A client's text, short and without what a terminal would act on.
fn short(text: &str) -> String {
    text.chars().take(SAID_CHARS_MAX).flat_map(char::escape_debug).collect()
}
