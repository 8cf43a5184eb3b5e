//! Values against Rust's own, derivatives against differences, and every error with its words.
#![allow(clippy::unwrap_used)]

use super::*;
use num_dual::Dual64;

fn value(text: &str) -> f64 {
    Formula::parse(text, &[]).unwrap().eval::<f64>(&[])
}

#[track_caller]
fn refused(text: &str, mistake: &str, fix: &str) {
    let error = Formula::parse(text, &["q", "v", "stiffness"]).unwrap_err();
    assert!(error.to_string().contains(mistake), "{text}: {error}");
    assert!(error.fix().contains(fix), "{text}: {}", error.fix());
}

#[test]
fn operators_bind_as_in_python() {
    let x = 3.0_f64;
    let with = |text: &str| Formula::parse(text, &["x"]).unwrap().eval(&[x]);
    for (text, expected) in [
        ("1 + 2*3 - 4/8", 6.5),
        ("-2**2", -4.0),
        ("2**-1", 0.5),
        ("2**3**2", 512.0),
        ("(2**3)**2", 64.0),
        ("2 - 3 - 4", -5.0),
        ("8/4/2", 1.0),
        ("--2 + +1", 3.0),
        (".5e1", 5.0),
        ("2e-3", 0.002),
        ("cos(pi)", -1.0),
        ("1 < 2", 1.0),
        ("2*(1 >= 2)", 0.0),
        ("where(1 <= 1, 7, log(0 - 1 + 1.5))", 7.0),
        ("minimum(2, 3) + maximum(2, 3)*10", 32.0),
        ("hypot(3, 4)", 5.0),
        ("sign(-2) + abs(-3)", 2.0),
    ] {
        assert_eq!(value(text), expected, "{text}");
    }
    assert_eq!((with("-x**2"), with("2*x**-1"), with("x**0.5")), (-9.0, 2.0 / 3.0, 3.0_f64.sqrt()));
    assert_eq!((with("x**2.0"), with("x**(1 + 1)"), with("x > 2 + 1")), (9.0, 9.0, 0.0));
}

/// Every function, at points where it is smooth, on both sides of its kinks.
#[test]
fn derivatives_are_those_of_differences() {
    let h = 1e-6;
    let texts = [
        "sin(x)",
        "cos(x)",
        "tan(x)",
        "arcsin(x/2)",
        "arccos(x/2)",
        "arctan(x)",
        "sinh(x)",
        "cosh(x)",
        "tanh(x)",
        "exp(x)",
        "expm1(x)",
        "log(x + 2)",
        "log1p(x)",
        "sqrt(x + 2)",
        "abs(x)*x",
        "sign(x)*x",
        "arctan2(x, 0.5)",
        "hypot(x, 0.3)",
        "minimum(x, 0.1)",
        "maximum(x**3, 0.1)",
        "where(x > 0, x**2, -x)",
        "(x + 2)**x",
        "(x + 2)**-3",
        "x**3/(1 + x**2)",
        "(x + 2)**0.3 - 2.5*x",
        "abs(x)**1.5",
    ];
    for text in texts {
        let f = Formula::parse(text, &["x"]).unwrap();
        for x in [-0.7, 0.4, 0.9] {
            let slope = f.eval(&[Dual64::new(x, 1.0)]).eps;
            let difference = (f.eval(&[x + h]) - f.eval(&[x - h])) / (2.0 * h);
            assert!((slope - difference).abs() < 1e-8 * (1.0 + difference.abs()), "{text} at {x}: {slope}, not {difference}");
        }
    }
    let all: Vec<&str> = FUNCTIONS.iter().copied().flatten().copied().collect();
    let missing: Vec<&&str> = all.iter().filter(|name| !texts.iter().any(|text| text.contains(&format!("{name}(")))).collect();
    assert!(missing.is_empty(), "{missing:?}");
}

