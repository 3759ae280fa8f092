//! Evaluates the formulas of the printed lists: numbers, names, `{names of any text}`, functions of one argument,
//! parentheses, a sign, `+ - * / ^`, and the comparisons `< >`, which are 1 or 0.
//!
//! The crates that evaluate formulas bring parsers of regular expressions with them. To compile those for these few
//! formulas took 30 s of a processor.

/// The operators. Each one has precedence over those before it, so `a*b/c` is `a*(b/c)`.
const OPERATORS: &str = "<>+-*/^";

type Function = fn(f64) -> f64;
/// The functions, by name.
#[rustfmt::skip]
const FUNCTIONS: [(&str, Function); 8] = [
    ("abs", f64::abs), ("atan", f64::atan), ("cos", f64::cos), ("exp", f64::exp),
    ("ln", f64::ln), ("sin", f64::sin), ("sqrt", f64::sqrt), ("tan", f64::tan),
];

/// Returns the value of a formula; `value` gives the values of its names.
pub fn evaluate(formula: &str, value: &dyn Fn(&str) -> Option<f64>) -> Option<f64> {
    let mut formula = Formula { rest: formula.trim_start(), value };
    let result = formula.operation(0)?;
    formula.rest.is_empty().then_some(result)
}

struct Formula<'a> {
    /// The text that has not been read yet; it does not begin with a space.
    rest: &'a str,
    value: &'a dyn Fn(&str) -> Option<f64>,
}

impl<'a> Formula<'a> {
    /// Takes this many bytes, and the spaces after them.
    fn take(&mut self, bytes: usize) -> &'a str {
        let (taken, rest) = self.rest.split_at(bytes);
        self.rest = rest.trim_start();
        taken
    }

    /// Reads operands that are joined by operators of this rank or above.
    fn operation(&mut self, least: usize) -> Option<f64> {
        let mut left = self.operand()?;
        let rank = |rest: &str| OPERATORS.find(rest.chars().next()?);
        while let Some(rank) = rank(self.rest).filter(|rank| *rank >= least) {
            let operator = self.take(1);
            let right = self.operation(rank + 1)?;
            left = match operator {
                "<" => f64::from(left < right),
                ">" => f64::from(left > right),
                "+" => left + right,
                "-" => left - right,
                "*" => left * right,
                "/" => left / right,
                _ => left.powf(right),
            };
        }
        Some(left)
    }

    fn operand(&mut self) -> Option<f64> {
        match self.rest.chars().next()? {
            '-' => {
                self.take(1);
                Some(-self.operand()?)
            }
            '(' => {
                self.take(1);
                let inner = self.operation(0)?;
                self.rest.starts_with(')').then(|| self.take(1))?;
                Some(inner)
            }
            '{' => {
                let name = self.take(self.rest.find('}')? + 1);
                (self.value)(&name[1..name.len() - 1])
            }
            _ => {
                let ends = |c: char| !c.is_alphanumeric() && c != '_' && c != '.';
                match self.take(self.rest.find(ends).unwrap_or(self.rest.len())) {
                    "PI" => Some(std::f64::consts::PI),
                    "TAU" => Some(std::f64::consts::TAU),
                    function if self.rest.starts_with('(') => {
                        let x = self.operand()?;
                        FUNCTIONS.iter().find(|(name, _)| *name == function).map(|(_, of)| of(x))
                    }
                    text => text.parse().ok().or_else(|| (self.value)(text)),
                }
            }
        }
    }
}
