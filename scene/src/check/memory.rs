//! Memory that a scene asks for, and what it costs to simulate: known before any of it is asked for.

use crate::error::{Mistake, SceneError};
use crate::file::{LinearSolver, Scene};

/// Bytes of a number.
const NUMBER: u64 = 8;
/// Matrices of the bodies, dense, that a step holds: mass, ∂f/∂q̄, the matrix of the step and its factor.
const MATRICES: u64 = 4;
/// Operations of a factorization above which a scene is worth a warning: half a second a step, where one has two factorizations (0.9 s
/// with 2400 degrees of freedom, on one core of 2026).
const SLOW: f64 = 5e9;

/// Bytes of memory that are free on this machine; none where the system does not say.
pub fn available_memory() -> Option<u64> {
    let text = std::fs::read_to_string("/proc/meminfo").ok()?;
    let line = text.lines().find_map(|line| line.strip_prefix("MemAvailable:"))?;
    line.trim().strip_suffix("kB")?.trim().parse::<u64>().ok()?.checked_mul(1024)
}

/// Refuses a scene that certainly does not fit into memory: the numbers are lower bounds.
pub(super) fn check(scene: &Scene) -> Result<(), SceneError> {
    available_memory().map_or(Ok(()), |available| fits(scene, available))
}

/// Degrees of freedom of joints.
fn joint_dofs(scene: &Scene) -> u64 {
    scene.body.iter().flat_map(|b| &b.joint).map(|j| j.kind.n_dofs() as u64).sum()
}

fn nodes(scene: &Scene) -> u64 {
    let ropes = scene.rope.iter().map(|r| r.n_nodes() as u64);
    ropes.chain(scene.cloth.iter().map(|c| c.n_nodes() as u64)).sum()
}

/// Bytes of a square matrix.
fn square(n: u64) -> u64 {
    NUMBER.saturating_mul(n.saturating_mul(n))
}

fn fits(scene: &Scene, available: u64) -> Result<(), SceneError> {
    let (dofs, nodes, steps) = (joint_dofs(scene), nodes(scene), scene.time.n_steps() as u64);
    let refuse = |field: &str, what: String, bytes: u64| Err(SceneError::at(field, Mistake::Memory { what, bytes, available }));
    let dense = MATRICES.saturating_mul(square(dofs));
    if dense > available {
        return refuse("body", format!("dense matrices of {dofs} degrees of freedom"), dense);
    }
    let of_nodes = square(3 * nodes);
    if scene.solver.linear == LinearSolver::Dense && of_nodes > available {
        return refuse("solver.linear", format!("a dense matrix of {nodes} nodes"), of_nodes);
    }
    // positions and velocities of every step
    let states = NUMBER.saturating_mul(steps + 1).saturating_mul(2 * (3 * nodes + dofs));
    if states > available {
        return refuse("time.duration", format!("states of {steps} steps"), states);
    }
    Ok(())
}

/// What is allowed but likely not meant, or costs more than one may expect, as errors are written.
pub fn warnings(scene: &Scene) -> Vec<SceneError> {
    let mut out = Vec::new();
    for (r, rope) in scene.rope.iter().enumerate() {
        let shortest = rope.fractions().iter().copied().fold(f64::INFINITY, f64::min) * rope.length;
        if rope.radius > shortest {
            let mistake = Mistake::Thick { radius: rope.radius, edge: shortest };
            out.push(SceneError::at(format!("rope[{r}].radius"), mistake));
        }
    }
    let dofs = joint_dofs(scene);
    let flops = 2.0 / 3.0 * (dofs as f64).powi(3);
    if flops > SLOW {
        out.push(SceneError::at("body", Mistake::DenseBodies { dofs, bytes: square(dofs), flops }));
    }
    out
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::{Body, Joint, JointKind, Nothing, Scene, Time, parse_scene};

    fn bodies(n: usize) -> Scene {
        let body = |k: usize| Body {
            name: format!("b{k}"),
            joint: vec![Joint { name: format!("j{k}"), kind: JointKind::Free, ..Joint::default() }],
            ..Body::default()
        };
        Scene {
            body: (0..n).map(body).collect(),
            time: Time { step: 0.01, duration: 1.0, ..Time::default() },
            ..Scene::default()
        }
    }

    #[track_caller]
    fn refused(scene: &Scene, available: u64) -> (String, u64) {
        let error = fits(scene, available).unwrap_err();
        let text = error.to_string();
        assert!(text.contains("likely cause: ") && text.contains("fix: "), "{text}");
        match *error.mistake {
            Mistake::Memory { bytes, .. } => (text, bytes),
            other => unreachable!("{other}"),
        }
    }

    #[test]
    fn scenes_that_do_not_fit_are_refused_with_their_bytes() {
        let (text, bytes) = refused(&bodies(1000), 1 << 30);
        assert_eq!(bytes, 4 * 8 * 6000 * 6000);
        assert!(text.starts_with("body: ") && text.contains("6000 degrees of freedom") && text.contains("1.15 GB"), "{text}");
        fits(&bodies(1000), 2 << 30).unwrap();
        let mut long = bodies(10);
        long.time.duration = 1e5;
        let (text, bytes) = refused(&long, 1 << 30);
        assert_eq!(bytes, 8 * 120 * 10_000_001);
        assert!(text.starts_with("time.duration: ") && text.contains("10000000 steps"), "{text}");
        let rope = "schema_version = 1\n[time]\nstep = 0.01\nduration = 1.0\n[solver]\nlinear = \"dense\"\n\
            [[rope]]\nname = \"r\"\nlength = 1.0\nnodes = 5000\nlinear_density = 0.1\nstretch_stiffness = 1.0\nbend_stiffness = 0.0\n\
            initial = { shape = \"straight\", from = [0, 0, 0], direction = [1, 0, 0] }\n";
        let rope: Scene<Nothing> = parse_scene(rope, "s.toml").unwrap();
        assert_eq!(refused(&rope.with_experiment(None), 1 << 30).1, 8 * 15_000 * 15_000);
    }

    #[test]
    fn warnings_say_what_is_odd_or_dear() {
        assert!(warnings(&bodies(300)).is_empty());
        let text = warnings(&bodies(1000))[0].to_string();
        assert!(text.starts_with("body: ") && text.contains("0.288 GB") && text.contains("1.4e11"), "{text}");
        let rope = |radius: f64| {
            let text = format!(
                "schema_version = 1\n[time]\nstep = 0.01\nduration = 1.0\n[[rope]]\nname = \"r\"\nlength = 1.0\nnodes = 51\nlinear_density = 1.0\nradius = {radius}\n\
                 stretch_stiffness = 1.0\nbend_stiffness = 0.0\ninitial = {{ shape = \"straight\", from = [0, 0, 0], direction = [1, 0, 0] }}\n"
            );
            warnings(&parse_scene::<Nothing>(&text, "s.toml").unwrap().with_experiment(None))
        };
        assert!(rope(0.019).is_empty());
        let thick = rope(0.021)[0].to_string();
        assert!(thick.starts_with("rope[0].radius: is 0.021 m, more than the shortest edge of 0.02 m"), "{thick}");
    }
}
