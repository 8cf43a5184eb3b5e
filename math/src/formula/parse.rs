//! From a text to the parts of a formula, by recursive descent.
//!
//! ```text
//! comparison  sum [(< | <= | > | >=) sum]
//! sum         product {(+ | −) product}
//! product     signed {(* | /) signed}
//! signed      (+ | −) signed | power
//! power       atom [** signed]
//! atom        number | name | function(comparison, …) | (comparison)
//! ```

use super::{DEEPEST, FUNCTIONS, FormulaError, Kind, MOST_PARTS, Operator, PI, Part};
use crate::params::edit_distance;

const VALUE: &str = "a number, a name or `(`";

/// A word of the text and where it begins: its character, from 1.
#[derive(Clone, Debug, PartialEq)]
struct Token {
    at: usize,
    text: String,
}

impl Token {
    fn is_name(&self) -> bool {
        self.text.starts_with(|c: char| c.is_alphabetic() || c == '_')
    }

    fn is_number(&self) -> bool {
        self.text.starts_with(|c: char| c.is_ascii_digit() || c == '.')
    }
}

/// The parts of a formula with these names.
pub(super) fn formula(text: &str, names: &[&str]) -> Result<Part, FormulaError> {
    let tokens = tokens(text)?;
    if tokens.is_empty() {
        return Err(FormulaError::Empty);
    }
    let mut parser = Parser { tokens, next: 0, names, parts: 0, open: 0 };
    let root = parser.comparison()?;
    match parser.peek() {
        Some(rest) => Err(unexpected(rest, "an operator or the end")),
        None => Ok(root),
    }
}

fn tokens(text: &str) -> Result<Vec<Token>, FormulaError> {
    let letters: Vec<char> = text.chars().collect();
    let (mut out, mut k) = (Vec::new(), 0);
    while let Some(&c) = letters.get(k) {
        let next = |j: usize| letters.get(j).copied().unwrap_or(' ');
        let length = match c {
            c if c.is_whitespace() => {
                k += 1;
                continue;
            }
            c if c.is_alphabetic() || c == '_' => letters[k..].iter().take_while(|c| c.is_alphanumeric() || **c == '_').count(),
            c if c.is_ascii_digit() || (c == '.' && next(k + 1).is_ascii_digit()) => number_length(&letters[k..]),
            '*' if next(k + 1) == '*' => 2,
            '<' | '>' if next(k + 1) == '=' => 2,
            '+' | '-' | '*' | '/' | '(' | ')' | ',' | '<' | '>' => 1,
            found => return Err(FormulaError::Character { at: k + 1, found }),
        };
        out.push(Token { at: k + 1, text: letters[k..k + length].iter().collect() });
        k += length;
    }
    Ok(out)
}

/// Digits, a point, an exponent with its sign, and letters that do not belong there but stand without a gap.
fn number_length(letters: &[char]) -> usize {
    let mut k = 0;
    while let Some(c) = letters.get(k) {
        let sign_of_exponent = matches!(c, '+' | '-') && k > 0 && matches!(letters[k - 1], 'e' | 'E');
        if !(c.is_alphanumeric() || matches!(c, '.' | '_') || sign_of_exponent) {
            break;
        }
        k += 1;
    }
    k
}

struct Parser<'a> {
    tokens: Vec<Token>,
    next: usize,
    names: &'a [&'a str],
    parts: usize,
    /// Rules that wait for one inside them.
    open: usize,
}

fn unexpected(token: &Token, wanted: &'static str) -> FormulaError {
    FormulaError::Unexpected { at: token.at, found: token.text.clone(), wanted }
}

