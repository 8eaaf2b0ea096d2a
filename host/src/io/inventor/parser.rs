//! Nodes and fields, without knowing what they mean: unknown nodes are read like the others.

use std::collections::HashMap;

use super::super::error::{Fault, Place, Problem, clipped};
use super::lexer::{Lexer, Token};

/// Nodes within nodes; real files stay below thirty. Guards the stack.
pub(super) const MAX_DEPTH: usize = 200;

/// Index of a node in its [`Document`]. Indices and not references, so that a chain of `USE` frees without recursion.
pub(super) type NodeId = usize;

#[derive(Debug)]
pub(super) struct Node<'a> {
    pub(super) kind: &'a str,
    /// Line in which it begins, counted from 1.
    pub(super) line: usize,
    pub(super) fields: Vec<(&'a str, Value<'a>)>,
    /// Nodes that stand directly in this one.
    pub(super) children: Vec<NodeId>,
}

#[derive(Debug)]
pub(super) enum Value<'a> {
    Numbers(Vec<f64>),
    /// Enumerated values, or a list that is neither of numbers nor of nodes.
    Words(Vec<&'a str>),
    Nodes(Vec<NodeId>),
}

#[derive(Debug, Default)]
pub(super) struct Document<'a> {
    pub(super) nodes: Vec<Node<'a>>,
    pub(super) roots: Vec<NodeId>,
    /// Statements that have been passed over and may have carried a surface, with their lines.
    pub(super) skipped: Vec<(&'static str, usize)>,
}

pub(super) fn parse(text: &str) -> Result<Document<'_>, Fault> {
    let mut parser = Parser { lexer: Lexer::new(text), document: Document::default(), names: HashMap::new() };
    loop {
        match parser.lexer.next()? {
            Token::End => return Ok(parser.document),
            Token::Word(word) => {
                if let Some(root) = parser.statement(word, 0)? {
                    parser.document.roots.push(root);
                }
            }
            other => return Err(parser.unexpected("a node", other)),
        }
    }
}

struct Parser<'a> {
    lexer: Lexer<'a>,
    document: Document<'a>,
    names: HashMap<&'a str, NodeId>,
}

impl<'a> Parser<'a> {
    /// What follows a word that is no field's name: a node, perhaps named or named before, or a statement without one.
    fn statement(&mut self, word: &'a str, depth: usize) -> Result<Option<NodeId>, Fault> {
        match word {
            "DEF" => {
                let (name, kind) = (self.word("a name")?, self.word("a node")?);
                let node = self.node(kind, depth)?;
                self.names.insert(name, node);
                Ok(Some(node))
            }
            "USE" => {
                let name = self.word("a name")?;
                let known = self.names.get(name).copied();
                known.map(Some).ok_or_else(|| self.fault(Problem::unknown("name behind USE", name)))
            }
            "PROTO" | "EXTERNPROTO" => {
                self.document.skipped.push(("PROTO", self.lexer.line()));
                self.word("a name")?;
                self.skip_balanced('[')?;
                if word == "PROTO" {
                    self.skip_balanced('{')?;
                } else if self.lexer.peek()? == Token::Mark('[') {
                    self.skip_balanced('[')?;
                } else {
                    self.lexer.next()?;
                }
                Ok(None)
            }
            "ROUTE" => {
                for _ in 0..3 {
                    self.word("'ROUTE a.b TO c.d'")?;
                }
                Ok(None)
            }
            "NULL" => Ok(None),
            kind => self.node(kind, depth).map(Some),
        }
    }

    fn node(&mut self, kind: &'a str, depth: usize) -> Result<NodeId, Fault> {
        if depth >= MAX_DEPTH {
            return Err(self.fault(Problem::TooDeep(MAX_DEPTH)));
        }
        let mut node = Node { kind, line: self.lexer.line(), fields: Vec::new(), children: Vec::new() };
        if kind == "Script" {
            // Its fields are declared as in a PROTO, type before name.
            self.skip_balanced('{')?;
        } else {
            self.mark('{', "'{' behind the kind of a node")?;
            loop {
                match self.lexer.next()? {
                    Token::Mark('}') => break,
                    Token::Word(word) if is_statement(word) || self.lexer.peek()? == Token::Mark('{') => {
                        node.children.extend(self.statement(word, depth + 1)?);
                    }
                    Token::Word(name) => node.fields.extend(self.value(depth)?.map(|value| (name, value))),
                    other => return Err(self.unexpected("a field, a node or '}'", other)),
                }
            }
        }
        self.document.nodes.push(node);
        Ok(self.document.nodes.len() - 1)
    }

