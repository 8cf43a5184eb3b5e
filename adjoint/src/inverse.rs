//! A and B of a step of nodes by implicit Euler: rows of the inverse of its system times the sparse partials, in place of a solve for
//! every column of both.
//!
//! With M the system whose contacts are not condensed ([`StageRecord::subtract_system`]), (r, F) its residuals and [G H] the rows of M⁻¹ that
//! are velocities (M has identity rows where nodes are prescribed),
//! ```text
//! ∂v⁺/∂v = G σM (zero in prescribed columns),   ∂v⁺/∂q̄ = G ∂f/∂q̄ − H ∂F/∂q̄,   ∂v⁺/∂v_cmd = the prescribed columns of G
//! ```
//! with q̄ = q + h v⁺. Edges carry rods' axes along by S_a = 1 + ψ_a before and S_b = 1 + ψ_b after the step
//! ([`TransportDerivative`]; both are 1 elsewhere), and ∂f/∂q̄ stands for ∂f/∂q̄ S_b at q̄ ([`StageRecord::carried_positions`]), so that with
//! V = ∂v⁺/∂q̄
//! ```text
//! ∂v⁺/∂q = V S_a,   ∂q⁺/∂q = S_b (1 + h V) S_a,   ∂q⁺/∂v = h S_b ∂v⁺/∂v
//! ```
//!
//! **Where nothing but contacts depends on velocities** (F_v = ∂F/∂v⁺, positions as they are), V needs no product: M's columns of velocities
//! are [D; F_v] − h ∂(−f, F)/∂q̄ with D = σ m in free columns and 1 in prescribed ones, hence
//! ```text
//! V = (G D + H F_v − 1)/h
//! ```
//! In the blocks on its diagonal the difference may lose all digits of nodes that stick or that hardly anything holds, and the product
//! those of stiff ones: there of both the one is taken that adds up smaller numbers. With damping V is the product, for sheets; ropes
//! and rods with damping are linearized the general way.
//!
//! **Rows of the inverse.** Without contacts G is K⁻¹, which the fronts of sheets give without solves. With contacts, which are 1e7 times
//! stiffer than the rest, ropes and rods solve for the columns of [G H]ᵀ and refine them. Fronts would be slow at that; sheets keep to
//! G = K⁻¹, contacts condensed, and take H F_v and H ∂F/∂q̄ from it with the part along the normal split off
//! ([`StageRecord::positions_beside_normals`]). Where a probe shows that refinement would change anything, or two shapes hold a node, such a
//! step is linearized the general way.

use crate::implicit::{Refinement, refinements, settled, worth_refining};
use crate::linearization::{Linearization, VECTOR};
use crate::stage::Context;
use pliant_engine::rods::TransportDerivative;
use pliant_engine::step::{EULER, NodeBlock, StageKind, StageRecord, StepRecord};
use pliant_linalg::{NodeMatrix, Sums};
use pliant_math::Input;
use std::borrow::Cow;

/// Memory, kept from one step to the next.
#[derive(Clone, Debug, Default)]
pub(crate) struct Inverse {
    /// G, row-major.
    rows: Vec<f64>,
    /// [G H]ᵀ, row-major in rows of `columns`, where rows are solved for; Gᵀ where V is a product.
    transposed: Vec<f64>,
    columns: usize,
    refinement: Refinement,
    /// V, where it comes from `transposed`; its blocks on the diagonal are chosen later.
    by_position: Vec<f64>,
    /// Vᵀ, on the way there.
    moved: Vec<f64>,
    /// σ m of every column; zero in prescribed ones.
    momentum: Vec<f64>,
    /// D/h of every column, and its entries of V's blocks on the diagonal: three of a node's, one of a twist's.
    scale: Vec<f64>,
    own: Vec<Sums>,
    difference: Vec<Sums>,
    contacts: Vec<Contact<4>>,
    condensed: Vec<Contact<3>>,
}

