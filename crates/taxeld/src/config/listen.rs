//! Where the service listens, and who may do what there: `[[listen]]` and `[access]`, resolved.

use std::net::SocketAddr;
use std::path::{Path, PathBuf};

use taxel_rpc::{Grant, Rules, Subject};

use super::door::Door;
use super::fault::Fault;
use super::file::Config;
use super::listen_places::{is_same_place, listens_beside};
use super::listen_sections::{AccessSection, GrantSection, ListenSection, RoleWord};
use super::load::beside;
use super::runtime_folder::runtime_folder;

/// The mode of a Unix socket, unless another is given: its owner and its group may connect.
const SOCKET_MODE: u32 = 0o660;

/// Where the service listens if the configuration says nothing.
const LISTEN_DEFAULT: SocketAddr = SocketAddr::new(std::net::IpAddr::V4(std::net::Ipv4Addr::LOCALHOST), 50_051);

/// Longest path of a Unix socket, unix(7): its field has 108 bytes, the last of which is zero.
const UNIX_PATH_BYTES_MAX: usize = 107;

/// Name of the Unix socket in the folder that systemd gives.
const SOCKET_NAME: &str = "taxeld.sock";

/// Where the service listens, and who may do what.
#[derive(Clone, Debug)]
pub struct Doors {
    /// Where.
    pub doors: Vec<Door>,
    /// Who; the tokens are read when the daemon starts.
    pub rules: Rules,
    /// Where the tokens are.
    pub tokens: Option<PathBuf>,
    /// Whether the rules are the configuration's.
    pub ruled: bool,
}

impl Doors {
    /// Certificates and keys, and the tokens.
    pub fn credentials(&self) -> impl Iterator<Item = PathBuf> {
        let of_door = |door: &Door| match door {
            Door::Tls { files, .. } => files.to_vec(),
            Door::Unix { .. } | Door::Tcp(_) => Vec::new(),
        };
        self.doors.iter().flat_map(of_door).chain(self.tokens.clone())
    }

    /// The grants that reach nobody as far as the configuration goes, because an account is known on a Unix socket alone and a
    /// certificate where there is TLS: a line each.
    pub fn unreached_grants(&self) -> Vec<String> {
        let unix = self.doors.iter().any(|door| matches!(door, Door::Unix { .. }));
        let tls = self.doors.iter().any(|door| matches!(door, Door::Tls { .. }));
        let unreached = |Grant { subject, role }: &Grant| {
            let (kind, name, place) = match subject {
                Subject::User(name) if !unix => {
                    ("user", name.clone(), "a Unix socket: write a [[listen]] with `unix`, or run it as taxeld.service")
                }
                Subject::Group(name) if !unix => (
                    "group",
                    name.clone(),
                    "a Unix socket: write a [[listen]] with `unix`, or run it as taxeld.service",
                ),
                Subject::Certificate(name) if !tls => {
                    ("certificate", name.to_string(), "TLS: write a [[listen]] with `tls`")
                }
                _ => return None,
            };
            Some(format!("access: {kind} {name} is {role} only over {place}"))
        };
        self.rules.grants.iter().filter_map(unreached).collect()
    }
}

