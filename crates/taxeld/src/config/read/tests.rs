use std::collections::BTreeSet;

use super::*;

const EXAMPLE: &str = include_str!("../../../../../deploy/taxeld.toml");

const SMALL: &str = "[store]\npath = \"t.db\"\n[[bus]]\nname = \"b\"\ninterface = \"can0\"\n[[patch]]\nname = \"p\"\n\
                     bus = \"b\"\nboards = [{ address = 13, modules = \"0-3\" }]\n";

fn problems(text: &str) -> Vec<Problem> {
    examine_text(Path::new("t.toml"), text).err().map(|problems| problems.all().to_vec()).unwrap_or_default()
}

fn lines(text: &str) -> Vec<String> {
    let told = examine_text(Path::new("t.toml"), text).err().map(|problems| problems.to_string()).unwrap_or_default();
    told.lines().map(str::to_owned).collect()
}

/// The line of the text that holds these words.
fn line(text: &str, words: &str) -> usize {
    1 + text.lines().position(|line| line.contains(words)).unwrap()
}

/// What is commented out in the example is a key, too, and all of them are there.
#[test]
fn the_example_names_every_key_and_no_other() {
    let sections: [(&str, &str); 11] = [
        ("", ""),
        ("tls", "[tls]"),
        ("access", "[access]"),
        ("store", "[store]"),
        ("page", "[page]"),
        ("shared_memory", "[shared_memory]"),
        ("record", "[record]"),
        ("bus", "[[bus]]"),
        ("patch", "[[patch]]"),
        ("session", "[[patch]]\n[patch.session]"),
        ("fit", "[[patch]]\n[patch.fit]"),
    ];
    let inline =
        [("boards", "[{", "}]"), ("gauge", "{", "}"), ("grid", "{", "}"), ("array", "{", "}"), ("push", "{", "}")];
    let headers = sections.iter().map(|(name, header)| (*name, format!("{header}\nno_such_key = 1\n")));
    let inline = inline
        .iter()
        .map(|(name, open, close)| (*name, format!("[[patch]]\n{name} = {open} no_such_key = 1 {close}\n")));
    let mut keys = BTreeSet::new();
    for (section, text) in headers.chain(inline) {
        let found = problems(&text);
        let unknown = found.iter().find(|problem| problem.message.starts_with("unknown key"));
        let known =
            unknown.unwrap_or_else(|| panic!("{section}: {found:#?}")).message.split_once("Known here: ").unwrap().1;
        let is_section = |key: &&str| {
            let below = ["tls", "access", "store", "page", "shared_memory", "record", "bus", "patch"];
            below.contains(key) && section.is_empty() || *key == "certificate" // the last one goes with its section
        };
        for key in known.split(", ").filter(|key| !is_section(key)) {
            assert!(
                EXAMPLE.contains(&format!("{key} = ")) || EXAMPLE.contains(&format!("[patch.{key}]")),
                "{section}: {key}"
            );
            if !["boards", "gauge", "grid", "array", "push", "session", "fit"].contains(&key) {
                keys.insert(key.to_owned());
            }
        }
    }
    assert!(keys.len() <= 70, "{} keys", keys.len());
}

#[test]
fn every_fault_is_told_in_one_run_with_line_key_and_what_was_expected() {
    let text = EXAMPLE
        .replace("period_ms = 50", "period_ms = \"50\"")
        .replace("socket_group =", "soket_group =")
        .replace("address = 13,", "adress = 13, address = 13,")
        .replace("area_mm2 = 42.1", "area_mm2 = 0.0")
        .replace("unit = \"Pa\"", "unit = \"ell\"")
        .replace("interface = \"can0\"", "interface = \"\"")
        .replace("group:skin", "gruop:skin");
    let found = problems(&text);
    let about = |key: &str| {
        let found = found.iter().find(|problem| problem.key == key);
        found.unwrap_or_else(|| panic!("{key}: {found:#?}")).clone()
    };
    assert_eq!(found.len(), 7, "{found:#?}");
    let period = about("patch[0].period_ms");
    assert_eq!(period.line, line(&text, "period_ms = \"50\""));
    assert!(period.message.ends_with("expected u16"), "{period}");
    assert!(about("soket_group").message.contains("did you mean `socket_group`?"));
    assert_eq!(about("patch[0].boards[0].adress").line, line(&text, "adress = 13"));
    assert!(about("patch[0].gauge.unit").message.contains("gauge.unit = \"ell\""));
    let area = about("patch[0].area_mm2");
    assert_eq!(area.line, line(&text, "area_mm2 = 0.0"));
    assert_eq!(area.message, "patch `left_forearm`: area_mm2 = 0: expected 0.01 to 100000");
    assert_eq!(about("bus[0]").line, line(&text, "[[bus]]"));
    assert!(about("access.operators[0]").message.contains("expected user:NAME"));
}