/// A contact's part of V, from `N` columns of [G H].
#[derive(Clone, Copy, Debug)]
struct Contact<const N: usize> {
    /// First row of its node.
    node: usize,
    /// First of the columns.
    from: usize,
    /// F_v/h; of a condensed contact H F_v/h = G × this.
    rates: [[f64; 3]; N],
    /// ∂F/∂q̄, unless condensed.
    by_q: [[f64; 3]; N],
}

impl Contact<3> {
    /// Adds H F_v/h to a row of V, from that of G.
    #[inline]
    fn add(&self, row: &[f64], v: &mut [f64]) {
        let (Some(x), Some(to)) = (row[self.from..].first_chunk::<3>(), v[self.node..].first_chunk_mut::<3>()) else { return };
        for (x, rates) in x.iter().zip(&self.rates) {
            to.iter_mut().zip(rates).for_each(|(to, rate)| *to += x * rate);
        }
    }
}

impl Contact<4> {
    /// Adds (H F_v/h)ᵀ to Vᵀ, from [G H]ᵀ; both in rows of `columns`.
    fn add_transposed(&self, transposed: &[f64], columns: usize, v: &mut [f64]) {
        let rows = &transposed[self.from * columns..(self.from + 4) * columns];
        for (c, to) in v[self.node * columns..(self.node + 3) * columns].chunks_exact_mut(columns).enumerate() {
            for (x, rates) in rows.chunks_exact(columns).zip(&self.rates) {
                let rate = rates[c];
                to.iter_mut().zip(x).for_each(|(to, x)| *to += x * rate);
            }
        }
    }
}

impl<const N: usize> Contact<N> {
    /// Adds its part of V's blocks on the diagonal, as a product and as a difference, for entries (row, column) of [G H].
    fn add_own(&self, at: impl Fn(usize, usize) -> f64, product: &mut [Sums], difference: &mut [Sums]) {
        let nodes = self.node..self.node + 3;
        let (product, difference) = (&mut product[nodes.clone()], &mut difference[nodes]);
        for (k, (by_q, rates)) in self.by_q.iter().zip(&self.rates).enumerate() {
            let entry = |r: usize| at(self.node + r, self.from + k);
            let x = [entry(0), entry(1), entry(2), 0.0];
            for c in 0..3 {
                product[c].add(x.map(|x| -x * by_q[c]));
                difference[c].add(x.map(|x| x * rates[c]));
            }
        }
    }
}

/// ∂f/∂q̄, and the blocks subtracted from V where normals were split off.
type Positions<'a> = (Cow<'a, NodeMatrix>, Vec<NodeBlock>);

/// The only stage of a step by implicit Euler of nodes alone, in which nothing but rods' axes is remembered.
fn stage_of<'a>(cx: Context, step: &'a StepRecord) -> Option<&'a StageRecord> {
    let [(StageKind::Single, stage)] = step.stages.as_slice() else { return None };
    let weights = stage.scheme.free == EULER.free && stage.scheme.prescribed == EULER.prescribed;
    let remembers = cx.model.ndz() > 0 || cx.model.has_actuators() || !stage.grasps.is_empty();
    let of_nodes = cx.model.nv() == cx.model.n_node_dofs() && stage.has_contacts_of_nodes_alone();
    (weights && !remembers && of_nodes && stage.transport.middle.is_identity()).then_some(stage)
}

/// Whether refinement changes the sum of all columns, as the general way asks.
fn probe_refines(cx: Context, step: &StepRecord, stage: &StageRecord) -> bool {
    let n = stage.v.len();
    let mut rhs = vec![0.0; stage.n_rows()];
    stage.add_position_product(-1.0, &vec![1.0; n], &mut rhs, 1);
    let prescribed = cx.model.prescribed_rows();
    for row in (0..n).filter(|row| !prescribed[*row]) {
        rhs[row] += cx.mass[row] * stage.inertia * stage.scheme.momentum;
    }
    for &(row, input, value) in &step.command {
        if matches!(input, Input::Q(_) | Input::U(_)) {
            rhs[row] += value;
        }
    }
    worth_refining(stage, rhs)
}

