//! Every kind of bad sheet is refused with its place, what is wrong and the fix; good ones survive being written and read.

use pliant_engine::model::ModelBuilder;
use pliant_scene::{Nothing, Scene, Start, control_list, parse_scene, read_scene, resting_inputs, to_toml};
use std::path::Path;

const GOOD: &str = r#"schema_version = 1
[time]
step = 0.01
integrator = "euler"
[[cloth]]
name = "sheet"
grid = { nodes = [4, 3], size = [0.3, 0.2], diagonal = "down" }
origin = [0, 0, 1]
thickness = 1e-3
area_density = 0.2
youngs_modulus = 1e5
poisson_ratio = 0.3
[[gripper]]
name = "hand"
cloth = "sheet"
nodes = [0, -1]
[[plane]]
name = "floor"
"#;

/// Checks the error of the good scene with one line replaced: its place, and that each of the parts occurs in it.
#[track_caller]
fn refused(old: &str, new: &str, place: &str, parts: &[&str]) {
    crate::common::refused(GOOD, (old, new), place, parts);
}

#[test]
fn the_good_scene_is_built() {
    let scene: Scene = parse_scene(GOOD, "scene.toml").unwrap();
    let model = ModelBuilder::new(&scene).unwrap().build();
    let sheet = model.cloth("sheet").unwrap();
    assert_eq!((sheet.nodes.clone(), sheet.triangles.len(), model.n_nodes(), model.nu()), (0..12, 12, 12, 6));
    let names: Vec<String> = control_list(&scene).into_iter().map(|c| c.name).collect();
    assert_eq!(names[3], "hand.node[11].x");
    assert_eq!(resting_inputs(&scene).unwrap()[3..], [0.3, 0.2, 1.0]);
    let mass: f64 = model.masses(model.params().values()).iter().sum();
    assert!((mass - 0.2 * 0.06).abs() < 1e-15);
    let bend = model.params().values()[model.params().find("sheet.bend_stiffness").unwrap()];
    assert!((bend - 1e5 * 1e-9 / (12.0 * 0.91)).abs() < 1e-18);
    // ten free nodes, each with the floor
    assert_eq!(model.contact_pairs().len(), 10);
}

#[test]
fn what_is_given() {
    let grid = "grid = { nodes = [4, 3], size = [0.3, 0.2], diagonal = \"down\" }";
    refused(grid, "", "5: cloth[0]", &["none of the keys `grid`, `mesh`"]);
    refused("area_density = 0.2", "", "5: cloth[0]", &["none of the keys `density`, `area_density`"]);
    refused("area_density = 0.2", "area_density = 0.2\ndensity = 200", "11: cloth[0].density", &["more than one of the keys"]);
    refused("cloth = \"sheet\"", "", "13: gripper[0]", &["none of the keys `rope`, `cloth`"]);
    refused("cloth = \"sheet\"", "cloth = \"sheet\"\nrope = \"x\"", "15: gripper[0].cloth", &["more than one of the keys"]);
    refused("cloth = \"sheet\"", "cloth = \"sheep\"", "15: gripper[0].cloth", &["no cloth \"sheep\"", "did you mean \"sheet\"?"]);
    refused("cloth = \"sheet\"", "rope = \"sheet\"", "15: gripper[0].rope", &["no rope \"sheet\""]);
    refused("\"down\"", "\"left\"", "7: cloth[0].grid.diagonal", &["none of \"up\", \"down\", \"alternating\""]);
    refused("thickness = 1e-3", "thicknes = 1e-3", "9: cloth[0].thicknes", &["did you mean `thickness`?"]);
}

