//! One Rust source: its words and signs, without comments, literals and tests, and what it imports and defines.

use std::collections::BTreeSet;

/// One `use` of one name.
pub(crate) struct Use {
    pub path: Vec<String>,
    /// Name in this file; `*` for all names.
    pub alias: String,
    /// Other files see the name.
    pub public: bool,
}

/// Imports and definitions of one file.
pub(crate) struct Module {
    pub file: String,
    pub path: Vec<String>,
    pub children: Vec<String>,
    pub uses: Vec<Use>,
    /// Paths outside `use`, of two names at least, and single names.
    pub paths: Vec<Vec<String>>,
    /// Names defined outside any braces; within braces.
    pub items: [BTreeSet<String>; 2],
    pub traits: BTreeSet<String>,
    /// Traits that types of this file implement.
    pub implements: BTreeSet<String>,
}

impl Module {
    /// Reads a file, by its path below `src`.
    pub(crate) fn new(file: &str, text: &str) -> Self {
        let path = file.trim_end_matches(".rs").trim_end_matches("/mod").split('/').filter(|s| *s != "lib");
        let mut m = Self {
            file: file.to_owned(),
            path: path.map(str::to_owned).collect(),
            children: vec![],
            uses: vec![],
            paths: vec![],
            items: [BTreeSet::new(), BTreeSet::new()],
            traits: BTreeSet::new(),
            implements: BTreeSet::new(),
        };
        m.collect(&without_tests(&tokens(text)));
        m
    }

    fn collect(&mut self, tokens: &[Token]) {
        let word = |i: usize| tokens.get(i).and_then(Token::word);
        let sign = |i: usize| tokens.get(i).and_then(Token::sign);
        let (mut i, mut braces) = (0usize, 0usize);
        while i < tokens.len() {
            match &tokens[i] {
                Token::Sign('{') => braces += 1,
                Token::Sign('}') => braces = braces.saturating_sub(1),
                Token::Word(w) if w == "use" && sign(i + 1) != Some('<') => {
                    let public = i > 0 && (word(i - 1) == Some("pub") || sign(i - 1) == Some(')'));
                    let end = (i..tokens.len()).find(|k| sign(*k) == Some(';')).unwrap_or(tokens.len());
                    let mut at = i + 1;
                    while at < end {
                        at = self.add_uses(&tokens[..end], at, &[], public);
                    }
                    i = end;
                }
                Token::Word(w) if w == "mod" && sign(i + 2) == Some(';') => {
                    self.children.extend(word(i + 1).map(str::to_owned));
                    i += 2;
                }
                Token::Word(w) => {
                    let name = if w == "macro_rules" { word(i + 2) } else { word(i + 1) };
                    let defines = matches!(
                        w.as_str(),
                        "fn" | "struct"
                            | "enum"
                            | "union"
                            | "trait"
                            | "type"
                            | "const"
                            | "static"
                            | "mod"
                            | "macro_rules"
                    );
                    if let Some(name) = name.filter(|_| defines) {
                        self.items[usize::from(braces > 0)].insert(name.to_owned());
                        if w == "trait" && braces == 0 {
                            self.traits.insert(name.to_owned());
                        }
                    }
                    if w == "for" && i > 0 {
                        self.implements.extend(implemented(&tokens[..i]));
                    }
                    let mut path = vec![w.clone()];
                    while sign(i + 1) == Some(':') && sign(i + 2) == Some(':') && word(i + 3).is_some() {
                        path.extend(word(i + 3).map(str::to_owned));
                        i += 3;
                    }
                    self.paths.push(path);
                }
                Token::Sign(_) => {}
            }
            i += 1;
        }
    }

    /// One tree of a `use` from token `at`; returns the token behind it.
    fn add_uses(&mut self, tokens: &[Token], mut at: usize, prefix: &[String], public: bool) -> usize {
        let mut path = prefix.to_vec();
        let mut alias = None;
        while let Some(token) = tokens.get(at) {
            at += 1;
            match token {
                Token::Word(w) if w == "as" => alias = tokens.get(at).and_then(Token::word).map(str::to_owned),
                Token::Word(w) if alias.is_none() => path.push(w.clone()),
                Token::Sign('*') => alias = Some("*".to_owned()),
                Token::Sign('{') => {
                    while tokens.get(at).is_some_and(|t| t.sign() != Some('}')) {
                        at = self.add_uses(tokens, at, &path, public);
                    }
                    return at + 1 + usize::from(tokens.get(at + 1).is_some_and(|t| t.sign() == Some(',')));
                }
                Token::Sign(',') => break,
                Token::Sign('}') => {
                    at -= 1;
                    break;
                }
                _ => {}
            }
        }
        if path.len() > prefix.len() && path.last().is_some_and(|l| l == "self") {
            path.pop();
        }
        let alias = alias.or_else(|| path.last().cloned());
        self.uses.extend(alias.map(|alias| Use { path, alias, public }));
        at
    }
}