impl Inverse {
    /// A and B; C is empty. `None` for a step that is linearized the general way.
    pub fn linearize(&mut self, cx: Context, step: &StepRecord, nu: usize) -> Option<Linearization> {
        let stage = stage_of(cx, step)?;
        let (n, h) = (stage.v.len(), stage.h);
        self.contacts.clear();
        self.condensed.clear();
        let factor = &stage.jacobians.factor;
        let (positions, normals) = if factor.is_sparse() && !(stage.undamped && stage.n_rows() == n) {
            self.invert_condensed(cx, step, stage)?
        } else if !stage.undamped {
            return None;
        } else {
            if factor.is_sparse() || factor.is_symmetric() {
                self.invert(stage);
            } else {
                self.solve_rows(stage);
            }
            (stage.carried_positions(cx.model), Vec::new())
        };
        self.prepare(cx, stage, &positions, &normals);
        let inertia = stage.inertia * stage.scheme.momentum;
        self.momentum.clear();
        self.momentum.extend(cx.mass.iter().zip(cx.model.prescribed_rows()).map(|(m, d)| if *d { 0.0 } else { inertia * m }));
        let [begin, end, _] = &stage.transport.carry;
        let mut out = Linearization { a: self.by_state(stage, begin), b: vec![0.0; 2 * n * nu], c: Vec::new() };
        self.add_commands(step, h, nu, &mut out);
        end.add_after(&mut out.a[..2 * n * n], 2 * n);
        end.add_after(&mut out.b[..n * nu], nu);
        Some(out)
    }

    /// G without contacts or damping.
    fn invert(&mut self, stage: &StageRecord) {
        let n = stage.v.len();
        stage.jacobians.factor.inverse_of_nodes(&mut self.rows);
        if worth_refining(stage, vec![1.0; n]) {
            // X ← X + X (1 − K X)
            let defect = &mut self.refinement.defect;
            defect.clear();
            defect.resize(n * n, 0.0);
            (0..n).for_each(|k| defect[k * n + k] = 1.0);
            stage.subtract_system(&self.rows, defect, n);
            stage.solve_velocities(defect, n);
            self.rows.iter_mut().zip(defect).for_each(|(x, d)| *x += *d);
        }
    }

