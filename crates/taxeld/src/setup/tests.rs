//! Whole robots of made-up files in iCub's formats, and iCub's own files where they are there.

use std::fmt::Write as _;

use super::*;
use clap::Parser;
use taxel_skin::ModuleKind;

#[derive(Debug, Parser)]
struct Cli {
    #[command(flatten)]
    args: SetupArgs,
}

fn run(arguments: &[&str]) -> anyhow::Result<()> {
    setup(&Cli::try_parse_from(std::iter::once("setup").chain(arguments.iter().copied()))?.args)
}

/// A position file of these modules, numbered over all boards; thermal pads have places, too, as in some files.
fn positions(name: &str, boards: usize, modules: &[usize]) -> String {
    let mut text = format!("name {name}\nspatial_sampling taxel\ntaxel2Repr ( 3 3 -1 )\n[calibration]\n");
    for row in 0..192 * boards {
        let (module, value) = ((row / 12) as f64, (row % 12) as f64);
        if modules.contains(&(row / 12)) {
            writeln!(text, "{:.4}\t{:.4} 0.02  {:.3} 0 0.8", 0.018 * module, 0.005 * value + 0.001, 0.01 * module)
                .unwrap();
        } else {
            text.push_str("0.0 0.0 0.0 0.0 0.0 0.0\n");
        }
    }
    text
}

/// The parts of an iCub that have skin, as its files call them: file, link and boards.
const PARTS: [(&str, &str, usize); 13] = [
    ("left_hand_V2_1", "l_hand", 1),
    ("right_hand_V2_1", "r_hand", 1),
    ("left_forearm_V2", "l_forearm", 2),
    ("right_forearm_mesh", "r_forearm", 2),
    ("left_arm", "l_upper_arm", 4),
    ("right_arm", "r_upper_arm", 4),
    ("torso", "torso", 4),
    ("left_foot", "l_foot", 2),
    ("right_foot", "r_foot", 2),
    ("left_leg_lower", "l_lower_leg", 4),
    ("right_leg_lower", "r_lower_leg", 4),
    ("left_leg_upper", "l_upper_leg", 7),
    ("right_leg_upper", "r_upper_leg", 7),
];

struct Folder(tempfile::TempDir);

impl Folder {
    fn new() -> Self {
        Self(tempfile::tempdir().unwrap())
    }

    fn put(&self, name: &str, text: &str) -> String {
        let path = self.0.path().join(name);
        std::fs::write(&path, text).unwrap();
        path.to_str().unwrap().to_owned()
    }

    fn path(&self, name: &str) -> String {
        self.0.path().join(name).to_str().unwrap().to_owned()
    }

    fn written(&self) -> String {
        std::fs::read_to_string(self.path("t.toml")).unwrap()
    }

    /// The configuration as the daemon takes it.
    fn resolved(&self) -> config::Scene {
        let path = PathBuf::from(self.path("t.toml"));
        config::examine_text(&path, &self.written()).unwrap().1
    }
}

#[test]
fn every_part_of_the_robot_resolves_with_all_of_its_positioned_taxels() {
    let folder = Folder::new();
    let mut arguments = vec!["--out".to_owned(), folder.path("t.toml"), "--positions".to_owned()];
    let mut expected = 0;
    for (number, (file, link, boards)) in PARTS.into_iter().enumerate() {
        // Its link says what part it is where the name of its file does not.
        let file = if number % 3 == 0 { format!("part_{number}") } else { file.to_owned() };
        let is_hand = link.ends_with("hand");
        let modules: Vec<usize> =
            (0..16 * boards).filter(|m| if is_hand { (8..12).contains(m) } else { m % 4 != 3 }).collect();
        arguments.push(folder.put(&format!("{file}.txt"), &positions(link, boards, &modules)));
        expected += modules.len() * if is_hand { 11 } else { 10 };
    }
    run(&arguments.iter().map(String::as_str).collect::<Vec<_>>()).unwrap();
    let scene = folder.resolved();
    assert_eq!((scene.plan.buses, scene.plan.patches.len()), (7, 13));
    let mut placed = 0;
    for plan in &scene.plan.patches {
        let poses = &plan.geometry.as_ref().unwrap().poses;
        assert!(poses.iter().all(Option::is_some), "{}: every taxel has a position", plan.patch.name());
        placed += poses.len();
    }
    assert_eq!(placed, expected, "all positioned taxels are there");
    assert!(placed > 4_200, "{placed}: a whole robot");
    let arm = scene.plan.patches.iter().find(|plan| plan.patch.name() == "left_arm").unwrap();
    let addresses: Vec<u8> = arm.patch.boards().iter().map(|board| board.address.get()).collect();
    assert_eq!(addresses, [11, 10, 9, 8]);
}

