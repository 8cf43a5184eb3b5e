//! Every kind of bad scene is refused with its line, the field, what is wrong and the fix.

use pliant_scene::{Nothing, parse_scene, read_scene};

const GOOD: &str = r#"schema_version = 1
[time]
step = 0.01
duration = 0.5
integrator = "euler"
[gravity]
magnitude = 9.81
tilt = [0.0, 0.0]
[[rope]]
name = "cable"
nodes = 5
length = 1.0
linear_density = 0.05
stretch_stiffness = 1.0e4
bend_stiffness = 1.0e-3
radius = 0.003
node_mass = [{ node = 3, mass = 0.01 }]
initial = { shape = "straight", from = [0, 0, 0.5], direction = [1, 0, 0] }
[[gripper]]
name = "left"
rope = "cable"
nodes = [0, 1]
motion = { kind = "sine", amplitude = [0, 0, 0.1], frequency = 1.0 }
[[plane]]
name = "floor"
normal = [0, 0, 1]
friction = 0.5
[[capsule]]
name = "bar"
a = [0, 0, -1]
b = [1, 0, -1]
radius = 0.02
"#;

/// Checks the error's place, and that each of the parts occurs in it.
#[track_caller]
fn refused(old: &str, new: &str, place: &str, parts: &[&str]) {
    crate::common::refused(GOOD, (old, new), place, parts);
}

#[test]
fn the_good_scene_is_accepted() {
    let scene = parse_scene::<Nothing>(GOOD, "scene.toml").unwrap();
    assert_eq!((scene.rope.len(), scene.gripper.len(), scene.n_shapes()), (1, 1, 2));
}

/// The model of the good scene with edges that touch, and one line replaced.
fn built(old: &str, new: &str) -> Result<(), String> {
    let edges = GOOD.replacen("radius = 0.003", "contact = \"edges\"\nradius = 0.003", 1);
    assert!(edges.contains(old), "{old}");
    let scene = parse_scene::<Nothing>(&edges.replacen(old, new, 1), "scene.toml").map_err(|error| error.to_string())?;
    pliant_engine::model::ModelBuilder::new(&scene).map(drop).map_err(|error| error.to_string())
}

#[test]
fn contact_of_edges() {
    assert_eq!(built("nodes = 5", "nodes = 5"), Ok(()));
    refused("radius = 0.003", "radius = 0.003\ncontact = \"faces\"", "17: rope[0].contact", &["\"nodes\"", "\"edges\""]);
    refused(
        "radius = 0.003",
        "contact = \"edges\"",
        "9: rope[0].radius",
        &["needs a radius", "give its `radius` in m", "contact = \"nodes\""],
    );
    // a ball between two nodes, whose surface both nodes clear
    let ball = "[[sphere]]\nname = \"ball\"\ncenter = [0.625, 0, 0.52]\nradius = 0.1\n[[plane]]";
    let error = built("[[plane]]", ball).unwrap_err();
    for part in ["rope[0].initial", "the inside of `cable` between nodes 2, 3", "`ball`", "overlap by 8.00e-2 m", "fix: "] {
        assert!(error.contains(part), "no `{part}` in\n{error}");
    }
    // nodes alone do not see it
    parse_scene::<Nothing>(&GOOD.replacen("[[plane]]", ball, 1), "scene.toml").unwrap();
    // a bar through a box's edge
    let brick = "[[box]]\nname = \"brick\"\nposition = [0.625, 0, 0.45]\nhalf_extents = [0.05, 0.05, 0.06]\n[[plane]]";
    assert!(built("[[plane]]", brick).unwrap_err().contains("`brick`"));
}

#[test]
fn unknown_key() {
    refused(
        "bend_stiffness =",
        "bend_stifness =",
        "15: rope[0].bend_stifness",
        &["unknown key", "did you mean `bend_stiffness`?"],
    );
    refused("friction = 0.5", "colour = 3", "27: plane[0].colour", &["keys known here: `friction`, `height`, `name`"]);
    refused("frequency = 1.0", "frequenzy = 1.0", "23: gripper[0].motion.frequenzy", &["did you mean `frequency`?"]);
    refused(
        "nodes = [0, 1]",
        "nodes = [0, 1]\ntemperature = 1",
        "23: gripper[0].temperature",
        &["keys known here", "`nodes`", "`end`"],
    );
    refused("[gravity]", "[gravitty]", "6: gravitty", &["did you mean `gravity`?"]);
}