    /// The value of a field; `None` for strings.
    fn value(&mut self, depth: usize) -> Result<Option<Value<'a>>, Fault> {
        match self.lexer.next()? {
            Token::Text => Ok(None),
            Token::Mark('[') => self.list(depth),
            Token::Mark('(') => {
                let mut words = Vec::new();
                loop {
                    match self.lexer.next()? {
                        Token::Mark(')') => return Ok(Some(Value::Words(words))),
                        Token::Mark('|') => {}
                        Token::Word(word) => words.push(word),
                        other => return Err(self.unexpected("')'", other)),
                    }
                }
            }
            Token::Word(word) if is_number(word) => {
                let mut numbers = vec![self.number(word)?];
                while let Token::Word(word) = self.lexer.peek()?
                    && is_number(word)
                {
                    self.lexer.next()?;
                    numbers.push(self.number(word)?);
                }
                Ok(Some(Value::Numbers(numbers)))
            }
            Token::Word("IS") => self.word("a name").map(|_| None),
            Token::Word(word) if is_statement(word) || self.lexer.peek()? == Token::Mark('{') => {
                Ok(Some(Value::Nodes(self.statement(word, depth + 1)?.into_iter().collect())))
            }
            Token::Word(word) => {
                let mut words = vec![word];
                while self.lexer.peek()? == Token::Mark('|') {
                    self.lexer.next()?;
                    words.push(self.word("a value behind '|'")?);
                }
                Ok(Some(Value::Words(words)))
            }
            other => Err(self.unexpected("the value of a field", other)),
        }
    }

    fn list(&mut self, depth: usize) -> Result<Option<Value<'a>>, Fault> {
        let (mut numbers, mut words, mut nodes) = (Vec::new(), Vec::new(), Vec::new());
        loop {
            match self.lexer.next()? {
                Token::Mark(']') => break,
                Token::Text => {}
                Token::Word(word) if is_number(word) => numbers.push(self.number(word)?),
                Token::Word(word) if is_statement(word) || self.lexer.peek()? == Token::Mark('{') => {
                    nodes.extend(self.statement(word, depth + 1)?);
                }
                Token::Word(word) if numbers.is_empty() => words.push(word),
                Token::Word(word) => return Err(self.fault(Problem::NotANumber(clipped(word)))),
                other => return Err(self.unexpected("the next item of a list or ']'", other)),
            }
        }
        Ok(Some(match (numbers.is_empty(), nodes.is_empty(), words.is_empty()) {
            (_, false, _) => Value::Nodes(nodes),
            (_, true, false) => Value::Words(words),
            _ => Value::Numbers(numbers),
        }))
    }

    fn number(&self, word: &str) -> Result<f64, Fault> {
        let hexadecimal = word.strip_prefix("0x").or_else(|| word.strip_prefix("0X"));
        let number = match hexadecimal {
            Some(digits) => u64::from_str_radix(digits, 16).ok().map(|number| number as f64),
            None => word.parse().ok(),
        };
        let number = number.ok_or_else(|| self.fault(Problem::NotANumber(clipped(word))))?;
        if number.is_finite() { Ok(number) } else { Err(self.fault(Problem::NotFinite(number))) }
    }

    fn word(&mut self, wanted: &'static str) -> Result<&'a str, Fault> {
        match self.lexer.next()? {
            Token::Word(word) => Ok(word),
            other => Err(self.unexpected(wanted, other)),
        }
    }

    fn mark(&mut self, mark: char, wanted: &'static str) -> Result<(), Fault> {
        match self.lexer.next()? {
            Token::Mark(found) if found == mark => Ok(()),
            other => Err(self.unexpected(wanted, other)),
        }
    }

    /// Passes over a bracket and everything up to the one that closes it.
    fn skip_balanced(&mut self, open: char) -> Result<(), Fault> {
        self.mark(open, if open == '{' { "'{'" } else { "'['" })?;
        let mut depth = 1usize;
        while depth > 0 {
            match self.lexer.next()? {
                Token::Mark('{' | '[') => depth += 1,
                Token::Mark('}' | ']') => depth -= 1,
                Token::End => return Err(self.unexpected("a closing bracket", Token::End)),
                _ => {}
            }
        }
        Ok(())
    }

    fn fault(&self, problem: Problem) -> Fault {
        problem.at_line(self.lexer.line())
    }

    fn unexpected(&self, wanted: &'static str, found: Token<'_>) -> Fault {
        match found {
            Token::End => Problem::EndOfFile(wanted).at(Place::File),
            Token::Word(word) => self.fault(Problem::expected(wanted, word)),
            Token::Mark(mark) => self.fault(Problem::expected(wanted, &mark.to_string())),
            Token::Text => self.fault(Problem::expected(wanted, "a string")),
        }
    }
}

/// Words that begin a statement wherever they stand.
fn is_statement(word: &str) -> bool {
    matches!(word, "DEF" | "USE" | "PROTO" | "EXTERNPROTO" | "ROUTE" | "NULL")
}

fn is_number(word: &str) -> bool {
    let digits = word.trim_start_matches(['+', '-']).trim_start_matches('.');
    digits.starts_with(|c: char| c.is_ascii_digit())
}
