//! The system of a stage with its contacts *not* condensed, for derivatives:
//! ```text
//! [ A     −P/h ] [v⁺]     A  = ∂r/∂v⁺ at fixed impulses,         P   = ∂p/∂w
//! [ F_v   F_w  ] [w ]     F_v = h a1 ∂F/∂q⁺ + ∂F/∂v⁺,            F_w = ∂F/∂w
//! ```
//! A closed contact at a nanometre's rest gap is 1e7 times stiffer than the rope. Condensed, K = A + P F_w⁻¹ F_v/h, that stiffness
//! stands in the same numbers as the rope's and eats seven of their sixteen digits; here all entries are of their natural size.
//! K's factor solves this system too, and refinement against it recovers what condensing lost.
//!
//! Vectors have nv rows, then four per contact of a node, then one per joint friction, stop or coupling, then four per contact of solids
//! ([`super::spot_rows`]); `columns` numbers per row.

use super::StageRecord;
use crate::contact::RowLinear;
use crate::kkt::NodeMatrix;
use nalgebra::{Matrix3x4, Matrix4, Matrix4x3, SMatrix, SVector};

/// A node and a block of its rows and columns.
pub type NodeBlock = (usize, [[f64; 3]; 3]);

impl StageRecord {
    /// Rows of the system: nv, four per contact of a node, one per joint friction, stop or coupling, four per contact of solids.
    pub fn n_rows(&self) -> usize {
        self.v.len() + 4 * self.contacts.len() + self.rows.len() + 4 * self.spots.len()
    }

    /// Row of joint friction, stop or coupling `k`.
    pub(super) fn joint_row(&self, k: usize) -> usize {
        self.v.len() + 4 * self.contacts.len() + k
    }

    /// ∂F/∂v⁺ of joint row `k`, positions moving along.
    fn joint_slope(&self, k: usize) -> f64 {
        self.rows[k].linear.f_v + self.h * self.scheme.free.a1 * self.rows[k].linear.f_q
    }

    /// ∂F/∂v⁺ of contact `c`, positions moving along.
    pub(super) fn f_v(&self, c: usize) -> Matrix4x3<f64> {
        let contact = &self.contacts[c];
        contact.df_dq * (self.h * self.scheme.free.a1) + contact.df_dv
    }

    /// First row of contact `c`.
    fn row(&self, c: usize) -> usize {
        self.v.len() + 4 * c
    }

    /// `out −= system · x`.
    pub fn subtract_system(&self, x: &[f64], out: &mut [f64], columns: usize) {
        let split = self.v.len() * columns;
        self.matrix.add_mul_many(-1.0, &x[..split], &mut out[..split], columns);
        for (c, (contact, &node)) in self.contacts.iter().zip(&self.contact_nodes).enumerate() {
            let impulse = contact.dp_dw / self.h;
            add_product(&impulse, x, self.row(c), out, 3 * node, columns);
            add_product(&-self.f_v(c), x, 3 * node, out, self.row(c), columns);
            add_product(&-contact.df_dw, x, self.row(c), out, self.row(c), columns);
        }
        for (k, row) in self.rows.iter().enumerate() {
            let at = self.joint_row(k);
            for (v, lever) in row.dofs() {
                add_scaled(row.direction * lever / self.h, x, at, out, v, columns);
                add_scaled(-self.joint_slope(k) * lever, x, v, out, at, columns);
            }
            add_scaled(-row.linear.f_gamma, x, at, out, at, columns);
        }
        self.subtract_spots(x, out, columns);
    }

    /// `out −= systemᵀ · x`, one column.
    pub fn subtract_system_transpose(&self, x: &[f64], out: &mut [f64]) {
        let split = self.v.len();
        self.matrix.add_mul_transpose(-1.0, &x[..split], &mut out[..split]);
        for (c, (contact, &node)) in self.contacts.iter().zip(&self.contact_nodes).enumerate() {
            let impulse = contact.dp_dw.transpose() / self.h;
            add_product(&impulse, x, 3 * node, out, self.row(c), 1);
            add_product(&-self.f_v(c).transpose(), x, self.row(c), out, 3 * node, 1);
            add_product(&-contact.df_dw.transpose(), x, self.row(c), out, self.row(c), 1);
        }
        for (k, row) in self.rows.iter().enumerate() {
            let at = self.joint_row(k);
            for (v, lever) in row.dofs() {
                add_scaled(row.direction * lever / self.h, x, v, out, at, 1);
                add_scaled(-self.joint_slope(k) * lever, x, at, out, v, 1);
            }
            add_scaled(-row.linear.f_gamma, x, at, out, at, 1);
        }
        self.subtract_spots_transpose(x, out);
    }

    /// `b ← system⁻¹ b`, by the factor of K.
    pub fn solve_system(&self, b: &mut [f64], columns: usize) {
        self.solve_velocities(b, columns);
        self.recover_impulses(b, columns);
    }

