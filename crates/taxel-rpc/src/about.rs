//! What a command is about, in words: for the logs and for refusals.

use taxel_engine::audit::Asked;
use taxel_engine::command::Command;
use taxel_engine::loads::Weight;
use taxel_engine::model_set::ModelSet;

use crate::access::caller::Caller;
use crate::service::Service;

/// Longest argument of a request that is kept, in characters.
const ARGUMENT_CHARS_MAX: usize = 128;

/// What a command is about.
#[derive(Default)]
pub(crate) struct About {
    /// Empty if it cannot be told.
    patch: String,
    session: Option<u64>,
    model_set: Option<String>,
    /// Its other arguments.
    arguments: String,
    /// The name that it claims.
    claimed: String,
}

impl About {
    /// The kinds of things that a command names, and which of them; the narrowest last.
    pub(crate) fn things(&self) -> impl Iterator<Item = (&'static str, String)> {
        let patch = Some(self.patch.clone()).filter(|patch| !patch.is_empty());
        let session = self.session.map(|session| session.to_string());
        let all = [("patch", patch), ("session", session), ("model_set", self.model_set.clone())];
        all.into_iter().filter_map(|(kind, which)| Some((kind, which?)))
    }

    /// What the audit log says of it; who answers the command adds number, time and model set.
    pub(crate) fn asked(self, caller: &Caller, method: &'static str) -> Asked {
        let session = self.session.map(|session| format!("session {session}"));
        let said: Vec<String> =
            session.into_iter().chain(Some(self.arguments)).filter(|text| !text.is_empty()).collect();
        Asked {
            who: caller.who(),
            role: caller.role.map_or("", |role| role.name()).to_owned(),
            transport: caller.origin.transport().to_owned(),
            place: caller.origin.place(),
            method: method.to_owned(),
            what: said.join(", "),
            claimed: short(&self.claimed),
            patch: self.patch,
            ..Asked::default()
        }
    }
}

impl Service {
    /// What a command is about.
    pub(crate) fn about(&self, command: &Command) -> About {
        let about = match command {
            Command::Tare { patch, confirmed_by } | Command::BringUp { patch, confirmed_by } => {
                let claimed = confirmed_by.clone().unwrap_or_default();
                About { patch: patch.clone(), claimed, ..About::default() }
            }
            Command::BeginPush { patch } => About { patch: patch.clone(), ..About::default() },
            Command::StartSession { patch, target, branches, confirmed_by, leave_out } => {
                let target = target.map(|target| format!("target {} kPa", target.0));
                let branches = branches.map(|branches| format!("branches {branches:?}").to_lowercase());
                let leave_out =
                    leave_out.iter().map(|(board, module)| format!("without board {board} module {module}"));
                let said: Vec<String> = target.into_iter().chain(branches).chain(leave_out).collect();
                let claimed = confirmed_by.clone().unwrap_or_default();
                About { patch: patch.clone(), arguments: short(&said.join(", ")), claimed, ..About::default() }
            }
            Command::StartRamp { session }
            | Command::FinishRamp { session }
            | Command::AbortSession { session }
            | Command::DiscardSession { session }
            | Command::DeleteSession { session } => {
                let patch = self.session(*session).map(|view| view.patch.clone()).unwrap_or_default();
                About { patch, session: Some(*session), arguments: step(command).to_owned(), ..About::default() }
            }
            Command::Activate { patch, model_set, expected } => {
                let expected = expected.as_ref().map(|expected| format!(", expected `{}`", short(expected)));
                let arguments = format!("model set {}{}", short(model_set), expected.unwrap_or_default());
                About { patch: patch.clone(), model_set: Some(model_set.clone()), arguments, ..About::default() }
            }
            Command::RecordLoad { patch, load } => {
                let laid = match load.weight {
                    Weight::Kilogram(kilogram) => format!("{kilogram} kg"),
                    Weight::Force(force) => format!("{} N", force.0),
                };
                let sigma = Some(format!("relative uncertainty {}", load.relative_sigma));
                let replaces = load.replaces.map(|number| format!("replaces load {number}"));
                let note = (!load.note.is_empty()).then(|| format!("`{}`", short(&load.note)));
                let said: Vec<String> = [Some(laid), sigma, replaces, note].into_iter().flatten().collect();
                About { patch: patch.clone(), arguments: said.join(", "), claimed: load.by.clone(), ..About::default() }
            }
            Command::DeleteModelSet { model_set } => {
                let patch = self.known_set(model_set).map(|set| set.patch.clone()).unwrap_or_default();
                let arguments = format!("model set {}", short(model_set));
                About { patch, model_set: Some(model_set.clone()), arguments, ..About::default() }
            }
            Command::Import { model_set, insist } => {
                let insists = if *insist { ", whose curves do not look like the patch's" } else { "" };
                of_set(model_set, format!("model set {}{insists}", short(&model_set.id)))
            }
            Command::KeepRecalibration { model_set } => {
                let of = model_set.recalibrated.as_ref();
                let loads = of.iter().flat_map(|of| &of.points).map(|point| point.number.to_string());
                let loads = short(&loads.collect::<Vec<_>>().join(", "));
                let (id, source) = (short(&model_set.id), short(model_set.derived_from().unwrap_or_default()));
                let gain = of.map_or(1.0, |of| of.gain);
                of_set(model_set, format!("model set {source} times {gain:.4} by loads {loads}: model set {id}"))
            }
            Command::KeepRefit { model_set, sessions } => {
                let numbers = short(&sessions.iter().map(u64::to_string).collect::<Vec<_>>().join(", "));
                let (id, method) = (short(&model_set.id), short(&model_set.method));
                of_set(model_set, format!("session {numbers}, {method}: model set {id}"))
            }
        };
        // An empty name stands for the only patch.
        let named = self.patch(&about.patch).map(|index| self.plan(index).patch.name().to_owned());
        About { patch: named.unwrap_or(about.patch), ..about }
    }
}

/// What becomes of a session.
const fn step(command: &Command) -> &'static str {
    match command {
        Command::StartRamp { .. } => "another ramp",
        Command::FinishRamp { .. } => "its ramp ends",
        Command::AbortSession { .. } => "it stops",
        Command::DiscardSession { .. } => "it is laid aside",
        _ => "",
    }
}

fn of_set(set: &ModelSet, arguments: String) -> About {
    About { patch: set.patch.clone(), model_set: Some(set.id.clone()), arguments, ..About::default() }
}

/// A client's text, short and without what a terminal would act on.
fn short(text: &str) -> String {
    text.chars().take(ARGUMENT_CHARS_MAX).flat_map(char::escape_debug).collect()
}