#[test]
fn missing_key() {
    refused("length = 1.0\n", "", "9: rope[0]", &["key `length` is missing [m]", "add `length = …`, in m"]);
    refused("step = 0.01", "", "2: time", &["key `step` is missing [s]"]);
    refused(", direction = [1, 0, 0]", "", "18: rope[0].initial", &["`direction` is missing"]);
    refused("shape = \"straight\", ", "", "18: rope[0].initial", &["`shape` is missing"]);
    refused("nodes = [0, 1]", "", "19: gripper[0]", &["none of the keys `nodes`, `end`"]);
    refused("nodes = [0, 1]", "nodes = [0]\nend = \"first\"", "19: gripper[0]", &["more than one of the keys", "keep one of"]);
    refused("nodes = 5", "", "9: rope[0]", &["none of the keys `nodes`, `edge_fractions`"]);
    refused("nodes = 5", "nodes = 5\nedge_fractions = [1, 1]", "11: rope[0].nodes", &["more than one of the keys"]);
}

#[test]
fn wrong_unit() {
    refused(
        "radius = 0.003",
        "radius = \"3 mm\"",
        "16: rope[0].radius",
        &["\"3 mm\"", "[m]", "write 0.003 (in m, without quotes)"],
    );
    refused("length = 1.0", "length = \"1\"", "12: rope[0].length", &["write 1 (in m"]);
    refused("length = 1.0", "length = \"long\"", "12: rope[0].length", &["write the number alone, in m"]);
    refused("length = 1.0", "length = 1500.0", "12: rope[0].length", &["1500 m", "given in mm", "write 1.5"]);
    refused("radius = 0.003", "radius = 3", "16: rope[0].radius", &["thicker than its length", "given in mm", "write 0.003"]);
    refused("linear_density = 0.05", "linear_density = 50", "13: rope[0].linear_density", &["given in g/m", "write 0.05"]);
    refused("magnitude = 9.81", "magnitude = 9810", "7: gravity.magnitude", &["mm/s²", "write 9.81"]);
    refused("tilt = [0.0, 0.0]", "tilt = [0.0, 45.0]", "8: gravity.tilt[1]", &["degrees", "write 0.785"]);
    refused("step = 0.01", "step = 10", "3: time.step", &["given in ms", "write 0.01"]);
}

#[test]
fn wrong_type() {
    refused("nodes = 5", "nodes = 5.5", "11: rope[0].nodes", &["the number 5.5", "write a whole number"]);
    refused("nodes = 5", "nodes = -5", "11: rope[0].nodes", &["a whole number from 0 on"]);
    refused("tilt = [0.0, 0.0]", "tilt = 0.0", "8: gravity.tilt", &["not a list"]);
    refused("a = [0, 0, -1]", "a = [0, 0]", "30: capsule[0].a", &["has 2 entries instead of 3"]);
    refused("\"euler\"", "\"eulr\"", "5: time.integrator", &["\"eulr\" is none of", "did you mean \"euler\"?"]);
    refused("\"straight\"", "\"round\"", "18: rope[0].initial.shape", &["\"straight\", \"between\", \"circle\", \"points\""]);
    refused("name = \"left\"", "name = 7", "20: gripper[0].name", &["a text in quotes"]);
    refused("[gravity]\nmagnitude = 9.81\ntilt = [0.0, 0.0]", "[air]\nwind = true", "7: air.wind", &["true, not a list"]);
    let error = parse_scene::<Nothing>("schema_version = 1\ntime = 3\n", "scene.toml").unwrap_err().to_string();
    assert!(error.starts_with("scene.toml:2: time: is the whole number 3, not a table"), "{error}");
}

#[test]
fn not_toml() {
    refused("tilt = [0.0, 0.0]", "tilt = [0.0, 0.0", "9", &["is not valid TOML"]);
    refused("step = 0.01", "step = 0.01\nstep = 0.02", "4", &["is not valid TOML", "duplicate key"]);
}

#[test]
fn version() {
    refused("schema_version = 1", "schema_version = 2", "1: schema_version", &["is 2", "reads 1"]);
}

