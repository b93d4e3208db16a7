//! Words and signs of Rust sources, without comments, literals and tests: enough to read imports.

/// Word or sign.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Token {
    /// Keyword, name or number.
    Word(String),
    /// Any other character.
    Sign(char),
}

impl Token {
    /// The word, if it is one.
    pub fn word(&self) -> Option<&str> {
        match self {
            Self::Word(w) => Some(w),
            Self::Sign(_) => None,
        }
    }

    /// The sign, if it is one.
    pub fn sign(&self) -> Option<char> {
        match self {
            Self::Word(_) => None,
            Self::Sign(s) => Some(*s),
        }
    }
}

/// Tokens of a source. Lifetimes are a sign and a word, literals of text and characters leave nothing.
pub fn tokens(text: &str) -> Vec<Token> {
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
pub fn without_tests(tokens: Vec<Token>) -> Vec<Token> {
    let test: Vec<Token> = super::tokens::tokens("#[cfg(test)]");
    let mut out = Vec::new();
    let mut i = 0;
    while i < tokens.len() {
        if tokens[i..].starts_with(&test) {
            i = item_end(&tokens, i + test.len());
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
