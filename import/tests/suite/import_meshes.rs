//! Meshes as shapes and masses: kinds of files, hulls, and what is wrong with them.

use pliant_engine::model::ModelBuilder;
use pliant_import::{ImportError, ImportMistake as M, Imported, MeshMistake, Options, Verdict, import_model};
use pliant_scene::ShapeKind;
use std::fs;
use std::path::Path;

/// A cuboid of 0.25 m × 0.125 m × 0.5 m as eight vertices and twelve triangles, counterclockwise from outside.
const SIDES: [f64; 3] = [0.25, 0.125, 0.5];
const TRIANGLES: [[usize; 3]; 12] = [
    [0, 2, 1],
    [1, 2, 3],
    [4, 5, 6],
    [5, 7, 6],
    [0, 1, 4],
    [1, 5, 4],
    [2, 6, 3],
    [3, 6, 7],
    [0, 4, 2],
    [2, 4, 6],
    [1, 3, 5],
    [3, 7, 5],
];

fn corner(k: usize) -> [f64; 3] {
    [0, 1, 2].map(|a| if k >> a & 1 == 1 { SIDES[a] } else { 0.0 })
}

fn obj(triangles: &[[usize; 3]]) -> String {
    let vertices = (0..8).map(|k| corner(k).map(|x| format!("{x}")).join(" ")).map(|v| format!("v {v}\n")).collect::<String>();
    vertices + &triangles.iter().map(|t| format!("f {}\n", t.map(|k| format!("{}//9", k + 1)).join(" "))).collect::<String>()
}

fn text_stl() -> String {
    let facet = |t: &[usize; 3]| {
        let corners = t.map(|k| format!("vertex {}\n", corner(k).map(|x| format!("{x:e}")).join(" ")));
        format!(" facet normal 0 0 0\n  outer loop\n{}  endloop\n endfacet\n", corners.concat())
    };
    format!("solid box\n{}endsolid box\n", TRIANGLES.iter().map(facet).collect::<String>())
}

fn binary_stl() -> Vec<u8> {
    let mut out = vec![b' '; 80];
    out.extend(12u32.to_le_bytes());
    for t in TRIANGLES {
        out.extend([0u8; 12]);
        t.iter().flat_map(|k| corner(*k)).for_each(|x| out.extend((x as f32).to_le_bytes()));
        out.extend([0, 0]);
    }
    out
}

/// A body of that mesh file over a floor.
fn import(content: &[u8], name: &str, asset: &str, approximate: bool) -> Result<Imported, ImportError> {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join(name), content).unwrap();
    let text = format!(
        "<mujoco><asset>\n<mesh name=\"m\" file=\"{name}\" {asset}/></asset><worldbody>\n\
         <body name=\"b\" pos=\"0 0 3\"><freejoint/>\n<geom type=\"mesh\" mesh=\"m\" pos=\"1 0 0\"/></body></worldbody></mujoco>"
    );
    fs::write(folder.path().join("m.xml"), text).unwrap();
    import_model(folder.path().join("m.xml"), &Options { approximate, ..Options::default() })
}

#[track_caller]
fn refused(content: &[u8], name: &str, asset: &str) -> (MeshMistake, String) {
    let error = import(content, name, asset, false).unwrap_err();
    let text = error.to_string();
    assert!(text.contains(name) && text.contains("likely cause: ") && text.contains("fix: ") && error.line == 4, "{text}");
    match *error.mistake {
        M::Mesh { error, .. } => (error, text),
        other => panic!("{other}"),
    }
}