#[test]
fn numbers() {
    refused("length = 1.0", "length = nan", "12: rope[0].length", &["NaN, not a finite number"]);
    refused("from = [0, 0, 0.5]", "from = [0, inf, 0.5]", "18: rope[0].initial.from[1]", &["inf"]);
    refused("length = 1.0", "length = 0", "12: rope[0].length", &["must be positive"]);
    refused("bend_stiffness = 1.0e-3", "bend_stiffness = -1.0", "15: rope[0].bend_stiffness", &["-1 N·m²", "sign error"]);
    refused("friction = 0.5", "friction = -0.5", "27: plane[0].friction", &["must not be negative"]);
    refused("radius = 0.02", "radius = 0.0", "32: capsule[0].radius", &["must be positive"]);
    refused("frequency = 1.0", "frequency = 0", "23: gripper[0].motion.frequency", &["Hz"]);
    refused("duration = 0.5", "duration = 0.001", "4: time.duration", &["shorter than one step of 0.01 s"]);
}

#[test]
fn sizes_beyond_memory() {
    refused(
        "duration = 0.5",
        "duration = 1e12",
        "4: time.duration",
        &["1e14 steps of 0.01 s", "may have 10000000", "at most 100000 s"],
    );
    refused("step = 0.01", "step = 1e-300", "3: time.step", &["is 1e-300, but must lie between 1e-9 and 1"]);
    refused("nodes = 5", "nodes = 300000000", "11: rope[0].nodes", &["300000000 nodes", "may have 1000000"]);
    refused("length = 1.0", "length = -1e300", "12: rope[0].length", &["is -1e300 m"]);
}

#[test]
fn negative_mass() {
    refused("mass = 0.01", "mass = -0.01", "17: rope[0].node_mass[0].mass", &["-0.01 kg", "must not be negative"]);
    refused("radius = 0.003", "radius = 0.003\ntip_mass = -1.0", "17: rope[0].tip_mass", &["-1 kg"]);
}

#[test]
fn nodes_that_do_not_exist() {
    refused(
        "nodes = [0, 1]",
        "nodes = [0, 5]",
        "22: gripper[0].nodes[1]",
        &["rope \"cable\" has no node 5", "from 0 to 4", "to -5"],
    );
    refused("nodes = [0, 1]", "nodes = [-6]", "22: gripper[0].nodes[0]", &["no node -6"]);
    refused("node = 3", "node = 13", "17: rope[0].node_mass[0].node", &["no node 13"]);
    refused("rope = \"cable\"", "rope = \"cabel\"", "21: gripper[0].rope", &["no rope \"cabel\"", "did you mean \"cable\"?"]);
    refused("rope = \"cable\"", "rope = \"x\"", "21: gripper[0].rope", &["name one of: `cable`"]);
    refused("nodes = [0, 1]", "nodes = []", "22: gripper[0].nodes", &["holds no node"]);
    refused("nodes = 5", "nodes = 1", "11: rope[0].nodes", &["1 nodes", "at least 3"]);
    refused("nodes = 5", "nodes = 2", "11: rope[0].nodes", &["bending", "at least 3"]);
}

#[test]
fn nodes_held_twice() {
    refused("nodes = [0, 1]", "nodes = [0, -5]", "22: gripper[0].nodes[1]", &["node 0", "already held by gripper \"left\""]);
    let second = "[[gripper]]\nname = \"right\"\nrope = \"cable\"\nend = \"first\"\n[[plane]]";
    refused("[[plane]]", second, "27: gripper[1].end", &["already held by gripper \"left\""]);
}

#[test]
fn clamps_that_contradict() {
    // the clamped end and the held edge would both say how the rod stands there
    let twist = "radius = 0.003\ntwist = { stiffness = 1.0e-3 }";
    let rod = GOOD.replacen("radius = 0.003", twist, 1).replacen("nodes = [0, 1]", "end = \"first\"", 1);
    let second = "[[gripper]]\nname = \"right\"\nrope = \"cable\"\nnodes = [1, 0]\n[[plane]]";
    let error = parse_scene::<Nothing>(&rod.replacen("[[plane]]", second, 1), "rod.toml").unwrap_err().to_string();
    for part in
        ["rod.toml:28: gripper[1].nodes[1]: ", "node 0", "\"left\"", "two grippers command one node", "a rod's axes", "fix: "]
    {
        assert!(error.contains(part), "no `{part}` in\n{error}");
    }
}

