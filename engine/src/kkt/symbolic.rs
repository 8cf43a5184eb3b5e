//! What is known about a system before its numbers: made once per model, shared.

use super::driven::CouplingPattern;
use super::fronts::Fronts;
use super::layout::{NodeLayout, Pattern};
use super::{KktError, Method, NodeMatrix, Symmetry};
use std::sync::Arc;

/// Method, symmetry, sizes and driven nodes of a system, and the analysis of its pattern. Cheap to clone.
#[derive(Clone, Debug)]
pub struct Symbolic {
    pub(super) shared: Arc<Shared>,
}

#[derive(Debug)]
pub(super) struct Shared {
    pub method: Method,
    pub symmetry: Symmetry,
    pub layout: Arc<NodeLayout>,
    /// Slot by slot.
    pub driven: Vec<bool>,
    /// Blocks of K_fp; empty unless symmetric.
    pub coupling: CouplingPattern,
    /// Only for [`Method::Sparse`].
    pub fronts: Option<Fronts>,
}

impl Symbolic {
    /// Analyses systems of that layout. `driven[i]`: node i has identity rows.
    pub fn new(method: Method, symmetry: Symmetry, layout: &Arc<NodeLayout>, driven: &[bool]) -> Result<Self, KktError> {
        if driven.len() != layout.n_nodes() {
            return Err(KktError::Shape { what: "driven flags", expected: layout.n_nodes(), found: driven.len() });
        }
        if symmetry == Symmetry::Symmetric && layout.block() != 3 {
            return Err(KktError::Twists);
        }
        if method == Method::Band && !matches!(layout.pattern, Pattern::Band(_)) {
            return Err(KktError::NoBand);
        }
        let driven = layout.by_slot(driven);
        let coupling = match symmetry {
            Symmetry::Symmetric => CouplingPattern::new(layout, &driven),
            Symmetry::General => CouplingPattern::default(),
        };
        let fronts = match (method, symmetry) {
            (Method::Sparse, Symmetry::Symmetric) => Some(Fronts::new(layout, true, &driven)?),
            (Method::Sparse, Symmetry::General) => Some(Fronts::new(layout, false, &vec![false; driven.len()])?),
            (Method::Band | Method::Dense, _) => None,
        };
        Ok(Self { shared: Arc::new(Shared { method, symmetry, layout: Arc::clone(layout), driven, coupling, fronts }) })
    }

    /// How matrices are factored.
    pub fn method(&self) -> Method {
        self.shared.method
    }

    /// What is assumed of them.
    pub fn symmetry(&self) -> Symmetry {
        self.shared.symmetry
    }

    /// Number of scalar rows.
    pub fn dim(&self) -> usize {
        self.shared.layout.dim()
    }
}

impl Shared {
    pub fn check(&self, a: &NodeMatrix) -> Result<(), KktError> {
        if Arc::ptr_eq(a.layout(), &self.layout) || **a.layout() == *self.layout {
            return Ok(());
        }
        Err(KktError::Shape { what: "rows of the matrix (or their pattern)", expected: self.layout.dim(), found: a.dim() })
    }
}
