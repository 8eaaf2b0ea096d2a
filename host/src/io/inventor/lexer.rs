//! Words, strings and brackets. Commas are white space and `#` begins a comment.

use super::super::error::{Fault, Problem};

#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Token<'a> {
    /// One of `{ } [ ] ( ) |`.
    Mark(char),
    /// A keyword, name, enumerated value or number.
    Word(&'a str),
    /// A string in quotes; what it says never matters here.
    Text,
    /// Nothing more.
    End,
}

#[derive(Debug, Clone)]
pub(super) struct Lexer<'a> {
    rest: &'a str,
    line: usize,
}

impl<'a> Lexer<'a> {
    pub(super) fn new(text: &'a str) -> Self {
        Self { rest: text, line: 1 }
    }

    /// The line of the token that was read last, counted from 1.
    pub(super) fn line(&self) -> usize {
        self.line
    }

    pub(super) fn next(&mut self) -> Result<Token<'a>, Fault> {
        self.skip_blank();
        let Some(first) = self.rest.chars().next() else { return Ok(Token::End) };
        if is_mark(first) {
            self.rest = &self.rest[1..];
            return Ok(Token::Mark(first));
        }
        if first == '"' {
            return self.string();
        }
        let end = self.rest.find(|c| is_mark(c) || is_blank(c) || c == '"' || c == '#');
        let (word, rest) = self.rest.split_at(end.unwrap_or(self.rest.len()));
        self.rest = rest;
        Ok(Token::Word(word))
    }

    /// The next token, which stays.
    pub(super) fn peek(&self) -> Result<Token<'a>, Fault> {
        self.clone().next()
    }

    fn skip_blank(&mut self) {
        loop {
            let trimmed = self.rest.trim_start_matches(is_blank);
            self.pass(self.rest.len() - trimmed.len());
            if !self.rest.starts_with('#') {
                return;
            }
            // The line end stays, to be counted as white space.
            self.rest = &self.rest[self.rest.find('\n').unwrap_or(self.rest.len())..];
        }
    }

    fn pass(&mut self, bytes: usize) {
        let (passed, rest) = self.rest.split_at(bytes);
        self.line += passed.bytes().filter(|&byte| byte == b'\n').count();
        self.rest = rest;
    }

    fn string(&mut self) -> Result<Token<'a>, Fault> {
        let start = self.line;
        let mut escaped = false;
        for (at, byte) in self.rest.bytes().enumerate().skip(1) {
            match byte {
                _ if escaped => escaped = false,
                b'\\' => escaped = true,
                b'"' => {
                    self.pass(at + 1);
                    return Ok(Token::Text);
                }
                _ => {}
            }
        }
        Err(Problem::EndOfFile("the end of a string").at_line(start))
    }
}

fn is_mark(c: char) -> bool {
    matches!(c, '{' | '}' | '[' | ']' | '(' | ')' | '|')
}

fn is_blank(c: char) -> bool {
    c.is_ascii_whitespace() || c == ','
}