    /// G of a sheet with contacts condensed, or with damping; its transpose too where V is a product.
    fn invert_condensed<'a>(&mut self, cx: Context, step: &StepRecord, stage: &'a StageRecord) -> Option<Positions<'a>> {
        if probe_refines(cx, step, stage) {
            return None;
        }
        let (positions, normals) = stage.positions_beside_normals()?;
        let n = stage.v.len();
        self.columns = n;
        if stage.undamped {
            stage.jacobians.factor.inverse_of_nodes(&mut self.rows);
            stage.visit_contact_damping(|node, block| {
                let rates = block.map(|row| row.map(|x| x / stage.h));
                self.condensed.push(Contact { node: 3 * node, from: 3 * node, rates, by_q: [[0.0; 3]; 3] });
            });
        } else {
            stage.jacobians.factor.inverses_of_nodes(&mut self.rows, &mut self.transposed);
        }
        Some((Cow::Owned(positions), normals))
    }

    /// [G H]ᵀ from the columns of M⁻ᵀ, refined: X ← X + M⁻ᵀ ([1; 0] − Mᵀ X).
    fn solve_rows(&mut self, stage: &StageRecord) {
        let n = stage.v.len();
        let columns = n.next_multiple_of(VECTOR);
        self.columns = columns;
        stage.visit_contact_rates(|node, from, rates, by_q| {
            self.contacts.push(Contact { node, from, rates: rates.map(|row| row.map(|x| x / stage.h)), by_q });
        });
        stage.transposed_inverse(columns, &mut self.transposed);
        let (Refinement { defect, largest, .. }, split) = (&mut self.refinement, n * columns);
        // with contacts always: H has their stiffness in its numbers, and keeps nine digits if it is made of G
        let count = if stage.n_rows() > n || worth_refining(stage, vec![1.0; n]) { refinements(stage) } else { 0 };
        for _ in 0..count {
            defect.clear();
            defect.resize(self.transposed.len(), 0.0);
            (0..n).for_each(|k| defect[k * columns + k] = 1.0);
            stage.subtract_system_transpose_many(&self.transposed, defect, columns);
            stage.solve_system_transpose_many(defect, columns);
            // (H by itself: it is far smaller than G)
            let ([g, h], [dg, dh]) =
                ([&self.transposed[..split], &self.transposed[split..]], [&defect[..split], &defect[split..]]);
            let done = settled(g, dg, columns, largest) && settled(h, dh, columns, largest);
            self.transposed.iter_mut().zip(&*defect).for_each(|(x, d)| *x += *d);
            if done {
                break;
            }
        }
        transpose_into(&self.transposed, columns, &mut self.rows, n);
    }

    /// Whether V comes from [G H]ᵀ.
    fn has_columns(&self, stage: &StageRecord) -> bool {
        !stage.undamped || !self.contacts.is_empty()
    }

    /// V where it comes from [G H]ᵀ; and unless it is a product D/h and the blocks on its diagonal.
    fn prepare(&mut self, cx: Context, stage: &StageRecord, positions: &NodeMatrix, normals: &[NodeBlock]) {
        let (n, columns, per_h) = (stage.v.len(), self.columns, 1.0 / stage.h);
        if !stage.undamped {
            positions.transpose_times(&self.transposed, &mut self.moved, columns);
            transpose_into(&self.moved, columns, &mut self.by_position, n);
            for (node, along) in normals {
                for (r, c) in (0..9).map(|k| (k / 3, k % 3)) {
                    self.by_position[(3 * node + r) * n + 3 * node + c] -= along[r][c] * per_h;
                }
            }
            return;
        }
        let scale = |(m, prescribed): (&f64, &bool)| per_h * if *prescribed { 1.0 } else { stage.inertia * m };
        self.scale.clear();
        self.scale.extend(cx.mass.iter().zip(cx.model.prescribed_rows()).map(scale));
        self.choose_own(positions, normals, per_h);
        if self.has_columns(stage) {
            self.moved.clear();
            for (g, s) in self.transposed.chunks_exact(columns).zip(&self.scale) {
                self.moved.extend(g.iter().map(|g| g * s));
            }
            self.contacts.iter().for_each(|contact| contact.add_transposed(&self.transposed, columns, &mut self.moved));
            transpose_into(&self.moved, columns, &mut self.by_position, n);
        }
    }

    /// The blocks on V's diagonal: of the product and the difference the one that adds up smaller numbers, entry by entry.
    fn choose_own(&mut self, positions: &NodeMatrix, normals: &[NodeBlock], per_h: f64) {
        let (n, nodes) = (self.scale.len(), 3 * positions.layout().n_nodes());
        positions.diagonal_blocks_of_product(&self.rows, &mut self.own);
        self.difference.clear();
        for (c, scale) in self.scale.iter().enumerate() {
            let (first, rows) = if c < nodes { (c - c % 3, 3) } else { (c, 1) };
            let (mut moved, mut unit, mut sums) = ([0.0; 4], [0.0; 4], Sums::default());
            (0..rows).for_each(|r| moved[r] = self.rows[(first + r) * n + c] * scale);
            unit[c - first] = -per_h;
            sums.add(moved);
            sums.add(unit);
            self.difference.push(sums);
        }
        for contact in &self.contacts {
            contact.add_own(|r, c| self.transposed[c * self.columns + r], &mut self.own, &mut self.difference);
        }
        for contact in &self.condensed {
            contact.add_own(|r, c| self.rows[r * n + c], &mut self.own, &mut self.difference);
        }
        for (node, along) in normals {
            for c in 0..3 {
                let along = [along[0][c], along[1][c], along[2][c], 0.0];
                self.own[3 * node + c].add(along.map(|along| -along * per_h));
            }
        }
        for (own, difference) in self.own.iter_mut().zip(&self.difference) {
            for r in (0..3).filter(|r| difference.size[*r] < own.size[*r]) {
                own.value[r] = difference.value[r];
            }
        }
    }

    /// A, with the commands as they are and rods' axes not yet carried to the end. (Written in order: zeros to begin with would cost as much
    /// as half of it.)
    fn by_state(&self, stage: &StageRecord, begin: &TransportDerivative) -> Vec<f64> {
        let (n, nodes, h) = (self.momentum.len(), 3 * stage.jacobians.dq.nodes.layout().n_nodes(), stage.h);
        let mut a = Vec::with_capacity(4 * n * n);
        for (i, g) in self.rows.chunks_exact(n).enumerate() {
            let row = a.len();
            if self.has_columns(stage) {
                a.extend_from_slice(&self.by_position[i * n..(i + 1) * n]);
            } else {
                push_scaled(g, &self.scale, &mut a);
            }
            if stage.undamped {
                let v = &mut a[row..];
                self.condensed.iter().for_each(|contact| contact.add(g, v));
                let (own, r) = if i < nodes { (i - i % 3..i - i % 3 + 3, i % 3) } else { (i..i + 1, 0) };
                own.for_each(|c| v[c] = self.own[c].value[r]);
            }
            begin.pull_before(&mut a[row..]);
            push_scaled(g, &self.momentum, &mut a);
        }
        // so far the rows of v⁺
        a.extend_from_within(..);
        for (i, q) in a[..2 * n * n].chunks_exact_mut(2 * n).enumerate() {
            q.iter_mut().for_each(|q| *q *= h);
            begin.add_row(i, q);
        }
        a
    }

    /// Adds to A and B the effect of positions and controls on the commanded velocities.
    fn add_commands(&self, step: &StepRecord, h: f64, nu: usize, out: &mut Linearization) {
        let n = self.momentum.len();
        for &(row, input, value) in &step.command {
            let (to, width, column) = match input {
                Input::Q(k) => (&mut out.a, 2 * n, k),
                Input::U(k) => (&mut out.b, nu, k),
                Input::Z(_) | Input::Theta(_) | Input::QNext(_) | Input::VNext(_) | Input::Command(_) => continue,
            };
            for (i, g) in self.rows.chunks_exact(n).enumerate() {
                to[i * width + column] += h * (g[row] * value);
                to[(n + i) * width + column] += g[row] * value;
            }
        }
    }
}

