//! Coupling of nodes and bodies in contact: the off-diagonal blocks of a [`crate::System`].

/// Rows of some nodes in the bodies' columns, and rows of the bodies in these nodes' columns.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Coupling {
    n_dofs: usize,
    nodes: Vec<usize>,
    /// Three rows per node of `n_dofs` numbers.
    upper: Vec<f64>,
    /// Likewise, transposed: number l of row a of a node stands in row l, column a.
    lower: Vec<f64>,
}

impl Coupling {
    /// Zero blocks between these nodes (in rising order) and `n_dofs` degrees of freedom.
    pub fn reset(&mut self, nodes: impl Iterator<Item = usize>, n_dofs: usize) {
        self.n_dofs = n_dofs;
        self.nodes.clear();
        self.nodes.extend(nodes);
        let size = 3 * self.nodes.len() * n_dofs;
        for data in [&mut self.upper, &mut self.lower] {
            data.clear();
            data.resize(size, 0.0);
        }
    }

    /// Whether nothing is coupled.
    #[inline]
    pub fn is_empty(&self) -> bool {
        self.nodes.is_empty()
    }

    /// Nodes that are coupled, in rising order.
    #[inline]
    pub fn nodes(&self) -> &[usize] {
        &self.nodes
    }

    /// Adds to row `axis` of `node`, column `dof`.
    #[inline]
    pub fn add_upper(&mut self, node: usize, axis: usize, dof: usize, value: f64) {
        if let Some(k) = self.place(node, axis, dof) {
            self.upper[k] += value;
        }
    }

    /// Adds to row `dof`, column `axis` of `node`.
    #[inline]
    pub fn add_lower(&mut self, dof: usize, node: usize, axis: usize, value: f64) {
        if let Some(k) = self.place(node, axis, dof) {
            self.lower[k] += value;
        }
    }

    fn place(&self, node: usize, axis: usize, dof: usize) -> Option<usize> {
        let k = self.nodes.binary_search(&node).ok();
        debug_assert!(k.is_some());
        Some((3 * k? + axis) * self.n_dofs + dof)
    }

    /// Rows of the coupled nodes: (row of the system, entries).
    fn rows<'a>(&'a self, data: &'a [f64]) -> impl Iterator<Item = (usize, &'a [f64])> {
        let rows = self.nodes.iter().flat_map(|node| (0..3).map(move |a| 3 * node + a));
        rows.zip(data.chunks_exact(self.n_dofs.max(1)))
    }

    /// Writes the upper block into the zeroed row-major `out` of `n_dofs` columns.
    pub(crate) fn spread_upper(&self, out: &mut [f64]) {
        for (row, entries) in self.rows(&self.upper) {
            out[row * self.n_dofs..(row + 1) * self.n_dofs].copy_from_slice(entries);
        }
    }

    /// Σ |a| y over a node's row of the upper block.
    pub(crate) fn upper_magnitude(&self, row: usize, y_bodies: &[f64]) -> f64 {
        let Ok(k) = self.nodes.binary_search(&(row / 3)) else { return 0.0 };
        let at = (3 * k + row % 3) * self.n_dofs;
        self.upper[at..at + self.n_dofs].iter().zip(y_bodies).map(|(a, y)| a.abs() * y).sum()
    }

    /// Σ |a| y over a degree of freedom's row of the lower block.
    pub(crate) fn lower_magnitude(&self, dof: usize, y_nodes: &[f64]) -> f64 {
        self.rows(&self.lower).map(|(row, entries)| entries[dof].abs() * y_nodes[row]).sum()
    }

    /// `y_nodes += scale · upper x_bodies`, row-major with `columns`.
    pub(crate) fn add_upper_product(&self, scale: f64, x: &[f64], y: &mut [f64], columns: usize) {
        for (row, entries) in self.rows(&self.upper) {
            let y = &mut y[row * columns..(row + 1) * columns];
            for (a, x) in entries.iter().zip(x.chunks_exact(columns)).filter(|(a, _)| **a != 0.0) {
                y.iter_mut().zip(x).for_each(|(y, x)| *y += scale * a * x);
            }
        }
    }

    /// `y_bodies += scale · lower x_nodes`.
    pub(crate) fn add_lower_product(&self, scale: f64, x: &[f64], y: &mut [f64], columns: usize) {
        for (row, entries) in self.rows(&self.lower) {
            let x = &x[row * columns..(row + 1) * columns];
            for (a, y) in entries.iter().zip(y.chunks_exact_mut(columns)).filter(|(a, _)| **a != 0.0) {
                y.iter_mut().zip(x).for_each(|(y, x)| *y += scale * a * x);
            }
        }
    }

    /// `y_bodies += scale · upperᵀ x_nodes`.
    pub(crate) fn add_upper_transpose(&self, scale: f64, x: &[f64], y: &mut [f64]) {
        for (row, entries) in self.rows(&self.upper) {
            y.iter_mut().zip(entries).for_each(|(y, a)| *y += scale * a * x[row]);
        }
    }

    /// `y_nodes += scale · lowerᵀ x_bodies`, row-major with `columns`.
    pub(crate) fn add_lower_transpose(&self, scale: f64, x: &[f64], y: &mut [f64], columns: usize) {
        for (row, entries) in self.rows(&self.lower) {
            let y = &mut y[row * columns..(row + 1) * columns];
            for (a, x) in entries.iter().zip(x.chunks_exact(columns)) {
                y.iter_mut().zip(x).for_each(|(y, x)| *y += scale * a * x);
            }
        }
    }
}
