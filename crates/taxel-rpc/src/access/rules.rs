//! The rules of an installation: which role an account, a certificate, an address or a token gives to who calls.

use std::fmt::{self, Write};
use std::sync::Arc;
use std::time::SystemTime;
use taxel_proto::refusal::Refusal;
use tokio::sync::watch;
use tonic::Status;

use crate::access::origin::Origin;
use crate::access::table::Role;
use crate::access::token::Tokens;

/// Longest name that goes into a log line, in characters.
const NAME_CHARS_MAX: usize = 128;

/// Whom a rule means.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Subject {
    /// An account on a Unix socket, by name or number.
    User(String),
    /// The accounts of a group on a Unix socket.
    Group(String),
    /// A certificate with this name: see [`check_certificate_name`](crate::check_certificate_name).
    Certificate(String),
}

/// One rule.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Grant {
    /// Whom it means.
    pub subject: Subject,
    /// What that one may do.
    pub role: Role,
}

/// Who makes a call. Cheap to clone.
#[derive(Clone, Debug)]
pub(crate) struct Caller {
    pub(crate) origin: Arc<Origin>,
    /// The name that is proven: of an account, a certificate or a token's holder.
    pub(crate) name: Option<Arc<str>>,
    /// By a token, and not by what the connection proves.
    pub(crate) by_token: bool,
    pub(crate) role: Option<Role>,
    /// What is asked for, as it came and shortened, once the request has been read.
    pub(crate) said: String,
}

impl Caller {
    /// The proven name for logs and the audit log, without anything that a terminal would act on.
    pub(crate) fn who(&self) -> String {
        let name = self.name.as_deref().unwrap_or("nobody in particular");
        let shown: String = name.chars().take(NAME_CHARS_MAX).flat_map(char::escape_debug).collect();
        if self.by_token { format!("token {shown}") } else { shown }
    }

    /// Whether reserved places are for this one, too.
    pub(crate) fn is_operator(&self) -> bool {
        self.role >= Some(Role::Operator)
    }

    /// Whose share the call takes: the holder of a token has one beside that of others from the same place.
    pub(crate) fn key(&self) -> String {
        if self.by_token { self.who() } else { self.origin.key() }
    }
}

/// Longest account of a request that is kept, in characters.
const SAID_CHARS_MAX: usize = 256;

/// A request as it came, short: what a terminal would act upon is written out.
pub(crate) fn said(request: &impl fmt::Debug) -> String {
    let mut short = Short(String::new());
    let _ = write!(short, "{request:?}"); // it ends where there is no more room
    short.0
}

/// Takes a text up to its limit: one with a model set in it has megabytes.
struct Short(String);

impl Write for Short {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        let room = SAID_CHARS_MAX.saturating_sub(self.0.chars().count());
        self.0.extend(text.chars().take(room));
        if room > 0 { Ok(()) } else { Err(fmt::Error) }
    }
}

/// All rules. A caller that none of them names has the role of its listener, which may be none.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Rules {
    /// The highest role of those that fit counts.
    pub grants: Vec<Grant>,
    /// Over TCP from this machine.
    pub loopback: Option<Role>,
    /// On a Unix socket.
    pub unix: Option<Role>,
    /// With a certificate that the authority signed.
    pub certificate: Option<Role>,
    /// Over TCP from elsewhere, without encryption.
    pub insecure: Option<Role>,
    /// The tokens that are good.
    pub tokens: Tokens,
}

impl Rules {
    /// Everything for everybody on this machine, nothing for anybody else: the demonstration, and configurations
    /// without rules.
    #[must_use]
    pub fn open() -> Self {
        Self { loopback: Some(Role::Admin), unix: Some(Role::Admin), ..Self::default() }
    }

    /// The role that a connection gives by itself.
    pub(crate) fn role(&self, origin: &Origin) -> Option<Role> {
        let granted = self.grants.iter().filter(|grant| is_meant(&grant.subject, origin)).map(|grant| grant.role).max();
        granted.or(match origin {
            Origin::Unix(..) => self.unix,
            Origin::Loopback(_) => self.loopback,
            Origin::Insecure(_) => self.insecure,
            Origin::Tls(..) => self.certificate,
        })
    }