/// Appends the numbers of a row, each times its scale.
fn push_scaled(row: &[f64], scale: &[f64], out: &mut Vec<f64>) {
    let from = out.len();
    out.extend_from_slice(row);
    out[from..].iter_mut().zip(scale).for_each(|(x, scale)| *x *= scale);
}

/// The square of the first `n` rows and columns of `from`, whose rows have `columns` numbers, transposed.
fn transpose_into(from: &[f64], columns: usize, to: &mut Vec<f64>, n: usize) {
    to.resize(n * n, 0.0);
    // squares that fit into the nearest cache, four rows of the result at a time
    for (first, to) in to.chunks_mut(n * TILE).enumerate() {
        for start in (0..n).step_by(TILE) {
            let end = n.min(start + TILE);
            for (k, rows) in to.chunks_mut(4 * n).enumerate() {
                let from = &from[start * columns + first * TILE + 4 * k..];
                if rows.len() < 4 * n {
                    for (r, row) in rows.chunks_exact_mut(n).enumerate() {
                        row[start..end].iter_mut().zip(from[r..].iter().step_by(columns)).for_each(|(to, from)| *to = *from);
                    }
                    continue;
                }
                let (ab, cd) = rows.split_at_mut(2 * n);
                let ((a, b), (c, d)) = (ab.split_at_mut(n), cd.split_at_mut(n));
                let to = a[start..end].iter_mut().zip(&mut b[start..end]).zip(&mut c[start..end]).zip(&mut d[start..end]);
                for (from, (((a, b), c), d)) in from.chunks(columns).zip(to) {
                    if let Some(from) = from.first_chunk::<4>() {
                        [*a, *b, *c, *d] = *from;
                    }
                }
            }
        }
    }
}

/// Rows and columns that are transposed together.
const TILE: usize = 16;
