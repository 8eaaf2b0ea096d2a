//! Descriptions and overrides that make no hand: each with its exact line.

use std::fmt::Write;

use host::hand::urdf::{Overrides, from_str, load};

use crate::{FIVE, THREE, loaded, model};

/// A parallel gripper, the smallest hand: every row below changes a word or two of it.
pub(crate) const GRIPPER: &str = r#"<robot name="gripper">
<link name="palm"><collision><geometry><box size="0.14 0.06 0.05"/></geometry></collision></link>
<link name="left"><collision><origin xyz="0 0 0.03"/><geometry><box size="0.012 0.02 0.06"/></geometry></collision></link>
<link name="right"><collision><origin xyz="0 0 0.03"/><geometry><box size="0.012 0.02 0.06"/></geometry></collision></link>
<joint name="slide" type="prismatic">
<parent link="palm"/><child link="left"/><origin xyz="-0.06 0 0.025"/><axis xyz="1 0 0"/>
<limit lower="0" upper="0.05" effort="40" velocity="0.1"/></joint>
<joint name="other" type="prismatic">
<parent link="palm"/><child link="right"/><origin xyz="0.06 0 0.025"/><axis xyz="-1 0 0"/>
<limit lower="0" upper="0.05" effort="40" velocity="0.1"/><mimic joint="slide"/></joint>
</robot>
"#;

/// What is replaced, by what, and the line that follows.
const ROWS: [(&str, &str, &str); 30] = [
    ("</robot>", "</robo>", "malformed XML: expected 'robot' tag, not 'robo' at 11:1"),
    (
        "</robot>",
        "<link name=\"${x}\"/></robot>",
        "this is xacro, not URDF: run `xacro FILE > hand.urdf` first",
    ),
    ("<link name=\"left\">", "<link>", "line 3: <link> has no name"),
    ("<link name=\"right\">", "<link name=\"left\">", "line 4: a second link is named 'left'"),
    ("<joint name=\"other\"", "<joint name=\"slide\"", "line 8: a second joint is named 'slide'"),
    ("<child link=\"right\"/>", "", "line 8: <joint> has no <child link=..>"),
    ("<child link=\"right\"/>", "<child link=\"nobody\"/>", "joint 'other': there is no link 'nobody'"),
    (
        "<child link=\"right\"/>",
        "<child link=\"left\"/>",
        "link 'left' has two parents, 'palm' and 'palm': loops are not supported",
    ),
    (
        "<parent link=\"palm\"/><child link=\"right\"/>",
        "<parent link=\"right\"/><child link=\"right\"/>",
        "link 'right' is its own ancestor: the joints form a cycle",
    ),
    (
        "<parent link=\"palm\"/><child link=\"left\"/>",
        "<parent link=\"right\"/><child link=\"palm\"/>",
        "link 'right' is its own ancestor: the joints form a cycle",
    ),
    (
        "<parent link=\"palm\"/><child link=\"right\"/>",
        "<parent link=\"right\"/><child link=\"palm\"/>",
        "1 finger(s) found: a hand needs two chains of moving joints that branch from one link",
    ),
    (
        "</robot>",
        "<link name=\"stray\"/></robot>",
        "several roots: 'palm', 'stray' have no parent; one link must carry all others",
    ),
    (
        "type=\"prismatic\">\n<parent link=\"palm\"/><child link=\"left\"/>",
        "type=\"floating\">\n<parent link=\"palm\"/><child link=\"left\"/>",
        "joint 'slide' is floating: a hand's joints are revolute, continuous, prismatic or fixed",
    ),
    (
        "type=\"prismatic\">\n<parent link=\"palm\"/><child link=\"left\"/>",
        "type=\"planar\">\n<parent link=\"palm\"/><child link=\"left\"/>",
        "joint 'slide' is planar: a hand's joints are revolute, continuous, prismatic or fixed",
    ),
    (
        "type=\"prismatic\">\n<parent link=\"palm\"/><child link=\"left\"/>",
        "type=\"elastic\">\n<parent link=\"palm\"/><child link=\"left\"/>",
        "joint 'slide': unknown type 'elastic'",
    ),
    ("<axis xyz=\"1 0 0\"/>", "<axis xyz=\"0 0 0\"/>", "joint 'slide' has a zero axis"),
    (
        "<axis xyz=\"1 0 0\"/>",
        "<axis xyz=\"1 0\"/>",
        r#"line 6: xyz="1 0" in <axis> is not three finite numbers"#,
    ),
    (
        "<axis xyz=\"1 0 0\"/>",
        "<axis xyz=\"NaN 0 0\"/>",
        r#"line 6: xyz="NaN 0 0" in <axis> is not three finite numbers"#,
    ),
    (
        "xyz=\"-0.06 0 0.025\"",
        "xyz=\"-0.06 0 inf\"",
        r#"line 6: xyz="-0.06 0 inf" in <origin> is not three finite numbers"#,
    ),
    (
        "<limit lower=\"0\" upper=\"0.05\" effort=\"40\" velocity=\"0.1\"/></joint>",
        "</joint>",
        "joint 'slide' has no limits: <limit lower=.. upper=..> is needed, or limits in the TOML",
    ),
    (
        "<limit lower=\"0\" upper=\"0.05\" effort=\"40\" velocity=\"0.1\"/></joint>",
        "<limit lower=\"0.05\" upper=\"0\" effort=\"40\" velocity=\"0.1\"/></joint>",
        "joint 'slide': its lower limit 0.05 lies above its upper limit 0",
    ),
    (
        "<mimic joint=\"slide\"/>",
        "<mimic joint=\"nobody\"/>",
        "joint 'other' mimics 'nobody', which is no moving joint of this description",
    ),
    (
        "<mimic joint=\"slide\"/>",
        "<mimic joint=\"other\"/>",
        "joint 'other' mimics 'other', which itself mimics 'other': name the joint that is driven",
    ),
    ("<mimic joint=\"slide\"/>", "<mimic/>", "line 10: <mimic> has no joint"),
    (
        "<box size=\"0.14 0.06 0.05\"/>",
        "<box size=\"0.14 -0.06 0.05\"/>",
        r#"line 2: size="0.14 -0.06 0.05" in <box> is not three numbers above 0"#,
    ),
    (
        "<box size=\"0.14 0.06 0.05\"/>",
        "<cone radius=\"1\"/>",
        "line 2: <geometry> holds no box, sphere, cylinder, capsule or mesh",
    ),
    ("<box size=\"0.14 0.06 0.05\"/>", "<sphere/>", "line 2: <sphere> has no radius"),
    (
        "<box size=\"0.14 0.06 0.05\"/>",
        "<mesh filename=\"palm.dae\"/>",
        "link 'palm': 'palm.dae' is COLLADA, which is not read: convert it to STL, OBJ, PLY or OFF",
    ),
    (
        "<box size=\"0.14 0.06 0.05\"/>",
        "<mesh filename=\"package://gone/palm.stl\"/>",
        "link 'palm': no mesh file at 'package://gone/palm.stl' (looked in gone/palm.stl)",
    ),
    (
        "<joint name=\"slide\" type=\"prismatic\">",
        "<joint name=\"slide\" type=\"fixed\">",
        "1 finger(s) found: a hand needs two chains of moving joints that branch from one link",
    ),
];

