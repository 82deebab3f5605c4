//! `taxeld calibrate --device`: a drive moves the pressure, and the session is an ordinary one. The drive is this program's alone:
//! the daemon knows of no pump, and what a pump's line does cannot touch the force.
//!
//! Twenty times a second the gauge is asked for at the daemon, the procedure ([`taxel_rig::drive`]) says what is to be done, and the
//! drive is told. Whatever ends this program vents the bag first: an error, Ctrl-C, a signal, a session that somebody aborted. Where
//! it cannot do that any more, because it was killed or the machine hangs, the drive's fail-safe has to.

use std::future::poll_fn;
use std::task::Poll;
use std::time::Duration;

use taxel_proto::v1::{Session, SessionAction, SessionState, StartSessionRequest};
use taxel_rig::drive::{Ask, Drive, Order, Phase, Programme, Seen, State};
use taxel_rig::modbus::Framing;
use taxel_rig::profile::{FailSafe, Profile, Question};
use taxel_rig::{Speech, Talk};
use tokio::signal::unix::{SignalKind, signal};
use tokio::time::{Instant, MissedTickBehavior, interval, sleep, timeout, timeout_at};
use tonic::Streaming;

use super::screen::Screen;
use crate::client::ask;
use crate::client::connect::Daemon;
use crate::client::failure::{Failure, Outcome};
use crate::client::sessions::{advance, session_word};
use crate::config;
use crate::rig::{At, Link};

/// From one order to the next.
const TICK: Duration = Duration::from_millis(50);
/// A drive answers within this, or has not.
const ANSWER_WITHIN: Duration = Duration::from_millis(300);
/// Between an answer and the next frame of RTU: three and a half characters at 9600 baud.
const RTU_GAP: Duration = Duration::from_millis(5);
/// The daemon answers what the gauge reads within this, or nothing is known of it.
const GAUGE_WITHIN: Duration = Duration::from_millis(150);
/// A session begins and ends within this. Its first answer is on disk.
const SESSION_WITHIN: Duration = Duration::from_secs(10);
/// What vents is waited for so long.
const VENT_WITHIN: Duration = Duration::from_secs(15);
/// Boards that are being set up are waited for so long: then the session refuses, or does without. For less than the first of these the
/// daemon listens whether they stream; boards that others set up it listens to for ever.
const LISTENED_WITHIN: Duration = Duration::from_secs(1);
const SET_UP_WITHIN: Duration = Duration::from_secs(5);
/// A bag above this is told of before it is vented, kPa.
const FOUND_KPA: f64 = 2.0;

/// A drive on its line.
pub struct Pump {
    profile: Profile,
    at: At,
    link: Link,
    talk: Talk,
    begun: Instant,
    answered: Instant,
    /// What its own gauge read last, kPa below ambient.
    own: Option<(f64, Instant)>,
    /// What was sent, received and expected, while the last question has no right answer.
    missed: Option<String>,
    /// Why the procedure was ended.
    ended: Option<String>,
}

impl Pump {
    /// Reads a profile, a file or one that comes with the program, and opens its line.
    ///
    /// # Errors
    /// What is wrong with it, or why its line cannot be opened.
    pub async fn open(file: &str, at: Option<&str>) -> Outcome<Self> {
        let (profile, at) = config::examine_profile(file, at).map_err(|faults| Failure::refused(faults.to_string()))?;
        let link = at.open().await.map_err(Failure::refused)?;
        let (begun, talk) = (Instant::now(), Talk::begin(true));
        Ok(Self { profile, at, link, talk, begun, answered: begun, own: None, missed: None, ended: None })
    }

    /// Asks the person who has to stand beside it.
    ///
    /// # Errors
    /// Nobody does.
    pub async fn attended(&self, asks: bool, agreed: bool) -> Outcome {
        if self.profile.fail_safe() != FailSafe::Attended || agreed {
            return Ok(());
        }
        let name = self.profile.name();
        let question =
            format!("{name} holds the vacuum if this computer stops. Do you stand beside its valve until the end?");
        match asks && ask::yes(&question, false).await? {
            true => Ok(()),
            false => Err(Failure::refused(format!(
                "{name} has no fail-safe of its own: somebody has to stand beside it; --attended says so"
            ))),
        }
    }

    /// Tells the drive, and waits for its answers.
    async fn tell(&mut self, order: Order) -> std::io::Result<()> {
        let questions = self.profile.questions(order);
        for question in &questions {
            if !self.ask(question).await? {
                return Ok(());
            }
        }
        if !questions.is_empty() {
            self.answered = Instant::now();
        }
        Ok(())
    }

