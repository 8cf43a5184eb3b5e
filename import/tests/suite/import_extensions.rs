//! Elements of a URDF for other programs, files in packages, and floors that reach far.

use pliant_import::{ImportError, ImportMistake as M, Imported, Options, Verdict, import_model, import_text};
use std::fs;
use std::path::Path;

const ROBOT: &str = r#"<robot name="r">
<link name="base"/>
<link name="arm">
<inertial><mass value="2"/><inertia ixx="0.1" iyy="0.2" izz="0.15"/></inertial>
</link>
<joint name="turn" type="continuous">
<parent link="base"/><child link="arm"/>
</joint>
</robot>"#;

fn with(old: &str, new: &str) -> Result<Imported, ImportError> {
    assert!(ROBOT.contains(old));
    import_text(&ROBOT.replacen(old, new, 1), "r.urdf", &Options::default())
}

/// Lines of what was ignored, with the tags.
fn ignored(imported: &Imported) -> Vec<(usize, String)> {
    let entries = imported.report.entries.iter().filter(|e| e.verdict == Verdict::Ignored);
    entries.map(|e| (e.line, e.element.clone())).collect()
}

#[test]
fn extensions_are_skipped_and_reported_with_their_lines() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/models");
    let imported = import_model(folder.join("explorer.urdf"), &Options::default()).unwrap();
    let found = ignored(&imported);
    for (line, tag) in [
        (4, "mujoco"),
        (7, "gazebo"),
        (18, "collision"),
        (22, "self_collision_checking"),
        (27, "rolling_friction"),
        (29, "stiffness"),
        (31, "restitution"),
        (32, "inertia_scaling"),
        (42, "contact_coefficients"),
        (49, "axis"),
        (51, "joint_properties"),
        (59, "laser"),
        (67, "dynamics"),
        (69, "transmission"),
        (74, "disable_collisions"),
    ] {
        assert!(found.contains(&(line, tag.to_owned())), "{line} {tag}: {found:?}");
    }
    // what is read is read in spite of them
    let wheel = &imported.scene.body[1];
    assert_eq!((wheel.shape[0].friction, wheel.mass, wheel.joint[0].axis), (Some(0.9), 2.5, [0.0, 1.0, 0.0]));
    assert_eq!(imported.scene.body[2].joint[0].damping, 0.1);
}

#[test]
fn what_looks_like_a_typing_error_is_refused() {
    let mistake = |old: &str, new: &str| *with(old, new).unwrap_err().mistake;
    assert!(matches!(mistake("<joint name", "<jiont/><joint name"), M::UnknownElement { nearest: Some(n), .. } if n == "joint"));
    assert!(matches!(mistake("<mass value", "<mas/><mass value"), M::UnknownElement { nearest: Some(n), .. } if n == "mass"));
    let limit = |inside: &str| format!("<child link=\"arm\"/>{inside}");
    let of = |inside: &str| mistake("<child link=\"arm\"/>", &limit(inside));
    assert!(matches!(of("<dynamics dampin=\"1\"/>"), M::UnknownAttribute { nearest: Some(n), .. } if n == "damping"));
    let approximate = Options { approximate: true, ..Options::default() };
    let text = ROBOT.replacen("<child link=\"arm\"/>", &limit("<dynamics dampin=\"1\"/>"), 1);
    let imported = import_text(&text, "r.urdf", &approximate).unwrap();
    assert!(ignored(&imported).contains(&(7, "dynamics".to_owned())));
}

/// A macro that was left would be parts of the robot.
#[test]
fn macros_are_no_extensions() {
    let text = ROBOT.replacen("<robot name=\"r\">", "<robot name=\"r\" xmlns:xacro=\"http://ros.org/wiki/xacro\">", 1);
    assert!(import_text(&text, "r.urdf", &Options::default()).is_ok());
    let text = text.replacen("<link name=\"base\"/>", "<link name=\"base\"/><xacro:arm side=\"left\"/>", 1);
    let error = import_text(&text, "r.urdf", &Options::default()).unwrap_err();
    assert!(matches!(*error.mistake, M::Syntax { xacro: true, .. }) && error.line == 2, "{error}");
}

