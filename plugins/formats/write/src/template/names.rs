//! Finds variables that no context of a template has.
//!
//! A name is reported only if nothing can define it: neither the context nor a `set`, a loop or a macro of the
//! template. Names that the template tests with `is defined`, `default` or `if` may be missing.

use std::collections::{BTreeMap, BTreeSet};
use tera::ast::{Expr, ExprVal, Forloop, FunctionCall, LogicOperator, MacroDefinition, Node};

/// The shape of a value, as known before a run.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum ValueShape {
    /// Unknown: any field may exist.
    Any,
    /// A number or a string, without fields.
    Scalar,
    /// Exactly these fields.
    Record(BTreeMap<String, ValueShape>),
    /// Elements of one shape.
    List(Box<ValueShape>),
}

/// An unknown name.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Unknown {
    /// The variable as written in the template: `view.camera.width`.
    pub variable: String,
    /// Its shortest unknown prefix: `view.camera`.
    pub missing: String,
    /// The value that lacks the field; none for the context.
    pub parent: Option<String>,
    /// The known names at this position.
    pub known: Vec<String>,
}

/// Tera's variable with the whole context.
const WHOLE_CONTEXT: &str = "__tera_context";

impl ValueShape {
    /// A record of fields.
    pub fn record<K: Into<String>>(fields: impl IntoIterator<Item = (K, Self)>) -> Self {
        Self::Record(fields.into_iter().map(|(name, shape)| (name.into(), shape)).collect())
    }

    /// A list of elements.
    pub fn list(element: Self) -> Self {
        Self::List(Box::new(element))
    }
}

/// The first unknown variable of a template, given the shape of its context.
pub fn unknown(nodes: &[Node], macros: &[&MacroDefinition], context: &BTreeMap<String, ValueShape>) -> Option<Unknown> {
    let bodies = || std::iter::once(nodes).chain(macros.iter().map(|definition| definition.body.as_slice()));
    let mut facts = Facts::default();
    bodies().for_each(|body| facts.body(body));
    let mut walk = NameWalk { facts: &facts, scopes: vec![context.clone()], found: None };
    walk.body(nodes);
    for definition in macros {
        let arguments = definition.args.keys().map(|name| (name.clone(), ValueShape::Any));
        walk.scopes.push(arguments.collect());
        walk.body(&definition.body);
        walk.scopes.pop();
    }
    walk.found
}

/// The names that a template defines anywhere.
#[derive(Default)]
struct Facts {
    /// Names that the template sets.
    set: BTreeSet<String>,
    /// Variables that the template expects to be missing.
    tested: BTreeSet<String>,
}

impl Facts {
    fn body(&mut self, body: &[Node]) {
        for node in body {
            if let Node::Set(_, set) = node {
                self.set.insert(set.key.clone());
            }
            if let Node::If(condition, _) = node {
                condition.conditions.iter().for_each(|(_, condition, _)| self.condition(condition));
            }
            expressions(node).into_iter().for_each(|expr| self.expr(expr));
            bodies(node).into_iter().for_each(|body| self.body(body));
        }
    }

    /// An operand of `and` and `or`, where an undefined variable is false.
    fn condition(&mut self, expr: &Expr) {
        match &expr.val {
            ExprVal::Ident(name) => drop(self.tested.insert(name.clone())),
            ExprVal::Logic(logic) if matches!(logic.operator, LogicOperator::And | LogicOperator::Or) => {
                self.condition(&logic.lhs);
                self.condition(&logic.rhs);
            }
            _ => {}
        }
    }

    fn expr(&mut self, expr: &Expr) {
        match &expr.val {
            ExprVal::Ident(name) if expr.negated || expr.has_default_filter() => {
                self.tested.insert(name.clone());
            }
            ExprVal::Test(test) => drop(self.tested.insert(test.ident.clone())),
            // `"a" in b` tests whether `b` has the field.
            ExprVal::In(inside) => {
                if let ExprVal::Ident(container) = &inside.rhs.val {
                    self.tested.insert(format!("{container}."));
                }
            }
            ExprVal::Logic(_) => self.condition(expr),
            _ => {}
        }
        operands(expr).into_iter().for_each(|inner| self.expr(inner));
    }