#[test]
fn each_kind_of_file_is_the_same_box() {
    for (name, content) in
        [("box.obj", obj(&TRIANGLES).into_bytes()), ("box.STL", text_stl().into_bytes()), ("box.stl", binary_stl())]
    {
        let imported = import(&content, name, "inertia=\"exact\"", false).unwrap();
        let body = &imported.scene.body[0];
        let mass = 1000.0 * SIDES.iter().product::<f64>();
        assert!((body.mass - mass).abs() < 1e-12 * mass, "{name}: {}", body.mass);
        let middle = [1.0 + 0.125, 0.0625, 0.25];
        assert!((0..3).all(|k| (body.center_of_mass[k] - middle[k]).abs() < 1e-15), "{name}");
        let xx = mass / 12.0 * (SIDES[1] * SIDES[1] + SIDES[2] * SIDES[2]);
        assert!((body.inertia.unwrap()[0] - xx).abs() < 1e-12 * xx, "{name}");
        let shape = &body.shape[0];
        assert_eq!((shape.kind, shape.position, shape.points.as_ref().unwrap().len()), (ShapeKind::Hull, middle, 8));
        assert!(ModelBuilder::new(&imported.scene).is_ok());
        let entry = imported.report.entries.iter().find(|e| e.reason.contains("convex hull of a mesh")).unwrap();
        assert_eq!((entry.line, entry.verdict), (4, Verdict::Kept));
    }
}

#[test]
fn damaged_files_are_refused_by_line() {
    let (mistake, text) = refused(&binary_stl()[..300], "cut.stl", "");
    assert_eq!(mistake, MeshMistake::Truncated { triangles: 12, expected: 684, bytes: 300 }, "{text}");
    let bad = obj(&TRIANGLES).replacen("v 0.25 0.125 0.5", "v 0.25 0.125 half", 1);
    let (mistake, _) = refused(bad.as_bytes(), "bad.obj", "");
    assert!(matches!(mistake, MeshMistake::Line { line: 8, what: "vertex", .. }), "{mistake}");
    let (mistake, _) = refused(obj(&[[0, 1, 11]]).as_bytes(), "bad.obj", "");
    assert_eq!(mistake, MeshMistake::NoVertex { line: 9, vertex: 12, vertices: 8 });
    let (mistake, _) = refused(b"v 0 0 0\nf 1 1\n", "bad.obj", "");
    assert!(matches!(mistake, MeshMistake::Line { line: 2, what: "face", .. }), "{mistake}");
    let (mistake, _) = refused(b"solid x\nfacet normal 0 0 0\nouter loop\nvertex 0 0 0\nendloop\n", "bad.stl", "");
    assert!(matches!(mistake, MeshMistake::Line { line: 5, .. }), "{mistake}");
    assert_eq!(refused(b"v 0 0 0\n", "bad.obj", "").0, MeshMistake::Empty);
    let huge = obj(&TRIANGLES).replacen("v 0 0 0", "v 0 0 1e400", 1);
    assert!(matches!(refused(huge.as_bytes(), "bad.obj", "").0, MeshMistake::NotFinite { vertex: 0 }));
}

#[test]
fn meshes_that_no_body_has_are_refused() {
    // a square
    let (mistake, _) = refused(obj(&TRIANGLES[..2]).replace(" 0.5\n", " 0\n").as_bytes(), "flat.obj", "inertia=\"convex\"");
    assert!(matches!(mistake, MeshMistake::Flat(_)), "{mistake}");
    // a box without a lid is closed by its hull, but not by itself
    let (mistake, text) = refused(obj(&TRIANGLES[2..]).as_bytes(), "open.obj", "inertia=\"exact\"");
    assert!(matches!(mistake, MeshMistake::Open { edges: 4, .. }) && text.contains("inertia=\"convex\""), "{text}");
    import(obj(&TRIANGLES[2..]).as_bytes(), "open.obj", "inertia=\"convex\"", false).unwrap();
    // one triangle turned inside out
    let mut turned = TRIANGLES;
    turned[3].swap(0, 1);
    let (mistake, _) = refused(obj(&turned).as_bytes(), "turned.obj", "inertia=\"exact\"");
    assert!(matches!(mistake, MeshMistake::Open { .. }), "{mistake}");
}

