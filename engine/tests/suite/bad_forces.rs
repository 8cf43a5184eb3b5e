//! Forces of one's own that make no sense are refused with line, field, cause and fix.

use pliant_scene::{Nothing, parse_scene};

const GOOD: &str = r#"schema_version = 1
[time]
step = 0.01
[[rope]]
name = "cord"
nodes = 5
length = 0.4
linear_density = 0.03
stretch_stiffness = 300.0
initial = { shape = "straight", from = [0, 0, 0], direction = [1, 0, 0] }
[[cloth]]
name = "sheet"
grid = { nodes = [3, 3], size = [0.2, 0.2] }
density = 500.0
thickness = 1e-3
youngs_modulus = 1e5
[[body]]
name = "arm"
mass = 1.0
inertia = [0.1, 0.1, 0.1, 0.0, 0.0, 0.0]
[[body.joint]]
name = "hinge"
kind = "revolute"
[[body]]
name = "hand"
parent = "arm"
mass = 1.0
inertia = [0.1, 0.1, 0.1, 0.0, 0.0, 0.0]
[[body.joint]]
name = "wrist"
kind = "ball"
[[force]]
name = "grease"
joint = "hinge"
formula = "-c*v"
parameters = { c = 0.0 }
[[force]]
name = "sleeve"
joint = "wrist"
formula = ["-k*qx", "-k*qy", "-k*qz"]
parameters = { k = 0.1 }
[[force]]
name = "draft"
rope = "cord"
formula = ["a*x", "a*vy", "0"]
parameters = { a = 0.1 }
[[force]]
name = "tug"
cloth = "sheet"
nodes = [0, -1]
formula = ["f", "0", "0"]
parameters = { f = 0.1 }
"#;

/// Refuses the good scene with one text replaced, at this place, with each of these parts in the message.
#[track_caller]
fn refused(old: &str, new: &str, place: &str, parts: &[&str]) {
    crate::common::refused(GOOD, (old, new), place, parts);
}

#[test]
fn the_good_scene_is_accepted() {
    let scene = parse_scene::<Nothing>(GOOD, "scene.toml").unwrap();
    assert_eq!((scene.force.len(), scene.force[1].formula.texts().len()), (4, 3));
    let table = scene.to_table().unwrap();
    let again = pliant_scene::Scene::<Nothing>::table_to_text(&table).unwrap();
    assert_eq!(parse_scene::<Nothing>(&again, "again.toml").unwrap().force, scene.force);
}

#[test]
fn where_it_acts() {
    refused("joint = \"hinge\"", "", "32: force[0]", &["none of the keys `joint`, `rope`, `cloth` is given"]);
    refused("rope = \"cord\"\nf", "rope = \"cord\"\njoint = \"hinge\"\nf", "42: force[2]", &["more than one of the keys"]);
    refused("joint = \"hinge\"", "joint = \"hing\"", "34: force[0].joint", &["no joint \"hing\"", "did you mean \"hinge\"?"]);
    refused("rope = \"cord\"", "rope = \"cort\"", "44: force[2].rope", &["no rope \"cort\"", "\"cord\""]);
    refused("cloth = \"sheet\"", "cloth = \"shirt\"", "49: force[3].cloth", &["no cloth \"shirt\"", "\"sheet\""]);
    refused(
        "kind = \"revolute\"",
        "kind = \"universal\"\nsecond_axis = [0, 1, 0]",
        "35: force[0].joint",
        &["\"hinge\" is universal", "two revolute joints"],
    );
    refused("kind = \"revolute\"", "kind = \"free\"", "34: force[0].joint", &["\"hinge\" is free", "three prismatic joints"]);
    refused("name = \"tug\"", "name = \"draft\"", "48: force[3].name", &["taken by force[2]"]);
    refused("name = \"tug\"", "name = \"gravity\"", "48: force[3].name", &["cannot be part of a parameter path"]);
}

#[test]
fn nodes() {
    refused("[0, -1]", "[]", "50: force[3].nodes", &["list of nodes is empty", "`nodes = [-1]`"]);
    refused("[0, -1]", "[0, 9]", "50: force[3].nodes[1]", &["has no node 9: it has 9 nodes"]);
    refused("[0, -1]", "[8, -1]", "50: force[3].nodes[1]", &["node -1 is listed twice", "list every node once"]);
    refused("rope = \"cord\"\n", "rope = \"cord\"\nnodes = [5]\n", "45: force[2].nodes[0]", &["no node 5: it has 5 nodes"]);
    refused(
        "joint = \"hinge\"",
        "joint = \"hinge\"\nnodes = [0]",
        "35: force[0].nodes",
        &["a joint has no nodes", "remove `nodes`"],
    );
    refused("[0, -1]", "0", "50: force[3].nodes", &["not a list"]);
}

