//! From a port to its wrapper to its device: whose boards a part has, and what of the files is not used.

use super::*;

/// A file of the robot's configuration.
type Xml = (&'static str, String);

fn device(name: &str, kind: &str, inside: &str) -> Xml {
    let file = Box::leak(format!("{name}.xml").into_boxed_str());
    (file, format!("<device xmlns:xi='http://www.w3.org/2001/XInclude' name='{name}' type='{kind}'>{inside}</device>"))
}

fn behind_ethernet(name: &str, boards: &str) -> Xml {
    device(
        name,
        "embObjSkin",
        &format!("<group name='patches'><param name='skinCanAddrsPatch1'>{boards}</param></group>"),
    )
}

fn wrapper(name: &str, port: &str, range: &str, network: &str) -> Xml {
    let file = Box::leak(format!("{name}.xml").into_boxed_str());
    let text = format!(
        "<devices><device name='{name}' type='skinWrapper'><paramlist name='ports'><elem name='{port}'>{range}</elem></paramlist>\
         <action phase='startup'><paramlist name='networks'><elem name='Set'> {network} </elem></paramlist></action></device></devices>"
    );
    (file, text)
}

/// The patch of a part with these modules, and what is not used; or why there is none.
fn patch(part: &str, modules: &[usize], files: &[&Xml]) -> Result<(PatchDraft, String), String> {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let rows: Vec<String> = modules.iter().map(|module| format!("triangle_10pad {module} 0 0 0 4 0 0\n")).collect();
    let drawing = at("drawing.ini");
    std::fs::write(&drawing, format!("robotPart {part}\n[SENSORS]\n{}", rows.concat())).unwrap();
    let xml: Vec<PathBuf> = files.iter().map(|(name, _)| at(name)).collect();
    files.iter().zip(&xml).for_each(|((_, text), path)| std::fs::write(path, text).unwrap());
    let args = SetupArgs {
        positions: Vec::new(),
        layout: vec![drawing],
        xml,
        gauge: None,
        interface: Vec::new(),
        out: at("taxeld.toml"),
        force: false,
    };
    let (mut drafts, notes) = drafts(&args).map_err(|why| format!("{why:#}"))?;
    let folder = format!("{}/", folder.path().display());
    Ok((drafts.remove(0), notes.join("\n").replace(&folder, "")))
}

fn addresses(draft: &PatchDraft) -> Vec<u8> {
    draft.boards.iter().map(|board| board.address).collect()
}

#[test]
fn a_port_says_the_device_whatever_its_name_and_the_order_of_the_files() {
    let (a, b) = (behind_ethernet("left_arm-a-skin", "14 11 10"), behind_ethernet("humanoid-b-skin", "1 2 3 4"));
    let (of_a, of_b) = (
        wrapper("wa", "left_hand", "0 191 0 191", "left_arm-a-skin"),
        wrapper("wb", "left_upperarm", "384 767 0 383", "humanoid-b-skin"),
    );
    for files in [[&a, &b, &of_a, &of_b], [&of_b, &of_a, &b, &a], [&b, &of_a, &a, &of_b]] {
        let (hand, notes) = patch("left_hand", &[0], &files).unwrap();
        assert_eq!(addresses(&hand), [14]);
        assert!(
            notes.contains("humanoid-b-skin.xml: not used: no part that was given is on device humanoid-b-skin"),
            "{notes}"
        );
        assert!(
            notes.contains("wb.xml: not used") && notes.contains("boards 11, 10 of left_arm-a-skin are in no patch"),
            "{notes}"
        );
        let (arm, _) = patch("left_upperarm", &[0, 17], &files).unwrap();
        assert_eq!(addresses(&arm), [3, 4], "the third board's values come first on that port");
    }
}

#[test]
fn without_a_wrapper_names_decide_and_what_fits_twice_is_refused() {
    let (a, b) = (behind_ethernet("left_arm-a-skin", "14 13"), behind_ethernet("left_upperarm-b-skin", "9"));
    let why = patch("left_forearm", &[0], &[&a, &b]).unwrap_err();
    assert!(
        why.contains("several devices fit left_forearm: left_arm-a-skin") && why.contains("left_upperarm-b-skin.xml"),
        "{why}"
    );
    // A CAN number is no name: several devices share it.
    let on_can = |name: &str, boards: &str| {
        device(
            name,
            "canBusSkin",
            &format!("<param name='canDeviceNum'>9</param><param name='skinCanIds'>{boards}</param>"),
        )
    };
    let (foot, torso) = (on_can("left_foot_skin", "2 3"), on_can("torso_skin", "7 8"));
    for files in [[&foot, &torso], [&torso, &foot]] {
        assert_eq!(addresses(&patch("torso", &[5], &files).unwrap().0), [7]);
    }
    let (none, notes) = patch("torso", &[5], &[&foot]).unwrap();
    assert!(none.open.iter().any(|line| line.contains("no device of the robot's files fits")), "{:?}", none.open);
    assert!(notes.contains("left_foot_skin.xml: not used"), "{notes}");
}

#[test]
fn a_wrapper_whose_device_is_missing_is_refused_with_its_name() {
    let why = patch("torso", &[0], &[&wrapper("w", "torso", "0 767 0 767", "torso-eb5-skin")]).unwrap_err();
    assert!(why.contains("w has the values of torso-eb5-skin, which is in none of the files"), "{why}");
}

#[test]
fn parameters_are_read_inside_of_params_and_of_files_of_any_name() {
    let settings = "<group name='defaultCfgTriangle'><param name='enabled'>true</param><param name='shift'>0</param>\
                    <param name='cdcOffset'>0x2000</param></group>";
    let inside = "<params robot='r' build='1'><param name='canDeviceNum'>7</param><param name='skinCanIds'> 15 </param>\
                  <param name='physDevice'> \"cfw2can\" </param></params><xi:include href='hardware/skin/setup-of-the-hand.xml' />";
    let hand = device("left_hand_skin", "canBusSkin", inside);
    let (draft, notes) =
        patch("left_hand", &[0], &[&hand, &("setup-of-the-hand.xml", format!("<params>{settings}</params>"))]).unwrap();
    assert_eq!((addresses(&draft), draft.boards[0].usual), (vec![15], (0, 0x2000)));
    assert!(draft.is_shared_address && notes.is_empty(), "{notes}");
    let out_of_reach = draft.out_of_reach.unwrap();
    assert!(out_of_reach.contains("(cfw2can) has no SocketCAN driver"), "{out_of_reach}");
}

#[test]
fn boards_behind_an_ethernet_board_are_told_with_the_port_of_their_counts() {
    let inside = "<group name='patches'><param name='skinCanAddrsPatch1'>9 10 11</param><param name='skinCanAddrsPatch2'>13 12</param>\
                  </group>";
    let arm = device("left_arm-eb31-skin", "embObjSkin", inside);
    let of_arm = wrapper("w", "left_forearm", "0 383 0 383", "left_arm-eb31-skin");
    let robot = (
        "robot.xml",
        "<robot name='r' portprefix='robo' xmlns:xi='http://www.w3.org/2001/XInclude'><devices><xi:include \
                  href='w.xml' /></devices></robot>"
            .to_owned(),
    );
    let (draft, notes) = patch("left_forearm", &[0, 16], &[&arm, &of_arm, &robot]).unwrap();
    assert_eq!(addresses(&draft), [13, 12], "the second bus comes first");
    let told = draft.out_of_reach.unwrap();
    assert!(told.contains("behind an Ethernet board") && told.contains("YARP port /robo/skin/left_forearm"), "{told}");
    assert_eq!(notes, "boards 9, 10, 11 of left_arm-eb31-skin are in no patch");
}

#[test]
fn files_that_say_nothing_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    std::fs::write(at("left_hand.txt"), "[calibration]\n".to_owned() + &"0 0 0 0 0 0\n".repeat(192)).unwrap();
    // As an editor on Windows saves it.
    let drawing = "\u{feff}cardid 14\nrobotPart left_hand\n[SENSORS]\nfingertip 0 0 0 0 4 0 0\n";
    std::fs::write(at("left_hand.ini"), drawing.encode_utf16().flat_map(u16::to_le_bytes).collect::<Vec<u8>>())
        .unwrap();
    std::fs::write(at("other.xml"), "<device name='head-mc' type='embObjMotionControl'/>").unwrap();
    let args = SetupArgs {
        positions: vec![at("left_hand.txt").into()],
        layout: vec![at("left_hand.ini").into()],
        xml: vec![at("other.xml").into()],
        gauge: None,
        interface: Vec::new(),
        out: at("taxeld.toml").into(),
        force: false,
    };
    let (drafts, notes) = drafts(&args).unwrap();
    assert_eq!(drafts[0].boards[0].modules.len(), 1);
    let notes = notes.join("\n");
    for says in [
        "left_hand.txt: not used: all its positions are zero",
        "cardid 14 is not used",
        "other.xml: not used: it has no skin device",
    ] {
        assert!(notes.contains(says), "{says}: {notes}");
    }
}