#[test]
fn numbers_and_units() {
    refused("nodes = [4, 3]", "nodes = [4, 1]", "7: cloth[0].grid.nodes[1]", &["1 node(s) along v", "at least 2"]);
    refused("[0.3, 0.2]", "[0.3, 0.0]", "7: cloth[0].grid.size[1]", &["must be positive"]);
    refused("[0.3, 0.2]", "[3000.0, 2000.0]", "7: cloth[0].grid.size", &["3000 m", "given in mm", "write 3"]);
    refused("thickness = 1e-3", "thickness = 0", "9: cloth[0].thickness", &["must be positive"]);
    refused(
        "thickness = 1e-3",
        "thickness = 1",
        "9: cloth[0].thickness",
        &["thicker than the sheet is wide", "mm", "write 0.001"],
    );
    refused("area_density = 0.2", "area_density = 200", "10: cloth[0].area_density", &["200000 kg/m³", "g/m²", "write 0.2"]);
    refused("area_density = 0.2", "density = 200000", "10: cloth[0].density", &["denser than any metal", "g/m³", "write 200"]);
    refused("area_density = 0.2", "area_density = -1", "10: cloth[0].area_density", &["must be positive"]);
    refused("= 0.3\n", "= 0.6\n", "12: cloth[0].poisson_ratio", &["is 0.6, but must lie between -0.999 and 0.5"]);
    refused("= 0.3\n", "= -1.0\n", "12: cloth[0].poisson_ratio", &["is -1, but"]);
    refused("youngs_modulus = 1e5", "youngs_modulus = nan", "11: cloth[0].youngs_modulus", &["not a finite number"]);
    refused("= 0.3\n", "= 0.3\nbend_damping = -1\n", "13: cloth[0].bend_damping", &["-1 N·m·s", "must not be negative"]);
    refused("= 0.3\n", "= 0.3\nradius = 5\n", "13: cloth[0].radius", &["more than the sheet is wide", "write 0.005"]);
    refused("nodes = [4, 3]", "nodes = [40000, 30000]", "7: cloth[0].grid.nodes", &["1200000000 nodes", "may have 1000000"]);
}

/// Sizes in mm that are smaller than the sheet is wide.
#[test]
fn thick_sheets() {
    let thick = ["too thick for a sheet: it is 0.2 m wide", "longest edge, from node", "0.1414", "given in mm", "write 0.00005"];
    refused("thickness = 1e-3", "thickness = 0.05", "9: cloth[0].thickness", &thick);
    let fine = GOOD.replacen("nodes = [4, 3]", "nodes = [61, 41]", 1).replacen("thickness = 1e-3", "thickness = 0.02", 1);
    let error = parse_scene::<Nothing>(&fine, "scene.toml").unwrap_err().to_string();
    assert!(error.contains("9: cloth[0].thickness") && error.contains("is 0.00707") && error.contains("m long"), "{error}");
    let fine = GOOD.replacen("nodes = [4, 3]", "nodes = [61, 41]", 1).replacen("= 0.3\n", "= 0.3\nradius = 0.05\n", 1);
    let error = parse_scene::<Nothing>(&fine, "scene.toml").unwrap_err().to_string();
    assert!(
        error.contains("13: cloth[0].radius: is 0.05 m, but the longest edge, from node") && error.contains("fix: "),
        "{error}"
    );
    let light = ["lighter than air", "0.02 m", "given in mm", "write 0.00002"];
    let wide = GOOD.replacen("area_density = 0.2", "area_density = 0.01", 1).replacen("thickness = 1e-3", "thickness = 0.02", 1);
    let error = parse_scene::<Nothing>(&wide, "scene.toml").unwrap_err().to_string();
    assert!(light.iter().all(|part| error.contains(part)) && error.contains("9: cloth[0].thickness"), "{error}");
    refused("area_density = 0.2", "density = 0.3", "10: cloth[0].density", &["lighter than air", "g/cm³", "write 300"]);
}

#[test]
fn equilibria_of_what_is_free() {
    let free = |start: &str| {
        let text = GOOD.replacen("= 0.3\n", &format!("= 0.3\n{start}"), 1);
        format!("{}{}", &text[..text.find("[[gripper]]").unwrap()], &text[text.find("[[plane]]").unwrap()..])
    };
    parse_scene::<Nothing>(&free(""), "scene.toml").unwrap();
    let error = parse_scene::<Nothing>(&free("start = \"equilibrium\"\n"), "scene.toml").unwrap_err().to_string();
    for part in ["scene.toml:13: cloth[0].start: nothing holds cloth \"sheet\"", "is singular", "by a [[gripper]]"] {
        assert!(error.contains(part), "no `{part}` in\n{error}");
    }
}

