//! What went wrong, where, and how to mend it.

use std::fmt;
use std::path::PathBuf;

use annotate_snippets::{AnnotationKind, Group, Level, Renderer, Snippet};
use serde::Serialize;

use crate::node::ErrorClass;

macro_rules! codes {
    ($($(#[$doc:meta])* $variant:ident = $name:literal, exit $exit:literal;)*) => {
        /// What sort of fault it is. Each has a stable name and an exit code.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
        pub enum Code { $($(#[$doc])* $variant,)* }

        impl Code {
            /// The stable name, in reports.
            pub fn name(self) -> &'static str {
                match self { $(Code::$variant => $name,)* }
            }

            /// The exit code of a run that stops at such a fault.
            pub fn exit_code(self) -> u8 {
                match self { $(Code::$variant => $exit,)* }
            }
        }
    };
}

codes! {
    /// The command line is wrong.
    Usage = "usage", exit 2;
    /// The text is not RON.
    Syntax = "syntax", exit 2;
    /// The text is RON, but not a graph.
    Malformed = "malformed", exit 2;
    /// An input names a node that is not there.
    UnknownNode = "unknown_node", exit 2;
    /// Two nodes have one name.
    DuplicateNode = "duplicate_node", exit 2;
    /// An input names an output that its node does not have.
    UnknownOutput = "unknown_output", exit 2;
    /// There is no node type of that name.
    UnknownType = "unknown_type", exit 2;
    /// The node type has no such parameter.
    UnknownParameter = "unknown_parameter", exit 2;
    /// A parameter that has no default is not given.
    MissingParameter = "missing_parameter", exit 2;
    /// A parameter is given twice.
    DuplicateParameter = "duplicate_parameter", exit 2;
    /// A value of the wrong type.
    Mistyped = "mistyped", exit 2;
    /// A value outside its range.
    OutOfRange = "out_of_range", exit 2;
    /// Parameters that a node refuses, most often because they do not go together.
    Conflict = "conflict", exit 2;
    /// NaN or an infinity.
    NotFinite = "not_finite", exit 2;
    /// A connection between kinds that do not fit.
    WrongKind = "wrong_kind", exit 2;
    /// A port that must be connected is not.
    MissingInput = "missing_input", exit 2;
    /// Nodes wait for each other.
    Cycle = "cycle", exit 2;
    /// There is nothing to run.
    NoTarget = "no_target", exit 2;
    /// Two sinks write one file.
    SinkConflict = "sink_conflict", exit 2;
    /// Something changes over frames, and no frames are given.
    NoFrames = "no_frames", exit 2;
    /// Several frames would be written to one file.
    NeedsFramePattern = "needs_frame_pattern", exit 2;
    /// An environment variable is not set.
    MissingVariable = "missing_variable", exit 2;
    /// The file asks for a newer program.
    NewerVersion = "newer_version", exit 2;
    /// The file is too large to be a graph.
    TooLarge = "too_large", exit 2;
    /// A plugin is not there.
    MissingPlugin = "missing_plugin", exit 5;
    /// No target reaches the node.
    Unreached = "unreached", exit 0;
    /// A node has a result that may not be what is expected.
    Doubtful = "doubtful", exit 0;
    /// A file is missing or cannot be read.
    InputUnreadable = "input_unreadable", exit 3;
    /// A file is of a sort that is not supported.
    InputUnsupported = "input_unsupported", exit 4;
    /// A file cannot be written.
    OutputUnwritable = "output_unwritable", exit 6;
    /// A file that is to be verified is another, or is not there.
    OutputDiffers = "output_differs", exit 7;
    /// A node refused its inputs.
    Refused = "refused", exit 7;
    /// A pair needs more memory than the budget allows.
    OverBudget = "over_budget", exit 7;
    /// A recomputed value differs from its record.
    Nondeterministic = "nondeterministic", exit 7;
    /// A node panicked.
    Panic = "panic", exit 70;
    /// The run was stopped.
    Cancelled = "cancelled", exit 75;
}

impl From<ErrorClass> for Code {
    fn from(class: ErrorClass) -> Self {
        match class {
            ErrorClass::Refused => Code::Refused,
            ErrorClass::InputUnreadable => Code::InputUnreadable,
            ErrorClass::InputUnsupported => Code::InputUnsupported,
            ErrorClass::OutputUnwritable => Code::OutputUnwritable,
            ErrorClass::OutputDiffers => Code::OutputDiffers,
            ErrorClass::OverBudget => Code::OverBudget,
            ErrorClass::Cancelled => Code::Cancelled,
        }
    }
}

impl Serialize for Code {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.name())
    }
}

/// A place in a text that a person wrote.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Place {
    /// The graph file, or the flag the text came from.
    pub file: PathBuf,
    /// From 1.
    pub line: usize,
    /// From 1, in characters.
    pub column: usize,
    /// Characters to underline, within the line.
    #[serde(skip)]
    pub length: usize,
    /// The line's text; of a long one the part around the place.
    #[serde(skip)]
    pub text: String,
    /// Characters of the line cut off before `text`.
    #[serde(skip)]
    pub cut: usize,
}

impl Place {
    /// The file's absolute path; a flag stays as it is.
    fn absolute(&self) -> PathBuf {
        let is_flag = self.file.to_string_lossy().starts_with("--");
        std::path::absolute(&self.file).ok().filter(|_| !is_flag).unwrap_or_else(|| self.file.clone())
    }
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}:{}:{}", self.file.display(), self.line, self.column)
    }
}

