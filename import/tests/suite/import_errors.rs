//! Every kind of bad model is refused with its file, line, element, mistake, likely cause and fix.

use pliant_import::{ImportError, ImportMistake as M, Imported, Options, Verdict, import_model, import_text};
use pliant_scene::{Nothing, Scene, parse_scene};
use std::path::Path;

const MJCF: &str = r#"<mujoco>
<compiler angle="radian"/>
<default><default class="soft"><joint damping="1"/></default></default>
<worldbody>
<body name="arm" pos="0 0 1">
<joint name="hinge" axis="0 1 0" range="-1 1"/>
<geom type="capsule" fromto="0 0 0 0 0 -0.5" size="0.02"/>
<body name="hand" pos="0 0 -0.5">
<joint name="slide" type="slide" class="soft"/>
<inertial pos="0 0 0" mass="0.5" diaginertia="0.01 0.02 0.015"/>
</body>
</body>
</worldbody>
<actuator>
<motor name="m" joint="hinge"/>
</actuator>
</mujoco>"#;

const URDF: &str = r#"<robot name="r">
<link name="base"/>
<link name="arm">
<inertial><mass value="2"/><inertia ixx="0.1" iyy="0.2" izz="0.15" ixy="0" ixz="0" iyz="0"/></inertial>
</link>
<link name="tool">
<inertial><mass value="1"/><inertia ixx="0.1" iyy="0.2" izz="0.15" ixy="0" ixz="0" iyz="0"/></inertial>
</link>
<joint name="j1" type="revolute">
<parent link="base"/><child link="arm"/><origin xyz="0 0 1"/>
<limit lower="-1" upper="1" effort="1" velocity="1"/>
</joint>
<joint name="j2" type="prismatic">
<parent link="arm"/><child link="tool"/><axis xyz="0 0 1"/>
</joint>
</robot>"#;

fn import(text: &str, approximate: bool) -> Result<Imported, ImportError> {
    import_text(text, "model.xml", &Options { approximate, ..Options::default() })
}

/// The error of a good model with one text replaced: its place, that it has all its parts, and its kind.
#[track_caller]
fn refused(good: &str, old: &str, new: &str, place: &str) -> M {
    assert!(good.contains(old), "{old}");
    let error = import(&good.replacen(old, new, 1), false).unwrap_err();
    let text = error.to_string();
    assert!(text.starts_with(&format!("model.xml:{place}")), "{text}");
    assert!(text.contains("\n  likely cause: ") && text.contains("\n  fix: "), "{text}");
    *error.mistake
}

#[track_caller]
fn advice(good: &str, old: &str, new: &str, part: &str) {
    let text = import(&good.replacen(old, new, 1), false).unwrap_err().to_string();
    assert!(text.contains(part), "{text}");
}

#[test]
fn the_good_models_are_accepted() {
    let scene = import(MJCF, false).unwrap().scene;
    assert_eq!((scene.body.len(), scene.actuator.len(), scene.body[1].joint[0].damping), (2, 1, 1.0));
    let scene = import(URDF, false).unwrap().scene;
    assert_eq!((scene.body.len(), scene.body[1].joint[0].axis), (3, [1.0, 0.0, 0.0]));
}

#[test]
fn xml_and_its_kind() {
    assert!(matches!(refused(MJCF, "</actuator>", "", "17: is not valid XML"), M::Syntax { xacro: false, .. }));
    assert!(matches!(refused(URDF, "<link name=\"base\"/>", "<xacro:arm/>", "2"), M::Syntax { xacro: true, .. }));
    advice(URDF, "<link name=\"base\"/>", "<xacro:arm/>", "xacro robot.urdf.xacro");
    let error = import("<sdf/>", false).unwrap_err();
    assert!(matches!(*error.mistake, M::NotAModel { .. }), "{error}");
    assert!(matches!(*import_model("no/such.xml", &Options::default()).unwrap_err().mistake, M::Read { .. }));
    let deep = format!("<mujoco>{}{}</mujoco>", "<body>".repeat(5000), "</body>".repeat(5000));
    assert!(matches!(*import(&deep, false).unwrap_err().mistake, M::Unsupported { .. } | M::Syntax { .. }));
}

