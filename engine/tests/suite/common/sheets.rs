//! A soft sheet thrown into the air.

use super::Case;
use pliant_scene::{Cloth, Grid, Integrator, Scene, Time};

/// A soft sheet thrown into the air, turning and rippling.
pub fn thrown(integrator: Integrator, duration: f64, damping: f64) -> Scene {
    let sheet = Cloth {
        grid: Some(Grid { nodes: [5, 4], size: [0.4, 0.3], ..Grid::default() }),
        youngs_modulus: 2e4,
        thickness: 2e-3,
        bend_stiffness: Some(2e-3),
        membrane_damping: damping * 20.0,
        bend_damping: damping * 2e-5,
        ..Cloth::default()
    };
    let time = Time { step: 2e-3, duration, integrator };
    Scene { cloth: vec![sheet], time, ..Scene::default() }
}

pub fn rippling(scene: &Scene) -> Case {
    let mut case = Case::new(scene, scene.time.n_steps());
    for (i, x) in case.x0.q.clone().chunks(3).enumerate() {
        case.x0.q[3 * i + 2] += 0.02 * (9.0 * x[0]).sin() * (1.0 + 5.0 * x[1]);
        case.x0.v[3 * i] = -2.0 * x[1];
        case.x0.v[3 * i + 1] = 2.0 * x[0];
        case.x0.v[3 * i + 2] = 1.0 + 3.0 * x[0] * x[1];
    }
    case
}