    /// Whether the template handles the absence of a name.
    fn tests(&self, missing: &str) -> bool {
        self.tested.iter().any(|tested| match tested.strip_suffix('.') {
            Some(container) => missing.starts_with(container),
            None => tested.starts_with(missing),
        })
    }
}

/// Resolves names in the scopes of the surrounding loops.
struct NameWalk<'w> {
    facts: &'w Facts,
    /// The context, followed by the variables of loops or of a macro.
    scopes: Vec<BTreeMap<String, ValueShape>>,
    /// The first unknown name.
    found: Option<Unknown>,
}

impl NameWalk<'_> {
    fn body(&mut self, body: &[Node]) {
        for node in body {
            expressions(node).into_iter().for_each(|expr| self.expr(expr));
            match node {
                Node::Forloop(_, inner, _) => self.for_loop(inner),
                _ => bodies(node).into_iter().for_each(|body| self.body(body)),
            }
        }
    }

    fn for_loop(&mut self, node: &Forloop) {
        let container = match &node.container.val {
            ExprVal::Ident(name) if node.container.filters.is_empty() => self.look_up(name).unwrap_or(ValueShape::Any),
            _ => ValueShape::Any,
        };
        let element = match container {
            ValueShape::List(element) => *element,
            _ => ValueShape::Any,
        };
        let counters = ["index", "index0", "first", "last"].map(|name| (name, ValueShape::Scalar));
        let mut scope =
            BTreeMap::from([("loop".to_owned(), ValueShape::record(counters)), (node.value.clone(), element)]);
        scope.extend(node.key.clone().map(|key| (key, ValueShape::Scalar)));
        self.scopes.push(scope);
        self.body(&node.body);
        self.scopes.pop();
        node.empty_body.iter().for_each(|body| self.body(body));
    }

    fn expr(&mut self, expr: &Expr) {
        if let ExprVal::Ident(name) = &expr.val {
            self.name(name);
        }
        if let ExprVal::StringConcat(parts) = &expr.val {
            for part in &parts.values {
                match part {
                    ExprVal::Ident(name) => self.name(name),
                    ExprVal::FunctionCall(call) => call.args.values().for_each(|inner| self.expr(inner)),
                    _ => {}
                }
            }
        }
        operands(expr).into_iter().for_each(|inner| self.expr(inner));
    }

    /// Records an unknown name, if it is the first.
    fn name(&mut self, variable: &str) {
        if self.found.is_none()
            && let Err(unknown) = self.look_up(variable)
            && !self.facts.tests(&unknown.missing)
        {
            self.found = Some(unknown);
        }
    }

    /// The shape of a variable such as `views[0].camera["width"]`.
    fn look_up(&self, variable: &str) -> Result<ValueShape, Unknown> {
        let steps = steps(variable);
        let Some((root, rest)) = steps.split_first() else { return Ok(ValueShape::Any) };
        if self.facts.set.contains(&root.name) || root.name == WHOLE_CONTEXT {
            return Ok(ValueShape::Any);
        }
        let unknown = |end: usize, parent: Option<&str>, known: Vec<String>| Unknown {
            variable: variable.to_owned(),
            missing: variable[..end].to_owned(),
            parent: parent.map(str::to_owned),
            known,
        };
        let names = |fields: &BTreeMap<String, ValueShape>| fields.keys().cloned().collect::<Vec<_>>();
        let Some(mut shape) = self.scopes.iter().rev().find_map(|scope| scope.get(&root.name)).cloned() else {
            return Err(unknown(root.end, None, self.scopes.iter().flat_map(names).collect()));
        };
        let mut before = root.end;
        for step in rest {
            let index = step.computed || step.name.parse::<usize>().is_ok();
            shape = match shape {
                ValueShape::List(element) if index => *element,
                ValueShape::Record(fields) if !step.computed => match fields.get(&step.name) {
                    Some(field) => field.clone(),
                    None => return Err(unknown(step.end, Some(&variable[..before]), names(&fields))),
                },
                ValueShape::Scalar | ValueShape::List(_) => {
                    return Err(unknown(step.end, Some(&variable[..before]), Vec::new()));
                }
                ValueShape::Any | ValueShape::Record(_) => ValueShape::Any,
            };
            before = step.end;
        }
        Ok(shape)
    }
}