#[test]
fn formulas() {
    refused("\"-c*v\"", "\"-c*w\"", "35: force[0].formula", &["\"-c*w\": character 4: there is no `w`", "`q`, `v`, `c`"]);
    refused("\"-c*v\"", "\"-c*v^2\"", "35: force[0].formula", &["character 5: `^`", "`**`"]);
    refused("\"-k*qy\"", "\"-k*q\"", "40: force[1].formula[1]", &["there is no `q`", "`qx`"]);
    refused("\"a*vy\"", "\"a*v\"", "45: force[2].formula[1]", &["there is no `v`", "`vx`"]);
    refused("\"-c*v\"", "[\"-c*v\", \"0\", \"0\"]", "35: force[0].formula", &["3 formula(s) for a joint of one axis", "needs 1"]);
    refused("[\"a*x\", \"a*vy\", \"0\"]", "\"a*x\"", "45: force[2].formula", &["1 formula(s) for nodes", "needs 3"]);
    refused("[\"-k*qx\", \"-k*qy\", \"-k*qz\"]", "\"-k*qx\"", "40: force[1].formula", &["for a ball joint", "needs 3"]);
    refused("[\"a*x\", \"a*vy\", \"0\"]", "[\"a*x\", \"0\"]", "45: force[2].formula", &["2 entries instead of 3"]);
    refused("\"-c*v\"", "3.0", "35: force[0].formula", &["the number 3.0, not a text in quotes or a list of 3"]);
    refused("\"a*vy\"", "2", "45: force[2].formula[1]", &["not a text in quotes"]);
    refused("formula = \"-c*v\"\n", "", "32: force[0]", &["key `formula` is missing"]);
    refused("formula = \"-c*v\"", "formulas = \"-c*v\"", "35: force[0].formulas", &["did you mean `formula`?"]);
}

#[test]
fn parameters() {
    refused(
        "{ c = 0.0 }",
        "{ c = 0.0, d = 1.0 }",
        "36: force[0].parameters.d",
        &["no formula has the parameter \"d\"", "use `d`"],
    );
    refused("{ c = 0.0 }", "{ c = 0.0, v = 1.0 }", "36: force[0].parameters.v", &["\"v\" cannot be", "it is a variable"]);
    refused("{ c = 0.0 }", "{ c = 0.0, exp = 1.0 }", "36: force[0].parameters.exp", &["\"exp\" cannot be", "a function"]);
    refused("{ c = 0.0 }", "{ c = 0.0, pi = 3.0 }", "36: force[0].parameters.pi", &["\"pi\" cannot be"]);
    refused("{ c = 0.0 }", "{ c = 0.0, c-2 = 1.0 }", "36: force[0].parameters.c-2", &["\"c-2\" cannot be", "letters, digits"]);
    refused("{ c = 0.0 }", "{ c = nan }", "36: force[0].parameters.c", &["NaN, not a finite number"]);
    refused("{ c = 0.0 }", "{ c = inf }", "36: force[0].parameters.c", &["inf, not a finite number"]);
    refused("{ c = 0.0 }", "{ c = \"0.1\" }", "36: force[0].parameters.c", &["is the text \"0.1\", not a number", "write 0.1"]);
    refused("{ c = 0.0 }", "3", "36: force[0].parameters", &["not a table"]);
    refused("parameters = { c = 0.0 }", "", "35: force[0].formula", &["there is no `c`", "`parameters`"]);
    let many = |n: usize| (0..n).map(|k| format!("p{k} = 1.0")).collect::<Vec<_>>().join(", ");
    let sum = |n: usize| (0..n).map(|k| format!("p{k}")).collect::<Vec<_>>().join(" + ");
    let nine = GOOD.replace("\"-c*v\"", &format!("\"{}\"", sum(9))).replace("{ c = 0.0 }", &format!("{{ {} }}", many(9)));
    let error = parse_scene::<Nothing>(&nine, "scene.toml").unwrap_err().to_string();
    assert!(error.contains("36: force[0].parameters: 9 parameters; a force at a joint may have 8"), "{error}");
    let on_nodes = |n: usize| {
        GOOD.replace("\"a*x\"", &format!("\"{}\"", sum(n))).replace("{ a = 0.1 }", &format!("{{ a = 0.1, {} }}", many(n)))
    };
    let error = parse_scene::<Nothing>(&on_nodes(15), "scene.toml").unwrap_err().to_string();
    assert!(error.contains("46: force[2].parameters: 16 parameters; a force on nodes may have 15"), "{error}");
    assert!(parse_scene::<Nothing>(&on_nodes(14), "scene.toml").is_ok());
}