    /// Whether the answer is as it should be.
    async fn ask(&mut self, question: &Question) -> std::io::Result<bool> {
        if matches!(question.speech, Speech::Modbus(_, Framing::Rtu)) {
            sleep(RTU_GAP).await;
        }
        let asked = self.talk.question(&question.speech);
        self.link.write(&asked).await?;
        let (end, mut buffer) = (Instant::now() + ANSWER_WITHIN, [0; 256]);
        let (mut came, mut wrong) = (Vec::new(), None);
        while let Ok(count) = timeout_at(end, self.link.read(&mut buffer)).await {
            let bytes = &buffer[..count?];
            came.extend_from_slice(bytes);
            for said in self.talk.take(&question.speech, bytes) {
                match said.and_then(|number| question.judge(number)) {
                    Ok(own_kpa) => {
                        self.own = own_kpa.map(|kpa| (kpa, Instant::now())).or(self.own);
                        self.missed = None;
                        return Ok(true);
                    }
                    Err(why) => wrong = Some(why),
                }
            }
        }
        self.missed = Some(question.missed(&came, wrong.as_deref()));
        Ok(false)
    }

    /// Why the procedure was ended, with what the drive answered last. Told to vent, it may obey.
    fn ended(&mut self, drive: &Drive) -> Option<String> {
        let (why, _) = drive.stopped()?;
        let missed = self.missed.as_ref().filter(|_| why.is_not_taken());
        let missed = missed.map_or_else(String::new, |missed| format!(": {missed}"));
        Some(self.ended.get_or_insert_with(|| format!("{}: {why}{missed}", self.profile.name())).clone())
    }

    /// Opens the valve, whatever has happened.
    async fn vent(&mut self) {
        let (end, before) = (Instant::now() + Duration::from_secs(2), self.answered);
        while Instant::now() < end && self.answered == before {
            if self.tell(Order::Vent).await.is_err()
                && let Ok(link) = self.at.open().await
            {
                (self.link, self.talk) = (link, Talk::begin(true));
            }
        }
    }
}

/// A calibration by a drive.
pub struct ByDevice<'a> {
    /// The daemon, about the patch.
    pub daemon: &'a Daemon,
    /// Where it is shown.
    pub screen: &'a mut Screen,
    /// How the session begins.
    pub request: StartSessionRequest,
    /// Rises; the bag is vented between them.
    pub ramps: u32,
}

/// What is known of the session.
#[derive(Default)]
struct Followed {
    session: Option<Session>,
    stream: Option<Streaming<Session>>,
}

impl Followed {
    fn phase(&self) -> Phase {
        let Some(session) = &self.session else { return Phase::None };
        match session.state() {
            SessionState::Taring => Phase::Taring,
            SessionState::Ramping if session.falling => Phase::Falling,
            SessionState::Ramping => Phase::Rising,
            SessionState::Fitting | SessionState::Review | SessionState::Active => Phase::Over,
            _ => Phase::Failed,
        }
    }

    /// Waits for what changes.
    async fn next(&mut self) -> Option<Session> {
        match &mut self.stream {
            Some(stream) => stream.message().await.ok().flatten(),
            None => std::future::pending().await,
        }
    }
}

