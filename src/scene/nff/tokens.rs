//! The words of an NFF file: separated by white space, comments left out, each with its place.

/// One word of the file.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Token<'a> {
    /// The word itself; never empty, nor white space or `#` in it.
    pub text: &'a str,
    /// Byte offset of its first character.
    pub at: usize,
}

/// The words that are left, in file order. Line ends mean nothing but the end of a comment.
#[derive(Debug, Clone)]
pub(super) struct Tokens<'a> {
    text: &'a str,
    at: usize,
}

impl<'a> Tokens<'a> {
    pub fn new(text: &'a str) -> Self {
        Tokens { text, at: 0 }
    }

    /// The next word, left where it is.
    pub fn peek(&self) -> Option<Token<'a>> {
        self.clone().next()
    }

    fn skip(&mut self, skipped: impl Fn(u8) -> bool) {
        let rest = &self.text.as_bytes()[self.at..];
        self.at += rest.iter().position(|&byte| !skipped(byte)).unwrap_or(rest.len());
    }
}

impl<'a> Iterator for Tokens<'a> {
    type Item = Token<'a>;

    fn next(&mut self) -> Option<Token<'a>> {
        self.skip(is_space);
        while self.text[self.at..].starts_with('#') {
            self.skip(|byte| byte != b'\n' && byte != b'\r');
            self.skip(is_space);
        }
        let at = self.at;
        self.skip(|byte| !is_space(byte) && byte != b'#');
        (self.at > at).then(|| Token { text: &self.text[at..self.at], at })
    }
}

/// White space as C's `isspace` has it, the vertical tab included.
fn is_space(byte: u8) -> bool {
    matches!(byte, b' ' | b'\t'..=b'\r')
}

#[cfg(test)]
mod tests {
    use super::*;

    fn words(text: &str) -> Vec<(&str, usize)> {
        Tokens::new(text).map(|token| (token.text, token.at)).collect()
    }

    #[test]
    fn words_are_split_at_white_space_and_comments() {
        assert_eq!(words("# head\n s 0\t1\r\n2#tail 9\x0b\n3"), [("s", 8), ("0", 10), ("1", 12), ("2", 15), ("3", 25)]);
        assert_eq!(words("é ü"), [("é", 0), ("ü", 3)]);
        assert_eq!(words(" \n# nothing"), []);
        assert_eq!(words(""), []);
    }

    #[test]
    fn peeking_leaves_the_word() {
        let mut tokens = Tokens::new("a b");
        assert_eq!(tokens.peek(), tokens.next());
        assert_eq!((tokens.next().map(|token| token.text), tokens.next()), (Some("b"), None));
    }
}
