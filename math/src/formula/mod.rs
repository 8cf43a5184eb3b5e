//! Formulas: a force that somebody writes as a text, evaluated with any scalar.
//!
//! The syntax is Python's, the names of functions are NumPy's, so that the same text can be evaluated by either:
//! ```text
//! numbers      2, 0.5, .5, 1e-3, pi
//! operators    +  -  *  /  **  unary −, ( ), and < <= > >= (1 where it holds, 0 elsewhere)
//! functions    sin cos tan arcsin arccos arctan arctan2 sinh cosh tanh exp expm1 log log1p sqrt abs sign hypot minimum maximum
//!              where(condition, there, elsewhere)
//! ```
//! As in Python `**` binds more tightly than the minus before it, and from the right. An exponent that is a number may have any base; one
//! that depends on a name needs a base ≥ 0. Of `where` only the part that counts is evaluated, so the other may be undefined.
//!
//! Where a function has no slope it is given one: `abs`, `sqrt`, `hypot` and powers between 0 and 1 have the slope 0 at 0, `sign` and
//! comparisons have it everywhere, `minimum` and `maximum` have that of their first argument where both are equal.
//!
//! It is a parser of our own because a formula has to be evaluated with dual numbers, whose derivatives are exact: `evalexpr`, `meval`
//! and `fasteval` evaluate with `f64` alone.
//!
//! ```
//! use num_dual::Dual64;
//! use pliant_math::formula::Formula;
//!
//! let drag = Formula::parse("-c*abs(v)*v", &["v", "c"])?;
//! assert_eq!(drag.eval(&[3.0, 0.5]), -4.5);
//! let slope = drag.eval(&[Dual64::new(3.0, 1.0), Dual64::from(0.5)]).eps;
//! assert_eq!(slope, -3.0); // ∂f/∂v = −2 c |v|
//! # Ok::<(), pliant_math::formula::FormulaError>(())
//! ```

mod error;
mod parse;
#[cfg(test)]
mod tests;

pub use error::FormulaError;

use crate::Real;

/// Functions of one argument, of two, and of three.
pub const FUNCTIONS: [&[&str]; 3] = [
    &[
        "sin", "cos", "tan", "arcsin", "arccos", "arctan", "sinh", "cosh", "tanh", "exp", "expm1", "log", "log1p", "sqrt", "abs",
        "sign",
    ],
    &["arctan2", "hypot", "minimum", "maximum"],
    &["where"],
];
/// The one name of a number.
pub const PI: &str = "pi";
/// Most parts (numbers, names, operators, functions) of a formula.
pub const MOST_PARTS: usize = 2000;
/// Most parts inside each other: evaluation goes into them one by one.
pub const DEEPEST: usize = 100;

/// Whether a name means something in every formula, so that nothing else may have it.
pub fn is_known(name: &str) -> bool {
    name == PI || FUNCTIONS.iter().any(|of| of.contains(&name))
}

/// A formula, read and ready to be evaluated.
#[derive(Clone, Debug, PartialEq)]
pub struct Formula {
    root: Part,
    names: Vec<bool>,
}

/// A part of a formula, and how many there are inside each other.
#[derive(Clone, Debug, PartialEq)]
struct Part {
    kind: Kind,
    depth: usize,
}