#[test]
fn variables_that_were_left_take_their_defaults() {
    let given = "<child link=\"arm\"/><origin xyz=\"$(optenv ARM_XYZ 0.1 0 0.2)\"/>";
    let imported = with("<child link=\"arm\"/>", given).unwrap();
    assert_eq!(imported.scene.body[1].position, [0.1, 0.0, 0.2]);
    let entry = imported.report.entries.iter().find(|e| e.element == "origin" && e.line == 7).unwrap();
    assert!(entry.reason.contains("0.1 0 0.2") && entry.reason.contains("ARM_XYZ"), "{}", entry.reason);
}

/// A robot that names a mesh, in a folder of its own.
fn robot(folder: &Path, uri: &str) -> std::path::PathBuf {
    let mesh = format!("<link name=\"base\"><visual><geometry>\n<mesh filename=\"{uri}\"/></geometry></visual></link>");
    fs::create_dir_all(folder).unwrap();
    fs::write(folder.join("r.urdf"), ROBOT.replacen("<link name=\"base\"/>", &mesh, 1)).unwrap();
    folder.join("r.urdf")
}

#[test]
fn packages_are_found_by_folder_by_manifest_and_by_option() {
    let folder = tempfile::tempdir().unwrap();
    let at = |path: &str| folder.path().join(path);
    let put = |path: &str, text: &str| {
        fs::create_dir_all(at(path).parent().unwrap()).unwrap();
        fs::write(at(path), text).unwrap();
    };
    let uri = "package://arm_description/meshes/arm.stl";
    let plain = Options::default();

    // beside a folder above
    let beside = robot(&at("a/robots/urdf"), uri);
    put("a/arm_description/meshes/arm.stl", "");
    import_model(&beside, &plain).unwrap();
    // within a folder of that name
    let within = robot(&at("b/arm_description/urdf"), uri);
    put("b/arm_description/meshes/arm.stl", "");
    import_model(&within, &plain).unwrap();
    // by the name in package.xml; a folder above of another package does not count
    let manifest = robot(&at("c/checkout/urdf"), uri);
    put("c/checkout/package.xml", "<package format=\"2\"><name> arm_description </name></package>");
    put("c/checkout/meshes/arm.stl", "");
    import_model(&manifest, &plain).unwrap();
    // by option alone
    let elsewhere = robot(&at("d/urdf"), uri);
    put("e/anything/meshes/arm.stl", "");
    let error = import_model(&elsewhere, &plain).unwrap_err();
    let text = error.to_string();
    assert!(matches!(*error.mistake, M::MissingFile { what: "mesh", .. }) && error.line == 3, "{text}");
    let places = ["d/urdf/arm_description/meshes/arm.stl", "d/arm_description/meshes/arm.stl"];
    assert!(places.iter().all(|place| text.contains(place)), "{text}");
    assert!(text.contains("--package arm_description=FOLDER"), "{text}");
    let packages = vec![("arm_description".to_owned(), at("e/anything"))];
    import_model(&elsewhere, &Options { packages, ..Options::default() }).unwrap();
    // and then nowhere else
    let packages = vec![("arm_description".to_owned(), at("e"))];
    let text = import_model(&beside, &Options { packages, ..Options::default() }).unwrap_err().to_string();
    assert!(text.contains("e/meshes/arm.stl") && !text.contains("a/arm_description"), "{text}");
}

/// The middle of a floor may be far away; its height betrays millimetres.
#[test]
fn floors_reach_far() {
    let model = |plane: &str| {
        let body = "<body pos=\"0 0 1\"><freejoint/><geom size=\"0.1\"/></body>";
        let text = format!(
            "<mujoco><worldbody>\n<geom name=\"floor\" type=\"plane\" size=\"200 .8 .2\" {plane}/>{body}</worldbody></mujoco>"
        );
        import_text(&text, "m.xml", &Options::default())
    };
    let floor = model("pos=\"190 0 0.2\"").unwrap().scene.plane[0].clone();
    assert_eq!((floor.point, floor.normal), ([190.0, 0.0, 0.2], [0.0, 0.0, 1.0]));
    model("pos=\"0 -0.5 300\" zaxis=\"0 1 0\"").unwrap();
    for plane in ["pos=\"0 0 -850\"", "pos=\"0 -850 300\" zaxis=\"0 1 0\""] {
        assert!(matches!(*model(plane).unwrap_err().mistake, M::Unit { likely: "mm", .. }), "{plane}");
    }
}
