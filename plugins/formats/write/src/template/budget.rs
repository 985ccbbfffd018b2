//! The budget of a template: bytes of the values that it creates, and steps of its loops.
//!
//! Tera has no limits of its own, so this module inserts calls into the parsed template: one at the beginning of every
//! macro and every loop body, and one after every value that the template creates. The calls count, and fail beyond the
//! [limits](syntable_model::limits). A template is rendered by a single thread, so the counters are thread-local.

use serde_json::Value as Json;
use std::cell::{Cell, RefCell};
use std::collections::{BTreeSet, HashMap};
use syntable_model::limits::{Limit, TEMPLATE_LOOP_TEXT, TEMPLATE_STEPS, TEMPLATE_VALUE, TEMPLATE_WORK};
use tera::ast::{Expr, ExprVal, FunctionCall, Node, StringConcat, WS};
use tera::{Template, Tera};

/// Functions and filters that are inserted into a template.
const STEP: &str = "__step";
const OPEN: &str = "__open";
const CLOSE: &str = "__close";
const MADE: &str = "__made";
const LOOPED: &str = "__looped";
/// Inserted before a loop, at the beginning of each iteration, and after the loop.
const ENTER: &str = "__enter";
const TURN: &str = "__turn";
const LEAVE: &str = "__leave";
/// Prefix of the names above, which templates must not use.
const OWN: &str = "__";

/// Number of operands that are joined into one text at once. Each may be as long as a value.
const JOINED: usize = 8;

#[derive(Default)]
struct Spent {
    steps: u64,
    bytes: u64,
    /// Divisor of the limits of steps, of a value and of all values.
    divisor: u64,
    /// Bytes of each text that is currently built in memory, the innermost text last.
    open: Vec<u64>,
    /// The running loops, the innermost loop last: the number of each loop, and the number of texts that were open
    /// before it.
    loops: Vec<(u64, usize)>,
}

impl Spent {
    /// Closes the texts that `break` or `continue` left open in a loop. Returns the position of the loop in `loops`.
    fn close_texts_in(&mut self, number: u64) -> Option<usize> {
        let place = self.loops.iter().rposition(|(running, _)| *running == number)?;
        self.open.truncate(self.loops[place].1);
        Some(place)
    }
}

thread_local! {
    static SPENT: RefCell<Spent> = RefCell::default();
}

/// Resets the counters. All limits except the limit of [`LOOPED`] are divided by `divisor`, which is 1 except in tests.
pub fn start(divisor: u64) {
    SPENT.with_borrow_mut(|spent| *spent = Spent { divisor, ..Spent::default() });
}

/// Refuses a sum above a divided limit.
fn within_divided(limit: &Limit, sum: u64, divisor: u64) -> tera::Result<()> {
    if sum <= limit.most / divisor.max(1) { Ok(()) } else { Err(tera::Error::msg(limit.refuse(sum).to_string())) }
}

fn within(limit: &Limit, value: u64) -> tera::Result<()> {
    within_divided(limit, value, 1)
}

/// Refuses a value that is too large.
fn within_value(size: u64) -> tera::Result<()> {
    within_divided(&TEMPLATE_VALUE, size, SPENT.with_borrow(|spent| spent.divisor))
}

/// Counts steps.
pub fn steps(count: u64) -> tera::Result<()> {
    SPENT.with_borrow_mut(|spent| {
        spent.steps = spent.steps.saturating_add(count);
        within_divided(&TEMPLATE_STEPS, spent.steps, spent.divisor)
    })
}

/// Counts bytes of a value or of text in memory.
fn bytes(count: u64) -> tera::Result<()> {
    SPENT.with_borrow_mut(|spent| {
        within_divided(&TEMPLATE_VALUE, count, spent.divisor)?;
        spent.bytes = spent.bytes.saturating_add(count);
        within_divided(&TEMPLATE_WORK, spent.bytes, spent.divisor)?;
        match spent.open.last_mut() {
            Some(open) => {
                *open = open.saturating_add(count);
                within_divided(&TEMPLATE_VALUE, *open, spent.divisor)
            }
            None => Ok(()),
        }
    })
}

/// Bytes that a value in a list takes in addition to its text; about half of them are in use.
const OF_VALUE: u64 = 16;

/// Bytes of the texts of a value, plus an overhead for each value in it.
fn size(value: &Json) -> u64 {
    OF_VALUE
        + match value {
            Json::String(text) => text.len() as u64,
            Json::Array(values) => values.iter().map(size).sum(),
            Json::Object(fields) => fields.iter().map(|(name, value)| name.len() as u64 + size(value)).sum(),
            _ => 0,
        }
}

