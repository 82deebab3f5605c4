//! `taxeld calibrate`: a session from the zero to the models in use, guided.

mod args;
mod begin;
mod course;
mod guide;
mod review;
mod screen;

use crate::client::sessions::advance;
use taxel_proto::v1::{ActivateModelSetRequest, Session, SessionAction, SessionState};

pub use args::CalibrateArgs;
use begin::{Patch, begin, patch};
use course::{Course, Followed, follow, until_vented};
use screen::Screen;

use super::ask;
use super::failure::{Failure, Outcome};
use super::json;
use super::models::fetch;
use super::use_set::SetInWords;

/// Runs it.
///
/// # Errors
/// A calibration that fails or is left, what the daemon refuses, or no daemon.
pub async fn calibrate(args: CalibrateArgs) -> Outcome {
    let daemon = args.server.connect().await?;
    let mut patches = Vec::new();
    for name in std::iter::once(&daemon.patch()).chain(&args.with) {
        let patch = patch(&daemon, name).await?;
        if patches.iter().any(|other: &Patch| other.daemon.patch() == patch.daemon.patch()) {
            return Err(Failure::refused(format!("patch {} is named twice", patch.daemon.patch())));
        }
        patches.push(patch);
    }
    let asks = !args.yes && !args.json && ask::somebody();
    let places = patches.iter().map(|patch| (patch.daemon.patch(), patch.places.clone())).collect();
    let mut course = Course { screen: Screen::new(places, args.json), asks, offered: None };
    let mut all = begin_all(&course, &args, &patches).await?;
    let mut failed = ramps(&mut course, &args, &mut all).await?;
    course.screen.end();
    for followed in &all {
        let Some(patch) = patches.iter().find(|patch| patch.daemon.patch() == followed.session.patch) else { continue };
        // One patch without models takes nothing from the others.
        if let Err(why) = conclude(&course, &args, &followed.session, patch).await
            && let Some(earlier) = failed.replace(why)
        {
            course.screen.tell(&earlier.to_string());
        }
    }
    failed.map_or(Ok(()), Err)
}

/// The sessions of all patches. Where one is refused, those that have just begun are ended: half a bag is no calibration.
async fn begin_all(course: &Course, args: &CalibrateArgs, patches: &[Patch]) -> Outcome<Vec<Followed>> {
    let mut all: Vec<Followed> = Vec::new();
    for patch in patches {
        match begin(course, args, patch).await {
            Ok(followed) => all.push(followed),
            Err(refused) => {
                for begun in all.iter().filter(|followed| followed.begun) {
                    let ended = advance(&begun.daemon, begun.session.session, SessionAction::Abort).await;
                    if let Err(why) = ended {
                        course.screen.tell(&format!("session {}: {why}", begun.session.session));
                    }
                }
                return Err(refused);
            }
        }
    }
    Ok(all)
}

/// Takes all ramps. What fails is left out of those to come; the last of it is given back.
async fn ramps(course: &mut Course, args: &CalibrateArgs, all: &mut Vec<Followed>) -> Outcome<Option<Failure>> {
    let mut lost = None;
    loop {
        follow(course, all).await?;
        let ended = all.extract_if(.., |followed| followed.session.state() != SessionState::Review);
        for ended in ended {
            if let Some(earlier) = lost.replace(failed(&ended.session)) {
                course.screen.tell(&earlier.to_string());
            }
        }
        let Some(first) = all.first_mut() else {
            course.screen.end();
            return Err(lost.unwrap_or_else(|| Failure::refused("there is no session".to_owned())));
        };
        until_vented(course, first).await?;
        let taken = first.session.ramps;
        if taken >= args.ramps {
            return Ok(lost);
        }
        course.screen.tell(&format!("ramp {} of {}", taken + 1, args.ramps));
        for followed in all.iter_mut() {
            followed.session = advance(&followed.daemon, followed.session.session, SessionAction::StartRamp).await?;
        }
    }
}

/// Why no models came of it, and what can be done.
fn failed(session: &Session) -> Failure {
    let (number, state) = (session.session, super::sessions::session_word(session.state()));
    let kept = session.accepted;
    Failure::refused(format!(
        "session {number} is {state}: {}; its {kept} scans are kept: `taxeld calibrate --session {number}` adds another ramp",
        session.reason
    ))
}

/// The review, and what the operator makes of it.
async fn conclude(course: &Course, args: &CalibrateArgs, session: &Session, patch: &Patch) -> Outcome {
    let Patch { daemon, places, active } = patch;
    let set = fetch(daemon, &session.model_set).await?;
    if set.taxels.iter().all(|model| !model.is_usable()) {
        review::print(&set, None, places);
        return Err(Failure::refused(format!("not one of {} taxels got a usable model", set.taxels.len())));
    }
    let before = if active.is_empty() { None } else { Some(fetch(daemon, active).await?) };
    if !args.json {
        review::print(&set, before.as_ref(), places);
    }
    let words = SetInWords::of(daemon, &set.id).await?;
    let asked = format!("{}. Activate?", words.usable());
    let activate = match (args.yes, course.asks) {
        (true, _) => true,
        (false, false) => false,
        // Enter is no where most of the skin would be lost.
        (false, true) if words.is_much_less() => ask::agree(false, &asked, "").await.is_ok(),
        (false, true) => ask::yes(&asked).await?,
    };
    if !activate {
        course.screen.tell(&format!("not in use yet: taxeld models use {}", set.id));
        return Ok(());
    }
    let request =
        ActivateModelSetRequest { patch: daemon.patch(), model_set: set.id.clone(), expected: Some(active.clone()) };
    let answer = daemon.models().activate_model_set(request).await?.into_inner();
    if args.json {
        return json::print("ActivateModelSetResponse", &answer);
    }
    say!("{} is in use. With nothing on the skin: taxeld tare, then taxeld watch", answer.model_set);
    Ok(())
}
