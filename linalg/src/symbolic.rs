//! Symbolic analysis of a system: made once per model, shared.

use crate::layout::{NodeLayout, Pattern};
use crate::multifrontal;
use crate::prescribed::CouplingPattern;
use crate::{KktError, Method, NodeMatrix, Symmetry};
use std::sync::Arc;

/// Method, symmetry, sizes and prescribed nodes of a system, and the analysis of its pattern. Cheap to clone.
#[derive(Clone, Debug)]
pub struct Symbolic {
    pub(crate) shared: Arc<Shared>,
}

#[derive(Debug)]
pub(crate) struct Shared {
    pub method: Method,
    pub symmetry: Symmetry,
    pub layout: Arc<NodeLayout>,
    /// Slot by slot.
    pub prescribed: Vec<bool>,
    /// Blocks of K_fp; empty unless symmetric.
    pub coupling: CouplingPattern,
    /// Only for [`Method::Sparse`].
    pub multifrontal: Option<Arc<multifrontal::Symbolic>>,
}

impl Symbolic {
    /// Analyses systems of that layout. `prescribed[i]`: node i has identity rows.
    pub fn new(method: Method, symmetry: Symmetry, layout: &Arc<NodeLayout>, prescribed: &[bool]) -> Result<Self, KktError> {
        if prescribed.len() != layout.n_nodes() {
            return Err(KktError::Shape { what: "prescribed flags", expected: layout.n_nodes(), found: prescribed.len() });
        }
        if symmetry == Symmetry::Symmetric && layout.block() != 3 {
            return Err(KktError::Twists);
        }
        if method == Method::Band && !matches!(layout.pattern, Pattern::Band(_)) {
            return Err(KktError::NoBand);
        }
        let prescribed = layout.by_slot(prescribed);
        let coupling = match symmetry {
            Symmetry::Symmetric => CouplingPattern::new(layout, &prescribed),
            Symmetry::General => CouplingPattern::default(),
        };
        let multifrontal = match method {
            Method::Sparse => Some(Arc::new(multifrontal::Symbolic::new(layout, symmetry, &prescribed)?)),
            Method::Band | Method::Dense => None,
        };
        Ok(Self { shared: Arc::new(Shared { method, symmetry, layout: Arc::clone(layout), prescribed, coupling, multifrontal }) })
    }

    /// Method by which matrices are factored.
    pub fn method(&self) -> Method {
        self.shared.method
    }

    /// Assumed symmetry.
    pub fn symmetry(&self) -> Symmetry {
        self.shared.symmetry
    }

    /// Number of scalar rows.
    pub fn dim(&self) -> usize {
        self.shared.layout.dim()
    }

    /// The scalar rows in the order of their elimination; that of the layout in a band and in full matrices without pivoting.
    pub fn elimination_order(&self) -> Vec<usize> {
        let layout = &self.shared.layout;
        let slot = |at: usize| self.shared.multifrontal.as_ref().map_or(at, |fronts| fronts.slot(at));
        let slots = (0..layout.n_nodes()).map(slot);
        slots.flat_map(|slot| (0..layout.block()).filter_map(move |a| layout.system(layout.block() * slot + a))).collect()
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