#[test]
fn starts() {
    let at = "= 0.3\n";
    refused(at, "= 0.3\nu_axis = [0, 0, 0]\n", "13: cloth[0].u_axis", &["no direction"]);
    refused(at, "= 0.3\nu_axis = [1, 1, 0]\n", "13: cloth[0].u_axis", &["45.00 degrees apart"]);
    refused(at, "= 0.3\npoints = [[0, 0, 1]]\n", "13: cloth[0].points", &["1 points, but the sheet has 12 nodes"]);
    let points = |place: &dyn Fn(usize, usize) -> [f64; 3]| {
        let all: Vec<String> = (0..12).map(|k| format!("{:?}", place(k / 3, k % 3))).collect();
        format!("= 0.3\npoints = [{}]\n", all.join(", "))
    };
    let far = points(&|i, j| [100.0 * i as f64, 100.0 * j as f64, 1.0]);
    refused(at, &far, "13: cloth[0].points[1]", &["m long, but", "points in mm"]);
    let folded = points(&|i, j| [[0.0, 0.1, 0.0, 0.1][i], 0.1 * j as f64, 1.0]);
    refused(at, &folded, "13: cloth[0].points[3]", &["folds back onto itself"]);
    refused(
        "origin = [0, 0, 1]",
        "origin = [0, 0, -1]",
        "5: cloth[0]",
        &["node 1 of cloth \"sheet\" starts 1.0000 m inside plane"],
    );
}

#[test]
fn grippers() {
    refused("nodes = [0, -1]", "nodes = [0, 12]", "16: gripper[0].nodes[1]", &["cloth \"sheet\" has no node 12", "0 to 11"]);
    refused("nodes = [0, -1]", "nodes = [0, -12]", "16: gripper[0].nodes[1]", &["already held by gripper \"hand\""]);
    let other = "[[gripper]]\nname = \"other\"\ncloth = \"sheet\"\nnodes = [3, 11]\n[[plane]]";
    let parts = ["node 11 of cloth \"sheet\"", "already held by gripper \"hand\"", "two grippers command one node"];
    refused("[[plane]]", other, "20: gripper[1].nodes[1]", &parts);
    refused("nodes = [0, -1]", "end = \"first\"", "16: gripper[0].end", &["has no ends to hold"]);
    refused("nodes = [0, -1]", "nodes = [0,1,2,3,4,5,6,7,8,9,10,11]", "5: cloth[0]", &["hold every node of cloth \"sheet\""]);
    let rule = "[[contact.pair]]\nbetween = [\"sheet\", \"sheet\"]\n[[plane]]";
    refused("[[plane]]", rule, "18: contact.pair[0].between", &["they are the same"]);
}

/// A scene with a mesh beside it.
fn with_mesh(folder: &Path, mesh: &str, more: &str) -> Result<Scene, String> {
    std::fs::write(folder.join("sheet.obj"), mesh).unwrap();
    let grid = "grid = { nodes = [4, 3], size = [0.3, 0.2], diagonal = \"down\" }";
    let text = GOOD.replace(grid, &format!("mesh = \"sheet.obj\"{more}")).replace("nodes = [0, -1]", "nodes = [0]");
    std::fs::write(folder.join("scene.toml"), text).unwrap();
    read_scene::<Nothing>(folder.join("scene.toml")).map_err(|error| error.to_string())
}

const SQUARE: &str = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3\nf 1 3 4\n";