/// The trait in `impl Trait<..> for`, if tokens end so.
fn implemented(tokens: &[Token]) -> Option<String> {
    let mut angles = 0usize;
    for t in tokens.iter().rev() {
        match t {
            Token::Sign('>') => angles += 1,
            Token::Sign('<') => angles = angles.checked_sub(1)?,
            Token::Word(w) if angles == 0 => return Some(w.clone()),
            Token::Sign('\'' | ',') | Token::Word(_) if angles > 0 => {}
            _ => return None,
        }
    }
    None
}

/// Word or sign.
#[derive(Clone, Debug, PartialEq, Eq)]
enum Token {
    /// Keyword, name or number.
    Word(String),
    /// Any other character.
    Sign(char),
}

impl Token {
    /// The word, if it is one.
    fn word(&self) -> Option<&str> {
        match self {
            Self::Word(w) => Some(w),
            Self::Sign(_) => None,
        }
    }

    /// The sign, if it is one.
    fn sign(&self) -> Option<char> {
        match self {
            Self::Word(_) => None,
            Self::Sign(s) => Some(*s),
        }
    }
}

/// Tokens of a source. Lifetimes are a sign and a word, literals of text and characters leave nothing.
fn tokens(text: &str) -> Vec<Token> {
    let c: Vec<char> = text.chars().collect();
    let at = |i: usize| c.get(i).copied().unwrap_or('\0');
    let is_word = |x: char| x.is_alphanumeric() || x == '_';
    let mut out = Vec::new();
    let mut i = 0;
    while i < c.len() {
        match (at(i), at(i + 1)) {
            ('/', '/') => i = (i..c.len()).find(|k| at(*k) == '\n').unwrap_or(c.len()),
            ('/', '*') => {
                let mut open = 1;
                i += 2;
                while open > 0 && i < c.len() {
                    let step = match (at(i), at(i + 1)) {
                        ('/', '*') => 1,
                        ('*', '/') => -1,
                        _ => 0,
                    };
                    open += step;
                    i += if step == 0 { 1 } else { 2 };
                }
            }
            ('"', _) => i = text_end(&c, i),
            ('\'', '\\') => i = (i + 3..c.len()).find(|k| at(*k) == '\'').unwrap_or(c.len()) + 1,
            ('\'', _) if at(i + 2) == '\'' => i += 3,
            (x, _) if is_word(x) => {
                let end = (i..c.len()).find(|k| !is_word(at(*k))).unwrap_or(c.len());
                let word: String = c[i..end].iter().collect();
                let hashes = c[end..].iter().take_while(|x| **x == '#').count();
                if matches!(word.as_str(), "r" | "br") && at(end + hashes) == '"' {
                    i = raw_end(&c, end, hashes);
                } else if matches!(word.as_str(), "b" | "c") && matches!(at(end), '"' | '\'') {
                    i = end;
                } else {
                    out.push(Token::Word(word));
                    i = end;
                }
            }
            (x, _) => {
                if !x.is_whitespace() {
                    out.push(Token::Sign(x));
                }
                i += 1;
            }
        }
    }
    out
}

/// Behind the text literal that starts at `i`.
fn text_end(c: &[char], mut i: usize) -> usize {
    i += 1;
    while let Some(x) = c.get(i) {
        match x {
            '"' => return i + 1,
            '\\' => i += 2,
            _ => i += 1,
        }
    }
    c.len()
}

/// Behind the raw text literal whose `hashes` start at `i`.
fn raw_end(c: &[char], i: usize, hashes: usize) -> usize {
    let closes = |k: usize| c[k] == '"' && c[k + 1..].iter().take_while(|x| **x == '#').count() >= hashes;
    (i + hashes + 1..c.len()).find(|k| closes(*k)).map_or(c.len(), |k| k + 1 + hashes)
}

/// Tokens without the items under `#[cfg(test)]`.
fn without_tests(tokens: &[Token]) -> Vec<Token> {
    let test = self::tokens("#[cfg(test)]");
    let mut out = Vec::new();
    let mut i = 0;
    while i < tokens.len() {
        if tokens[i..].starts_with(&test) {
            i = item_end(tokens, i + test.len());
        } else {
            out.push(tokens[i].clone());
            i += 1;
        }
    }
    out
}

/// Behind the item that starts at `i`: a semicolon or a block, outside of brackets.
fn item_end(tokens: &[Token], mut i: usize) -> usize {
    let mut open = 0usize;
    while let Some(t) = tokens.get(i) {
        i += 1;
        match t.sign() {
            Some('{' | '(' | '[') => open += 1,
            Some('}') if open <= 1 => return i,
            Some('}' | ')' | ']') => open = open.saturating_sub(1),
            Some(';') if open == 0 => return i,
            _ => {}
        }
    }
    i
}