#[test]
fn parts_on_several_devices_of_a_limb_are_on_buses_of_their_own() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let files = [
        behind_ethernet("left_arm-a-skin", "14 13 12"),
        behind_ethernet("left_upperarm-b-skin", "13"),
        wrapper("wa", "left_forearm", "192 575 0 383", "left_arm-a-skin"),
        wrapper("wb", "left_arm", "0 191 0 191", "left_upperarm-b-skin"),
    ];
    files.iter().for_each(|(name, text)| std::fs::write(at(name), text).unwrap());
    for (part, module) in [("left_forearm", 0), ("left_arm", 3)] {
        let text = format!("robotPart {part}\n[SENSORS]\ntriangle_10pad {module} 0 0 0 4 0 0\n");
        std::fs::write(at(&format!("{part}.ini")), text).unwrap();
    }
    let args = SetupArgs {
        positions: Vec::new(),
        layout: vec![at("left_forearm.ini"), at("left_arm.ini")],
        xml: files.iter().map(|(name, _)| at(name)).collect(),
        gauge: None,
        interface: Vec::new(),
        out: at("taxeld.toml"),
        force: false,
    };
    let (drafts, _) = drafts(&args).unwrap();
    assert_eq!(drafts.iter().map(addresses).collect::<Vec<_>>(), [[13], [13]]);
    assert_eq!(drafts.iter().map(|draft| draft.bus.as_str()).collect::<Vec<_>>(), ["left_arm", "left_arm_2"]);
}

#[test]
fn sets_for_a_bus_that_the_device_does_not_have_are_named() {
    let inside = "<param name='canDeviceNum'>7</param><param name='skinCanIds'>14</param><group name='specialCfgBoards'>\
                  <param name='numOfSets'>1</param><param name='boardSetCfg1'>1 14 14 50 1 0xf0</param></group>";
    let (draft, _) = patch("left_hand", &[0], &[&device("left_hand_skin", "canBusSkin", inside)]).unwrap();
    let says = "1 special sets are for CAN 1 and not used: the device has CAN 7";
    assert!(draft.open.iter().any(|line| line.starts_with(says)), "{:?}", draft.open);
}