/// Something wrong (or, as a warning, worth knowing) and how to mend it.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Fault {
    /// What sort of fault.
    pub code: Code,
    /// The node it is about.
    pub node: Option<String>,
    /// The parameter or port it is about.
    pub parameter: Option<String>,
    /// The frame at work.
    pub frame: Option<i64>,
    /// Where it stands.
    #[serde(flatten, serialize_with = "place_or_nulls")]
    pub place: Option<Place>,
    /// What is wrong, with the value and the allowed range.
    pub message: String,
    /// How to mend it.
    pub hint: Option<String>,
}

fn place_or_nulls<S: serde::Serializer>(place: &Option<Place>, serializer: S) -> Result<S::Ok, S::Error> {
    use serde::ser::SerializeMap;
    let mut map = serializer.serialize_map(Some(3))?;
    map.serialize_entry("file", &place.as_ref().map(|place| place.absolute()))?;
    map.serialize_entry("line", &place.as_ref().map(|place| place.line))?;
    map.serialize_entry("column", &place.as_ref().map(|place| place.column))?;
    map.end()
}

impl Fault {
    /// A fault that is nowhere yet.
    pub fn new(code: Code, message: impl Into<String>) -> Self {
        Self { code, node: None, parameter: None, frame: None, place: None, message: message.into(), hint: None }
    }

    /// Names the node.
    pub fn node(mut self, node: &str) -> Self {
        self.node = Some(node.to_owned());
        self
    }

    /// Names the parameter.
    pub fn parameter(mut self, parameter: &str) -> Self {
        self.parameter = Some(parameter.to_owned());
        self
    }

    /// Names the place.
    pub fn place(mut self, place: Option<Place>) -> Self {
        self.place = place;
        self
    }

    /// Says how to mend it.
    pub fn hint(mut self, hint: impl Into<Option<String>>) -> Self {
        self.hint = hint.into();
        self
    }

    /// For a terminal or a log: what, where with the line underlined, and the mend. Codes of a terminal that a file holds
    /// are not passed on.
    pub fn render(&self, warning: bool, color: bool, width: usize) -> String {
        let renderer = if color { Renderer::styled() } else { Renderer::plain() }.term_width(width.max(60));
        let level = if warning { Level::WARNING } else { Level::ERROR };
        let mut title = self.message.clone();
        if self.place.is_none() || self.frame.is_some() {
            let at: Vec<String> = self
                .node
                .iter()
                .map(|node| format!("node \"{node}\""))
                .chain(self.frame.map(|frame| format!("frame {frame}")))
                .collect();
            if !at.is_empty() {
                title = format!("{}: {title}", at.join(", "));
            }
        }
        let mut group = Group::with_title(level.primary_title(seen(&title)).id(self.code.name()));
        // What was cut off a long line is made up for, so that columns are counted right.
        let file = self.place.as_ref().map(|place| seen(&place.file.display().to_string()));
        let line = self.place.as_ref().map(|place| format!("{}{}", " ".repeat(place.cut), seen(&place.text)));
        if let (Some(place), Some(file), Some(line)) = (&self.place, &file, &line) {
            let byte = |chars: usize| line.char_indices().nth(chars).map_or(line.len(), |(at, _)| at);
            let first = place.column - 1;
            let (start, end) = (byte(first), byte(first + place.length.max(1)));
            let label = match (&self.node, &self.parameter) {
                (Some(node), Some(parameter)) => seen(&format!("{node}.{parameter}")),
                _ => String::new(),
            };
            let mark = AnnotationKind::Primary.span(start..end.max(start)).label(label);
            group = group
                .element(Snippet::source(line.as_str()).line_start(place.line).path(file.as_str()).annotation(mark));
        }
        if let Some(hint) = &self.hint {
            group = group.element(Level::HELP.message(seen(hint)));
        }
        renderer.render(&[group])
    }
}

/// A text as it may be shown: signs that a terminal would obey are one sign that says so.
fn seen(text: &str) -> String {
    text.chars().map(|c| if c.is_control() && c != '\n' && c != '\t' { '\u{FFFD}' } else { c }).collect()
}

/// The closest of `names` to what was written, if any is close.
pub fn closest<'a>(written: &str, names: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    // Beyond any name; comparing would take the product of both lengths.
    if written.len() > 200 {
        return None;
    }
    let written = written.to_lowercase();
    let mut best: Option<(f64, &str)> = None;
    for name in names.into_iter().filter(|name| name.len() <= 200) {
        let lower = name.to_lowercase();
        // The one forgives what is left out at the end, the other counts slips wherever they are.
        let beginning = strsim::jaro_winkler(&written, &lower);
        let slips = strsim::normalized_damerau_levenshtein(&written, &lower);
        let score = beginning + slips;
        if beginning.max(slips) > 0.75 && best.is_none_or(|(top, _)| score > top) {
            best = Some((score, name));
        }
    }
    best.map(|(_, name)| name)
}

/// "did you mean `X`?", or the names there are.
pub fn suggestion<'a>(written: &str, names: impl IntoIterator<Item = &'a str> + Clone) -> Option<String> {
    if let Some(name) = closest(written, names.clone()) {
        return Some(format!("did you mean `{name}`?"));
    }
    let all: Vec<&str> = names.into_iter().collect();
    match all.len() {
        0 => None,
        1 => Some(format!("there is only `{}`", all[0])),
        2..=12 => Some(format!("there are {}", all.iter().map(|n| format!("`{n}`")).collect::<Vec<_>>().join(", "))),
        count => Some(format!("there are {count} names, none of them like it")),
    }
}
