//! Texts made from a tape of numbers, the simplest of them from zeros: what shrinks the tape shrinks the text.

/// Numbers from 0, by which choices are made.
pub struct Dice<'a> {
    tape: std::slice::Iter<'a, u32>,
}

impl<'a> Dice<'a> {
    /// Dice that roll what is on the tape, and 0 behind its end.
    pub fn new(tape: &'a [u32]) -> Self {
        Dice { tape: tape.iter() }
    }

    /// A number below `sides`.
    pub fn below(&mut self, sides: usize) -> usize {
        self.tape.next().map_or(0, |&roll| roll as usize % sides)
    }

    /// One of several.
    pub fn one_of<T: Copy>(&mut self, choices: &[T]) -> T {
        choices[self.below(choices.len())]
    }

    fn many(&mut self, most: usize, choices: &[&str]) -> String {
        (0..self.below(most + 1)).map(|_| self.one_of(choices)).collect()
    }

    /// A text that is RON, or was before it was mutated.
    pub fn text(&mut self) -> String {
        let mut text = match self.below(8) {
            0..3 => self.document(),
            graph => GRAPHS[graph % GRAPHS.len()].to_owned(),
        };
        for _ in 0..self.below(4) {
            self.mutate(&mut text);
        }
        text
    }

    /// A text that is RON, but for literals that may not be.
    pub fn document(&mut self) -> String {
        let mut text = String::new();
        self.blank(&mut text);
        if self.below(6) == 5 {
            text += self.one_of(&[
                "#![enable(implicit_some)]",
                "#![enable(unwrap_newtypes, implicit_some,)]",
                "# ! [ enable ( unwrap_variant_newtypes ) ]",
                "#![type = \"a.b\"]#![schema = r#\"c\"#]",
                "#![enable(explicit_struct_names)]\n#![enable(unwrap_variant_newtypes, implicit_some)]",
                "#![enable()]",
                "#![enable(nothing)]",
                "#![enable(r#implicit_some)]",
                "#![type(\"a\")]",
            ]);
            self.blank(&mut text);
        }
        self.value(&mut text, 5);
        self.blank(&mut text);
        text
    }

    fn blank(&mut self, text: &mut String) {
        if self.below(3) == 2 {
            *text += self.one_of(&[
                " ",
                "\n",
                "\t\r\n",
                "// c\n",
                "/* \" /* ( */ */",
                "\u{85}",
                "\u{200E}",
                "\u{2028}",
                "\x0B\x0C",
                "//",
                "/",
                "/*/ */",
            ]);
        }
    }

    fn value(&mut self, text: &mut String, depth: usize) {
        match self.below(if depth == 0 { 8 } else { 14 }) {
            0 | 1 => *text += &self.number(),
            2 => *text += &self.quoted(),
            3 => *text += &self.name(),
            4 => {
                *text +=
                    self.one_of(&["true", "false", "None", "inf", "-inf", "NaN", "inff32", "NaNf64", "()", "+NaNf32"])
            }
            5 => *text += &self.range(),
            6 => {
                *text += self.one_of(&[
                    "'x'",
                    "'\\''",
                    "'''",
                    "'\\u{e9}'",
                    "'日'",
                    "b'a'",
                    "b'\\xff'",
                    "'\\x41'",
                    "''",
                    "'ab'",
                ])
            }
            7 => {
                *text +=
                    self.one_of(&["Some", "Some(1)", "Some (1 , )", "Some()", "Some(1, 2)", "Some(a: 1)", "Some 1"])
            }
            8 => self.list(text, "[", "]", depth, Self::value),
            9 => self.list(text, "{", "}", depth, Self::entry),
            10 => self.list(text, "(", ")", depth, Self::value),
            11 => self.list(text, "(", ")", depth, Self::field),
            kind => {
                *text += &self.name();
                self.blank(text);
                self.list(text, "(", ")", depth, if kind == 12 { Self::value } else { Self::field });
            }
        }
    }