#[test]
fn what_lacks_is_told_with_its_section() {
    let found = lines(&SMALL.replace("path = \"t.db\"\n", ""));
    assert_eq!(found, ["t.toml:1: store.path is missing: the file for sessions and model sets"]);
    let found = lines(&SMALL.replace("[store]\npath = \"t.db\"\n", "").replace("bus = \"b\"", "bus = \"c\""));
    assert!(
        found.len() == 2 && found[0].contains("store.path is missing") && found[1].contains("bus `c`"),
        "{found:?}"
    );
    let found = lines(&SMALL.replace("bus = \"b\"", "bus = \"c\"").replace("0-3", "0-30"));
    assert!(found.len() == 2 && found[1].contains("board 13: "), "{found:?}");
    let found = lines(&SMALL.replace("\"t.db\"", "5"));
    assert!(found.len() == 1 && found[0].contains("store.path: invalid type"), "{found:?}");
    let found = lines(&SMALL.replace("address = 13, ", ""));
    assert_eq!(found, ["t.toml:9: patch[0].boards[0].address is missing"]);
    let found = lines(&format!("{SMALL}gauge = {{ signal = \"0|32@1-\", unit = \"Pa\" }}\n"));
    assert_eq!(found.len(), 1);
    assert!(found[0].ends_with("gauge.id is missing: the identifier of its frames, as in 0x3A1"), "{found:?}");
}

#[test]
fn contradictions_of_two_patches_have_the_place_of_the_second() {
    let second =
        "[[patch]]\nname = \"q\"\nbus = \"b\"\nperiod_ms = 500\nboards = [{ address = 12, modules = \"0\" }]\n";
    let gauge = "gauge = { id = 0x4D1, signal = \"0|32@1-\", unit = \"Pa\" }\n";
    let found = problems(&format!("{SMALL}{gauge}{second}"));
    let keys: Vec<&str> = found.iter().map(|problem| problem.key.as_str()).collect();
    assert_eq!(keys, ["patch[0]", "patch[1].period_ms"], "{found:#?}");
    let of_board_13 = second.replace("address = 12", "address = 13");
    let tips = of_board_13.replace("500", "50").replace("\"0\"", "\"4-7 fingertip\"");
    assert_eq!(problems(&format!("{SMALL}{tips}")), [], "fingertips and palm may be two patches");
    for (period, modules, says) in [
        ("50", "3-4", "module 3 of board 13 is in patch `p` and in patch `q`"),
        ("100", "4", "board 13 is configured by patch `p` and by patch `q` with other settings"),
    ] {
        let second = of_board_13.replace("500", period).replace("\"0\"", &format!("\"{modules}\""));
        let found = problems(&format!("{SMALL}{second}"));
        assert_eq!((found.len(), found[0].key.as_str(), found[0].line), (1, "patch[1]", 10), "{found:#?}");
        assert!(found[0].message.contains(says), "{found:#?}");
    }
}

#[test]
fn no_more_is_told_than_a_hundred_problems() {
    let patch = |n: usize| format!("[[patch]]\nname = \"p{n}\"\nbus = \"b\"\nunknown = 1\n");
    let text = SMALL.to_owned() + &(0..=PROBLEMS_MAX).map(patch).collect::<String>();
    assert_eq!(lines(&text).len(), PROBLEMS_MAX);
}

#[test]
fn a_bus_without_a_number_is_refused() {
    let bus = |n: usize| format!("[[bus]]\nname = \"b{n}\"\ninterface = \"can{n}\"\n");
    let found = problems(&(SMALL.to_owned() + &(0..256).map(bus).collect::<String>()));
    assert_eq!((found.len(), found[0].message.as_str()), (1, "bus = 257: expected 0 to 256"), "{found:#?}");
}

#[test]
fn a_pipe_is_no_configuration() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("t.toml");
    nix::unistd::mkfifo(&path, nix::sys::stat::Mode::S_IRWXU).unwrap();
    let refused = examine(&path).unwrap_err().to_string();
    assert!(refused.contains("it is no regular file"), "{refused}");
    let config = folder.path().join("u.toml");
    std::fs::write(&config, format!("{SMALL}geometry = \"t.toml\"\n")).unwrap();
    let refused = examine(&config).unwrap_err().to_string();
    assert!(
        refused.contains("u.toml:10: patch `p`: geometry ") && refused.contains("it is no regular file"),
        "{refused}"
    );
}

#[test]
fn faults_of_syntax_are_told_at_once_and_up_to_the_limit() {
    let found = lines("[store\npath = 1\n[[bus]]\nname = = 2\n");
    assert!(found.len() >= 2 && found[0].starts_with("t.toml:1: "), "{found:#?}");
    assert_eq!(lines(&"= 1\n".repeat(2 * PROBLEMS_MAX)).len(), PROBLEMS_MAX);
}