#[test]
fn elements_and_attributes() {
    let mistake =
        refused(MJCF, "<joint name=\"hinge\"", "<jiont name=\"hinge\"", "6: jiont \"hinge\": unknown element <jiont> in <body>");
    assert!(matches!(mistake, M::UnknownElement { nearest: Some(ref n), .. } if n == "joint"));
    assert!(matches!(refused(MJCF, "<motor", "<moter", "15"), M::UnknownElement { nearest: Some(ref n), .. } if n == "motor"));
    assert!(matches!(refused(MJCF, "axis=", "axsi=", "6"), M::UnknownAttribute { nearest: Some(ref n), .. } if n == "axis"));
    assert!(matches!(refused(MJCF, " mass=\"0.5\"", "", "10: inertial: `mass` is missing"), M::Missing { .. }));
    assert!(matches!(refused(MJCF, "joint=\"hinge\"", "", "15: motor"), M::Missing { .. }));
    assert!(matches!(refused(MJCF, "mass=\"0.5\"", "mass=\"0.5kg\"", "10"), M::NotANumber { .. }));
    assert!(matches!(refused(MJCF, "mass=\"0.5\"", "mass=\"nan\"", "10"), M::NotANumber { .. }));
    assert!(matches!(refused(MJCF, "axis=\"0 1 0\"", "axis=\"0 1\"", "6"), M::Count { found: 2, .. }));
    assert!(matches!(refused(MJCF, "axis=\"0 1 0\"", "axis=\"0 0 0\"", "6"), M::NoDirection { .. }));
    assert!(matches!(refused(MJCF, "\"capsule\"", "\"capsul\"", "7"), M::Choice { nearest: Some(_), .. }));
    assert!(matches!(refused(MJCF, "size=\"0.02\"", "size=\"0\"", "7"), M::Sign { .. }));
    assert!(matches!(refused(MJCF, "size=\"0.02\"", "", "7"), M::Missing { .. }));
    assert!(matches!(refused(MJCF, "pos=\"0 0 1\"", "quat=\"1 0 0 0\" euler=\"0 0 1\"", "5"), M::Unsupported { .. }));
    assert!(matches!(refused(URDF, "<mass value=\"2\"/>", "", "4: inertial: <mass> is missing"), M::Missing { .. }));
    assert!(matches!(refused(URDF, "<parent link=\"base\"/>", "", "9"), M::Missing { .. }));
    assert!(matches!(refused(URDF, "\"prismatic\"", "\"sliding\"", "13"), M::Choice { .. }));
    assert!(matches!(refused(URDF, "\"prismatic\"", "\"planar\"", "13"), M::Unsupported { .. }));
    assert!(matches!(refused(URDF, "<link name=\"base\"/>", "<lnk name=\"base\"/>", "2"), M::UnknownElement { .. }));
}

#[test]
fn references() {
    assert!(matches!(
        refused(MJCF, "\"slide\" class=\"soft\"", "\"slide\" class=\"sofd\"", "9"),
        M::UnknownClass { nearest: Some(_), .. }
    ));
    assert!(matches!(refused(MJCF, "name=\"arm\"", "name=\"arm\" childclass=\"no\"", "5"), M::UnknownClass { .. }));
    assert!(matches!(
        refused(MJCF, "joint=\"hinge\"", "joint=\"hnge\"", "15"),
        M::NoSuch { what: "joint", nearest: Some(_), .. }
    ));
    assert!(matches!(refused(URDF, "<child link=\"arm\"", "<child link=\"amr\"", "10"), M::NoSuch { what: "link", .. }));
    assert!(matches!(refused(URDF, "<link name=\"tool\"", "<link name=\"arm\"", "6"), M::Duplicate { first: 3, .. }));
    let mimic = "<axis xyz=\"0 0 1\"/><mimic joint=\"j9\"/>";
    assert!(matches!(refused(URDF, "<axis xyz=\"0 0 1\"/>", mimic, "14"), M::NoSuch { what: "joint", .. }));
}

#[test]
fn trees() {
    let second = "<joint name=\"j3\" type=\"fixed\"><parent link=\"base\"/><child link=\"tool\"/></joint></robot>";
    let loops = refused(URDF, "</robot>", second, "16: joint \"j3\"");
    assert!(matches!(loops, M::Loop { ref first, ref second, .. } if first == "j2" && second == "j3"));
    assert!(matches!(refused(URDF, "</robot>", "<link name=\"lost\"/></robot>", "16"), M::Roots { .. }));
    let back = "<joint name=\"j3\" type=\"fixed\"><parent link=\"tool\"/><child link=\"base\"/></joint></robot>";
    assert!(matches!(refused(URDF, "</robot>", back, "2"), M::NoRoot));
    let circle = "<link name=\"a\"/><link name=\"b\"/>\
        <joint name=\"j3\" type=\"fixed\"><parent link=\"a\"/><child link=\"b\"/></joint>\
        <joint name=\"j4\" type=\"fixed\"><parent link=\"b\"/><child link=\"a\"/></joint></robot>";
    assert!(matches!(refused(URDF, "</robot>", circle, "16: link \"a\""), M::NoRoot));
    assert!(matches!(refused(URDF, "\"prismatic\"", "\"floating\"", "6: link \"tool\""), M::FreeBelow { .. }));
    assert!(matches!(refused(MJCF, "type=\"slide\" class=\"soft\"", "type=\"free\"", "8"), M::FreeBelow { .. }));
}