    /// Who makes a call over this connection, with this `authorization` if it has one.
    pub(crate) fn caller(&self, origin: &Arc<Origin>, authorization: Option<&[u8]>) -> Result<Caller, Status> {
        if let Origin::Tls(_, certificate) = &**origin
            && certificate.until <= SystemTime::now()
        {
            return Err(Refusal::unauthenticated("the client certificate has expired: connect with a new one").into());
        }
        let Some(authorization) = authorization else {
            let (name, role) = (origin.name().map(Arc::from), self.role(origin));
            return Ok(Caller { origin: Arc::clone(origin), name, by_token: false, role, said: String::new() });
        };
        if matches!(**origin, Origin::Insecure(_)) {
            let why = "a token came over a connection without encryption, where anybody can read it";
            let what_to_do = "make a new token, and use TLS or this machine's own addresses";
            return Err(Refusal::unauthenticated(format!("{why}: {what_to_do}")).into());
        }
        let token = strip_scheme(authorization)
            .ok_or_else(|| Refusal::unauthenticated("the metadata `authorization` is not `Bearer TOKEN`"))?;
        let holder = self.tokens.holder(token).ok_or_else(|| {
            Refusal::unauthenticated("the token in `authorization` is none of those in the daemon's token file")
        })?;
        let name = Some(Arc::from(holder.name.as_str()));
        Ok(Caller { origin: Arc::clone(origin), name, by_token: true, role: Some(holder.role), said: String::new() })
    }
}

/// The token after `Bearer`, whose case does not count (RFC 9110 section 11.1).
fn strip_scheme(authorization: &[u8]) -> Option<&[u8]> {
    let (scheme, token) = authorization.split_at_checked(7)?;
    scheme.eq_ignore_ascii_case(b"bearer ").then(|| token.trim_ascii()).filter(|token| !token.is_empty())
}

fn is_meant(subject: &Subject, origin: &Origin) -> bool {
    match (subject, origin) {
        (Subject::User(name), Origin::Unix(account, _)) => {
            account.user.as_ref() == Some(name) || *name == account.uid.to_string()
        }
        (Subject::Group(name), Origin::Unix(account, _)) => account.groups.contains(name),
        (Subject::Certificate(name), Origin::Tls(_, certificate)) => certificate.names.contains(name),
        _ => false,
    }
}

/// The rules as they are now; they can be replaced while calls are made. Cheap to clone.
#[derive(Clone, Debug)]
pub struct Access(Arc<watch::Sender<Arc<Rules>>>);

impl Access {
    /// These rules until they are replaced.
    #[must_use]
    pub fn new(rules: Rules) -> Self {
        Self(Arc::new(watch::Sender::new(Arc::new(rules))))
    }

    /// Other rules from now on, made of the present ones. Streams that are being served go on, but for those of scans that are
    /// pushed, which are judged anew; every new call is judged by them.
    pub fn update(&self, change: impl FnOnce(&Rules) -> Rules) {
        self.0.send_modify(|rules| *rules = Arc::new(change(rules)));
    }

    pub(crate) fn rules(&self) -> Arc<Rules> {
        Arc::clone(&self.0.borrow())
    }