#[test]
fn a_hand_has_its_fingertips_from_the_drawing_and_their_settings_as_exceptions() {
    let folder = Folder::new();
    let positions = folder.put("left_hand_V2_1.txt", &positions("l_hand", 1, &[8, 9, 10, 11]));
    let drawing = "cardid 14\nrobotPart left_hand\n[SENSORS]\npalmL 8 -25 0 0 4 0 0\nfingertip2L 3 32 35 -30 4 0 0\n\
                   fingertip2L 2 1 1 1 4 0 0\nfingertip2L 1 1 1 1 4 0 0\nfingertip2L 0 1 1 1 4 0 0\nfingertip2L 4 1 1 1 4 0\n";
    let drawing = folder.put("left_hand_V2_1.ini", drawing);
    let out = folder.path("t.toml");
    run(&["--positions", &positions, "--layout", &drawing, "--out", &out]).unwrap();
    let text = folder.written();
    assert!(text.contains("modules = \"8-11 palm\", board_type = 1 },"), "{text}");
    assert!(text.contains("modules = \"0-4 fingertip\", board_type = 1, shift = 0, cdc_offset = 0x2000 },"), "{text}");
    assert!(text.contains("board_type = 1") && text.contains("area = \"equal\""), "{text}");
    let scene = folder.resolved();
    assert_eq!(scene.plan.patches[0].patch.taxels().len(), 104);
    // Without the drawing it is said that there may be fingertips.
    run(&["--positions", &positions, "--out", &out, "--force"]).unwrap();
    let text = folder.written();
    assert!(text.contains("modules = \"8-11 palm\"") && text.contains("Fingertips are modules 0 to 4"), "{text}");
    let kinds: Vec<ModuleKind> = folder.resolved().plan.patches[0].patch.modules().iter().map(|m| m.kind).collect();
    assert_eq!(kinds[..3], [ModuleKind::PalmPad11; 3]);
    assert_eq!(kinds[3], ModuleKind::PalmPad7);
}

#[test]
fn the_robots_configuration_gives_addresses_periods_and_exceptions() {
    let folder = Folder::new();
    let torso = folder.put("torso.txt", &positions("torso", 4, &[5, 16, 32, 33, 48]));
    let device = folder.put(
        "torso-eb22-skin.xml",
        "<?xml version=\"1.0\"?>\n<!DOCTYPE devices PUBLIC \"-//YARP//DTD\" \"x.dtd\">\n\
         <device xmlns:xi=\"http://www.w3.org/2001/XInclude\" name=\"torso-eb22-skin\" type=\"embObjSkin\">\n\
         <!-- <!-- an older list --> -->\n\
         <group name=\"patches\"><param name=\"skinCanAddrsPatch1\"> 7 8 11 10 </param></group>\n\
         <xi:include href=\"hardware/skin/torso-eb22-skinSpec.xml\" /></device>\n",
    );
    let spec = folder.put(
        "torso-eb22-skinSpec.xml",
        "<params><group name=\"defaultCfgBoard\"><param name=\"period\">30</param><param name=\"skinType\">8</param>\
         <param name=\"noLoad\">0xf0</param></group><group name=\"defaultCfgTriangle\"><param name=\"enabled\">fasle</param>\
         <param name=\"shift\">2</param><param name=\"cdcOffset\">0x2200</param></group>\
         <group name=\"specialCfgTriangles\"><param name=\"numOfSets\">3</param>\
         <param name=\"triangleSetCfg1\">1 7 4 5 1 2 0x2200</param>\
         <param name=\"triangleSetCfg2\">1 11 0 0 1 1 0x2000</param>\
         <param name=\"triangleSetCfg3\">1 11 1 1 1 2 0x2200</param>\
         <param name=\"triangleSetCfg4\">1 11 0 0 1 4 0x1000</param></group></params>",
    );
    let out = folder.path("t.toml");
    let wrapper = folder.put("w.xml", &wrapper("w", "torso", "0 767 0 767", "torso-eb22-skin").1);
    run(&["--positions", &torso, "--xml", &device, &spec, &wrapper, "--can", "--out", &out]).unwrap();
    let text = folder.written();
    let plan = &folder.resolved().plan.patches[0];
    let addresses: Vec<u8> = plan.patch.boards().iter().map(|board| board.address.get()).collect();
    assert_eq!(addresses, [7, 8, 11, 10], "as this robot has them");
    assert_eq!(plan.period.as_millis(), 30);
    assert!(text.contains("modules = \"5\", board_type = 8 }"), "{text}");
    assert!(text.contains("CHECK: triangleSetCfg4 is not used"), "{text}");
    assert!(text.contains("modules = \"0\", board_type = 8, shift = 1, cdc_offset = 0x2000 }"), "{text}");
}

