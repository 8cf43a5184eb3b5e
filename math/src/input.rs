//! Derivatives of a map by named inputs: q, u, θ, z, and the state at the end of a step.

use nalgebra::SVector;
use num_dual::{Derivative, DualSVec64};

/// A quantity that a command, a force or an internal variable may depend on, by its index.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Input {
    /// A position dof at the start of the step.
    Q(usize),
    /// A control.
    U(usize),
    /// A parameter.
    Theta(usize),
    /// An internal variable at the start of the step.
    Z(usize),
    /// A position dof at the end of the step.
    QNext(usize),
    /// A velocity at the end of the step.
    VNext(usize),
    /// A commanded velocity, by its row.
    Command(usize),
}

/// Inputs that are differentiated at a time.
const DUALS: usize = 12;
/// A number with its derivatives by up to twelve inputs.
pub type Dual = DualSVec64<DUALS>;
/// The value of an input, with its derivatives.
type Get<'a> = &'a dyn Fn(Input) -> Dual;

/// Calls `visit(row, input, ∂of[row]/∂input)` for every row that `of` returns and each of `inputs`, whose values `value` gives.
pub fn differentiate(
    inputs: &[Input],
    value: &dyn Fn(Input) -> f64,
    of: &dyn Fn(Get) -> Vec<(usize, Dual)>,
    visit: &mut dyn FnMut(usize, Input, f64),
) {
    for inputs in inputs.chunks(DUALS) {
        let seeded = |input: Input| {
            let re = value(input);
            match inputs.iter().position(|i| *i == input) {
                Some(k) => {
                    let mut eps = SVector::<f64, DUALS>::zeros();
                    eps[k] = 1.0;
                    Dual::new(re, Derivative::some(eps))
                }
                None => Dual::from_re(re),
            }
        };
        for (row, command) in of(&seeded) {
            if let Some(eps) = command.eps.0 {
                inputs.iter().enumerate().for_each(|(k, input)| visit(row, *input, eps[k]));
            }
        }
    }
}