/// Maximum size of the result of a filter that lengthens text.
type FilterGrowth = fn(&str, &HashMap<String, Json>) -> u64;

fn argument<'a>(arguments: &'a HashMap<String, Json>, name: &str) -> &'a str {
    arguments.get(name).and_then(Json::as_str).unwrap_or_default()
}

/// Arguments of the inserted calls: bytes of text, and the number of a loop in the template.
const TEXT: &str = "text";
const LOOP: &str = "loop_number";

fn number(arguments: &HashMap<String, Json>, name: &str) -> u64 {
    arguments.get(name).and_then(Json::as_u64).unwrap_or_default()
}

/// Inserts the calls into the template with this name, and registers their functions in `tera`. Refuses a template that
/// calls these functions explicitly.
pub fn limit(tera: &mut Tera, name: &str) -> tera::Result<()> {
    let step = |arguments: &HashMap<String, Json>| {
        steps(1)?;
        let text = number(arguments, TEXT);
        if text > 0 {
            bytes(text)?;
        }
        Ok(Json::from(""))
    };
    tera.register_function(STEP, step);
    tera.register_function(ENTER, |arguments: &HashMap<String, Json>| {
        SPENT.with_borrow_mut(|spent| spent.loops.push((number(arguments, LOOP), spent.open.len())));
        Ok(Json::from(""))
    });
    tera.register_function(TURN, move |arguments: &HashMap<String, Json>| {
        SPENT.with_borrow_mut(|spent| {
            if let Some(place) = spent.close_texts_in(number(arguments, LOOP)) {
                spent.loops.truncate(place + 1);
            }
        });
        step(arguments)
    });
    tera.register_function(LEAVE, |arguments: &HashMap<String, Json>| {
        SPENT.with_borrow_mut(|spent| {
            if let Some(place) = spent.close_texts_in(number(arguments, LOOP)) {
                spent.loops.truncate(place);
            }
        });
        Ok(Json::from(""))
    });
    tera.register_function(OPEN, |_: &HashMap<String, Json>| {
        SPENT.with_borrow_mut(|spent| spent.open.push(0));
        Ok(Json::from(""))
    });
    tera.register_function(CLOSE, |_: &HashMap<String, Json>| {
        SPENT.with_borrow_mut(|spent| {
            spent.open.pop();
        });
        Ok(Json::from(""))
    });
    let made = |value: &Json, _: &HashMap<String, Json>| {
        bytes(size(value))?;
        Ok(value.clone())
    };
    tera.register_filter(MADE, made);
    tera.register_function(MADE, |arguments: &HashMap<String, Json>| {
        let value = arguments.get("value").cloned().unwrap_or_default();
        bytes(size(&value))?;
        Ok(value)
    });
    tera.register_filter(LOOPED, |value: &Json, _: &HashMap<String, Json>| {
        if let Json::String(text) = value {
            within(&TEMPLATE_LOOP_TEXT, text.len() as u64)?;
        }
        Ok(value.clone())
    });
    let grown: [(&str, FilterGrowth); 3] = [
        ("replace", |text, arguments| {
            let found = text.matches(argument(arguments, "from")).count() as u64;
            found.saturating_mul(argument(arguments, "to").len() as u64).saturating_add(text.len() as u64)
        }),
        ("indent", |text, arguments| {
            let prefix = arguments.get("prefix").and_then(Json::as_str).unwrap_or("    ").len() as u64;
            (text.lines().count() as u64).saturating_mul(prefix).saturating_add(text.len() as u64)
        }),
        // A part takes more memory than its letters.
        ("split", |text, arguments| {
            let parts = text.matches(argument(arguments, "pat")).count() as u64;
            parts.saturating_mul(64).saturating_add(text.len() as u64)
        }),
    ];
    for (filter, most) in grown {
        let Some(inner) = tera.filters.get(filter).cloned() else { continue };
        tera.register_filter(filter, move |value: &Json, arguments: &HashMap<String, Json>| {
            if let Json::String(text) = value {
                within_value(most(text, arguments))?;
            }
            inner.filter(value, arguments)
        });
    }
    if let Some(inner) = tera.filters.get("join").cloned() {
        tera.register_filter("join", move |value: &Json, arguments: &HashMap<String, Json>| {
            let count = value.as_array().map_or(0, Vec::len) as u64;
            let between = count.saturating_mul(argument(arguments, "sep").len() as u64);
            within_value(between.saturating_add(size(value)))?;
            inner.filter(value, arguments)
        });
    }
    let Some(template) = tera.templates.get_mut(name) else { return Ok(()) };
    let texts = Texts::of(template);
    let walk = BudgetWalk { texts, loops: Cell::new(0), forbidden: RefCell::new(None) };
    walk.body(&mut template.ast, false);
    for definition in template.macros.values_mut() {
        walk.text_in_memory(&mut definition.body);
        let length = text_length(&definition.body);
        definition.body.insert(0, call(STEP, [(TEXT, length)]));
        definition.args.values_mut().flatten().for_each(|default| walk.expr(default, true));
    }
    template.blocks.values_mut().for_each(|block| walk.body(&mut block.body, false));
    if let Some(name) = walk.forbidden.take() {
        let message = format!("a template has no function or filter `{name}`: names that begin with `{OWN}` are kept");
        return Err(tera::Error::msg(message));
    }
    tera.build_inheritance_chains()
}