    fn list(
        &mut self,
        text: &mut String,
        open: &str,
        close: &str,
        depth: usize,
        entry: fn(&mut Self, &mut String, usize),
    ) {
        *text += open;
        self.blank(text);
        for index in (0..self.below(4)).rev() {
            entry(self, text, depth - 1);
            self.blank(text);
            if index > 0 || self.below(2) == 1 {
                *text += ",";
            }
            self.blank(text);
        }
        *text += close;
    }

    fn entry(&mut self, text: &mut String, depth: usize) {
        self.value(text, depth / 2);
        self.colon(text);
        self.value(text, depth);
    }

    fn field(&mut self, text: &mut String, depth: usize) {
        *text += &self.name();
        self.colon(text);
        self.value(text, depth);
    }

    fn colon(&mut self, text: &mut String) {
        self.blank(text);
        *text += ":";
        self.blank(text);
    }

    fn name(&mut self) -> String {
        let names = [
            "a", "b", "r", "br", "Grün", "_", "日本", "r#type", "r#a-b.c", "true", "inf", "Some", "r#1", "a-b", "r#r",
            "e5",
        ];
        self.one_of(&names).to_owned()
    }

    /// A number, or what looks like one.
    pub fn number(&mut self) -> String {
        const WHOLE: [&str; 12] = [
            "1",
            "0",
            "-1",
            "2.5",
            "1_000",
            "0x1F",
            "1e5",
            "-.5e-3",
            "18446744073709551615",
            "9007199254740993",
            "300u8",
            "7i64",
        ];
        const PIECES: [&str; 38] = [
            "1",
            "0",
            "9",
            "255",
            "128",
            "_",
            ".",
            "e",
            "E",
            "+",
            "-",
            "0x",
            "0b",
            "0o",
            "f",
            "A",
            "i8",
            "u8",
            "i16",
            "u16",
            "i32",
            "u32",
            "i64",
            "u64",
            "f32",
            "f64",
            "inf",
            "NaN",
            "18446744073709551615",
            "18446744073709551616",
            "9223372036854775808",
            "1e400",
            "10",
            "-0",
            "b'a'",
            "x",
            "0.1",
            "340282350000000000000000000000000000000",
        ];
        if self.below(4) < 3 { self.one_of(&WHOLE).to_owned() } else { self.many(5, &PIECES) }
    }

    fn range(&mut self) -> String {
        let start = if self.below(2) == 0 { String::new() } else { self.number() };
        let end = match self.below(4) {
            0 => String::new(),
            1 => self.one_of(&["inf", "NaNf32", "b'z'", "x"]).to_owned(),
            _ => self.number(),
        };
        start + self.one_of(&["..", "..=", "..."]) + &end
    }

    /// A text, character or byte string.
    pub fn quoted(&mut self) -> String {
        const PIECES: [&str; 34] = [
            "a",
            " ",
            "é",
            "日",
            "\n",
            "\\n",
            "\\t",
            "\\r",
            "\\0",
            "\\\\",
            "\\\"",
            "\\'",
            "'",
            "\\x41",
            "\\x7f",
            "\\xc3\\xa9",
            "\\xe6\\x97\\xa5",
            "\\xff",
            "\\xc3",
            "\\u{e9}",
            "\\u{1F600}",
            "\\u{d800}",
            "\\u{}",
            "\\u{1234567}",
            "\\u{00041}",
            "\\p",
            "\\\n   ",
            "\\\r\n\t",
            "\\\r",
            "#",
            "\"#",
            "//",
            ",",
            "\r\n",
        ];
        let plain = self.below(3) < 2;
        let inner = self.many(4, if plain { &PIECES[..16] } else { &PIECES });
        let (open, close) =
            self.one_of(&[("\"", "\""), ("r\"", "\""), ("r#\"", "\"#"), ("b\"", "\""), ("br##\"", "\"##"), ("'", "'")]);
        format!("{open}{inner}{close}")
    }