/// A step in a variable: a field, or an index in brackets.
struct NameStep {
    name: String,
    /// Whether the index is the value of another variable.
    computed: bool,
    /// Bytes of the variable up to its end.
    end: usize,
}

/// The parts of a variable.
fn steps(variable: &str) -> Vec<NameStep> {
    let mut parts = Vec::new();
    let mut at = 0;
    while at < variable.len() {
        let rest = &variable[at..];
        if let Some(inside) = rest.strip_prefix('[') {
            let length = closing(inside);
            let text = &inside[..length];
            let quoted = text.starts_with(['"', '\'', '`']);
            let computed = !quoted && text.parse::<usize>().is_err();
            at = (at + length + 2).min(variable.len());
            parts.push(NameStep { name: text.trim_matches(['"', '\'', '`']).to_owned(), computed, end: at });
        } else {
            at += usize::from(rest.starts_with('.'));
            let length = variable[at..].find(['.', '[']).unwrap_or(variable.len() - at);
            at += length;
            parts.push(NameStep { name: variable[at - length..at].to_owned(), computed: false, end: at });
        }
    }
    parts
}

/// Length of the text before the closing bracket.
fn closing(inside: &str) -> usize {
    let mut depth = 0;
    for (at, letter) in inside.char_indices() {
        match letter {
            '[' => depth += 1,
            ']' if depth == 0 => return at,
            ']' => depth -= 1,
            _ => {}
        }
    }
    inside.len()
}

/// The expressions of a node, without the expressions of nested nodes.
fn expressions(node: &Node) -> Vec<&Expr> {
    match node {
        Node::VariableBlock(_, expr) => vec![expr],
        Node::Set(_, set) => vec![&set.value],
        Node::FilterSection(_, section, _) => arguments(&section.filter),
        Node::Forloop(_, inner, _) => vec![&inner.container],
        Node::If(condition, _) => condition.conditions.iter().map(|(_, condition, _)| condition).collect(),
        _ => Vec::new(),
    }
}

/// The bodies inside a node.
fn bodies(node: &Node) -> Vec<&[Node]> {
    match node {
        Node::FilterSection(_, section, _) => vec![&section.body],
        Node::Block(_, block, _) => vec![&block.body],
        Node::Forloop(_, inner, _) => {
            std::iter::once(&inner.body).chain(&inner.empty_body).map(Vec::as_slice).collect()
        }
        Node::If(condition, _) => {
            let branches = condition.conditions.iter().map(|(_, _, body)| body.as_slice());
            branches.chain(condition.otherwise.iter().map(|(_, body)| body.as_slice())).collect()
        }
        _ => Vec::new(),
    }
}

/// The expressions inside an expression.
fn operands(expr: &Expr) -> Vec<&Expr> {
    let mut inner: Vec<&Expr> = match &expr.val {
        ExprVal::Math(math) => vec![&math.lhs, &math.rhs],
        ExprVal::Logic(logic) => vec![&logic.lhs, &logic.rhs],
        ExprVal::In(inside) => vec![&inside.lhs, &inside.rhs],
        ExprVal::Test(test) => test.args.iter().collect(),
        ExprVal::MacroCall(call) => call.args.values().collect(),
        ExprVal::FunctionCall(call) => arguments(call),
        ExprVal::Array(items) => items.iter().collect(),
        _ => Vec::new(),
    };
    inner.extend(expr.filters.iter().flat_map(arguments));
    inner
}

/// The arguments of a call, in the order of their names.
fn arguments(call: &FunctionCall) -> Vec<&Expr> {
    let by_name: BTreeMap<&String, &Expr> = call.args.iter().collect();
    by_name.into_values().collect()
}
