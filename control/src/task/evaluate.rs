//! Values and derivatives of a task's costs and limits.

use super::When;
use super::resolve::{Guard, Part, TaskProblem};
use crate::problem::{Problem, Rows, Terms};
use pliant_math::{State, Vec3};

impl Problem for TaskProblem {
    fn evaluate(&self, k: usize, n: usize, x: &State, u: Option<&[f64]>, out: &mut Terms) -> Result<(), String> {
        for part in &self.parts {
            self.cost(part, (k, n), x, u, &mut out.residuals);
        }
        for guard in self.guards.iter().filter(|_| k > 0) {
            guard.add(x, out);
        }
        Ok(())
    }

    fn bounds(&self, _: usize, lower: &mut [f64], upper: &mut [f64]) {
        lower.copy_from_slice(&self.lower);
        upper.copy_from_slice(&self.upper);
    }

    fn constraint(&self, k: usize, n: usize, row: usize) -> String {
        let mut before = 0;
        for guard in &self.guards {
            if row < before + guard.rows() {
                return format!("{} after step {k} of {n}", guard.says(row - before));
            }
            before += guard.rows();
        }
        format!("constraint {row} after step {k} of {n}")
    }
}

fn node(x: &State, node: usize) -> Vec3<f64> {
    Vec3::new(x.q[3 * node], x.q[3 * node + 1], x.q[3 * node + 2])
}

impl TaskProblem {
    fn cost(&self, part: &Part, (k, n): (usize, usize), x: &State, u: Option<&[f64]>, out: &mut Rows) {
        // the first state is given, and its cost with it
        let counts = |when: When| k > 0 && (when == When::Always || k == n);
        let model = &self.model;
        match part {
            Part::Nodes { nodes, weight, when } if counts(*when) => {
                for (node, goal) in nodes {
                    for a in (0..3).filter(|a| weight[*a] != 0.0) {
                        let row = out.push(weight[a] * (x.q[3 * node + a] - goal[a]));
                        out.slope(row, 3 * node + a, weight[a]);
                    }
                }
            }
            Part::Distance { nodes: [i, j], distance, weight, when } if counts(*when) => {
                let apart = node(x, *i) - node(x, *j);
                let d = apart.norm();
                let row = out.push(weight * (d - distance));
                for a in (0..3).filter(|_| d > 0.0) {
                    out.slope(row, 3 * i + a, weight * apart[a] / d);
                    out.slope(row, 3 * j + a, -weight * apart[a] / d);
                }
            }
            Part::Joint { q, v, goal, weight, when } if counts(*when) => {
                let row = out.push(weight * (x.q[*q] - goal));
                out.slope(row, *v, *weight);
            }
            Part::JointSpeed { v, weight, when } if counts(*when) => {
                let row = out.push(weight * x.v[*v]);
                out.slope(row, model.nv() + v, *weight);
            }
            Part::Body { body, point, goal, weight, when } if counts(*when) => {
                let (first, tree) = (model.n_node_dofs(), model.tree());
                let frames = tree.frames(&x.q[first..], &x.v[first..]);
                let frame = &frames.bodies[*body];
                let p = frame.position + frame.rotation * Vec3::from(*point);
                for a in (0..3).filter(|a| weight[*a] != 0.0) {
                    let row = out.push(weight[a] * (p[a] + frames.origin[a] - goal[a]));
                    for l in tree.chain(tree.last_dof(*body)) {
                        out.slope(row, first + l, weight[a] * frames.axes[l].s.at(&p)[a]);
                    }
                }
            }
            Part::Inputs { inputs, target, weight } => {
                let Some(u) = u else { return };
                for &input in inputs {
                    let row = out.push(weight * (u[input] - target));
                    out.slope(row, model.ndx() + input, *weight);
                }
            }
            Part::Reach { grasp, inside, weight } if k > 0 => {
                let grasp = &model.grasps()[*grasp];
                let row = out.push(0.0);
                let Some(reach) = grasp.reach(&x.q).filter(|reach| reach.distance > *inside && grasp.held(&x.z).is_none()) else {
                    return;
                };
                out.values[row] = weight * (reach.distance - inside);
                reach.visit_distance(|column, slope| out.slope(row, column, weight * slope));
            }
            _ => {}
        }
    }
}

impl Guard {
    fn rows(&self) -> usize {
        match self {
            Self::Outside { nodes, .. } | Self::Above { nodes, .. } => nodes.len(),
            Self::Joint { .. } => 2,
        }
    }

    fn says(&self, row: usize) -> String {
        match self {
            Self::Outside { nodes, first, radius, object, a, .. } => {
                format!("node {} of \"{object}\" is nearer than {radius} m to the axis at {a:?}", nodes[row] - first)
            }
            Self::Above { nodes, first, object, offset, .. } => {
                format!("node {} of \"{object}\" is below the plane at {offset} m", nodes[row] - first)
            }
            Self::Joint { joint, lower, upper, .. } => format!("joint \"{joint}\" leaves {lower} … {upper}"),
        }
    }

    fn add(&self, x: &State, out: &mut Terms) {
        match self {
            Self::Outside { nodes, a, b, radius, price, .. } => {
                let (a, b) = (Vec3::from(*a), Vec3::from(*b));
                let axis = b - a;
                let length2 = axis.norm_squared();
                for &k in nodes {
                    let p = node(x, k);
                    let t = if length2 > 0.0 { ((p - a).dot(&axis) / length2).clamp(0.0, 1.0) } else { 0.0 };
                    let away = p - (a + axis * t);
                    let d = away.norm();
                    let row = out.constrain(radius - d, *price);
                    // on the axis itself any direction leads out
                    let normal = if d > 0.0 { away / d } else { Vec3::z() };
                    (0..3).for_each(|c| out.constraints.slope(row, 3 * k + c, -normal[c]));
                }
            }
            Self::Above { nodes, normal, offset, price, .. } => {
                for &k in nodes {
                    let row = out.constrain(offset - node(x, k).dot(&Vec3::from(*normal)), *price);
                    (0..3).for_each(|c| out.constraints.slope(row, 3 * k + c, -normal[c]));
                }
            }
            Self::Joint { q, v, lower, upper, price, .. } => {
                let row = out.constrain(lower - x.q[*q], *price);
                out.constraints.slope(row, *v, -1.0);
                let row = out.constrain(x.q[*q] - upper, *price);
                out.constraints.slope(row, *v, 1.0);
            }
        }
    }
}