/// A call that outputs no text.
fn call(function: &str, numbers: impl IntoIterator<Item = (&'static str, i64)>) -> Node {
    let numbers = numbers.into_iter().map(|(name, value)| (name.to_owned(), Expr::new(ExprVal::Int(value))));
    let args = numbers.collect();
    Node::VariableBlock(
        WS::default(),
        Expr::new(ExprVal::FunctionCall(FunctionCall { name: function.to_owned(), args })),
    )
}

fn filter(name: &str) -> FunctionCall {
    FunctionCall { name: name.to_owned(), args: HashMap::new() }
}

/// Bytes of the text of a body, without the text of nested loops.
fn text_length(body: &[Node]) -> i64 {
    let of = |node: &Node| match node {
        Node::Text(text) | Node::Raw(_, text, _) => text.len() as i64,
        Node::If(condition, _) => {
            let branches = condition.conditions.iter().map(|(_, _, body)| body);
            branches
                .chain(condition.otherwise.iter().map(|(_, body)| body))
                .map(|body| text_length(body))
                .max()
                .unwrap_or(0)
        }
        Node::Block(_, block, _) => text_length(&block.body),
        _ => 0,
    };
    body.iter().map(of).sum()
}

/// Variables that may hold a text that the template created. Variables of the context hold values of products.
struct Texts(BTreeSet<String>);

impl Texts {
    fn of(template: &Template) -> Self {
        let mut texts = Self(BTreeSet::new());
        texts.0.extend(template.macros.values().flat_map(|definition| definition.args.keys().cloned()));
        loop {
            let before = texts.0.len();
            texts.body(&template.ast);
            template.macros.values().for_each(|definition| texts.body(&definition.body));
            if texts.0.len() == before {
                return texts;
            }
        }
    }

    fn body(&mut self, body: &[Node]) {
        for node in body {
            match node {
                Node::Set(_, set) => drop(self.0.insert(set.key.clone())),
                Node::FilterSection(_, section, _) => self.body(&section.body),
                Node::Block(_, block, _) => self.body(&block.body),
                Node::Forloop(_, inner, _) => {
                    if self.may_be(&inner.container) {
                        self.0.insert(inner.value.clone());
                    }
                    self.body(&inner.body);
                    inner.empty_body.iter().for_each(|body| self.body(body));
                }
                Node::If(condition, _) => {
                    condition.conditions.iter().for_each(|(_, _, body)| self.body(body));
                    condition.otherwise.iter().for_each(|(_, body)| self.body(body));
                }
                _ => {}
            }
        }
    }

    /// Whether the container of a loop may be, or contain, such a text.
    fn may_be(&self, container: &Expr) -> bool {
        match &container.val {
            ExprVal::Ident(name) => {
                let root = name.split(['.', '[']).next().unwrap_or_default();
                !container.filters.is_empty() || self.0.contains(root)
            }
            _ => true,
        }
    }
}

/// Inserts calls into nodes and expressions.
struct BudgetWalk {
    texts: Texts,
    /// Number of loops so far.
    loops: Cell<i64>,
    /// A name that the template must not use.
    forbidden: RefCell<Option<String>>,
}

impl BudgetWalk {
    /// Records a function or filter of the template whose name is reserved for the inserted calls.
    fn check(&self, name: &str) {
        if name.starts_with(OWN) {
            self.forbidden.borrow_mut().get_or_insert_with(|| name.to_owned());
        }
    }

    fn body(&self, body: &mut Vec<Node>, is_in_memory: bool) {
        for mut node in std::mem::take(body) {
            let number = self.loops.get();
            self.node(&mut node, is_in_memory);
            if matches!(node, Node::Forloop(..)) {
                body.extend([call(ENTER, [(LOOP, number)]), node, call(LEAVE, [(LOOP, number)])]);
            } else {
                body.push(node);
            }
        }
    }

    fn node(&self, node: &mut Node, is_in_memory: bool) {
        match node {
            Node::VariableBlock(_, expr) => self.expr(expr, is_in_memory),
            Node::Set(_, set) => self.expr(&mut set.value, true),
            Node::FilterSection(_, section, _) => {
                self.check(&section.filter.name);
                section.filter.args.values_mut().for_each(|argument| self.expr(argument, true));
                self.text_in_memory(&mut section.body);
            }
            Node::Block(_, block, _) => self.body(&mut block.body, is_in_memory),
            Node::Forloop(_, inner, _) => {
                let number = self.loops.replace(self.loops.get() + 1);
                let may_be_text = self.texts.may_be(&inner.container);
                self.expr(&mut inner.container, false);
                if may_be_text {
                    inner.container.filters.push(filter(LOOPED));
                }
                let length = if is_in_memory { text_length(&inner.body) } else { 0 };
                self.body(&mut inner.body, is_in_memory);
                inner.body.insert(0, call(TURN, [(TEXT, length), (LOOP, number)]));
                inner.empty_body.iter_mut().for_each(|body| self.body(body, is_in_memory));
            }
            Node::If(condition, _) => {
                for (_, test, body) in &mut condition.conditions {
                    self.expr(test, false);
                    self.body(body, is_in_memory);
                }
                condition.otherwise.iter_mut().for_each(|(_, body)| self.body(body, is_in_memory));
            }
            _ => {}
        }
    }

    /// A body whose text is not written directly to the file.
    fn text_in_memory(&self, body: &mut Vec<Node>) {
        self.body(body, true);
        body.insert(0, call(OPEN, []));
        body.push(call(CLOSE, []));
    }

    /// Counts the intermediate values of an expression, and its result if `is_kept`.
    fn expr(&self, expr: &mut Expr, is_kept: bool) {
        let each = |arguments: &mut HashMap<String, Expr>| arguments.values_mut().for_each(|it| self.expr(it, true));
        let mut is_made = is_kept;
        match &mut expr.val {
            ExprVal::Math(math) => [&mut math.lhs, &mut math.rhs].into_iter().for_each(|it| self.expr(it, false)),
            ExprVal::Logic(logic) => [&mut logic.lhs, &mut logic.rhs].into_iter().for_each(|it| self.expr(it, false)),
            ExprVal::In(inside) => [&mut inside.lhs, &mut inside.rhs].into_iter().for_each(|it| self.expr(it, false)),
            ExprVal::Test(test) => test.args.iter_mut().for_each(|it| self.expr(it, true)),
            ExprVal::MacroCall(call) => each(&mut call.args),
            ExprVal::FunctionCall(call) => {
                self.check(&call.name);
                each(&mut call.args);
            }
            ExprVal::Array(values) => {
                is_made = true;
                values.iter_mut().for_each(|it| self.expr(it, true));
            }
            ExprVal::StringConcat(parts) => {
                is_made = true;
                for part in &mut parts.values {
                    if let ExprVal::FunctionCall(call) = part {
                        self.check(&call.name);
                        each(&mut call.args);
                    }
                }
                join_few(parts);
            }
            _ => {}
        }
        for mut own in std::mem::take(&mut expr.filters) {
            self.check(&own.name);
            each(&mut own.args);
            // Tera does not treat these two as filters: it requires them to be the first or the last one.
            let is_counted = !["default", "safe"].contains(&own.name.as_str());
            expr.filters.push(own);
            if is_counted {
                expr.filters.push(filter(MADE));
            }
            is_made &= !is_counted;
        }
        if is_made {
            expr.filters.push(filter(MADE));
        }
    }
}

/// Joins texts a few at a time, so that each intermediate result is counted before the next join.
fn join_few(parts: &mut StringConcat) {
    while parts.values.len() > JOINED {
        let first: Vec<ExprVal> = parts.values.drain(..JOINED).collect();
        let value = Expr::new(ExprVal::StringConcat(StringConcat { values: first }));
        let args = HashMap::from([("value".to_owned(), value)]);
        parts.values.insert(0, ExprVal::FunctionCall(FunctionCall { name: MADE.to_owned(), args }));
    }
}