#[test]
fn equilibria_that_are_singular() {
    let start = "radius = 0.003\nstart = \"equilibrium\"";
    let without = |scene: &str| {
        let (from, to) = (scene.find("[[gripper]]").unwrap(), scene.find("[[plane]]").unwrap());
        format!("{}{}", &scene[..from], &scene[to..])
    };
    let says = |scene: &str, place: &str, parts: &[&str]| {
        let error = parse_scene::<Nothing>(scene, "scene.toml").unwrap_err().to_string();
        assert!(error.starts_with(&format!("scene.toml:{place}: ")), "{error}");
        for part in parts.iter().chain(&["likely cause: ", "fix: ", "the matrix of statics is singular"]) {
            assert!(error.contains(part), "no `{part}` in\n{error}");
        }
    };
    let hung = GOOD.replacen("radius = 0.003", start, 1);
    parse_scene::<Nothing>(&hung, "scene.toml").unwrap();
    says(&without(&hung), "17: rope[0].start", &["nothing holds rope \"cable\"", "by a [[gripper]]"]);
    // a gripper that grasps holds nothing as the scene begins
    let grasped = hung.replacen("nodes = [0, 1]", "grasp = { at = [0, 0, 0.5] }", 1);
    says(&grasped, "17: rope[0].start", &["nothing holds rope \"cable\"", "grasps"]);
    // the equilibrium is the whole scene's
    let free = "[[rope]]\nname = \"free\"\nnodes = 3\nlength = 1.0\nlinear_density = 0.05\nstretch_stiffness = 1.0e4\n\
                initial = { shape = \"straight\", from = [0, 0, 9], direction = [1, 0, 0] }\n[[plane]]";
    says(&hung.replacen("[[plane]]", free, 1), "17: rope[0].start", &["nothing holds rope \"free\""]);
    let slack = hung.replacen("stretch_stiffness = 1.0e4", "stretch_stiffness = 0", 1);
    says(&slack, "14: rope[0].stretch_stiffness", &["0 N", "rope \"cable\"", "in N"]);
    let rod = hung.replacen("radius = 0.003", "radius = 0.003\ntwist = { stiffness = 1.0e-3 }", 1);
    parse_scene::<Nothing>(&rod, "scene.toml").unwrap();
    let pinned = rod.replacen("nodes = [0, 1]", "nodes = [0, 2]", 1);
    says(&pinned, "18: rope[0].start", &["rope \"cable\" may turn about itself", "clamp an `end` or two neighbouring nodes"]);
    // what is curved or flat minds how it stands
    for inside in [
        "rest_curvature = [1, 0]",
        "bend_stiffness_2 = 2e-3",
        "rest = \"initial\"",
        "joint = [{ node = 2, rest_curvature = [1, 0] }]",
    ] {
        let bent = pinned.replacen("stiffness = 1.0e-3 }", &format!("stiffness = 1.0e-3, {inside} }}"), 1);
        parse_scene::<Nothing>(&bent, "scene.toml").unwrap();
    }
    let soft = rod.replacen("{ stiffness = 1.0e-3 }", "{ stiffness = 0.0 }", 1);
    says(&soft, "17: rope[0].twist.stiffness", &["0 N·m²", "rope \"cable\""]);
}

/// Radii in mm that are shorter than the rope is long.
#[test]
fn thick_ropes() {
    let long = GOOD.replacen("length = 1.0", "length = 10.0", 1);
    let error = parse_scene::<Nothing>(&long.replacen("radius = 0.003", "radius = 3", 1), "scene.toml").unwrap_err().to_string();
    for part in ["16: rope[0].radius: is 3 m", "(2.5 m, from node 0 to node 1)", "lighter than air", "given in mm", "write 0.003"]
    {
        assert!(error.contains(part), "no `{part}` in\n{error}");
    }
    let fine = GOOD.replacen("nodes = 5", "nodes = 201", 1);
    parse_scene::<Nothing>(&fine.replacen("radius = 0.003", "radius = 0.02", 1), "scene.toml").unwrap();
    let error =
        parse_scene::<Nothing>(&fine.replacen("radius = 0.003", "radius = 0.1", 1), "scene.toml").unwrap_err().to_string();
    for part in
        ["16: rope[0].radius: is 0.1 m", "the longest edge, from node", "is 0.005 m long", "at most 0.025 (in m)", "51 nodes"]
    {
        assert!(error.contains(part), "no `{part}` in\n{error}");
    }
}

