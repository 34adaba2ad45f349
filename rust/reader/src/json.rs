//! Checks notes, which are JSON, without keeping what they say.

/// The name of the option that holds an object: what was reported of the source.
const FACTS: &str = "source_facts";
/// Levels of objects and lists within each other.
const DEEPEST: usize = 32;

/// What of a text of JSON has not been read yet. All functions say whether it is as it should be: None if not.
pub struct Json<'a>(pub &'a str);

impl<'a> Json<'a> {
    pub fn new(text: &'a str) -> Self {
        Json(text)
    }

    /// What is left, after white space.
    pub fn rest(&mut self) -> &'a str {
        self.0 = self.0.trim_start_matches([' ', '\t', '\r', '\n']);
        self.0
    }

    pub fn ends(&mut self) -> Option<()> {
        self.rest().is_empty().then_some(())
    }

    pub fn object(&mut self, mut member: impl FnMut(&mut Self, &'a str) -> Option<()>) -> Option<()> {
        self.several(['{', '}'], |json| {
            let key = json.string()?;
            json.token(':')?;
            member(json, key)
        })
    }

    pub fn list(&mut self, item: impl FnMut(&mut Self) -> Option<()>) -> Option<()> {
        self.several(['[', ']'], item)
    }

    /// What is between the quotes, as it is written.
    pub fn string(&mut self) -> Option<&'a str> {
        self.token('"')?;
        let (text, bytes) = (self.0, self.0.as_bytes());
        let mut at = 0;
        loop {
            match *bytes.get(at)? {
                b'"' => break,
                0..0x20 => return None,
                b'\\' => match *bytes.get(at + 1)? {
                    b'"' | b'\\' | b'/' | b'b' | b'f' | b'n' | b'r' | b't' => at += 2,
                    b'u' if bytes.get(at + 2..at + 6)?.iter().all(u8::is_ascii_hexdigit) => at += 6,
                    _ => return None,
                },
                _ => at += 1,
            }
        }
        self.0 = &text[at + 1..];
        Some(&text[..at])
    }

    /// An object of 64 names of at most 100 characters, with numbers, words, and texts of at most 1000 characters; `FACTS` may be
    /// such an object, if asked for.
    pub fn plain(&mut self, with_facts: bool) -> Option<()> {
        let mut count = 0;
        self.object(|json, key| {
            if with_facts && key == FACTS {
                return json.plain(false);
            }
            count += 1;
            let short = if json.rest().starts_with('"') {
                json.string()?.chars().count() <= 1000
            } else {
                json.value(0)?;
                true
            };
            (short && count <= 64 && key.chars().count() <= 100).then_some(())
        })
    }

    /// A value whose objects and lists lie in each other at most so deep.
    pub fn value(&mut self, deepest: usize) -> Option<()> {
        let rest = self.rest();
        match rest.as_bytes().first()? {
            b'{' => deepest.checked_sub(1).and_then(|deepest| self.object(|json, _| json.value(deepest))),
            b'[' => deepest.checked_sub(1).and_then(|deepest| self.list(|json| json.value(deepest))),
            b'"' => self.string().map(|_| ()),
            _ => {
                let end = rest.find([',', '}', ']', ' ', '\t', '\r', '\n']).unwrap_or(rest.len());
                self.0 = &rest[end..];
                (["true", "false", "null"].contains(&&rest[..end]) || is_number(&rest[..end])).then_some(())
            }
        }
    }

    fn token(&mut self, wanted: char) -> Option<()> {
        self.0 = self.rest().strip_prefix(wanted)?;
        Some(())
    }

    fn several(&mut self, [start, end]: [char; 2], mut one: impl FnMut(&mut Self) -> Option<()>) -> Option<()> {
        self.token(start)?;
        if self.token(end).is_some() {
            return Some(());
        }
        loop {
            one(self)?;
            if self.token(',').is_none() {
                return self.token(end);
            }
        }
    }
}

/// Whether a text is a number of JSON, up to 10³⁰⁰.
fn is_number(text: &str) -> bool {
    let unsigned = text.strip_prefix('-').unwrap_or(text);
    let (mantissa, power) = unsigned.split_once(['e', 'E']).map_or((unsigned, None), |(m, p)| (m, Some(p)));
    let (whole, fraction) = mantissa.split_once('.').map_or((mantissa, None), |(w, f)| (w, Some(f)));
    let digits = |text: &str| !text.is_empty() && text.bytes().all(|c| c.is_ascii_digit());
    let fine = digits(whole) && (whole == "0" || !whole.starts_with('0')) && fraction.is_none_or(digits);
    let fine = fine && power.is_none_or(|power| digits(power.strip_prefix(['+', '-']).unwrap_or(power)));
    fine && text.parse().is_ok_and(|number: f64| number.abs() <= 1e300)
}

/// Whether notes are as docs/format.md says: of the names that they may have, `options` and `metrics` are plain.
pub fn notes_are_fine(text: &str) -> bool {
    let mut json = Json::new(text);
    let object = |json: &mut Json| {
        json.object(|json, key| match key {
            "options" => json.plain(true),
            "metrics" => json.plain(false),
            _ => json.value(DEEPEST - 1),
        })?;
        json.ends()
    };
    text.is_empty() || object(&mut json).is_some()
}
