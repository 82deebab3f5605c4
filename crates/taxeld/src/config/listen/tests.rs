use super::super::examine_text;
use super::*;

const EXAMPLE: &str = include_str!("../../../../../deploy/insole.toml");

/// Of the insole with keys of the file before its sections and sections behind them.
fn resolved(top: &str, rest: &str) -> Result<Doors, String> {
    let path = Path::new("/etc/taxeld/t.toml");
    let resolved = examine_text(path, &format!("{top}\n{EXAMPLE}\n{rest}"));
    resolved.map(|(_, scene)| scene.doors).map_err(|problems| problems.to_string())
}

#[test]
fn without_any_key_the_loopback_is_served_and_everything_is_allowed_there() {
    let doors = resolved("", "").unwrap();
    assert_eq!(doors.doors, [Door::Tcp(LISTEN_DEFAULT)]);
    assert_eq!(doors.rules, None);
}

#[test]
fn with_an_access_section_nothing_is_allowed_that_it_does_not_say() {
    let rules = |access: &str| resolved("", &format!("[access]\n{access}")).unwrap().rules.unwrap();
    let ways = |rules: &Rules| (rules.loopback, rules.unix, rules.certificate, rules.insecure);
    let observer = Some(Role::Observer);
    let usual = rules("operators = [\"group:skin\"]");
    assert_eq!(ways(&usual), (observer, observer, None, observer));
    assert_eq!(usual.grants, [Grant { subject: Subject::Group("skin".to_owned()), role: Role::Operator }]);
    assert_eq!(ways(&rules("observers = []")), (None, None, None, None));
    let lab = rules("operators = [\"loopback\", \"tls\"]\nadmins = [\"unix\"]");
    assert_eq!(ways(&lab), (Some(Role::Operator), Some(Role::Admin), Some(Role::Operator), observer));
}

/// Without a socket that tells accounts apart, a section that was copied by itself leaves nobody who may tare.
#[test]
fn a_grant_that_no_listener_can_honour_is_told() {
    let access = "[access]\noperators = [\"group:skin\"]\nadmins = [\"certificate:CN=ann\"]";
    let told = resolved("", access).unwrap().unreached_grants();
    assert_eq!(told.len(), 2, "{told:?}");
    assert!(told[0].starts_with("access: group skin is operator only over a Unix socket"), "{}", told[0]);
    assert!(told[1].starts_with("access: certificate CN=ann is admin only over TLS"), "{}", told[1]);
    let told = resolved("listen = [\"unix:/run/taxeld/s\"]", access).unwrap().unreached_grants();
    assert!(told.len() == 1 && told[0].contains("CN=ann"), "{told:?}");
}

#[test]
fn listeners_are_resolved_beside_the_configuration() {
    let top = "listen = [\"unix:s\", \"tls:0.0.0.0:50052\", \"insecure:10.0.0.1:1\"]\nsocket_group = \"skin\"\n\
               tls = { cert = \"s.pem\", key = \"/run/k.pem\", client_ca = \"ca.pem\" }";
    let found = resolved(top, "[access]").unwrap();
    let files = TlsFiles {
        certificate: "/etc/taxeld/s.pem".into(),
        key: "/run/k.pem".into(),
        client_ca: "/etc/taxeld/ca.pem".into(),
    };
    let unix = Door::Unix("/etc/taxeld/s".into());
    let tls = Door::Tls { address: "0.0.0.0:50052".parse().unwrap(), files };
    assert_eq!(found.group.as_deref(), Some("skin"));
    assert_eq!(found.doors, [unix, tls, Door::Tcp("10.0.0.1:1".parse().unwrap())]);
}

#[test]
fn what_would_let_strangers_in_is_refused_with_what_to_write() {
    let cases = [
        ("listen = [\"tcp:0.0.0.0:1\"]", "", "for other machines write tls:, or insecure:"),
        ("listen = [\"insecure:10.0.0.1:1\"]", "", "needs an [access] section"),
        ("listen = [\"tls:10.0.0.1:1\"]", "[access]", "it needs the section [tls]"),
        ("listen = [\"127.0.0.1:50051\"]", "", "expected unix:PATH, tcp:ADDRESS:PORT"),
        ("listen = [\"nonsense\"]", "", "expected unix:PATH, tcp:ADDRESS:PORT"),
        ("listen = [\"tcp:localhost\"]", "", "expected an address and a port"),
        ("listen = [\"unix:\"]", "", "expected a path"),
        ("", "[access]\noperators = [\"insecure\"]", "nobody would know who did"),
        ("", "[access]\nadmins = [\"ann\"]", "expected user:NAME, group:NAME"),
        ("", "[access]\nadmins = [\"user:\"]", "expected a name behind the colon"),
        ("", "[access]\nadmins = [\"certificate:cn=ann\"]", "access.admins: \"certificate:cn=ann\": "),
        ("", "[access]\noperator = []", "did you mean `operators`"),
    ];
    for (top, rest, expected) in cases {
        let problem = resolved(top, rest).unwrap_err();
        assert!(problem.contains(expected), "{top} {rest}: {problem}");
    }
}