/// A comment in Latin-1 is nothing that matters, to `setup` and to the daemon.
#[test]
fn a_comment_in_another_encoding_is_no_fault_of_a_position_file() {
    let folder = Folder::new();
    let hand = folder.put("left_hand.txt", "");
    let text = [b"# gepr\xFCft\n", positions("l_hand", 1, &[8]).as_bytes()].concat();
    std::fs::write(&hand, text).unwrap();
    run(&["--positions", &hand, "--out", &folder.path("t.toml")]).unwrap();
    assert!(folder.resolved().plan.patches[0].geometry.is_some());
}

#[test]
fn what_cannot_be_is_refused_with_the_file() {
    let folder = Folder::new();
    let out = folder.path("t.toml");
    let hand = folder.put("left_hand.txt", &positions("l_hand", 1, &[8]));
    let nameless = folder.put("skin.txt", &positions("", 1, &[8]));
    let large = folder.put("right_foot.txt", &positions("r_foot", 3, &[33]));
    let broken = folder.put("left_arm.txt", "[calibration]\n1 2 3\n");
    let xml = folder.put("left_arm-eb1-skin.xml", "<device>");
    let refused = |arguments: &[&str]| {
        let why = format!("{:#}", run(&[arguments, &["--out", &out]].concat()).unwrap_err());
        assert!(!Path::new(&out).exists(), "nothing is written");
        why
    };
    for (arguments, says) in [
        (vec!["--positions", nameless.as_str()], "neither its name nor its content names a part"),
        (vec!["--positions", &large], "right_foot: the files have modules on 3 boards, and the part has 2"),
        (vec!["--positions", &broken], "left_arm.txt: line 2: `1 2 3`"),
        (vec!["--positions", &hand, "--xml", &xml], "left_arm-eb1-skin.xml: not well-formed XML"),
        (vec!["--positions", &hand, &hand], "are both of left_hand"),
        (vec!["--positions", "nowhere.txt"], "nowhere.txt"),
    ] {
        let why = refused(&arguments);
        assert!(why.contains(says), "{says}: {why}");
    }
    let said = format!("right_hand={nameless}");
    run(&["--positions", &said, "--out", &out]).unwrap();
    assert_eq!(folder.resolved().plan.patches[0].patch.name(), "right_hand");
    let again = format!("{:#}", run(&["--positions", &hand, "--out", &out]).unwrap_err());
    assert!(again.contains("--force"), "{again}");
}

/// A device behind an Ethernet board, of a file of its name.
fn device(name: &str, inside: &str) -> (String, String) {
    let head = "<device xmlns:xi='http://www.w3.org/2001/XInclude' type='embObjSkin'";
    (format!("{name}.xml"), format!("{head} name='{name}'><group name='patches'>{inside}</group></device>"))
}

fn boards(list: &str) -> String {
    format!("<param name='skinCanAddrsPatch1'>{list}</param>")
}

fn wrapper(name: &str, port: &str, range: &str, network: &str) -> (String, String) {
    let text = format!(
        "<devices><device name='{name}' type='skinWrapper'><paramlist name='ports'><elem name='{port}'>{range}</elem></paramlist>\
         <action phase='startup'><paramlist name='networks'><elem name='Set'> {network} </elem></paramlist></action></device></devices>"
    );
    (format!("{name}.xml"), text)
}

/// The patches of parts with these modules, or why there are none.
fn patches(parts: &[(&str, &[usize])], files: &[&(String, String)]) -> Result<Vec<PatchDraft>, String> {
    patches_and_notes(parts, files).map(|(drafts, _)| drafts)
}

type Made = (Vec<PatchDraft>, Vec<String>);

fn patches_and_notes(parts: &[(&str, &[usize])], files: &[&(String, String)]) -> Result<Made, String> {
    let folder = Folder::new();
    let drawing = |(part, modules): &(&str, &[usize])| {
        let rows: Vec<String> = modules.iter().map(|module| format!("triangle_10pad {module} 0 0 0 4 0 0\n")).collect();
        folder.put(&format!("{part}.ini"), &format!("robotPart {part}\n[SENSORS]\n{}", rows.concat())).into()
    };
    let layout = parts.iter().map(drawing).collect();
    let xml = files.iter().map(|(name, text)| folder.put(name, text).into()).collect();
    let (positions, out) = (Vec::new(), folder.path("t.toml").into());
    let args = SetupArgs { positions, layout, xml, yarp: false, can: false, out, force: false };
    drafts(&args).map_err(|why| format!("{why:#}"))
}