#[test]
fn rules_for_pairs() {
    let rule = |between: &str, what: &str| format!("[[contact.pair]]\nbetween = [{between}]\n{what}\n[[plane]]");
    let twice = format!(
        "{}{}",
        rule("\"cable\", \"floor\"", "friction = 0.1").replace("[[plane]]", ""),
        rule("\"floor\", \"cable\"", "ignore = true")
    );
    refused("[[plane]]", &twice, "28: contact.pair[1].between", &["\"floor\" and \"cable\"", "contact.pair[0]", "remove one"]);
    let soft = rule("\"cable\", \"bar\"", "compliance = 1e-3");
    refused("[[plane]]", &soft, "26: contact.pair[0].compliance", &["against a fixed shape has none", "remove `compliance`"]);
    // a rope that touches nothing may begin inside
    let inside = GOOD.replacen("from = [0, 0, 0.5]", "from = [0, 0, -0.01]", 1);
    parse_scene::<Nothing>(&inside, "scene.toml").unwrap_err();
    let ignored = inside.replacen("[[plane]]", &rule("\"floor\", \"cable\"", "ignore = true"), 1);
    parse_scene::<Nothing>(&ignored, "scene.toml").unwrap();
}

#[test]
fn names() {
    refused("name = \"bar\"", "name = \"floor\"", "29: capsule[0].name", &["\"floor\" is taken by plane[0]"]);
    refused("name = \"bar\"", "name = \"my.bar\"", "29: capsule[0].name", &["cannot be part of a parameter path"]);
    refused("name = \"bar\"", "name = \"gravity\"", "29: capsule[0].name", &["not gravity"]);
}

#[test]
fn impossible_geometry() {
    let points = |list: &str| format!("shape = \"points\", points = {list} }}");
    let old = "shape = \"straight\", from = [0, 0, 0.5], direction = [1, 0, 0] }";
    let field = "18: rope[0].initial.points";
    refused(old, &points("[[0, 0, 1], [1, 0, 1]]"), field, &["2 points", "5 nodes"]);
    let twice = "[[0, 0, 1], [0, 0, 1], [0.5, 0, 1], [0.75, 0, 1], [1, 0, 1]]";
    refused(old, &points(twice), "18: rope[0].initial.points[1]", &["nodes 0 and 1", "same place"]);
    let folded = "[[0, 0, 1], [0.25, 0, 1], [0.5, 0, 1], [0.25, 0, 1], [0, 0, 1]]";
    refused(old, &points(folded), "18: rope[0].initial.points[2]", &["folds back", "node 2"]);
    let millimetres = "[[0, 0, 1], [250, 0, 1], [500, 0, 1], [750, 0, 1], [1000, 0, 1]]";
    refused(old, &points(millimetres), "18: rope[0].initial.points[1]", &["250.0000 m long, but 0.2500 m at rest", "mm"]);
    refused("direction = [1, 0, 0]", "direction = [0, 0, 0]", "18: rope[0].initial.direction", &["no direction"]);
    let far = "shape = \"between\", from = [0, 0, 1], to = [9, 0, 1] }";
    refused(old, far, "18: rope[0].initial.to", &["at rest", "too short"]);
    refused("normal = [0, 0, 1]", "normal = [0, 0, 0]", "26: plane[0].normal", &["no direction"]);
    refused("b = [1, 0, -1]", "b = [0, 0, -1]", "31: capsule[0].b", &["same point", "[[sphere]]"]);
    refused("from = [0, 0, 0.5]", "from = [0, 0, -0.01]", "18: rope[0].initial", &["node 2", "0.0100 m inside plane \"floor\""]);
}

#[test]
fn contact_that_cannot_be() {
    refused("\"euler\"", "\"midpoint\"", "5: time.integrator", &["with contact", "2 shape(s)", "sdirk2"]);
    let held = &["grippers hold every node of rope \"cable\"", "leave nodes of it free"];
    refused("nodes = [0, 1]", "nodes = [0, 1, 2, 3, 4]", "9: rope[0]", held);
    // a second rope that is free changes nothing about the first
    let free = "[[rope]]\nname = \"free\"\nnodes = 3\nlength = 1.0\nlinear_density = 0.05\nstretch_stiffness = 1.0e4\n\
                initial = { shape = \"straight\", from = [0, 0, 9], direction = [1, 0, 0] }\n[[plane]]";
    let two = GOOD.replacen("nodes = [0, 1]", "nodes = [0, 1, 2, 3, 4]", 1).replacen("[[plane]]", free, 1);
    let error = parse_scene::<Nothing>(&two, "scene.toml").unwrap_err().to_string();
    assert!(error.starts_with("scene.toml:9: rope[0]: grippers hold every node of rope \"cable\""), "{error}");
}