#[test]
fn millimetres_are_found_out() {
    let content = obj(&TRIANGLES);
    let (mistake, text) = refused(content.as_bytes(), "box.obj", "scale=\"1000 1000 1000\"");
    assert_eq!(mistake, MeshMistake::Size { size: 500.0 });
    assert!(text.contains("500 m long") && text.contains("scale=\"0.001 0.001 0.001\""), "{text}");
    import(content.as_bytes(), "box.obj", "scale=\"3 3 3\"", false).unwrap();
}

/// A mesh with more corners than are tried in contact is made coarser from within, and the report says by how much.
#[test]
fn large_hulls_are_reduced_and_reported() {
    let (rings, around) = (12, 16);
    let mut text = String::new();
    for i in 0..rings {
        let (s, c) = ((f64::from(i) + 0.5) / f64::from(rings) * std::f64::consts::PI).sin_cos();
        for j in 0..around {
            let (y, x) = (f64::from(j) / f64::from(around) * std::f64::consts::TAU).sin_cos();
            text += &format!("v {} {} {}\n", 0.1 * s * x, 0.1 * s * y, 0.1 * c);
        }
    }
    for i in 0..rings - 1 {
        for j in 0..around {
            let [a, b] = [j, (j + 1) % around].map(|j| i * around + j + 1);
            text += &format!("f {a} {} {} {b}\n", a + around, b + around);
        }
    }
    let imported = import(text.as_bytes(), "ball.obj", "inertia=\"convex\"", false).unwrap();
    let points = imported.scene.body[0].shape[0].points.clone().unwrap();
    assert_eq!(points.len(), 32);
    let entry = imported.report.entries.iter().find(|e| e.verdict == Verdict::Approximated).unwrap();
    assert!(entry.line == 4 && entry.reason.contains("160 more are left out, which reach"), "{}", entry.reason);
    // the mass is that of all of it
    let ball = 4.0 / 3.0 * std::f64::consts::PI * 0.1_f64.powi(3) * 1000.0;
    assert!((imported.scene.body[0].mass / ball - 1.0).abs() < 0.05);
    assert!(ModelBuilder::new(&imported.scene).is_ok());
}

#[test]
fn a_mesh_of_the_world_is_a_body_that_stays() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("box.obj"), obj(&TRIANGLES)).unwrap();
    let text = "<mujoco><asset><mesh file=\"box.obj\"/></asset><worldbody>\n<geom name=\"table\" type=\"mesh\" mesh=\"box\" pos=\"0 0 -1\"/>\n\
        <body name=\"b\"><freejoint/><geom size=\"0.1\"/></body></worldbody></mujoco>";
    fs::write(folder.path().join("m.xml"), text).unwrap();
    let imported = import_model(folder.path().join("m.xml"), &Options::default()).unwrap();
    let table = &imported.scene.body[0];
    assert_eq!((table.name.as_str(), table.joint.len(), table.shape[0].kind, table.mass), ("table", 0, ShapeKind::Hull, 0.0));
    let model = ModelBuilder::new(&imported.scene).unwrap().build();
    assert_eq!(model.colliders().len(), 2);
}

/// Files for display do not touch; in a URDF they are common.
#[test]
fn other_formats_touch_nothing() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("base.dae"), "<COLLADA/>").unwrap();
    let robot = "<robot name=\"r\"><link name=\"base\"><collision>\n<geometry><mesh filename=\"base.dae\"/></geometry></collision></link>\
        <link name=\"arm\"><inertial><mass value=\"2\"/><inertia ixx=\"0.1\" iyy=\"0.2\" izz=\"0.15\"/></inertial></link>\
        <joint name=\"j\" type=\"continuous\"><parent link=\"base\"/><child link=\"arm\"/></joint></robot>";
    fs::write(folder.path().join("r.urdf"), robot).unwrap();
    let imported = import_model(folder.path().join("r.urdf"), &Options::default()).unwrap();
    let entry = imported.report.entries.iter().find(|e| e.element == "collision").unwrap();
    assert!(entry.verdict == Verdict::Ignored && entry.reason.contains(".dae"), "{}", entry.reason);
    assert!(Path::new(&entry.file).ends_with("r.urdf"));
}