/// Overrides, and the line that follows.
const TOML_ROWS: [(&str, &str); 18] = [
    (
        "[[finger]]\ntip = \"left\"\nname = \"jaw\"\n[[finger]]\ntip = \"right\"\nname = \"jaw\"",
        "finger[1].name: a second finger is named 'jaw'",
    ),
    (
        "[[finger]]\ntip = \"left\"\nname = \"palm\"\n[[finger]]\ntip = \"right\"",
        "finger[0].name: 'palm' is no name for a finger",
    ),
    ("name = ", "line 1: string values must be quoted, expected literal string"),
    (
        "nmae = \"x\"",
        "line 1: unknown field `nmae`, expected one of `name`, `mass_kg`, `tip_force_n`, `stiffness_nm_per_rad`, `soft_tip_torsion_m`, `opposing`, `held`, `palm`, `flange_from_palm`, `finger`, `flexion`, `limits`",
    ),
    ("mass_kg = -1", "mass_kg: give a number above 0"),
    ("mass_kg = \"heavy\"", r#"line 1: invalid type: string "heavy", expected f64"#),
    ("tip_force_n = nan", "tip_force_n: give a number above 0"),
    ("opposing = \"thumb\"", "opposing: the description has no finger 'thumb'"),
    ("held = [\"nobody\"]", "held: the description has no joint 'nobody'"),
    ("[palm]\nlink = \"nobody\"", "palm.link: the description has no link 'nobody'"),
    ("[palm]\nxyz = [0, 0]", "line 2: invalid length 2, expected an array of length 3"),
    (
        "[palm]\nlink = \"left\"",
        "0 finger(s) found: a hand needs two chains of moving joints that branch from one link",
    ),
    (
        "[flexion]\nslide = \"sideways\"",
        "line 2: unknown variant `sideways`, expected one of `upper`, `lower`, `none`",
    ),
    ("[flexion]\nnobody = \"upper\"", "flexion: the description has no joint 'nobody'"),
    (
        "[flexion]\nother = \"upper\"",
        "flexion: the description has no joint that moves a finger by itself named 'other'",
    ),
    ("[limits]\nslide = [0.05, 0]", "limits.slide: give [lower, upper], finite, and lower not above upper"),
    ("[[finger]]\ntip = \"nobody\"", "finger[0].tip: the description has no link 'nobody'"),
    (
        "[[finger]]\ntip = \"left\"\n[[finger]]\ntip = \"left\"",
        "finger[1].tip: another finger ends in the same moving link",
    ),
];

#[test]
fn the_gripper_itself_is_a_hand() {
    let hand = from_str(GRIPPER, "".as_ref(), None, &[]).unwrap().hand;
    assert_eq!((hand.joints.len(), hand.fingers.len()), (1, 2));
    // Both jaws by one drive, which closes upwards.
    assert_eq!((hand.joints[0].flexes, hand.joints[0].is_held), (Some(true), false));
    assert!(!hand.candidates.is_empty());
}

#[test]
fn what_makes_no_hand_is_refused_in_one_line() {
    let mut wrong = String::new();
    let mut check = |what: &str, found: Option<String>, expected: &str| {
        let found = found.unwrap_or_else(|| "(a hand)".to_owned());
        if found != expected || found.contains('\n') {
            let _ = writeln!(wrong, "{what}\n   is   {found}\n   not  {expected}");
        }
    };
    for (from, to, expected) in ROWS {
        assert!(GRIPPER.contains(from), "{from}");
        let text = GRIPPER.replacen(from, to, 1);
        let found = from_str(&text, "".as_ref(), None, &[]).err().map(|problem| problem.to_string());
        check(to, found, expected);
    }
    for (toml, expected) in TOML_ROWS {
        let found = match Overrides::parse(toml) {
            Err(problem) => Some(problem.to_string()),
            Ok(overrides) => {
                from_str(GRIPPER, "".as_ref(), Some(&overrides), &[]).err().map(|problem| problem.to_string())
            }
        };
        check(toml, found, expected);
    }
    assert!(wrong.is_empty(), "{wrong}");
}

/// A chain of `n` joints in each of `fingers` fingers, as a description.
fn grown(fingers: usize, n: usize) -> String {
    let mut text = "<robot name=\"grown\"><link name=\"palm\"/>".to_owned();
    for finger in 0..fingers {
        for k in 0..n {
            let parent = if k == 0 { "palm".to_owned() } else { format!("l{finger}_{}", k - 1) };
            let _ = write!(
                text,
                "<link name=\"l{finger}_{k}\"><collision><geometry><sphere radius=\"0.01\"/></geometry></collision></link>\
                 <joint name=\"j{finger}_{k}\" type=\"revolute\"><parent link=\"{parent}\"/>\
                 <child link=\"l{finger}_{k}\"/><origin xyz=\"{} 0 0.03\"/><axis xyz=\"0 1 0\"/>\
                 <limit lower=\"-1\" upper=\"1\" effort=\"1\" velocity=\"1\"/></joint>",
                0.02 * finger as f64
            );
        }
    }
    text + "</robot>"
}

#[test]
fn too_many_joints_and_fingers_are_counted() {
    let refused = |text: &str| from_str(text, "".as_ref(), None, &[]).unwrap_err().to_string();
    assert_eq!(
        refused(&grown(9, 1)),
        "9 fingers, at most 8: name the ones to use with [[finger]] in the TOML"
    );
    assert_eq!(
        refused(&grown(7, 5)),
        "more than 32 independent joints: name fewer fingers with [[finger]] in the TOML"
    );
    assert_eq!(refused(&grown(2, 9)), "finger l0_8 has 9 joint(s), not 1 to 8");
    assert_eq!(
        refused(&grown(1, 3)),
        "1 finger(s) found: a hand needs two chains of moving joints that branch from one link"
    );
    assert_eq!(refused("<sdf/>"), "not a robot description: the root element is <sdf>, not <robot>");
    assert_eq!(refused("<robot name=\"x\"/>"), "the description has no link");
    let many: String = (0..2001).map(|i| format!("<link name=\"{i}\"/>")).collect();
    assert_eq!(
        refused(&format!("<robot>{many}</robot>")),
        "more than 2000 links or joints, which no robot has"
    );
    let bare =
        grown(2, 2).replace("<collision><geometry><sphere radius=\"0.01\"/></geometry></collision>", "");
    assert_eq!(
        refused(&bare),
        "finger l0: its last link 'l0_1' has neither a collision nor a visual shape, so there is no fingertip"
    );
}

#[test]
fn a_cut_or_garbled_description_never_panics() {
    let text = std::fs::read_to_string(model(THREE)).unwrap();
    for end in (0..text.len()).step_by(97) {
        let _ = from_str(text.get(..end).unwrap_or_default(), "".as_ref(), None, &[]);
    }
    for value in ["1e308", "-1e308", "1e-308", "0", "x"] {
        for number in ["0.048", "2.4", "0.333", "1.5707963267948966", "0.072"] {
            let garbled = text.replace(&format!("\"{number}\""), &format!("\"{value}\""));
            let _ = from_str(&garbled, "".as_ref(), None, &[]);
        }
    }
}

#[test]
fn messages_name_the_file_and_a_hand_on_an_arm_is_found() {
    let error = load("nowhere.urdf".as_ref(), None, &[]).unwrap_err().to_string();
    assert!(error.starts_with("nowhere.urdf: No such file"), "{error}");
    // Under three more joints, the palm is still where the fingers branch.
    let mut text = std::fs::read_to_string(model(THREE)).unwrap();
    for k in 0..3 {
        let child = if k == 2 { "base".to_owned() } else { format!("arm_{}", k + 1) };
        let element = format!(
            "<link name=\"arm_{k}\"/><joint name=\"axis_{k}\" type=\"continuous\"><parent link=\"arm_{k}\"/>\
             <child link=\"{child}\"/><origin xyz=\"0 0 0.3\"/><axis xyz=\"0 {k} 1\"/></joint></robot>"
        );
        text = text.replace("</robot>", &element);
    }
    let on_arm = from_str(&text, "".as_ref(), None, &[]).unwrap();
    let alone = loaded(THREE);
    assert_eq!(on_arm.palm_link, "base");
    assert_eq!(on_arm.hand.candidates, alone.hand.candidates);
    assert_eq!(on_arm.hand.palm, alone.hand.palm);
}

#[test]
fn a_mesh_that_is_a_directory_or_garbage_is_named() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("bad.stl"), "solid nothing\n").unwrap();
    std::fs::create_dir(folder.path().join("folder.stl")).unwrap();
    for (uri, words) in
        [("bad.stl", "link 'palm': "), ("folder.stl", "link 'palm': no mesh file at 'folder.stl'")]
    {
        let text =
            GRIPPER.replacen("<box size=\"0.14 0.06 0.05\"/>", &format!("<mesh filename=\"{uri}\"/>"), 1);
        let error = from_str(&text, folder.path(), None, &[]).unwrap_err().to_string();
        assert!(error.starts_with(words), "{error}");
    }
    // A triangle, and one without area.
    let flawed = "v 0 0 0\nv 0.1 0 0\nv 0 0.1 0.1\nv 0.05 0 0\nf 1 2 3\nf 1 4 2\n";
    std::fs::write(folder.path().join("flawed.obj"), flawed).unwrap();
    let scaled = |scale: &str| {
        let mesh = format!("<mesh filename=\"flawed.obj\" scale=\"{scale}\"/>");
        from_str(&GRIPPER.replacen("<box size=\"0.14 0.06 0.05\"/>", &mesh, 1), folder.path(), None, &[])
    };
    let warnings = scaled("0.5 0.5 0.5").unwrap().warnings;
    assert!(
        warnings.iter().any(|w| w == "link 'palm': flawed.obj: 1 faces without area were dropped"),
        "{warnings:?}"
    );
    assert_eq!(scaled("1 0 0").unwrap_err().to_string(), "link 'palm': a mesh without extent");
    assert_eq!(scaled("1e308 1e308 1e309").unwrap_err().to_string().lines().count(), 1);
    // A package outside the folders above is found by its path.
    let text = std::fs::read_to_string(model(FIVE)).unwrap();
    let moved = folder.path().join("moved.urdf");
    std::fs::write(
        &moved,
        text.replace("../meshes/", "package://five_finger/meshes/").replace("file://package", "package"),
    )
    .unwrap();
    assert!(load(&moved, None, &[]).is_err());
    let packages = [model("")];
    assert_eq!(load(&moved, None, &packages).unwrap().hand.fingers.len(), 5);
}