fn addresses(draft: &PatchDraft) -> Vec<u8> {
    draft.boards.iter().map(|board| board.address).collect()
}

#[test]
fn a_port_says_the_device_whatever_its_name_and_the_order_of_the_files() {
    let (a, b) = (device("left_arm-a-skin", &boards("14 11 10")), device("humanoid-b-skin", &boards("1 2 3 4")));
    let of_a = wrapper("wa", "left_hand", "0 191 0 191", "left_arm-a-skin");
    let of_b = wrapper("wb", "left_upperarm", "384 767 0 383", "humanoid-b-skin");
    for files in [[&a, &b, &of_a, &of_b], [&of_b, &of_a, &b, &a]] {
        let drafts = patches(&[("left_hand", &[0]), ("left_upperarm", &[0, 17])], &files).unwrap();
        assert_eq!(addresses(&drafts[0]), [14]);
        assert_eq!(addresses(&drafts[1]), [3, 4], "the third board's values come first on that port");
        let port = |draft: &PatchDraft| draft.port.clone().unwrap();
        assert_eq!(port(&drafts[0]).boards, [14], "one board of three");
        assert_eq!(port(&drafts[1]).name, "/icub/skin/left_upperarm");
    }
    let why = patches(&[("left_hand", &[0])], &[&of_a]).unwrap_err();
    assert!(why.contains("wa has the values of left_arm-a-skin, which is in none of the files"), "{why}");
}

#[test]
fn without_a_wrapper_the_addresses_are_those_of_most_robots_and_that_is_said() {
    let draft = &patches(&[("left_forearm", &[0])], &[&device("left_arm-a-skin", &boards("9 8"))]).unwrap()[0];
    assert_eq!(addresses(draft), [13]);
    assert!(draft.open.iter().any(|line| line.contains("no wrapper of the robot's files")), "{:?}", draft.open);
}

#[test]
fn a_device_on_a_can_card_has_its_parameters_in_params_and_its_settings_in_what_it_includes() {
    let settings = "<params><group name='defaultCfgTriangle'><param name='shift'>0</param><param name='cdcOffset'>0x2000</param>\
                    </group></params>";
    let hand = "<device xmlns:xi='http://www.w3.org/2001/XInclude' name='left_hand_skin' type='canBusSkin'><params robot='r'>\
                <param name='canDeviceNum'>7</param><param name='skinCanIds'> 15 </param></params><xi:include href='hardware/skin/setup-of-the-hand.xml' /></device>";
    let files = [("hand.xml", hand), ("setup-of-the-hand.xml", settings)]
        .map(|(name, text)| (name.to_owned(), text.to_owned()));
    // It names no device: there is only one.
    let wrapper = wrapper("w", "left_hand", "0 191 0 191", "");
    let draft = &patches(&[("left_hand", &[0])], &[&files[0], &files[1], &wrapper]).unwrap()[0];
    assert_eq!((addresses(draft), draft.boards[0].modules[0].0), (vec![15], (0, 0x2000)));
    assert!(draft.listens.is_some() && draft.port.is_none());
}

#[test]
fn boards_behind_an_ethernet_board_are_read_over_the_port_of_their_counts() {
    let second = format!("{}<param name='skinCanAddrsPatch2'>13 12</param>", boards("9 10 11"));
    let arm = device("left_arm-eb31-skin", &second);
    let of_arm = wrapper("w", "left_forearm", "0 383 0 383", "left_arm-eb31-skin");
    let robot = "<robot name='r' portprefix='robo' xmlns:xi='http://www.w3.org/2001/XInclude'><xi:include href='w.xml'/></robot>";
    let robot = ("robot.xml".to_owned(), robot.to_owned());
    let draft = &patches(&[("left_forearm", &[0, 16])], &[&arm, &of_arm, &robot]).unwrap()[0];
    assert_eq!(addresses(draft), [13, 12], "the second bus comes first");
    let port = draft.port.as_ref().unwrap();
    assert_eq!((port.name.as_str(), &port.boards[..]), ("/robo/skin/left_forearm", &[13, 12][..]));
    let text = text("", std::slice::from_ref(draft), Path::new("."));
    let (_, scene) = crate::config::examine_text(Path::new("t.toml"), &text).unwrap();
    assert!(text.contains("source = \"yarp\"") && !scene.plan.patches[0].configures(), "{text}");
}

