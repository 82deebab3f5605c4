//! `taxeld models use`: uses a model set from now on.

use taxel_proto::v1::{ActivateModelSetRequest, GetModelSetRequest, TaxelModelSummary};

use super::connect::{Daemon, Server};
use super::failure::{Failure, Outcome};
use super::{ask, json};

/// Uses a model set from now on, also after a restart. Activating the set that was in use before is the way back.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Examples:\n  taxeld models use m-26dc52bea9635074\n  taxeld models use m-26dc          # the beginning is enough if no other set has it\n  taxeld models use newest"
)]
pub struct UseArgs {
    #[command(flatten)]
    server: Server,
    /// Id of the set, its beginning, or `newest`.
    #[arg(value_name = "MODEL_SET")]
    model_set: String,
    /// Refuse unless this set is the active one now; the empty text for none.
    #[arg(long, value_name = "MODEL_SET")]
    expected: Option<String>,
    /// Do not ask where it has far fewer usable taxels than the set in use.
    #[arg(long)]
    yes: bool,
    /// Print the answer as JSON.
    #[arg(long)]
    json: bool,
}

/// Runs it.
///
/// # Errors
/// Refused with the daemon's reason, or no daemon.
pub async fn use_set(args: UseArgs) -> Outcome {
    let daemon = args.server.connect().await?;
    let model_set = full_id(&daemon, &args.model_set).await?;
    let set = SetInWords::of(&daemon, &model_set).await?;
    if set.is_much_less() {
        ask::agree(args.yes, &format!("{}. Use it?", set.usable()), &format!("taxeld models use {model_set}")).await?;
    }
    let request = ActivateModelSetRequest { patch: daemon.patch(), model_set, expected: args.expected };
    let answer = daemon.models().activate_model_set(request).await?.into_inner();
    if args.json {
        return json::print("ActivateModelSetResponse", &answer);
    }
    let before = if answer.previous.is_empty() { "none" } else { &answer.previous };
    say!("{} is in use; before it: {before}", answer.model_set);
    say!("  {}\n  {}", set.usable(), set.rest());
    Ok(())
}

/// A set with less than this share of the usable taxels of the one in use is not used without a question.
const ENOUGH_SHARE: f64 = 0.9;

/// What a user should know of a set before it is used.
pub struct SetInWords {
    id: String,
    usable: u32,
    taxels: u32,
    /// Id of the set in use, if that is another, and how many taxels it can use.
    in_use: Option<(String, u32)>,
    /// Whether it knows what its taxels read at rest.
    knows_rest: bool,
}

impl SetInWords {
    /// A set of the daemon.
    ///
    /// # Errors
    /// No such set, or no daemon.
    pub async fn of(daemon: &Daemon, model_set: &str) -> Outcome<Self> {
        let request = GetModelSetRequest { model_set: model_set.to_owned(), ..GetModelSetRequest::default() };
        let set = daemon.models().get_model_set(request).await?.into_inner();
        let summary = set.summary.unwrap_or_default();
        let sets = daemon.about(&summary.patch).model_sets().await?;
        let in_use = sets.into_iter().find(|other| other.active && other.model_set != model_set);
        let knows = |taxel: &TaxelModelSummary| taxel.status == "ok" && taxel.figures.contains_key("baseline_counts");
        Ok(Self {
            id: summary.model_set,
            usable: summary.calibrated,
            taxels: summary.taxels,
            in_use: in_use.map(|set| (set.model_set, set.calibrated)),
            knows_rest: set.taxels.iter().any(knows),
        })
    }

    /// Whether it reads far fewer taxels than the set in use.
    pub fn is_much_less(&self) -> bool {
        self.in_use.as_ref().is_some_and(|(_, usable)| f64::from(self.usable) < ENOUGH_SHARE * f64::from(*usable))
    }

    /// How many taxels it can use, against the set in use.
    pub fn usable(&self) -> String {
        let of_other = self.in_use.as_ref().map(|(id, usable)| format!("; {id}, in use until now, has {usable}"));
        format!("{}: {} of {} taxels usable{}", self.id, self.usable, self.taxels, of_other.unwrap_or_default())
    }

    /// Where its zero comes from, and what to do.
    pub fn rest(&self) -> &'static str {
        if self.knows_rest {
            "it has the zero of its calibration. Unload the skin, then: taxeld tare"
        } else {
            "it has no zero of its own and takes it from the next confirmed tare. Unload the skin, then: taxeld tare \
             --confirmed-by NAME"
        }
    }
}

/// Fewer characters name no set: a script's variable that is empty would name the only one there is.
const BEGINNING_MIN: usize = 4;

/// The id that these characters begin; `newest` is the newest set of the patch.
///
/// # Errors
/// No set or several begin so, or no daemon.
pub async fn full_id(daemon: &Daemon, beginning: &str) -> Outcome<String> {
    let sets = daemon.model_sets().await?;
    if beginning == "newest" {
        let newest = sets.into_iter().next().map(|set| set.model_set);
        return newest.ok_or_else(|| Failure::refused("there is no model set"));
    }
    if sets.iter().any(|set| set.model_set == beginning) {
        return Ok(beginning.to_owned());
    }
    if beginning.chars().count() < BEGINNING_MIN {
        let words =
            format!("`{beginning}` names no model set: give at least its first {BEGINNING_MIN} characters, as in m-1e");
        return Err(Failure::refused(words));
    }
    let found: Vec<String> = sets.into_iter().map(|set| set.model_set).filter(|id| id.starts_with(beginning)).collect();
    match found.as_slice() {
        [one] => Ok(one.clone()),
        [] => Err(Failure::refused(format!("there is no model set `{beginning}`; `taxeld models list` has them"))),
        several => Err(Failure::refused(format!("`{beginning}` begins {}", several.join(", ")))),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_set_with_less_than_nine_tenths_of_the_usable_taxels_is_asked_about_and_none_else() {
        let set = |usable, in_use: Option<u32>| SetInWords {
            id: "m-2".to_owned(),
            usable,
            taxels: 230,
            in_use: in_use.map(|usable| ("m-1".to_owned(), usable)),
            knows_rest: true,
        };
        assert!(set(27, Some(218)).is_much_less() && set(89, Some(100)).is_much_less());
        assert!(!set(90, Some(100)).is_much_less() && !set(27, None).is_much_less());
        assert_eq!(set(27, Some(218)).usable(), "m-2: 27 of 230 taxels usable; m-1, in use until now, has 218");
    }
}
