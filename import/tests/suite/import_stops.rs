//! Limits and dry friction of imported joints.

use pliant_engine::model::ModelBuilder;
use pliant_import::{Imported, Options, Verdict, import_text};
use pliant_scene::{Integrator, Joint};
use std::f64::consts::PI;

fn model(joint: &str, option: &str) -> String {
    format!(
        "<mujoco>{option}<worldbody><body name=\"a\"><joint name=\"j\" {joint}/><geom size=\"0.1\"/></body></worldbody></mujoco>"
    )
}

fn mjcf(joint: &str, option: &str) -> Imported {
    import_text(&model(joint, option), "model.xml", &Options::default()).unwrap()
}

/// Features that scenes lack are refused, and with `approximate` left out.
fn approximated(joint: &str) -> Imported {
    let text = model(joint, "");
    let error = import_text(&text, "model.xml", &Options::default()).unwrap_err();
    assert!(error.to_string().contains("--approximate"), "{error}");
    import_text(&text, "model.xml", &Options { approximate: true, ..Options::default() }).unwrap()
}

fn urdf(kind: &str, inside: &str) -> Imported {
    let text = format!(
        "<robot name=\"r\"><link name=\"base\"/><link name=\"arm\"><inertial><mass value=\"2\"/>\
         <inertia ixx=\"0.1\" iyy=\"0.2\" izz=\"0.15\" ixy=\"0\" ixz=\"0\" iyz=\"0\"/></inertial></link>\
         <joint name=\"j\" type=\"{kind}\"><parent link=\"base\"/><child link=\"arm\"/>{inside}</joint></robot>"
    );
    import_text(&text, "model.urdf", &Options::default()).unwrap()
}

fn joint(imported: &Imported) -> &Joint {
    &imported.scene.body.iter().find(|b| !b.joint.is_empty()).unwrap().joint[0]
}

#[track_caller]
fn says(imported: &Imported, verdict: Verdict, words: &str) {
    let found = imported.report.entries.iter().any(|e| e.verdict == verdict && e.reason.contains(words));
    assert!(found, "no `{words}` in\n{}", imported.report.text());
}

#[test]
fn ranges_of_mjcf_are_stops() {
    let hinge = mjcf("range=\"-90 45\" ref=\"15\"", "");
    let limits = joint(&hinge).limits.unwrap();
    assert!((limits[0] + 105.0 / 180.0 * PI).abs() < 1e-15 && (limits[1] - PI / 6.0).abs() < 1e-15, "{limits:?}");
    assert_eq!(hinge.scene.time.integrator, Integrator::Euler);
    says(&hinge, Verdict::Kept, "range -90 … 45 degrees: hard stops");
    ModelBuilder::new(&hinge.scene).unwrap();

    let without = Options { without_stops: vec!["j".to_owned()], ..Options::default() };
    let free = import_text(&model("range=\"-90 45\"", ""), "model.xml", &without).unwrap();
    assert_eq!((joint(&free).limits, free.scene.time.integrator), (None, Integrator::Midpoint));
    says(&free, Verdict::Ignored, "stops that are not reached");

    let slide = mjcf("type=\"slide\" range=\"0.1 0.3\"", "");
    assert_eq!((joint(&slide).limits, joint(&slide).start.as_slice()), (Some([0.1, 0.3]), [0.1].as_slice()));
    says(&slide, Verdict::Approximated, "its zero is beyond a stop");

    for (attributes, option) in [
        ("range=\"-90 45\" limited=\"false\"", ""),
        ("range=\"-90 45\"", "<compiler autolimits=\"false\"/>"),
        ("range=\"-90 45\"", "<option><flag limit=\"disable\"/></option>"),
        ("range=\"-90 45\"", "<option><flag constraint=\"disable\"/></option>"),
    ] {
        let free = mjcf(attributes, option);
        assert_eq!((joint(&free).limits, free.scene.time.integrator), (None, Integrator::Midpoint), "{attributes} {option}");
    }
    assert!(joint(&mjcf("range=\"-90 45\" limited=\"true\"", "<compiler autolimits=\"false\"/>")).limits.is_some());
    let ball = approximated("type=\"ball\" range=\"0 45\"");
    assert_eq!(joint(&ball).limits, None);
    says(&ball, Verdict::Approximated, "a ball's largest turn");
}

#[test]
fn frictionloss_of_mjcf_is_dry_friction() {
    let hinge = mjcf("frictionloss=\"0.2\"", "");
    assert_eq!((joint(&hinge).friction, hinge.scene.time.integrator), (0.2, Integrator::Midpoint));
    says(&hinge, Verdict::Kept, "frictionloss 0.2");
    assert_eq!(joint(&mjcf("frictionloss=\"0.2\"", "<option><flag frictionloss=\"disable\"/></option>")).friction, 0.0);
    let ball = approximated("type=\"ball\" frictionloss=\"0.2\"");
    assert_eq!(joint(&ball).friction, 0.0);
    says(&ball, Verdict::Approximated, "frictionloss 0.2");
}

#[test]
fn limits_and_friction_of_urdf() {
    let limit = "<limit lower=\"-1\" upper=\"0.5\" effort=\"30\" velocity=\"2\"/><dynamics damping=\"0.1\" friction=\"0.3\"/>";
    let revolute = urdf("revolute", limit);
    let read = joint(&revolute);
    assert_eq!((read.limits, read.friction, read.damping), (Some([-1.0, 0.5]), 0.3, 0.1));
    says(&revolute, Verdict::Kept, "-1 … 0.5: hard stops");
    says(&revolute, Verdict::Ignored, "effort 30, velocity 2");
    assert_eq!(revolute.scene.time.integrator, Integrator::Euler);
    for (kind, inside) in [("continuous", limit), ("revolute", "<limit effort=\"30\" velocity=\"2\"/>"), ("prismatic", "")] {
        assert_eq!(joint(&urdf(kind, inside)).limits, None, "{kind}");
    }
    let locked = urdf("prismatic", "<limit lower=\"0.2\" upper=\"0.2\" effort=\"1\" velocity=\"1\"/>");
    assert_eq!(joint(&locked).limits, None);
    says(&locked, Verdict::Ignored, "both stops at one place");
}

/// MuJoCo's f = −(d + d₁ |v| + d₂ v²) v: the first two numbers of a hinge or slide are kept, the others are not.
#[test]
fn damping_by_the_square_of_the_speed_is_kept() {
    let of = |imported: &Imported| (joint(imported).damping, joint(imported).quadratic_damping);
    for kind in ["hinge", "slide"] {
        let attributes = format!("type=\"{kind}\" damping=\"0.1 0.02 0\"");
        assert_eq!(of(&mjcf(&attributes, "")), (0.1, 0.02));
    }
    assert_eq!(of(&mjcf("damping=\"0.1 0.02\"", "<option><flag damper=\"disable\"/></option>")), (0.0, 0.0));
    for (attributes, expected) in [
        ("damping=\"0.1 0.02 0.3\"", (0.1, 0.02)),
        ("damping=\"0.1 -0.02\"", (0.1, 0.0)),
        ("type=\"ball\" damping=\"0.1 0.02\"", (0.1, 0.0)),
    ] {
        assert_eq!(of(&approximated(attributes)), expected, "{attributes}");
    }
}