#[test]
fn masses_limits_and_units() {
    assert!(matches!(refused(MJCF, "0.01 0.02 0.015", "0.01 0.05 0.015", "8: body \"hand\""), M::Inertia { .. }));
    assert!(matches!(refused(MJCF, "0.01 0.02 0.015", "0.01 -0.05 0.015", "8"), M::Inertia { .. }));
    assert!(matches!(refused(MJCF, "mass=\"0.5\"", "mass=\"-0.5\"", "10"), M::Sign { .. }));
    assert!(matches!(refused(MJCF, "mass=\"0.5\"", "mass=\"0\"", "8"), M::Massless { .. }));
    assert!(matches!(refused(URDF, "<mass value=\"1\"/>", "<mass value=\"0\"/>", "6"), M::Massless { .. }));
    assert!(matches!(refused(URDF, "iyy=\"0.2\"", "iyy=\"0.9\"", "4"), M::Inertia { .. }));
    assert!(matches!(refused(MJCF, "\"-1 1\"", "\"1 -1\"", "6"), M::LimitOrder { .. }));
    assert!(matches!(refused(URDF, "lower=\"-1\"", "lower=\"2\"", "11"), M::LimitOrder { .. }));
    assert!(matches!(refused(MJCF, "\"-1 1\"", "\"-90 90\"", "6"), M::Unit { likely: "degrees", .. }));
    assert!(matches!(refused(URDF, "upper=\"1\"", "upper=\"170\"", "11"), M::Unit { likely: "degrees", .. }));
    assert!(matches!(refused(URDF, "xyz=\"0 0 1\"", "xyz=\"0 0 850\"", "10"), M::Unit { likely: "mm", .. }));
    assert!(matches!(refused(MJCF, "size=\"0.02\"", "size=\"200\"", "7"), M::Unit { likely: "mm", .. }));
    assert!(matches!(refused(MJCF, "mass=\"0.5\"", "mass=\"250000\"", "8"), M::Unit { likely: "g", .. }));
    advice(MJCF, "\"-1 1\"", "\"-90 90\"", "degrees?");
}

#[test]
fn shapes_and_pairs() {
    let geom = "<geom type=\"capsule\"";
    assert!(matches!(refused(MJCF, geom, "<geom friction=\"-1\" type=\"capsule\"", "7"), M::Sign { .. }));
    assert!(matches!(refused(MJCF, geom, "<geom friction=\"high\" type=\"capsule\"", "7"), M::NotANumber { .. }));
    let contact = |inside: &str| format!("</worldbody><contact>\n{inside}</contact>");
    let of = |inside: &str| refused(MJCF, "</worldbody>", &contact(inside), "14");
    assert!(matches!(of("<exclude body1=\"arm\" body2=\"hnd\"/>"), M::NoSuch { what: "body", nearest: Some(_), .. }));
    assert!(matches!(of("<exclude body1=\"arm\"/>"), M::Missing { .. }));
    assert!(matches!(of("<pair geom1=\"a\" geom2=\"b\"/>"), M::NoSuch { what: "geom", .. }));
    assert!(matches!(of("<pair geom1=\"a\" geom2=\"b\" friction=\"-1\"/>"), M::Sign { .. }));
    let within = "<geom name=\"a\" size=\"0.1\" pos=\"0 0 0.9\"/>\n<body name=\"arm\"";
    let overlap = refused(MJCF, "<body name=\"arm\"", within, "6: body \"arm\"");
    assert!(matches!(overlap, M::Overlap { .. }), "{overlap}");
    advice(MJCF, "<body name=\"arm\"", within, "<exclude>");
    let unnamed = MJCF.replacen("<body name=\"arm\"", within, 1);
    let rules = import(&unnamed, true).unwrap().scene.contact.pair;
    assert!(rules.len() == 1 && rules[0].ignore);

    let collision = |shape: &str| format!("<link name=\"base\"><collision><geometry>\n{shape}</geometry></collision></link>");
    let of = |shape: &str| refused(URDF, "<link name=\"base\"/>", &collision(shape), "3");
    assert!(matches!(of("<sphere/>"), M::Missing { .. }));
    assert!(matches!(of("<sphere radius=\"0\"/>"), M::Sign { .. }));
    assert!(matches!(of("<box size=\"1 2\"/>"), M::Count { .. }));
    assert!(matches!(of("<box size=\"1 -2 3\"/>"), M::Sign { .. }));
    assert!(matches!(of("<cylinder radius=\"80\" length=\"0.2\"/>"), M::Unit { likely: "mm", .. }));
}