/// Resolves where the service listens; `path` is the configuration's, for files relative to it.
///
/// # Errors
/// The key, its value and what was expected.
pub fn doors(config: &Config, path: &Path) -> Result<Doors, Fault> {
    let beside = |file: &Path| beside(path, file);
    let mut doors = Vec::new();
    if let Some(listen) = config.service.listen.or(config.listen.is_empty().then_some(LISTEN_DEFAULT)) {
        if !listen.ip().is_loopback() {
            let words = format!(
                "service.listen = {listen}: only loopback addresses are served without more; for another one write a \
                 [[listen]] with `tls`"
            );
            return Err(Fault::of("service.listen", words));
        }
        doors.push(Door::Tcp(listen));
    }
    if config.listen.is_empty()
        && let Some(folder) = runtime_folder()
    {
        doors.push(Door::Unix { path: folder.join(SOCKET_NAME), mode: SOCKET_MODE, group: None });
    }
    for (position, section) in config.listen.iter().enumerate() {
        let wrong = |problem: String| {
            Fault::of(format!("listen[{position}]"), format!("[[listen]] {}: {problem}", position + 1))
        };
        let door = door(section, &beside).map_err(wrong)?;
        if let Some(other) = doors.iter().find(|other| is_same_place(other, &door)) {
            return Err(wrong(format!("{other} is there already, and two cannot listen at one place")));
        }
        doors.push(door);
    }
    if let Some((key, address)) = listens_beside(config, &doors) {
        return Err(Fault::of(key, format!("{key} = {address}: the service listens there already: give another port")));
    }
    let Some(access) = &config.access else {
        let far = doors.iter().find(|door| !is_near(door));
        return match far {
            Some(_) => {
                let words = "a [[listen]] for other machines needs an [access] section that says who may do what";
                Err(Fault::of("listen", words))
            }
            None => Ok(Doors { doors, rules: Rules::open(), tokens: None, ruled: false }),
        };
    };
    if access.tokens.as_deref().is_some_and(|file| file.as_os_str().is_empty()) {
        return Err(Fault::of("access.tokens", "access.tokens = \"\": expected the path of a file"));
    }
    let tokens = access.tokens.as_deref().map(beside);
    Ok(Doors { doors, rules: rules(access)?, tokens, ruled: true })
}

/// Why no socket can have this path, if so.
fn no_socket(path: &Path) -> Option<String> {
    let bytes = path.as_os_str().as_encoded_bytes();
    match bytes.len() {
        0 => Some("unix = \"\": expected a path".to_owned()),
        _ if bytes.contains(&0) => Some(format!("unix = {path:?}: a path has no zero byte")),
        1..=UNIX_PATH_BYTES_MAX => None,
        long => Some(format!("unix = {path:?}: has {long} bytes, a socket's path at most {UNIX_PATH_BYTES_MAX}")),
    }
}

/// Whether only this machine reaches it.
fn is_near(door: &Door) -> bool {
    match door {
        Door::Unix { .. } => true,
        Door::Tcp(address) => address.ip().is_loopback(),
        Door::Tls { .. } => false,
    }
}

fn door(section: &ListenSection, beside: &impl Fn(&Path) -> PathBuf) -> Result<Door, String> {
    let of_unix = section.mode.is_some() || section.group.is_some();
    match (&section.unix, section.tcp) {
        (Some(_), None) if section.tls.is_some() || section.allow_insecure => {
            Err("`tls` and `allow_insecure` are for `tcp`, not for `unix`".to_owned())
        }
        (Some(path), None) => {
            let mode = section.mode.unwrap_or(SOCKET_MODE);
            if !(0o600..=0o777).contains(&mode) {
                return Err(format!("mode = 0o{mode:o}: expected 0o600 to 0o777: its owner may connect"));
            }
            if section.group.as_deref() == Some("") {
                return Err("group = \"\": expected the name of a group".to_owned());
            }
            let whole = beside(path);
            match no_socket(path).or_else(|| no_socket(&whole)) {
                Some(problem) => Err(problem),
                None => Ok(Door::Unix { path: whole, mode, group: section.group.clone() }),
            }
        }
        (None, Some(_)) if of_unix => Err("`mode` and `group` are for `unix`, not for `tcp`".to_owned()),
        (None, Some(address)) => match &section.tls {
            Some(tls) => {
                let files = [&tls.certificate, &tls.key, &tls.client_ca].map(|file| beside(file));
                Ok(Door::Tls { address, files })
            }
            None if address.ip().is_loopback() || section.allow_insecure => Ok(Door::Tcp(address)),
            None => Err(format!(
                "tcp = \"{address}\" is for other machines, too: it needs `tls`, or, where everybody on that net may read \
                 along, `allow_insecure = true`"
            )),
        },
        (Some(_), Some(_)) | (None, None) => Err("expected one of `unix` and `tcp`".to_owned()),
    }
}

