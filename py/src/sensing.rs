//! Sensors of controllers.

use crate::convert::to_vector;
use crate::errors::input;
use crate::model::Model;
use numpy::PyArray1;
use pliant::control::sensing::{Output, Sensors};
use pyo3::prelude::*;

/// Sensors of a controller that does not know the state.
#[pyclass(module = "pliant", frozen)]
pub struct Sensing {
    pub sensors: Sensors,
    model: Py<Model>,
}

impl Sensing {
    pub fn of(sensors: Sensors, model: Py<Model>) -> Self {
        Self { sensors, model }
    }
}

/// A standard deviation.
fn deviation(name: &str, noise: f64) -> PyResult<f64> {
    if noise.is_finite() && noise >= 0.0 {
        Ok(noise)
    } else {
        Err(input(format!("{name} is {noise}, but must be a standard deviation, finite and not negative")))
    }
}

#[pymethods]
impl Sensing {
    #[new]
    #[pyo3(signature = (model, nodes=None, noise=0.0, *, joints=Vec::new(), joint_noise=0.0, delay=0))]
    fn new(
        model: Bound<'_, Model>,
        nodes: Option<Vec<usize>>,
        noise: f64,
        joints: Vec<String>,
        joint_noise: f64,
        delay: usize,
    ) -> PyResult<Self> {
        let engine = model.get().engine();
        let (noise, joint_noise) = (deviation("noise", noise)?, deviation("joint_noise", joint_noise)?);
        let count = engine.n_nodes();
        let nodes = nodes.unwrap_or_else(|| (0..count).collect());
        if let Some((k, node)) = nodes.iter().enumerate().find(|(_, node)| **node >= count) {
            return Err(input(format!("nodes[{k}] is {node}, but the model has the nodes 0 to {}", count.saturating_sub(1))));
        }
        let mut outputs: Vec<Output> = nodes.iter().flat_map(|node| Output::of_node(*node, noise)).collect();
        let (first, tree) = (engine.n_node_dofs(), engine.tree());
        for name in joints {
            let single = || tree.joints().iter().filter(|joint| joint.kind.n_dofs() == 1);
            let Some(joint) = single().find(|joint| joint.name == name) else {
                let known: Vec<_> = single().map(|joint| joint.name.as_str()).collect();
                return Err(input(format!("there is no joint of one coordinate \"{name}\"; there are: {}", known.join(", "))));
            };
            let (q, column) = (first + joint.q, first + joint.v);
            outputs.push(Output { name: format!("joint \"{name}\""), q, column, noise: joint_noise });
        }
        Ok(Self { sensors: Sensors { outputs, delay }, model: model.unbind() })
    }

    /// Steps from a state to the decision that knows its reading.
    #[getter]
    fn delay(&self) -> usize {
        self.sensors.delay
    }

    /// Standard deviations of the readings' noise, (n,); 0 of whether grippers hold something.
    #[getter]
    fn noise<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        let mut noise: Vec<f64> = self.sensors.outputs.iter().map(|output| output.noise).collect();
        noise.resize(self.sensors.len(self.model.get().engine()), 0.0);
        to_vector(py, noise)
    }

    /// The reading of a state x (nx,) without noise, (n,).
    fn read<'py>(&self, py: Python<'py>, x: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let model = self.model.get();
        let x = model.state("x", x)?;
        Ok(to_vector(py, self.sensors.read(model.engine(), &x)))
    }

    fn __repr__(&self) -> String {
        format!("<pliant.Sensing: {} numbers, {} step(s) late>", self.sensors.len(self.model.get().engine()), self.sensors.delay)
    }
}