    /// Tells when there are others.
    pub(crate) fn watch(&self) -> watch::Receiver<Arc<Rules>> {
        self.0.subscribe()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::access::origin::{Account, Certificate, uri_name};
    use std::time::Duration;

    fn unix(uid: u32, user: &str, groups: &[&str]) -> Origin {
        let groups = groups.iter().map(|group| (*group).to_owned()).collect();
        Origin::Unix(Arc::new(Account { uid, user: Some(user.to_owned()), groups }), None)
    }

    fn tls(names: &[String], until: SystemTime) -> Origin {
        Origin::Tls("192.0.2.7:1".parse().unwrap(), Arc::new(Certificate { names: names.to_vec(), until }))
    }

    fn uri(text: &str) -> String {
        uri_name(text)
    }

    fn common(name: &str) -> String {
        format!("CN={name}")
    }

    fn dns(name: &str) -> String {
        format!("DNS:{name}")
    }

    fn rules() -> Rules {
        let grant = |subject, role| Grant { subject, role };
        Rules {
            grants: vec![
                grant(Subject::Group("skin".to_owned()), Role::Operator),
                grant(Subject::User("ann".to_owned()), Role::Admin),
                grant(Subject::User("77".to_owned()), Role::Operator),
                grant(Subject::Certificate(uri("spiffe://robot/operator")), Role::Operator),
                grant(Subject::Certificate(common("ann")), Role::Admin),
            ],
            loopback: Some(Role::Observer),
            unix: Some(Role::Observer),
            ..Rules::default()
        }
    }

    #[test]
    fn the_highest_role_that_fits_counts() {
        let future = SystemTime::now() + Duration::from_secs(3600);
        let cases = [
            (unix(1000, "bob", &["users"]), Some(Role::Observer)),
            (unix(1000, "bob", &["users", "skin"]), Some(Role::Operator)),
            (unix(1001, "ann", &["skin"]), Some(Role::Admin)),
            (unix(77, "joe", &[]), Some(Role::Operator)),
            (unix(1002, "skin", &[]), Some(Role::Observer)),
            (unix(1002, "CN=ann", &["ann", "spiffe://robot/operator"]), Some(Role::Observer)),
            (tls(&[uri("spiffe://robot/operator")], future), Some(Role::Operator)),
            (tls(&[uri("spiffe://robot/operator/x"), common("ann ")], future), None),
            (tls(&[dns("x"), common("ann")], future), Some(Role::Admin)),
            (Origin::of_tcp("127.0.0.1:1".parse().unwrap()), Some(Role::Observer)),
            (Origin::of_tcp("[::ffff:127.0.0.1]:1".parse().unwrap()), Some(Role::Observer)),
            (Origin::of_tcp("192.0.2.7:1".parse().unwrap()), None),
        ];
        for (origin, expected) in cases {
            assert_eq!(rules().role(&origin), expected, "{origin:?}");
        }
    }

    #[test]
    fn what_is_written_down_of_a_name_shows_its_kind() {
        let future = SystemTime::now() + Duration::from_secs(3600);
        let who = |name| rules().caller(&Arc::new(tls(&[name], future)), None).unwrap().who();
        assert_eq!(who(common("ann")), "CN=ann");
        assert_eq!(who(uri("spiffe://robot/operator")), "spiffe://robot/operator");
        for text in ["CN=ann", "DNS:bench.example", "token bench", "nobody in particular"] {
            assert_eq!(who(uri(text)), format!("URI:{text}"));
        }
    }

    #[test]
    fn a_wrong_token_is_nobody_also_where_none_is_needed() {
        let origin = Arc::new(Origin::of_tcp("127.0.0.1:1".parse().unwrap()));
        for wrong in
            [&b"Bearer x"[..], b"Bearer ", b"Bearer", b"Basic abc", b"", b"abc", b"\xFF\xFF\xFF\xFF\xFF\xFF\xFF\xFF"]
        {
            let status = rules().caller(&origin, Some(wrong)).unwrap_err();
            assert_eq!(status.code(), tonic::Code::Unauthenticated, "{wrong:?}");
        }
    }

    #[test]
    fn an_expired_certificate_is_refused_also_on_a_connection_that_is_open() {
        let past = SystemTime::now() - Duration::from_secs(1);
        let status = rules().caller(&Arc::new(tls(&[common("ann")], past)), None).unwrap_err();
        assert_eq!(status.code(), tonic::Code::Unauthenticated);
    }

    #[test]
    fn a_token_over_the_open_net_is_refused() {
        let origin = Arc::new(Origin::of_tcp("192.0.2.7:1".parse().unwrap()));
        let status = rules().caller(&origin, Some(b"Bearer abc")).unwrap_err();
        assert!(status.message().contains("without encryption"), "{status:?}");
    }

    #[test]
    fn a_caller_is_told_by_the_proven_name_short_and_without_control_characters() {
        let address = ([127, 0, 0, 1], 4000).into();
        let caller = |name: Option<&str>, by_token| Caller {
            origin: Arc::new(Origin::of_tcp(address)),
            name: name.map(Arc::from),
            by_token,
            role: None,
            said: String::new(),
        };
        assert_eq!(caller(None, false).who(), "nobody in particular");
        assert_eq!(caller(Some("ada"), false).who(), "ada");
        assert_eq!(caller(Some("bench"), true).who(), "token bench");
        assert_eq!(caller(Some("a\u{1b}[2Jb\n"), false).who(), "a\\u{1b}[2Jb\\n");
        assert_eq!(caller(Some(&"x".repeat(500)), false).who().len(), NAME_CHARS_MAX);
        assert_eq!(caller(Some("ada"), false).key(), "loopback TCP");
        assert_eq!(caller(Some("bench"), true).key(), "token bench");
    }
}
