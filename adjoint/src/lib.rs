//! Adjoint.