impl ByDevice<'_> {
    /// Runs the procedure to its end; the session in review.
    ///
    /// # Errors
    /// Why it was ended; the bag is vented then as far as the drive obeys.
    pub async fn run(mut self, pump: &mut Pump) -> Outcome<Session> {
        // A program before this one may have left it so.
        if let Some((kpa, _)) = self.gauge().await.filter(|(kpa, _)| *kpa > FOUND_KPA) {
            self.screen.tell(&format!("the bag is still at {kpa:.1} kPa: venting it first"));
        }
        // Boards that are set up take what presses on them for nothing, and the self-test presses.
        let begun = Instant::now();
        while self.sets_boards_up(begun.elapsed()).await {
            sleep(TICK).await;
        }
        let ended = self.procedure(pump).await;
        if ended.is_err() {
            pump.vent().await;
        }
        ended
    }

    async fn procedure(&mut self, pump: &mut Pump) -> Outcome<Session> {
        let (limits, abilities) = (pump.profile.limits(), pump.profile.abilities());
        let programme = Programme { kpa_per_s: pump.profile.kpa_per_s(), ramps: self.ramps };
        let mut drive = Drive::new(pump.begun.elapsed(), limits, abilities, programme);
        let (mut followed, mut told) = (Followed::default(), None);
        let mut tick = interval(TICK);
        tick.set_missed_tick_behavior(MissedTickBehavior::Delay);
        let kinds = [SignalKind::interrupt(), SignalKind::terminate(), SignalKind::hangup()];
        let mut signals = kinds.into_iter().map(signal).collect::<std::io::Result<Vec<_>>>()?;
        let mut stopped_at = None;
        loop {
            tokio::select! {
                () = poll_fn(|context| match signals.iter_mut().any(|one| one.poll_recv(context).is_ready()) {
                    true => Poll::Ready(()),
                    false => Poll::Pending,
                }) => drive.stop(pump.begun.elapsed(), "a signal"),
                session = followed.next() => match session {
                    Some(session) => {
                        self.screen.show(&session)?;
                        followed.session = Some(session);
                    }
                    None => followed.stream = None, // while it is needed, the gauge says nothing any more either
                },
                _ = tick.tick() => {
                    self.step(pump, &mut drive, &mut followed).await;
                    self.show(&drive, &mut told);
                }
            }
            if let Some((why, (_, vented))) = pump.ended(&drive).zip(drive.stopped()) {
                let since = *stopped_at.get_or_insert_with(Instant::now);
                if vented || since.elapsed() > VENT_WITHIN {
                    let end = if vented {
                        "the bag is vented"
                    } else {
                        "THE GAUGE DOES NOT SHOW IT VENTED: open the valve by hand"
                    };
                    return Err(Failure::refused(format!("{why}; {end}")));
                }
            } else if drive.state() == State::Done && followed.phase() != Phase::Over {
                let state = followed.session.map_or("gone", |session| session_word(session.state()));
                return Err(Failure::refused(format!("the session is {state}; the bag is vented")));
            } else if drive.state() == State::Done
                && let Some(session) = followed.session.take_if(|session| session.state() == SessionState::Review)
            {
                return Ok(session);
            } else if drive.state() == State::Done && followed.stream.is_none() {
                return Err(Failure::refused("the daemon has gone; the bag is vented"));
            }
        }
    }

    /// One turn of the procedure: look, decide, tell.
    async fn step(&mut self, pump: &mut Pump, drive: &mut Drive, followed: &mut Followed) {
        let gauge = self.gauge().await;
        let target_kpa = followed.session.as_ref().map_or(0.0, |session| session.target_kpa);
        let answer_age = pump.answered.elapsed();
        let own = pump.own.map(|(kpa, at)| (kpa, at.elapsed()));
        let seen = Seen { now: pump.begun.elapsed(), gauge, own, answer_age, phase: followed.phase(), target_kpa };
        let (order, ask) = drive.step(&seen);
        let why = pump.ended(drive).unwrap_or_default();
        if let Err(error) = pump.tell(order).await {
            drive.stop(pump.begun.elapsed(), format!("the drive's line ({error})"));
            pump.vent().await;
        }
        let Some(ask) = ask else { return };
        let asked = timeout(SESSION_WITHIN, self.ask((ask, &why), followed)).await;
        match asked.unwrap_or_else(|_| Err(Failure::refused("the daemon does not answer"))) {
            Err(failure) if ask != Ask::Abort => drive.stop(pump.begun.elapsed(), format!("the session ({failure})")),
            _ => {}
        }
    }

    /// Whether boards are being set up still, after so long a wait.
    async fn sets_boards_up(&self, waited: Duration) -> bool {
        let Ok(health) = self.daemon.skin().get_health(()).await else { return false };
        let mut boards = health.get_ref().boards.iter().filter(|board| board.patch == self.request.patch);
        boards.any(|board| match board.bring_up.as_str() {
            "listening" => waited < LISTENED_WITHIN,
            "configuring" => waited < SET_UP_WITHIN,
            _ => false,
        })
    }

    /// What the gauge reads, kPa below ambient, and how long ago.
    async fn gauge(&self) -> Option<(f64, Duration)> {
        let asked = Instant::now();
        let health = timeout(GAUGE_WITHIN, self.daemon.skin().get_health(())).await.ok()?.ok()?.into_inner();
        if health.engine_stalled_s.is_some() {
            return None;
        }
        let patch = health.patches.iter().find(|patch| patch.patch == self.request.patch)?;
        let age = Duration::try_from_secs_f64(patch.gauge_age_s?).ok()?;
        Some((patch.gauge_kpa?, age + asked.elapsed()))
    }

    async fn ask(&self, (ask, why): (Ask, &str), followed: &mut Followed) -> Outcome {
        let number = followed.session.as_ref().map(|session| session.session).unwrap_or_default();
        let session = match ask {
            Ask::Begin => {
                let begun = self.daemon.calibration().start_session(self.request.clone()).await?.into_inner();
                begun.look.iter().for_each(|line| self.screen.tell(&format!("check: {line}")));
                begun
            }
            Ask::Ramp => advance(self.daemon, number, SessionAction::StartRamp, "").await?,
            Ask::Abort => advance(self.daemon, number, SessionAction::Abort, why).await?,
        };
        followed.stream = Some(self.daemon.watch_session(session.session).await?);
        followed.session = Some(session);
        Ok(())
    }

    /// Says where the procedure is, when that changes.
    fn show(&self, drive: &Drive, told: &mut Option<State>) {
        let state = drive.state();
        if told.replace(state) == Some(state) {
            return;
        }
        let leak = drive.leak_kpa_per_min().map_or_else(String::new, |leak| format!("leak {leak:.1} kPa/min; "));
        let differ = drive.gauges_differ().map_or_else(String::new, |(more_kpa, kpa)| {
            format!("; its own gauge read up to {more_kpa:+.1} kPa against the bag's, at {kpa:.0} kPa")
        });
        let words = match state {
            State::Armed => "drive: the valve is open; hands off",
            State::SelfTest => "drive: self-test, 5 kPa and a vent",
            State::LeakTest => "drive: leak test at 20 kPa",
            State::Tare => &format!("drive: {leak}the bag is vented, the zero is being taken"),
            State::Ramp => "drive: rising",
            State::Hold => "drive: holding",
            State::Fall => "drive: falling",
            State::Vent => "drive: venting",
            State::Done => &format!("drive: the bag is vented{differ}"),
            State::SafeVent => "drive: STOPPED, venting",
        };
        self.screen.tell(words);
    }
}