impl Parser<'_> {
    fn peek(&self) -> Option<&Token> {
        self.tokens.get(self.next)
    }

    /// The next word, if it is one of these.
    fn take(&mut self, words: &[&str]) -> Option<Token> {
        let token = self.peek().filter(|token| words.contains(&token.text.as_str()))?.clone();
        self.next += 1;
        Some(token)
    }

    fn expect(&mut self, word: &str, wanted: &'static str) -> Result<(), FormulaError> {
        match (self.take(&[word]), self.peek()) {
            (Some(_), _) => Ok(()),
            (None, Some(other)) => Err(unexpected(other, wanted)),
            (None, None) => Err(FormulaError::End { wanted }),
        }
    }

    /// A part at this character; a number where nothing in it depends on a name.
    fn part(&mut self, at: usize, kind: Kind) -> Result<Part, FormulaError> {
        self.parts += 1;
        if self.parts > MOST_PARTS {
            return Err(FormulaError::Long);
        }
        let inside: Vec<&Part> = match &kind {
            Kind::Number(_) | Kind::Name(_) => Vec::new(),
            Kind::Negative(of) => vec![of.as_ref()],
            Kind::Operator(_, sides) => sides.iter().collect(),
            Kind::Function(_, of) => of.iter().collect(),
        };
        let depth = 1 + inside.iter().map(|part| part.depth).max().unwrap_or(0);
        if depth > DEEPEST {
            return Err(FormulaError::Deep { at });
        }
        let constant = !inside.is_empty() && inside.iter().all(|part| matches!(part.kind, Kind::Number(_)));
        let part = Part { kind, depth };
        if !constant {
            return Ok(part);
        }
        let value = part.eval::<f64>(&[]);
        if !value.is_finite() {
            return Err(FormulaError::NotFinite { at, value });
        }
        Ok(Part { kind: Kind::Number(value), depth: 1 })
    }

    fn operator(&mut self, token: &Token, a: Part, b: Part) -> Result<Part, FormulaError> {
        let operator = match token.text.as_str() {
            "+" => Operator::Add,
            "-" => Operator::Subtract,
            "*" => Operator::Multiply,
            "/" => Operator::Divide,
            "**" => Operator::Power,
            "<" => Operator::Less,
            "<=" => Operator::LessOrEqual,
            ">" => Operator::Greater,
            _ => Operator::GreaterOrEqual,
        };
        self.part(token.at, Kind::Operator(operator, Box::new([a, b])))
    }

    fn comparison(&mut self) -> Result<Part, FormulaError> {
        const SIGNS: [&str; 4] = ["<", "<=", ">", ">="];
        let first = self.sum()?;
        let Some(sign) = self.take(&SIGNS) else { return Ok(first) };
        let second = self.sum()?;
        match self.take(&SIGNS) {
            Some(again) => Err(FormulaError::Chain { at: again.at, found: again.text }),
            None => self.operator(&sign, first, second),
        }
    }

    fn sum(&mut self) -> Result<Part, FormulaError> {
        let mut left = self.product()?;
        while let Some(sign) = self.take(&["+", "-"]) {
            let right = self.product()?;
            left = self.operator(&sign, left, right)?;
        }
        Ok(left)
    }

    fn product(&mut self) -> Result<Part, FormulaError> {
        let mut left = self.signed()?;
        while let Some(sign) = self.take(&["*", "/"]) {
            let right = self.signed()?;
            left = self.operator(&sign, left, right)?;
        }
        Ok(left)
    }

    fn signed(&mut self) -> Result<Part, FormulaError> {
        self.open += 1;
        if self.open > DEEPEST {
            return Err(FormulaError::Deep { at: self.peek().map_or(0, |token| token.at) });
        }
        let part = match self.take(&["+", "-"]) {
            None => self.power(),
            Some(sign) if sign.text == "+" => self.signed(),
            Some(sign) => self.signed().and_then(|of| self.part(sign.at, Kind::Negative(Box::new(of)))),
        };
        self.open -= 1;
        part
    }

    fn power(&mut self) -> Result<Part, FormulaError> {
        let base = self.atom()?;
        let Some(sign) = self.take(&["**"]) else { return Ok(base) };
        let exponent = self.signed()?;
        self.operator(&sign, base, exponent)
    }

    fn atom(&mut self) -> Result<Part, FormulaError> {
        let Some(token) = self.peek().cloned() else { return Err(FormulaError::End { wanted: VALUE }) };
        self.next += 1;
        if token.text == "(" {
            let inside = self.comparison()?;
            self.expect(")", "`)` or an operator")?;
            return Ok(inside);
        }
        if token.is_number() {
            let value = token.text.parse().ok().filter(|x: &f64| x.is_finite());
            let value = value.ok_or_else(|| FormulaError::Number { at: token.at, text: token.text.clone() })?;
            return self.part(token.at, Kind::Number(value));
        }
        match token.text.as_str() {
            "if" | "else" | "and" | "or" | "not" | "lambda" => Err(unexpected(&token, VALUE)),
            _ if !token.is_name() => Err(unexpected(&token, VALUE)),
            _ if self.take(&["("]).is_some() => self.call(&token),
            _ => self.name(&token),
        }
    }

    fn name(&mut self, token: &Token) -> Result<Part, FormulaError> {
        let (at, name) = (token.at, token.text.clone());
        if let Some(k) = self.names.iter().position(|known| *known == name) {
            return self.part(at, Kind::Name(k));
        }
        if name == PI {
            return self.part(at, Kind::Number(std::f64::consts::PI));
        }
        if FUNCTIONS.iter().any(|of| of.contains(&name.as_str())) {
            return Err(FormulaError::NotCalled { at, name });
        }
        let known = || self.names.iter().copied().chain([PI]);
        Err(FormulaError::Unknown { at, nearest: nearest(&name, known()), known: list(known()), name })
    }

    fn call(&mut self, token: &Token) -> Result<Part, FormulaError> {
        let (at, name) = (token.at, token.text.clone());
        if self.names.contains(&name.as_str()) || name == PI {
            return Err(FormulaError::Called { at, name });
        }
        let all = || FUNCTIONS.iter().copied().flatten().copied();
        let Some(function) = all().find(|known| *known == name) else {
            return Err(FormulaError::UnknownFunction { at, nearest: nearest(&name, all()), known: list(all()), name });
        };
        let mut arguments = Vec::new();
        if self.take(&[")"]).is_none() {
            loop {
                arguments.push(self.comparison()?);
                if self.take(&[","]).is_none() {
                    break;
                }
            }
            self.expect(")", "`)`, a comma or an operator")?;
        }
        let expected = 1 + FUNCTIONS.iter().position(|of| of.contains(&function)).unwrap_or(0);
        if arguments.len() != expected {
            return Err(FormulaError::Arguments { at, name, found: arguments.len(), expected });
        }
        self.part(at, Kind::Function(function, arguments))
    }
}

/// A known word that a typing error would make this one of.
fn nearest<'a>(word: &str, known: impl Iterator<Item = &'a str>) -> Option<String> {
    let limit = (word.chars().count() / 3).max(1) + 1;
    let near = known.map(|candidate| (edit_distance(word, candidate), candidate));
    let near = near.filter(|(distance, _)| *distance <= limit && *distance < word.chars().count());
    near.min_by_key(|(distance, _)| *distance).map(|(_, candidate)| candidate.to_owned())
}

fn list<'a>(words: impl Iterator<Item = &'a str>) -> String {
    words.map(|word| format!("`{word}`")).collect::<Vec<_>>().join(", ")
}