#[derive(Clone, Debug, PartialEq)]
enum Kind {
    Number(f64),
    Name(usize),
    Negative(Box<Part>),
    Operator(Operator, Box<[Part; 2]>),
    Function(&'static str, Vec<Part>),
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Operator {
    Add,
    Subtract,
    Multiply,
    Divide,
    Power,
    Less,
    LessOrEqual,
    Greater,
    GreaterOrEqual,
}

impl Formula {
    /// Reads a formula in which these names may occur.
    ///
    /// # Errors
    /// A text that is no formula, a name or function that is not known, a part that is no finite number.
    pub fn parse(text: &str, names: &[&str]) -> Result<Self, FormulaError> {
        let root = parse::formula(text, names)?;
        let mut used = vec![false; names.len()];
        root.mark(&mut used);
        Ok(Self { root, names: used })
    }

    /// Whether the name of this number occurs.
    pub fn uses(&self, name: usize) -> bool {
        self.names.get(name).copied().unwrap_or(false)
    }

    /// The value, for values of the names in the order in which they were given to [`Formula::parse`].
    ///
    /// Not finite where a function is not defined: a division by 0, `log(0)`, a power of a negative number.
    ///
    /// # Panics
    /// If there are fewer values than names.
    pub fn eval<S: Real>(&self, values: &[S]) -> S {
        self.root.eval(values)
    }
}

impl Part {
    fn mark(&self, used: &mut [bool]) {
        match &self.kind {
            Kind::Number(_) => {}
            Kind::Name(k) => used[*k] = true,
            Kind::Negative(of) => of.mark(used),
            Kind::Operator(_, sides) => sides.iter().for_each(|side| side.mark(used)),
            Kind::Function(_, of) => of.iter().for_each(|part| part.mark(used)),
        }
    }

    fn eval<S: Real>(&self, values: &[S]) -> S {
        match &self.kind {
            Kind::Number(x) => S::from(*x),
            Kind::Name(k) => values[*k],
            Kind::Negative(of) => -of.eval(values),
            Kind::Operator(Operator::Power, sides) => match sides[1].kind {
                Kind::Number(exponent) => power(sides[0].eval(values), exponent),
                _ => power_of_both(sides[0].eval(values), sides[1].eval(values)),
            },
            Kind::Operator(operator, sides) => operate(*operator, sides[0].eval(values), sides[1].eval(values)),
            Kind::Function("where", of) => {
                let chosen = if of[0].eval(values).re() != 0.0 { 1 } else { 2 };
                of[chosen].eval(values)
            }
            Kind::Function(name, of) if of.len() == 1 => function(name, of[0].eval(values)),
            Kind::Function(name, of) => function_of_two(name, of[0].eval(values), of[1].eval(values)),
        }
    }
}

fn operate<S: Real>(operator: Operator, a: S, b: S) -> S {
    let holds = |holds: bool| if holds { S::one() } else { S::zero() };
    match operator {
        Operator::Add => a + b,
        Operator::Subtract => a - b,
        Operator::Multiply => a * b,
        Operator::Divide => a / b,
        Operator::Power => power_of_both(a, b),
        Operator::Less => holds(a.re() < b.re()),
        Operator::LessOrEqual => holds(a.re() <= b.re()),
        Operator::Greater => holds(a.re() > b.re()),
        Operator::GreaterOrEqual => holds(a.re() >= b.re()),
    }
}

fn function<S: Real>(name: &str, x: S) -> S {
    match name {
        "sin" => x.sin(),
        "cos" => x.cos(),
        "tan" => x.tan(),
        "arcsin" => x.asin(),
        "arccos" => x.acos(),
        "arctan" => x.atan(),
        "sinh" => x.sinh(),
        "cosh" => x.cosh(),
        "tanh" => x.tanh(),
        "exp" => x.exp(),
        "expm1" => x.exp_m1(),
        "log" => x.ln(),
        "log1p" => x.ln_1p(),
        // the slope of a root at 0 is infinite, and 0 times that is no number: at rest a speed would have no derivative
        "sqrt" if x.re() == 0.0 => S::zero(),
        "sqrt" => x.sqrt(),
        "abs" if x.re() < 0.0 => -x,
        "abs" if x.re() == 0.0 => S::zero(),
        "abs" => x,
        // of NaN it is NaN
        _ if x.re() == 0.0 => S::zero(),
        _ => S::from(x.re().signum()),
    }
}

fn function_of_two<S: Real>(name: &str, a: S, b: S) -> S {
    let undefined = a.re().is_nan() || b.re().is_nan();
    match name {
        "arctan2" => a.atan2(b),
        "hypot" => function("sqrt", a * a + b * b),
        _ if undefined => S::from(f64::NAN),
        "minimum" if b.re() < a.re() => b,
        "maximum" if b.re() > a.re() => b,
        _ => a,
    }
}

/// aⁿ of a number n.
fn power<S: Real>(a: S, n: f64) -> S {
    match whole(n) {
        Some(n) if n >= 0 => a.powi(n),
        // the powers of duals divide by the base, which may be 0
        Some(n) => S::one() / a.powi(-n),
        None if a.re() == 0.0 && n > 0.0 => S::zero(),
        None => a.powf(n),
    }
}

/// The exponent as a whole number, if it is one that a power by multiplication is exact enough for.
fn whole(n: f64) -> Option<i32> {
    (n.fract() == 0.0 && n.abs() <= 64.0).then_some(n as i32)
}

/// aᵇ = exp(b log a), a ≥ 0, with the limits at a = 0.
fn power_of_both<S: Real>(a: S, b: S) -> S {
    match (a.re() == 0.0, b.re()) {
        (true, 1.0) => a,
        (true, 0.0) => S::one(),
        (true, exponent) if exponent > 0.0 => S::zero(),
        _ => (a.ln() * b).exp(),
    }
}
