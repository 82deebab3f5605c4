//! The words in which the audit log has a command.

use taxel_engine::audit::Asked;
use taxel_engine::command::Command;
use taxel_engine::loads::Weight;

use crate::access::caller::Caller;

/// Longest argument of a request that is kept, in characters.
const ARGUMENT_CHARS_MAX: usize = 128;

/// What the audit log says of a command; who answers it adds number, time and model set.
pub(crate) fn asked(caller: &Caller, method: &'static str, patch: String, command: &Command) -> Asked {
    let (what, claimed) = words(command);
    Asked {
        who: caller.who(),
        role: caller.role.map_or("", |role| role.name()).to_owned(),
        transport: caller.origin.transport().to_owned(),
        place: caller.origin.place(),
        method: method.to_owned(),
        what,
        claimed: short(claimed.unwrap_or_default()),
        patch,
        ..Asked::default()
    }
}

/// The arguments of a command, and the name that it claims.
fn words(command: &Command) -> (String, Option<&str>) {
    match command {
        Command::Tare { confirmed_by, .. } | Command::BringUp { confirmed_by, .. } => {
            (String::new(), confirmed_by.as_deref())
        }
        Command::BeginPush { .. } => (String::new(), None),
        Command::StartSession { target, branches, confirmed_by, leave_out, .. } => {
            let target = target.map(|target| format!("target {} kPa", target.0));
            let branches = branches.map(|branches| format!("branches {branches:?}").to_lowercase());
            let leave_out = leave_out.iter().map(|(board, module)| format!("without board {board} module {module}"));
            let said: Vec<String> = target.into_iter().chain(branches).chain(leave_out).collect();
            (short(&said.join(", ")), confirmed_by.as_deref())
        }
        Command::StartRamp { session } => (format!("session {session}, another ramp"), None),
        Command::FinishRamp { session } => (format!("session {session}, its ramp ends"), None),
        Command::AbortSession { session } => (format!("session {session}, it stops"), None),
        Command::DiscardSession { session } => (format!("session {session}, it is laid aside"), None),
        Command::DeleteSession { session } => (format!("session {session}"), None),
        Command::Activate { model_set, expected, .. } => {
            let expected = expected.as_ref().map(|expected| format!(", expected `{}`", short(expected)));
            (format!("model set {}{}", short(model_set), expected.unwrap_or_default()), None)
        }
        Command::RecordLoad { load, .. } => {
            let laid = match load.weight {
                Weight::Kilogram(kilogram) => format!("{kilogram} kg"),
                Weight::Force(force) => format!("{} N", force.0),
            };
            let sigma = Some(format!("relative uncertainty {}", load.relative_sigma));
            let replaces = load.replaces.map(|number| format!("replaces load {number}"));
            let note = (!load.note.is_empty()).then(|| format!("`{}`", short(&load.note)));
            let said: Vec<String> = [Some(laid), sigma, replaces, note].into_iter().flatten().collect();
            (said.join(", "), Some(&load.by))
        }
        Command::DeleteModelSet { model_set } => (format!("model set {}", short(model_set)), None),
        Command::Import { model_set, insist } => {
            let insists = if *insist { ", whose curves do not look like the patch's" } else { "" };
            (format!("model set {}{insists}", short(&model_set.id)), None)
        }
        Command::KeepRecalibration { model_set } => {
            let of = model_set.recalibrated.as_ref();
            let loads = of.iter().flat_map(|of| &of.points).map(|point| point.number.to_string()).collect::<Vec<_>>();
            let (id, source) = (short(&model_set.id), short(model_set.derived_from().unwrap_or_default()));
            let gain = of.map_or(1.0, |of| of.gain);
            (format!("model set {source} times {gain:.4} by loads {}: model set {id}", short(&loads.join(", "))), None)
        }
        Command::KeepRefit { model_set, sessions } => {
            let numbers: Vec<String> = sessions.iter().map(u64::to_string).collect();
            let (id, method) = (short(&model_set.id), short(&model_set.method));
            (format!("session {}, {method}: model set {id}", short(&numbers.join(", "))), None)
        }
    }
}

/// A client's text, short and without what a terminal would act on.
fn short(text: &str) -> String {
    text.chars().take(ARGUMENT_CHARS_MAX).flat_map(char::escape_debug).collect()
}