/// A part on the second board of its port.
#[test]
fn a_port_has_all_of_its_boards_in_the_patch_also_those_without_a_module() {
    let files = [device("d", &boards("13 12")), wrapper("w", "left_forearm", "0 383 0 383", "d")];
    let draft = patches(&[("left_forearm", &[17])], &[&files[0], &files[1]]).unwrap();
    let text = text("", &draft, Path::new("."));
    assert!(text.contains("{ address = 13, modules = \"\" },"), "{text}");
    let (_, scene) = crate::config::examine_text(Path::new("t.toml"), &text).unwrap();
    assert_eq!(scene.plan.patches[0].patch.port_index(0), Some(204), "as the rows of port and position file");
}

#[test]
fn what_was_given_and_is_not_used_is_named() {
    let set = "<param name='numOfSets'>2</param><param name='triangleSetCfg1'>1 14 0 1</param>\
               <param name='triangleSetCfg2'>1 5 0 1 1 2 0x2200</param>";
    let group = format!("</group><group name='specialCfgTriangles'>{set}");
    let arm = device("left_arm-a-skin", &(boards("14 11 10") + &group));
    let hand = wrapper("wa", "left_hand", "0 191 0 191", "left_arm-a-skin");
    let (other, broken) =
        (wrapper("wb", "torso", "0 191 0 191", "torso-skin"), ("skin.xml".to_owned(), "<a>".to_owned()));
    let includes = "<xi:include href='hand-skin.xml'/><xi:include href='motors.xml'/>";
    let list = format!("<robot name='r' xmlns:xi='http://www.w3.org/2001/XInclude'>{includes}</robot>");
    let list = ("all.xml".to_owned(), list);
    let (drafts, notes) = patches_and_notes(&[("left_hand", &[0])], &[&arm, &hand, &other, &list]).unwrap();
    let [missing, file, boards] = &notes[..] else { panic!("{notes:?}") };
    assert!(missing.starts_with("hand-skin.xml, which ") && missing.ends_with("is not there"), "{missing}");
    assert!(file.contains("wb.xml: not used: it says nothing of the parts that were given"), "{file}");
    assert!(boards.starts_with("left_arm-a-skin: boards 11, 10 are in no patch"), "{boards}");
    let [malformed, nowhere] = &drafts[0].open[..] else { panic!("{:?}", drafts[0].open) };
    assert_eq!(malformed, "triangleSetCfg1 = 1 14 0 1 is not used: expected 7 numbers");
    assert_eq!(nowhere, "a special set of triangles is not used: bus 1 has no board 5 to 5");
    let including = ("all.xml".to_owned(), list.1.replace("hand-skin", "skin"));
    let refused = patches_and_notes(&[("left_hand", &[0])], &[&arm, &hand, &including, &broken]).unwrap_err();
    assert!(refused.contains("skin.xml: not well-formed XML"), "{refused}");
}

#[test]
fn icubs_own_forearm_files_make_a_configuration() {
    let data = std::env::var("TAXELD_DATA").map_or_else(
        |_| Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data"),
        |folder| Path::new(&folder).to_owned(),
    );
    let icub = data.join("icub_positions");
    if !icub.exists() {
        eprintln!("SKIPPED icubs_own_forearm_files_make_a_configuration: no {}", icub.display());
        return;
    }
    let folder = Folder::new();
    for (positions, drawing, taxels, modules, normals) in [
        ("left_forearm_mesh.txt", "left_forearm.ini", 230, "1, 5, 8-10, 12-13", "Usable"),
        ("left_forearm_V2.txt", "left_forearm_V2.ini", 240, "0-1, 3, 6, 8-9, 12-13", "Usable"),
    ] {
        let file = |name: &str| icub.join(name).to_str().unwrap().to_owned();
        let out = folder.path("t.toml");
        run(&["--positions", &file(positions), "--layout", &file(drawing), "--out", &out, "--force"]).unwrap();
        let text = folder.written();
        assert!(text.contains(&format!("address = 12, modules = \"{modules}\"")), "{text}");
        let example = include_str!("../../../../deploy/taxeld.toml");
        assert!(example.contains(&format!("\"{modules}\"")), "the example is the real forearm: {modules}");
        assert!(!text.contains("other modules"), "both files have the same modules: {text}");
        let plan = &folder.resolved().plan.patches[0];
        let geometry = plan.geometry.as_ref().unwrap();
        assert_eq!(geometry.poses.iter().flatten().count(), taxels, "{positions}");
        assert_eq!(format!("{:?}", geometry.normals), normals);
    }
}