/// At rest: a speed, its square root and powers have finite slopes.
#[test]
fn slopes_where_there_is_none() {
    let names = ["x", "n"];
    for (text, slope) in [
        ("sqrt(x**2)*x", 0.0),
        ("abs(x)", 0.0),
        ("sign(x)", 0.0),
        ("x**0.5", 0.0),
        ("abs(x)**1.5", 0.0),
        ("abs(x)**n*sign(x)", 0.0),
        ("hypot(x, x)", 0.0),
        ("x**3 + x", 1.0),
        ("x**1", 1.0),
        ("minimum(x, 2*x)", 1.0),
    ] {
        let found = Formula::parse(text, &names).unwrap().eval(&[Dual64::new(0.0, 1.0), Dual64::from(1.7)]);
        assert_eq!((found.re, found.eps), (0.0, slope), "{text}");
    }
    let ends = Formula::parse("x**n", &names).unwrap();
    assert_eq!([0.0, 1.0, 2.0].map(|n| ends.eval::<f64>(&[0.0, n])), [1.0, 0.0, 0.0]);
    assert!(ends.eval::<f64>(&[-1.0, 2.0]).is_nan() && !ends.eval::<f64>(&[0.0, -1.0]).is_finite());
    assert!(Formula::parse("maximum(log(x), 0)", &names).unwrap().eval::<f64>(&[-1.0, 0.0]).is_nan());
}

#[test]
fn names_that_occur() {
    let f = Formula::parse("where(v > 0, stiffness, 2)*1e3", &["q", "v", "stiffness"]).unwrap();
    assert_eq!([0, 1, 2, 3].map(|k| f.uses(k)), [false, true, true, false]);
}

#[test]
fn every_error_has_its_words() {
    refused("  ", "is empty", "-c*v");
    refused("q^2", "character 2: `^`", "`**`");
    refused("q == 1", "character 3: `=`", "`<=`");
    refused("np.sin(q)", "character 3: `.`", "not `np.sin(q)`");
    refused("(q > 0) & (v > 0)", "character 9: `&`", "(q > 0)*(v > 0)");
    refused("q # v", "character 3: `#`", "parentheses");
    refused("2q", "character 1: `2q` is no number", "`*` between");
    refused("1.2.3 + q", "`1.2.3` is no number", "`0.5`");
    refused("1e999*q", "`1e999` is no number", "`1e-3`");
    refused("q v", "character 3: `v` stands where an operator or the end", "missing");
    refused("q*/v", "character 3: `/` stands where a number, a name or `(`", "missing");
    refused("q*(v + 1", "ends where `)` or an operator", "complete");
    refused("q*", "ends where a number", "complete");
    refused("sin(q, ", "ends where a number", "complete");
    refused("q if v > 0 else 1", "character 3: `if`", "where(condition");
    refused("not q", "character 1: `not`", "where(condition");
    refused("0 < q < 1", "character 7: `<` compares", "(a < b)*(b < c)");
    refused("-stifness*q", "character 2: there is no `stifness`", "`stiffness`? known here: `q`, `v`, `stiffness`, `pi`");
    refused("-k_of_mine*q", "there is no `k_of_mine`", "`parameters`");
    refused("sine(q)", "no function `sine`", "did you mean `sin`");
    refused("gamma(q)", "no function `gamma`", "use one of `sin`");
    refused("sin*q", "the function `sin` has no arguments", "sin(…)");
    refused("q(v + 1)", "`q` is a number, not a function", "`q*(…)`");
    refused("pi(v)", "`pi` is a number", "`pi*(…)`");
    refused("sin(q, v)", "`sin` has 2 argument(s) instead of 1", "give 1");
    refused("sin()", "0 argument(s)", "give 1");
    refused("where(q > 0, 1)", "2 argument(s) instead of 3", "where(condition");
    refused("q + 1/0", "character 6: this is inf", "division");
    refused("(-1)**0.5*q", "this is NaN", "undefined");
    refused(&vec!["q"; 101].join("+"), "more than 100 parts stand inside", "two forces");
    refused(&("(".repeat(120) + "q"), "more than 100 parts", "more simply");
    let sums = vec!["q*q*q*q*q"; 90].join("+");
    refused(&vec![format!("sin({sums})"); 3].join("*"), "more than 2000 parts", "more simply");
}

#[test]
fn known_names() {
    assert!(is_known("sin") && is_known("where") && is_known("pi") && !is_known("q"));
}