/// Changes that would make it another model are refused, and with `approximate` reported.
#[test]
fn what_cannot_be_kept() {
    let equality = "</worldbody><equality><tendon tendon1=\"t\"/></equality>";
    let tendon = "</worldbody><tendon><fixed stiffness=\"3\"><joint joint=\"hinge\" coef=\"1\"/></fixed></tendon>";
    let cases = [
        (MJCF, "</worldbody>", equality, "tendon"),
        (MJCF, "</worldbody>", tendon, "fixed"),
        (MJCF, "<geom type=\"capsule\" fromto=\"0 0 0 0 0 -0.5\" size=\"0.02\"/>", "<geom type=\"sdf\"/>", "geom"),
        (MJCF, "<body name=\"hand\"", "<replicate count=\"2\"/><body name=\"hand\"", "replicate"),
        (MJCF, "range=\"-1 1\"", "springdamper=\"0.1 1\"", "joint"),
        (MJCF, "0.01 0.02 0.015", "0.01 0.05 0.015", "body"),
        (URDF, "<axis xyz=\"0 0 1\"/>", "<mimic joint=\"j2\"/>", "mimic"),
    ];
    for (good, old, new, tag) in cases {
        let text = good.replacen(old, new, 1);
        let error = import(&text, false).unwrap_err();
        assert!(matches!(*error.mistake, M::NeedsApproximate { .. } | M::Inertia { .. }) && error.line > 0, "{error}");
        assert!(error.to_string().contains("--approximate"), "{error}");
        let report = import(&text, true).unwrap().report;
        assert!(report.entries.iter().any(|e| e.element == tag && e.verdict == Verdict::Approximated), "{}", report.text());
    }
    let global = MJCF.replace("angle=\"radian\"", "coordinate=\"global\"");
    assert!(matches!(*import(&global, true).unwrap_err().mistake, M::Unsupported { .. }));
}

#[test]
fn files() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, text: &str| {
        let path = folder.path().join(name);
        std::fs::write(&path, text).unwrap();
        path
    };
    let include = |file: &str| format!("<mujoco>\n<include file=\"{file}\"/>\n</mujoco>");
    let main = write("main.xml", &include("other.xml"));
    let mistake = |path: &Path| import_model(path, &Options::default()).unwrap_err();
    let missing = mistake(&main);
    assert!(matches!(*missing.mistake, M::MissingFile { what: "include file", .. }) && missing.line == 2, "{missing}");
    write("other.xml", &include("main.xml"));
    let cycle = mistake(&main);
    assert!(matches!(*cycle.mistake, M::IncludeCycle { .. }) && cycle.file.ends_with("other.xml") && cycle.line == 2, "{cycle}");
    write("other.xml", "<mujocoinclude>\n<worldbody>\n<body><joint/></body>\n</worldbody>\n</mujocoinclude>");
    let massless = mistake(&main);
    assert!(
        matches!(*massless.mistake, M::Massless { .. }) && massless.file.ends_with("other.xml") && massless.line == 3,
        "{massless}"
    );

    let mesh =
        "<link name=\"base\"><visual><geometry>\n<mesh filename=\"package://robot/meshes/base.stl\"/></geometry></visual></link>";
    let robot = write("robot.urdf", &URDF.replacen("<link name=\"base\"/>", mesh, 1));
    let error = mistake(&robot);
    assert!(matches!(*error.mistake, M::MissingFile { what: "mesh", .. }) && error.line == 3, "{error}");
    std::fs::create_dir_all(folder.path().join("meshes")).unwrap();
    write("meshes/base.stl", "");
    import_model(&robot, &Options::default()).unwrap();
}

/// The written scene reads back as the imported one, and nothing of the model is left without a word.
#[test]
fn the_shared_models_come_through_whole() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/models");
    let mut count = 0;
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            continue;
        }
        for free_base in [false, true] {
            let imported = import_model(&path, &Options { free_base, ..Options::default() }).unwrap();
            let again: Scene<Nothing> = parse_scene(&imported.to_toml(), "scene.toml").unwrap();
            assert_eq!(again, imported.scene, "{}", path.display());
            let unread = imported.report.entries.iter().find(|e| e.reason.contains("not read by the importer"));
            assert_eq!(unread, None);
        }
        count += 1;
    }
    assert!(count >= 15);
}