#[test]
fn nothing_to_simulate() {
    let error = parse_scene::<Nothing>("schema_version = 1\n[time]\nstep = 0.01\n", "scene.toml").unwrap_err().to_string();
    assert!(error.contains("scene.toml: rope: the scene has nothing that moves") && error.contains("add a [[rope]]"), "{error}");
}

#[test]
fn no_file() {
    let error = read_scene::<Nothing>("/nowhere/scene.toml").unwrap_err().to_string();
    assert!(error.starts_with("/nowhere/scene.toml: cannot be read") && error.contains("check the path"), "{error}");
}

#[test]
fn sections_that_cannot_remember() {
    let memory = |inside: &str| format!("radius = 0.003\ntwist = {{ stiffness = 1.0e-3 }}\n{inside}");
    let at = "radius = 0.003";
    refused(at, "radius = 0.003\ncreep = { fraction = 0.1, time = 1.0 }", "17: rope[0].creep", &["no `twist`", "[rope.twist]"]);
    let alone = "radius = 0.003\nplasticity = { yield_curvature = 3.0, time = 1.0 }";
    refused(at, alone, "17: rope[0].plasticity", &["no `twist`", "remove `[rope.plasticity]`"]);
    let creep = |numbers: &str| memory(&format!("creep = {{ {numbers} }}"));
    refused(at, &creep("fraction = -0.1, time = 1.0"), "18: rope[0].creep.fraction", &["must not be negative"]);
    refused(at, &creep("fraction = 0.1, time = 0.0"), "18: rope[0].creep.time", &["s, but must be positive"]);
    refused(at, &creep("fraction = 0.1"), "18: rope[0].creep", &["`time` is missing", "s"]);
    refused(at, &creep("fraction = 0.1, twist_fraction = -1.0, time = 1.0"), "18: rope[0].creep.twist_fraction", &["negative"]);
    let plastic = |numbers: &str| memory(&format!("plasticity = {{ {numbers} }}"));
    let (curvature, time) = ("18: rope[0].plasticity.yield_curvature", "18: rope[0].plasticity.time");
    refused(at, &plastic("yield_curvature = 0.0, time = 1.0"), curvature, &["1/m", "must be positive"]);
    refused(at, &plastic("yield_curvature = 1.0, time = -1.0"), time, &["must be positive"]);
}

#[test]
fn sections_that_cannot_stiffen_or_rub() {
    let section = |inside: &str| format!("radius = 0.003\ntwist = {{ stiffness = 1.0e-3 }}\n{inside}");
    let at = "radius = 0.003";
    let alone = |table: &str| format!("radius = 0.003\n{table}");
    let fix = |key: &str| format!("remove `[rope.{key}]`");
    let stiffening = alone("stiffening = { coefficient = 0.1 }");
    refused(at, &stiffening, "17: rope[0].stiffening", &["no `twist`", "[rope.twist]", &fix("stiffening")]);
    let friction = alone("bend_friction = { moment = 0.1, curvature = 1.0 }");
    refused(at, &friction, "17: rope[0].bend_friction", &["no `twist`", "[rope.twist]", &fix("bend_friction")]);
    let stiffening = |numbers: &str| section(&format!("stiffening = {{ {numbers} }}"));
    refused(at, &stiffening(""), "18: rope[0].stiffening", &["`coefficient` is missing", "m²"]);
    refused(at, &stiffening("coefficient = nan"), "18: rope[0].stiffening.coefficient", &["not a finite number"]);
    refused(at, &stiffening("coefficient = inf"), "18: rope[0].stiffening.coefficient", &["not a finite number"]);
    refused(at, &stiffening("coefficient = 0.1, power = 3"), "18: rope[0].stiffening.power", &["unknown key", "`coefficient`"]);
    let friction = |numbers: &str| section(&format!("bend_friction = {{ {numbers} }}"));
    let (moment, curvature) = ("18: rope[0].bend_friction.moment", "18: rope[0].bend_friction.curvature");
    refused(at, &friction("moment = -0.1, curvature = 1.0"), moment, &["N·m", "must not be negative"]);
    refused(at, &friction("moment = nan, curvature = 1.0"), moment, &["not a finite number"]);
    refused(at, &friction("moment = 0.1, curvature = 0.0"), curvature, &["1/m", "must be positive"]);
    refused(at, &friction("moment = 0.1, curvature = -2.0"), curvature, &["must be positive"]);
    refused(at, &friction("moment = 0.1"), "18: rope[0].bend_friction", &["`curvature` is missing", "1/m"]);
    refused(at, &friction("curvature = 1.0"), "18: rope[0].bend_friction", &["`moment` is missing", "N·m"]);
}