#[test]
fn meshes() {
    let folder = tempfile::tempdir().unwrap();
    let error = |mesh: &str, more: &str| with_mesh(folder.path(), mesh, more).unwrap_err();
    let says =
        |error: String, parts: &[&str]| parts.iter().for_each(|part| assert!(error.contains(part), "no `{part}` in\n{error}"));
    says(error(SQUARE, "\nu_axis = [1, 0, 0]"), &["scene.toml:8: cloth[0].u_axis: a mesh has its own axes"]);
    says(error(&SQUARE.replace("f 1 3 4", "f 1 3 9"), ""), &["sheet.obj:6: cloth[0].mesh: the face names vertex 9"]);
    says(error(&SQUARE.replace("v 0 1 0", "v 2 2 0"), ""), &["sheet.obj:6: cloth[0].mesh: triangle 1 has an area of 0 m²"]);
    says(error(&SQUARE.replace("v 0 1 0", "v 0 0 0"), ""), &["sheet.obj:6", "triangle 1 has vertices 3 and 0 at the same place"]);
    says(error(&format!("{SQUARE}f 2 3 1\n"), ""), &["sheet.obj:7", "triangles 0 and 2 have the same vertices", "keep one"]);
    let fin = format!("{SQUARE}v 0.5 0.5 1\nf 1 3 5\n");
    says(error(&fin, ""), &["sheet.obj:8", "triangles 0, 1 and 2 meet at the edge from vertex 0 to 2"]);
    says(error(&format!("{SQUARE}v 3 3 3\n"), ""), &["sheet.obj:7: cloth[0].mesh: vertex 4 belongs to no triangle"]);
    says(error("v 0 0 0\n", ""), &["sheet.obj: cloth[0].mesh: there is no triangle"]);
    let band: String = (0..5).map(|k| format!("v {} {} {}\n", k, k * k, k * k * k)).collect();
    let band = band + "f 1 2 3\nf 2 3 4\nf 3 4 5\nf 4 5 1\nf 5 1 2\n";
    says(error(&band, ""), &["like a Möbius strip"]);
    std::fs::remove_file(folder.path().join("sheet.obj")).unwrap();
    let error = read_scene::<Nothing>(folder.path().join("scene.toml")).unwrap_err().to_string();
    says(error, &["sheet.obj: cloth[0].mesh: cannot be read"]);
}

/// A mesh is placed by `origin`, keeps its rest shape, and its triangles are turned to agree.
#[test]
fn a_mesh_is_a_sheet() {
    let folder = tempfile::tempdir().unwrap();
    let roof = "v 0 0 0\nv 1 0 0\nv 1 1 0.5\nv 0 1 0\nf 1/1 2/2 3/3\nf 3 1 4\n";
    let scene = with_mesh(folder.path(), roof, "").unwrap();
    let model = ModelBuilder::new(&scene).unwrap().build();
    assert_eq!(model.initial_positions()[6..9], [1.0, 1.0, 1.5]);
    assert_eq!(model.cloths()[0].triangles, [[0, 1, 2], [2, 3, 0]].map(|t: [usize; 3]| t));
    let potential = |q: &[f64]| {
        let weightless: Vec<f64> = model.params().values().to_vec();
        let at = pliant_engine::terms::Point { q, v: &vec![0.0; q.len()], theta: &weightless };
        model.terms().iter().filter(|t| t.name() != "gravity").map(|t| t.energy(&at)).sum::<f64>()
    };
    assert!(potential(model.initial_positions()).abs() < 1e-20, "the mesh is the shape at rest");
    let flat: Vec<f64> = model.initial_positions().iter().enumerate().map(|(k, x)| if k == 8 { 1.0 } else { *x }).collect();
    assert!(potential(&flat) > 1e-6);
}

#[test]
fn a_sheet_survives_being_written() {
    let more = "velocity = [0.1, 0, 0]\nu_axis = [0, 1, 0]\nv_axis = [0, 0, 1]\nmembrane_damping = 3.0\n\
        bend_damping = 1e-6\nbend_stiffness = 1e-4\ndrag_normal = 0.1\ndrag_quadratic = 0.2\nradius = 0.002\n";
    let i = GOOD.find("[[gripper]]").unwrap();
    let mut scene: Scene = parse_scene(&format!("{}{more}", &GOOD[..i]), "scene.toml").unwrap();
    assert_eq!(parse_scene::<Nothing>(&to_toml(&scene, "a sheet"), "again.toml").unwrap(), scene);
    // grippers are not written, and without them there is no equilibrium to read again
    scene.cloth[0].start = Start::Equilibrium;
    assert!(to_toml(&scene, "a sheet").contains("start = \"equilibrium\"\n"));
    let whole: Scene = parse_scene(GOOD, "scene.toml").unwrap();
    assert_eq!(parse_scene::<Nothing>(&toml::to_string(&whole).unwrap(), "again.toml").unwrap(), whole);
}