    /// The rows of `system⁻¹ b` that are velocities; the others stay as they are, for [`StageRecord::recover_impulses`].
    pub fn solve_velocities(&self, b: &mut [f64], columns: usize) {
        for (c, (contact, &node)) in self.contacts.iter().zip(&self.contact_nodes).enumerate() {
            let gain: Matrix3x4<f64> = contact.gain / self.h;
            add_within(&gain, b, self.row(c), 3 * node, columns);
        }
        for (k, row) in self.rows.iter().enumerate() {
            for (v, lever) in row.dofs() {
                add_scaled_within(row.direction * lever / (row.linear.f_gamma * self.h), b, self.joint_row(k), v, columns);
            }
        }
        self.eliminate_spots(b, columns);
        self.factor.solve_many(&mut b[..self.v.len() * columns], columns);
    }

    /// The other rows of `system⁻¹ b` after [`StageRecord::solve_velocities`].
    pub fn recover_impulses(&self, b: &mut [f64], columns: usize) {
        self.recover_spots(b, columns);
        for (c, (contact, &node)) in self.contacts.iter().zip(&self.contact_nodes).enumerate() {
            add_within(&-self.f_v(c), b, 3 * node, self.row(c), columns);
            replace(&contact.inverse, b, self.row(c), columns);
        }
        for (k, row) in self.rows.iter().enumerate() {
            let at = self.joint_row(k);
            row.dofs().for_each(|(v, lever)| add_scaled_within(-self.joint_slope(k) * lever, b, v, at, columns));
            b[at * columns..(at + 1) * columns].iter_mut().for_each(|x| *x /= row.linear.f_gamma);
        }
    }

    /// `b ← system⁻ᵀ b`, one column.
    pub fn solve_system_transpose(&self, b: &mut [f64]) {
        for (c, (contact, &node)) in self.contacts.iter().zip(&self.contact_nodes).enumerate() {
            replace(&contact.inverse.transpose(), b, self.row(c), 1);
            add_within(&-self.f_v(c).transpose(), b, self.row(c), 3 * node, 1);
        }
        for (k, row) in self.rows.iter().enumerate() {
            let at = self.joint_row(k);
            b[at] /= row.linear.f_gamma;
            row.dofs().for_each(|(v, lever)| b[v] -= self.joint_slope(k) * lever * b[at]);
        }
        self.eliminate_spots_transpose(b);
        self.factor.solve_transpose(&mut b[..self.v.len()]);
        self.recover_spots_transpose(b);
        for (c, (contact, &node)) in self.contacts.iter().zip(&self.contact_nodes).enumerate() {
            let gain = contact.gain.transpose() / self.h;
            add_within(&gain, b, 3 * node, self.row(c), 1);
        }
        for (k, row) in self.rows.iter().enumerate() {
            let pulled: f64 = row.dofs().map(|(v, lever)| lever * b[v]).sum();
            b[self.joint_row(k)] += row.direction / (row.linear.f_gamma * self.h) * pulled;
        }
    }

    /// `out += scale · ∂(r, F)/∂q̄ · q`, with `q` of nv rows.
    pub fn add_position_product(&self, scale: f64, q: &[f64], out: &mut [f64], columns: usize) {
        let split = self.v.len() * columns;
        self.dq.add_mul_many(-scale, q, &mut out[..split], columns);
        for (c, (contact, &node)) in self.contacts.iter().zip(&self.contact_nodes).enumerate() {
            add_product(&(contact.df_dq * scale), q, 3 * node, out, self.row(c), columns);
        }
        for (k, row) in self.rows.iter().enumerate() {
            row.dofs().for_each(|(v, lever)| add_scaled(scale * row.linear.f_q * lever, q, v, out, self.joint_row(k), columns));
        }
        self.add_spot_positions(scale, q, out, columns);
    }