    /// Deletes, inserts or replaces a token or a character.
    fn mutate(&mut self, text: &mut String) {
        const TOKENS: [&str; 52] = [
            "(", ")", "[", "]", "{", "}", ",", ":", "\"", "'", " ", "\n", "=", ";", "#", "/", "//", "/*", "*/", "\\",
            "..", "..=", ".", "-", "+", "_", "1", "1.5", "e5", "u8", "f32", "0x", "inf", "true", "Some", "Some(",
            "None", "r#", "r\"", "r#\"", "b\"", "b'", "x", "x:", "\"k\":", "()", "\u{A0}", "\u{FEFF}", "\u{201C}",
            "日", "\u{200E}", "",
        ];
        let boundaries: Vec<usize> = (0..=text.len()).filter(|&at| text.is_char_boundary(at)).collect();
        let index = self.below(boundaries.len());
        let at = boundaries[index];
        let until = match self.below(3) {
            0 => at,
            1 => boundaries[(index + 1).min(boundaries.len() - 1)],
            _ => token_end(text, at),
        };
        let token = self.one_of(&TOKENS);
        text.replace_range(at..until, token);
    }
}

/// End of the word or the quoted text at `at`, else of one character.
fn token_end(text: &str, at: usize) -> usize {
    let rest = &text[at..];
    let word = rest.len() - rest.trim_start_matches(|c: char| c.is_alphanumeric() || c == '_').len();
    let quoted = rest.strip_prefix('"').and_then(|inner| inner.find('"')).map_or(0, |len| len + 2);
    let character = rest.chars().next().map_or(0, char::len_utf8);
    at + word.max(quoted).max(character)
}

/// Graphs as people write them.
pub const GRAPHS: [&str; 4] = [
    r#"Graph(
    version: 1,
    frames: "1001-1012",                                   // optional; --frames overrides
    nodes: {
        "plate":  Load(path: "plates/sh010.####.exr"),
        "mask":   Threshold(image: "plate", channel: "A", above: 0.5),
        "parts":  Components(mask: "mask"),
        "grid":   Lattice(domain: "plate", cell: 5.0),
        "factor": FeatureFactor(grid: "grid", features: "parts", weight: 10.0, radius: 2.0),
        "bend":   Arc(grid: "grid", angle: 60.0),
        "keep":   FeatureWarp(warp: "bend", factor: "factor", mode: Similarity),
        "warped": Resample(image: "plate", warp: "keep"),
        "out":    Save(image: "warped", path: "out/sh010.####.exr"),
    },
)
"#,
    r##"#![enable(implicit_some, unwrap_newtypes)]
/* a matte /* and its holes */ */
Graph(version: 1, nodes: {
    "ruß": Load(path: r"C:\plates\日本.exr", layers: [r#"a "b""#, "c\u{e9}\x41\n", 'x'], raw: true),
    "fade": Gain(image: "ruß.rgb", gain: Keys([(1001, 0.0), (1_012, 6.0e1), (0x3FF, -.5)]), by: Some(1.5)),
    "mix": Merge(images: ["ruß", "fade"], seed: 18446744073709551615, size: (1920, 1080), none: None,),
})
"##,
    "Graph(\n\tversion: 1,\n\tnodes: {\n\t\t\"a\": Noise(\n\t\t\tsize: (64, 64),\n\t\t\ttable: {\"x\": 1, \"y\": [2, 3]},\n\
     \t\t\tbytes: b\"\\xff\\\"\",\n\t\t\tbounds: (inf, -inf, NaN, 1u8, 2.5f32, 0..10, ..=3),\n\t\t),\n\t\t\"b\": Empty(),\n\t},\n)\n",
    r#"(frames: "1-5", nodes: {"a": Solid(color: (0.5, 0.25, 1e-3, 1.)), "b": Blur(image: "a", radius: +3)}) // end"#,
];