#[test]
fn rings_that_cannot_be() {
    let straight = "initial = { shape = \"straight\", from = [0, 0, 0.5], direction = [1, 0, 0] }";
    let circle = "initial = { shape = \"circle\", center = [0, 0, 0.5], normal = [0, 0, 1] }";
    refused(straight, circle, "18: rope[0].initial", &["open rope", "as a circle", "`closed = true`"]);
    refused(straight, &format!("closed = true\n{straight}"), "19: rope[0].initial", &["closed rope", "straight", "circle"]);
    refused(straight, &format!("closed = true\ntip_mass = 0.1\n{circle}"), "19: rope[0].tip_mass", &["no tip", "node_mass"]);
    let flat = circle.replace("[0, 0, 1]", "[0, 0, 0]");
    refused(straight, &format!("closed = true\n{flat}"), "19: rope[0].initial.normal", &["length zero"]);
    let along = circle.replace("[0, 0, 1]", "[0, 0, 1], first = [0, 0, 2]");
    refused(straight, &format!("closed = true\n{along}"), "19: rope[0].initial.first", &["no direction"]);
    let ring = GOOD.replace(straight, &format!("closed = true\n{circle}"));
    assert!(parse_scene::<Nothing>(&ring, "ring.toml").is_ok());
    let refused = |from: &str, to: &str, parts: &[&str]| {
        let error = parse_scene::<Nothing>(&ring.replace(from, to), "ring.toml").unwrap_err().to_string();
        assert!(parts.iter().all(|part| error.contains(part)), "{error}");
    };
    refused("nodes = [0, 1]", "end = \"first\"", &["gripper[0].end", "\"cable\" is closed, so it has no end"]);
    refused("nodes = 5", "nodes = 3", &["rope[0].nodes", "a closed rope needs at least 4"]);
    let long = "edge_fractions = [1.0, 1.0, 5.0, 1.0]";
    refused("nodes = 5", long, &["rope[0].edge_fractions[2]", "too long for a circle"]);
    let points = "points = [[0, 0, 0], [0.2, 0, 0], [0.2, 0.2, 0], [0.1, 0.3, 0], [0, 0.9, 0]]";
    refused("shape = \"circle\", center = [0, 0, 0.5], normal = [0, 0, 1]", &format!("shape = \"points\", {points}"), &["edge"]);
}

#[test]
fn twists_that_make_no_sense() {
    let twist = |inside: &str| format!("radius = 0.003\ntwist = {{ stiffness = 1.0e-3{inside} }}");
    refused("radius = 0.003", &twist(", damping = -1.0"), "17: rope[0].twist.damping", &["N·m²·s", "must not be negative"]);
    refused("radius = 0.003", &twist(", inertia = 0.0"), "17: rope[0].twist.inertia", &["kg·m"]);
    refused("radius = 0.003", &twist(", bend_stiffness_2 = -1.0"), "17: rope[0].twist.bend_stiffness_2", &["N·m²"]);
    refused("radius = 0.003", &twist(", director = [2, 0, 0]"), "17: rope[0].twist.director", &["no direction"]);
    refused("radius = 0.003", &twist(", stifness = 2.0"), "17: rope[0].twist.stifness", &["unknown key", "`stiffness`"]);
    refused("radius = 0.003", "twist = { stiffness = 1.0e-3 }", "16: rope[0].twist", &["`inertia`", "kg·m"]);
    refused(
        "nodes = [0, 1]",
        "end = \"first\"\nspin = 1.0",
        "23: gripper[0].spin",
        &["\"cable\" cannot be turned", "[rope.twist]"],
    );
    refused("nodes = [0, 1]", "nodes = [0, 1]\nroll = 1.0", "23: gripper[0].roll", &["cannot be turned"]);
}