    /// Of a stage by implicit Euler B and the blocks of P such that K⁻¹ ∂f/∂q̄ = K⁻¹ B − P/h, contacts condensed: P projects the nodes
    /// that touch onto their normals, and
    /// ```text
    /// B = ∂f/∂q̄ (w fixed) − ∂p/∂w F_w⁻¹ ∂F/∂q̄ (1 − P)/h + A P/h
    /// ```
    /// A closed contact resists along its normal by 1e7 times what else there is in K and in ∂f/∂q̄; of B and P all entries are of their natural size.
    /// `None` if two contacts of a node are closed.
    pub fn positions_beside_normals(&self) -> Option<(NodeMatrix, Vec<NodeBlock>)> {
        let (mut out, mut normals) = (self.dq.nodes.clone(), Vec::with_capacity(self.contacts.len()));
        for (contact, &node) in self.contacts.iter().zip(&self.contact_nodes) {
            let normal = contact.dp_dw.column(0).into_owned();
            let mut own = contact.gain * contact.df_dq * (-1.0 / self.h);
            let other = self.matrix.nodes.block(node, node);
            let resists = |a: usize| normal[a] * (0..3).map(|b| other[a][b] * normal[b]).sum::<f64>();
            if -self.h * normal.dot(&(own * normal)) > (0..3).map(resists).sum() {
                let along = normal * normal.transpose();
                own -= own * along;
                normals.push((node, [0, 1, 2].map(|a| [along[(a, 0)], along[(a, 1)], along[(a, 2)]])));
            }
            out.add_block(node, node, 1.0, &[0, 1, 2].map(|a| [own[(a, 0)], own[(a, 1)], own[(a, 2)]]));
        }
        normals.sort_unstable_by_key(|(node, _)| *node);
        if normals.windows(2).any(|pair| pair[0].0 == pair[1].0) {
            return None;
        }
        for (node, along) in &normals {
            out.add_columns_times(&self.matrix.nodes, *node, 1.0 / self.h, along);
        }
        Some((out, normals))
    }

    /// Whether the rows beyond those of velocities are of contacts of nodes alone.
    pub fn has_contacts_of_nodes_alone(&self) -> bool {
        self.rows.is_empty() && self.spots.is_empty()
    }

    /// `out += scale · (∂(r, F)/∂q̄)ᵀ · x`, one column.
    pub fn add_position_transpose(&self, scale: f64, x: &[f64], out: &mut [f64]) {
        self.dq.add_mul_transpose(-scale, &x[..self.v.len()], out);
        for (c, (contact, &node)) in self.contacts.iter().zip(&self.contact_nodes).enumerate() {
            add_product(&(contact.df_dq.transpose() * scale), x, self.row(c), out, 3 * node, 1);
        }
        for (k, row) in self.rows.iter().enumerate() {
            row.dofs().for_each(|(v, lever)| out[v] += scale * row.linear.f_q * lever * x[self.joint_row(k)]);
        }
        self.add_spot_positions_transpose(scale, x, out);
    }
}

/// A joint's friction or stop, or a coupling, at the root.
#[derive(Clone, Copy, Debug)]
pub(crate) struct RowRecord {
    /// Row of its degree of freedom.
    pub v: usize,
    /// Impulse on it per unit of γ.
    pub direction: f64,
    /// Row of the degree of freedom that leads, and its lever.
    pub lead: Option<(usize, f64)>,
    pub linear: RowLinear,
}

impl RowRecord {
    /// Rows of the degrees of freedom it acts on, with how much of them counts.
    fn dofs(&self) -> impl Iterator<Item = (usize, f64)> {
        std::iter::once((self.v, 1.0)).chain(self.lead)
    }
}

/// Row `to` of `out` += factor · row `from` of `x`.
fn add_scaled(factor: f64, x: &[f64], from: usize, out: &mut [f64], to: usize, columns: usize) {
    let source = &x[from * columns..(from + 1) * columns];
    out[to * columns..(to + 1) * columns].iter_mut().zip(source).for_each(|(o, x)| *o += factor * x);
}

/// Row `to` of `b` += factor · row `from`.
fn add_scaled_within(factor: f64, b: &mut [f64], from: usize, to: usize, columns: usize) {
    for k in 0..columns {
        b[to * columns + k] += factor * b[from * columns + k];
    }
}

/// `out[to..] += m x[from..]`.
#[inline(always)]
pub(super) fn add_product<const R: usize, const C: usize>(
    m: &SMatrix<f64, R, C>,
    x: &[f64],
    from: usize,
    out: &mut [f64],
    to: usize,
    columns: usize,
) {
    for (r, out) in out[to * columns..(to + R) * columns].chunks_exact_mut(columns).enumerate() {
        for (c, x) in x[from * columns..(from + C) * columns].chunks_exact(columns).enumerate() {
            let factor = m[(r, c)];
            out.iter_mut().zip(x).for_each(|(o, x)| *o += factor * x);
        }
    }
}

/// `b[to..] += m b[from..]`.
fn add_within<const R: usize, const C: usize>(m: &SMatrix<f64, R, C>, b: &mut [f64], from: usize, to: usize, columns: usize) {
    for k in 0..columns {
        let part = SVector::<f64, C>::from_fn(|r, _| b[(from + r) * columns + k]);
        let product = m * part;
        (0..R).for_each(|r| b[(to + r) * columns + k] += product[r]);
    }
}

/// `b[at..] ← m b[at..]`.
#[inline(always)]
pub(super) fn replace(m: &Matrix4<f64>, b: &mut [f64], at: usize, columns: usize) {
    for k in 0..columns {
        let product = m * SVector::<f64, 4>::from_fn(|r, _| b[(at + r) * columns + k]);
        (0..4).for_each(|r| b[(at + r) * columns + k] = product[r]);
    }
}