fn rules(access: &AccessSection) -> Result<Rules, Fault> {
    let grant = |(position, section): (usize, &GrantSection)| {
        let told = |problem: &str| {
            Fault::of(format!("access.grant[{position}]"), format!("[[access.grant]] {}: {problem}", position + 1))
        };
        let role = section.role.role().ok_or_else(|| told("role = \"none\" grants nothing"))?;
        let subject = match (&section.user, &section.group, &section.certificate) {
            (Some(user), None, None) => Subject::User(user.clone()),
            (None, Some(group), None) => Subject::Group(group.clone()),
            (None, None, Some(name)) => {
                Subject::Certificate(name.parse().map_err(|problem| told(&format!("certificate = {problem}")))?)
            }
            _ => return Err(told("expected one of `user`, `group` and `certificate`")),
        };
        Ok(Grant { subject, role })
    };
    if access.insecure > RoleWord::Observer {
        let words = "access.insecure: whoever is on the net could do it, and nobody would know who did: expected \
                     \"none\" or \"observer\"";
        return Err(Fault::of("access.insecure", words));
    }
    Ok(Rules {
        grants: access.grant.iter().enumerate().map(grant).collect::<Result<_, _>>()?,
        loopback: access.loopback.role(),
        unix: access.unix.role(),
        certificate: access.certificate.role(),
        insecure: access.insecure.role(),
        ..Rules::default()
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use taxel_rpc::Role;

    const EXAMPLE: &str = include_str!("../../../../deploy/insole.toml");

    fn resolved(more: &str) -> Result<Doors, String> {
        let path = Path::new("/etc/taxeld/t.toml");
        let text = format!("{EXAMPLE}\n{more}");
        let config = super::super::load::parse(path, &text).map_err(|error| error.to_string())?;
        doors(&config, path).map_err(|fault| fault.words().to_owned())
    }

    #[test]
    fn without_any_key_the_loopback_is_served_and_everything_is_allowed_there() {
        let doors = resolved("").unwrap();
        assert_eq!(doors.doors, [Door::Tcp(LISTEN_DEFAULT)]);
        assert_eq!((doors.rules, doors.ruled), (Rules::open(), false));
    }

    #[test]
    fn with_an_access_section_nothing_is_allowed_that_it_does_not_say() {
        let doors = resolved("[access]\n[[access.grant]]\nrole = \"operator\"\ngroup = \"skin\"").unwrap();
        let observer = Some(Role::Observer);
        let rules = &doors.rules;
        assert_eq!(
            (rules.loopback, rules.unix, rules.certificate, rules.insecure),
            (observer, observer, None, observer)
        );
        assert_eq!(rules.grants, [Grant { subject: Subject::Group("skin".to_owned()), role: Role::Operator }]);
    }

    /// Without a socket that tells accounts apart, a section that was copied by itself leaves nobody who may tare.
    #[test]
    fn a_grant_that_no_listener_can_honour_is_told() {
        let grants = "[access]\n[[access.grant]]\nrole = \"operator\"\ngroup = \"skin\"\n\
                      [[access.grant]]\nrole = \"admin\"\ncertificate = \"CN=ann\"";
        let told = resolved(grants).unwrap().unreached_grants();
        assert_eq!(told.len(), 2, "{told:?}");
        assert!(told[0].starts_with("access: group skin is operator only over a Unix socket"), "{}", told[0]);
        assert!(told[1].starts_with("access: certificate CN=ann is admin only over TLS"), "{}", told[1]);
        let told = resolved(&format!("[[listen]]\nunix = \"/run/taxeld/s\"\n{grants}")).unwrap().unreached_grants();
        assert!(told.len() == 1 && told[0].contains("CN=ann"), "{told:?}");
    }

    #[test]
    fn listeners_are_resolved_beside_the_configuration() {
        let tls = "tls = { certificate = \"s.pem\", key = \"/run/k.pem\", client_ca = \"ca.pem\" }";
        let more = format!(
            "[[listen]]\nunix = \"/run/taxeld/s\"\nmode = 0o600\n[[listen]]\ntcp = \"0.0.0.0:50052\"\n{tls}\n[access]"
        );
        let found = resolved(&more);
        let files = ["/etc/taxeld/s.pem", "/run/k.pem", "/etc/taxeld/ca.pem"].map(PathBuf::from);
        let unix = Door::Unix { path: "/run/taxeld/s".into(), mode: 0o600, group: None };
        assert_eq!(found.unwrap().doors, [unix, Door::Tls { address: "0.0.0.0:50052".parse().unwrap(), files }]);
    }

    /// A path of 108 bytes.
    const LONG: &str = "[[listen]]\nunix = \"/aaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaa\"";

    #[test]
    fn what_would_let_strangers_in_is_refused_with_what_to_write() {
        let cases = [
            ("[service]\nlisten = \"0.0.0.0:1\"", "only loopback addresses are served without more"),
            ("[[listen]]\ntcp = \"10.0.0.1:1\"", "it needs `tls`, or"),
            ("[[listen]]\ntcp = \"10.0.0.1:1\"\nallow_insecure = true", "needs an [access] section"),
            ("[[listen]]\nmode = 1", "expected one of `unix` and `tcp`"),
            ("[[listen]]\nunix = \"/a\"\ntcp = \"127.0.0.1:1\"", "expected one of `unix` and `tcp`"),
            ("[[listen]]\nunix = \"/a\"\nmode = 0o1777", "expected 0o600 to 0o777"),
            ("[[listen]]\nunix = \"/a\"\nmode = 0", "mode = 0o0: expected 0o600 to 0o777: its owner may connect"),
            (
                "[[listen]]\nunix = \"/a\"\n[[listen]]\nunix = \"/a\"",
                "[[listen]] 2: unix:/a (mode 660) is there already",
            ),
            ("[[listen]]\nunix = \"/a/./b\"\n[[listen]]\nunix = \"/a//b\"", "is there already"),
            ("[[listen]]\nunix = \"\"", "expected a path"),
            ("[[listen]]\nunix = \"/a\\u0000b\"", "no zero byte"),
            (LONG, "a socket's path at most 107"),
            ("[[listen]]\nunix = \"/a\"\ngroup = \"\"", "expected the name of a group"),
            ("[access]\ntokens = \"\"", "expected the path of a file"),
            ("[service]\nlisten = \"127.0.0.1:9\"\n[[listen]]\ntcp = \"127.0.0.1:9\"", "is there already"),
            (
                "[[listen]]\ntcp = \"0.0.0.0:9\"\nallow_insecure = true\n[[listen]]\ntcp = \"127.0.0.1:9\"",
                "is there already",
            ),
            (
                "[page]\nlisten = \"127.0.0.1:50051\"",
                "page.listen = 127.0.0.1:50051: the service listens there already",
            ),
            (
                "[page]\n[metrics]\nlisten = \"127.0.0.1:50051\"",
                "metrics.listen = 127.0.0.1:50051: the service listens",
            ),
            ("[access]\ninsecure = \"operator\"", "access.insecure"),
            ("[access]\n[[access.grant]]\nrole = \"admin\"", "[[access.grant]] 1: expected one of"),
            ("[access]\n[[access.grant]]\nrole = \"admin\"\ncertificate = \"ann\"", "expected a URI"),
            (
                "[access]\n[[access.grant]]\nrole = \"admin\"\ncertificate = \"cn=ann\"",
                "[[access.grant]] 1: certificate = \"cn=ann\": expected a URI",
            ),
            ("[access]\n[[access.grant]]\nrole = \"none\"\nuser = \"ann\"", "grants nothing"),
            ("[access]\nloopback = \"root\"", "unknown variant"),
            ("[access]\nloopbak = \"none\"", "did you mean `loopback`"),
        ];
        for (more, expected) in cases {
            let problem = resolved(more).unwrap_err();
            assert!(problem.contains(expected), "{more}: {problem}");
        }
    }

    #[test]
    fn an_insecure_listener_needs_its_word_and_an_access_section() {
        let doors = resolved("[[listen]]\ntcp = \"10.0.0.1:1\"\nallow_insecure = true\n[access]").unwrap();
        assert_eq!(doors.doors, [Door::Tcp("10.0.0.1:1".parse().unwrap())]);
    }
}
