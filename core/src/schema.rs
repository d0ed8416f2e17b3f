//! A node type's parameters, compiled from its JSON Schema.
//!
//! The schema is what a Rust node derives and what a plugin ships; both take this path.

use serde_json::{Map, Value as Json};

use crate::value::Kind;

/// A port or parameter.
#[derive(Clone, Debug, PartialEq)]
pub struct Param {
    /// Its name in a graph file.
    pub name: String,
    /// What it is for.
    pub doc: String,
    /// What it takes.
    pub shape: Shape,
    /// The value it has when it is not given; ports have none.
    pub default: Json,
    /// Whether it must be given.
    pub required: bool,
    /// The unit of its numbers.
    pub unit: Option<String>,
    /// Extensions that a path may have, in lower case; none means any.
    pub extensions: Vec<String>,
}

/// What a parameter takes.
#[derive(Clone, Debug, PartialEq)]
pub enum Shape {
    /// A finite number; may be Keys or a link.
    Number(Range),
    /// A whole number; may be Keys or a link only where `animatable`.
    Integer {
        /// Smallest and largest.
        range: IntRange,
        /// Whether Keys and links are allowed.
        animatable: bool,
    },
    /// `true` or `false`.
    Bool,
    /// Text; a path where it says so.
    Text(Option<Access>),
    /// One of several names, some with content.
    Choice(Vec<Variant>),
    /// A fixed count of values in parentheses.
    Tuple(Vec<Shape>),
    /// Any count of values in brackets.
    List(Box<Shape>),
    /// Named fields in parentheses.
    Struct(Vec<Param>),
    /// The same, or `None`.
    Optional(Box<Shape>),
    /// An input port.
    Port(PortShape),
}

/// Range of a number.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub struct Range {
    /// Least value.
    pub min: Option<f64>,
    /// Greatest value.
    pub max: Option<f64>,
    /// Whether the least value itself is out.
    pub above_min: bool,
}

/// Range of a whole number.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct IntRange {
    /// Least value.
    pub min: i128,
    /// Greatest value.
    pub max: i128,
}

/// What a path parameter is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Access {
    /// The node reads the file.
    Read,
    /// The node writes the file.
    Write,
}

/// One name of a choice.
#[derive(Clone, Debug, PartialEq)]
pub struct Variant {
    /// The name.
    pub name: String,
    /// What it means.
    pub doc: String,
    /// What stands in parentheses after it.
    pub content: Option<Shape>,
}

/// An input port.
#[derive(Clone, Debug, PartialEq)]
pub struct PortShape {
    /// Kinds that may be connected.
    pub kinds: Vec<Kind>,
    /// Whether it takes one, at most one, or a list.
    pub arity: Arity,
    /// Whether only windows are read.
    pub windows_only: bool,
    /// The node type whose Factor it takes, if not any's.
    pub maker: Option<String>,
}

/// How many connections a port takes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Arity {
    /// Exactly one.
    One,
    /// One or none.
    Optional,
    /// A list of at least one.
    List,
}

impl Param {
    /// The default as it would stand in a graph file.
    pub fn default_as_written(&self) -> String {
        as_written(&self.default, &self.shape)
    }
}

/// A value as it would stand in a graph file.
fn as_written(json: &Json, shape: &Shape) -> String {
    let list = |items: &[Json], shapes: &mut dyn Iterator<Item = &Shape>| {
        let items = items.iter().zip(shapes).map(|(item, shape)| as_written(item, shape));
        items.collect::<Vec<_>>().join(", ")
    };
    match (shape, json) {
        (Shape::Optional(_), Json::Null) => "None".into(),
        (Shape::Optional(inner), json) => as_written(json, inner),
        (Shape::Number(_), json) => json.as_f64().map_or(json.to_string(), shown),
        (Shape::Choice(_), Json::String(name)) => name.clone(),
        (Shape::Choice(_), Json::Object(content)) => {
            content.keys().next().map(|name| format!("{name}(..)")).unwrap_or_default()
        }
        (Shape::Struct(params), Json::Object(content)) => {
            let field = |param: &Param| {
                Some(format!("{}: {}", param.name, as_written(content.get(&param.name)?, &param.shape)))
            };
            format!("({})", params.iter().filter_map(field).collect::<Vec<_>>().join(", "))
        }
        (Shape::Tuple(shapes), Json::Array(items)) => format!("({})", list(items, &mut shapes.iter())),
        (Shape::List(shape), Json::Array(items)) => {
            format!("[{}]", list(items, &mut std::iter::repeat_with(|| &**shape)))
        }
        (_, json) => json.to_string(),
    }
}

/// A number as a person writes it: `5`, `0.25`, `1e300`.
pub fn shown(value: f64) -> String {
    let text = format!("{value:?}");
    text.strip_suffix(".0").map_or(text.clone(), str::to_owned)
}

impl Range {
    /// Whether `value` lies in it.
    pub fn holds(&self, value: f64) -> bool {
        self.min.is_none_or(|min| if self.above_min { value > min } else { value >= min })
            && self.max.is_none_or(|max| value <= max)
    }
}

impl std::fmt::Display for Range {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match (self.min.map(shown), self.max.map(shown), self.above_min) {
            (None, None, _) => f.write_str("any finite number"),
            (Some(min), None, false) => write!(f, "at least {min}"),
            (Some(min), None, true) => write!(f, "more than {min}"),
            (None, Some(max), _) => write!(f, "at most {max}"),
            (Some(min), Some(max), false) => write!(f, "{min} to {max}"),
            (Some(min), Some(max), true) => write!(f, "more than {min}, at most {max}"),
        }
    }
}

impl std::fmt::Display for IntRange {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        // The limits of the type itself say nothing to a person.
        let min = Some(self.min).filter(|&min| min > i64::MIN.into());
        let max = Some(self.max).filter(|&max| max < i64::MAX.into());
        match (min, max) {
            (None, None) => f.write_str("a whole number"),
            (Some(min), None) => write!(f, "a whole number, at least {min}"),
            (None, Some(max)) => write!(f, "a whole number, at most {max}"),
            (Some(min), Some(max)) => write!(f, "a whole number from {min} to {max}"),
        }
    }
}

/// Compiles the properties of a node type's schema; `defaults` is the type's default value as JSON.
///
/// The error says which property has a schema that no parameter can have; it is the author's to mend.
pub fn params(schema: &Json, defaults: &Json) -> Result<Vec<Param>, String> {
    let empty = Map::new();
    let properties = schema.get("properties").and_then(Json::as_object).unwrap_or(&empty);
    properties
        .iter()
        .map(|(name, property)| {
            let shape = shape(property).map_err(|message| format!("{name}: {message}"))?;
            if !matches!(shape, Shape::Text(_)) && property.to_string().contains("\"x-path\"") {
                return Err(format!("{name}: a path stands for itself, not within another parameter"));
            }
            let required = match &shape {
                Shape::Port(port) => port.arity != Arity::Optional,
                _ => property.get("x-required") == Some(&Json::Bool(true)),
            };
            Ok(Param {
                name: name.clone(),
                doc: text(property, "description"),
                default: defaults.get(name).cloned().unwrap_or(Json::Null),
                required,
                unit: property.get("x-unit").and_then(Json::as_str).map(str::to_owned),
                extensions: strings(property, "x-extensions"),
                shape,
            })
        })
        .collect()
}

fn strings(schema: &Json, key: &str) -> Vec<String> {
    let items = schema.get(key).and_then(Json::as_array).into_iter().flatten();
    items.filter_map(|item| Some(item.as_str()?.to_owned())).collect()
}

fn text(schema: &Json, key: &str) -> String {
    schema.get(key).and_then(Json::as_str).unwrap_or_default().to_owned()
}

fn shape(schema: &Json) -> Result<Shape, String> {
    if let Some(kinds) = schema.get("x-port") {
        return port(schema, kinds).map(Shape::Port);
    }
    if let Some(variants) = schema.get("oneOf").and_then(Json::as_array) {
        return choice(variants).map(Shape::Choice);
    }
    if let Some(names) = schema.get("enum").and_then(Json::as_array) {
        return choice(names).map(Shape::Choice);
    }
    if let Some(options) = schema.get("anyOf").and_then(Json::as_array) {
        let some: Vec<&Json> = options.iter().filter(|option| option.get("type") != Some(&"null".into())).collect();
        return match some[..] {
            [only] => Ok(Shape::Optional(Box::new(shape(only)?))),
            _ => Err("of several alternatives, only one or none can be told apart".into()),
        };
    }
    match schema.get("type") {
        Some(Json::String(kind)) => plain(kind, schema),
        Some(Json::Array(kinds)) => match &kinds[..] {
            [Json::String(kind), Json::String(null)] if null == "null" => {
                Ok(Shape::Optional(Box::new(plain(kind, schema)?)))
            }
            _ => Err("a parameter has one type".into()),
        },
        _ => Err("it has no type".into()),
    }
}

/// Constraints of JSON Schema that no check here keeps.
const UNKEPT: [&str; 5] = ["exclusiveMaximum", "multipleOf", "pattern", "minLength", "maxLength"];

fn plain(kind: &str, schema: &Json) -> Result<Shape, String> {
    let unkept = UNKEPT.iter().find(|name| schema.get(**name).is_some());
    if let Some(name) = unkept.or(["exclusiveMinimum"].iter().find(|n| kind == "integer" && schema.get(**n).is_some()))
    {
        return Err(format!("the constraint {name} is not kept"));
    }
    let number = |key: &str| schema.get(key).and_then(Json::as_f64);
    Ok(match kind {
        "number" => {
            let above = number("exclusiveMinimum");
            let min = above.or(number("minimum"));
            Shape::Number(Range { min, max: number("maximum"), above_min: above.is_some() })
        }
        "integer" => {
            let (least, greatest) = integer_limits(schema.get("format").and_then(Json::as_str));
            let min = number("minimum").map_or(least, |min| (min as i128).max(least));
            let max = number("maximum").map_or(greatest, |max| (max as i128).min(greatest));
            let animatable = schema.get("x-animatable") == Some(&Json::Bool(true));
            Shape::Integer { range: IntRange { min, max }, animatable }
        }
        "boolean" => Shape::Bool,
        "string" => Shape::Text(match schema.get("x-path").and_then(Json::as_str) {
            Some("read") => Some(Access::Read),
            Some("write") => Some(Access::Write),
            _ => None,
        }),
        "object" => Shape::Struct(params(schema, schema.get("default").unwrap_or(&Json::Null))?),
        "array" => return array(schema),
        other => return Err(format!("no parameter can be of type {other}")),
    })
}

fn array(schema: &Json) -> Result<Shape, String> {
    if let Some(items) = schema.get("prefixItems").and_then(Json::as_array) {
        return Ok(Shape::Tuple(items.iter().map(shape).collect::<Result<_, _>>()?));
    }
    let items = schema.get("items").ok_or("a list needs `items`")?;
    if let Some(kinds) = items.get("x-port") {
        return port(items, kinds).map(|port| Shape::Port(PortShape { arity: Arity::List, ..port }));
    }
    let item = shape(items)?;
    let count = |key: &str| schema.get(key).and_then(Json::as_u64);
    match (count("minItems"), count("maxItems")) {
        (Some(min), Some(max)) if min == max => Ok(Shape::Tuple(vec![item; min as usize])),
        _ => Ok(Shape::List(Box::new(item))),
    }
}

fn port(schema: &Json, kinds: &Json) -> Result<PortShape, String> {
    let names = kinds.as_array().ok_or("x-port is a list of kinds")?;
    let kinds: Vec<Kind> = names
        .iter()
        .map(|name| {
            let name = name.as_str().ok_or("x-port is a list of kinds")?;
            Kind::from_name(name).ok_or_else(|| format!("there is no kind {name}"))
        })
        .collect::<Result<_, String>>()?;
    let arity = if schema.get("type").is_some_and(Json::is_array) { Arity::Optional } else { Arity::One };
    let windows_only = schema.get("x-reads").and_then(Json::as_str) == Some("windows");
    let maker = schema.get("x-maker").and_then(Json::as_str).map(str::to_owned);
    Ok(PortShape { kinds, arity, windows_only, maker })
}

fn choice(variants: &[Json]) -> Result<Vec<Variant>, String> {
    let mut found = Vec::new();
    for variant in variants {
        let doc = text(variant, "description");
        if let Some(name) = variant.as_str().or_else(|| variant.get("const")?.as_str()) {
            found.push(Variant { name: name.to_owned(), doc, content: None });
        } else if let Some(names) = variant.get("enum").and_then(Json::as_array) {
            found.extend(choice(names)?);
        } else if let Some((name, content)) = variant.get("properties").and_then(|p| p.as_object()?.iter().next()) {
            found.push(Variant { name: name.clone(), doc, content: Some(shape(content)?) });
        } else {
            return Err("a choice is between names".into());
        }
    }
    Ok(found)
}

fn integer_limits(format: Option<&str>) -> (i128, i128) {
    match format {
        Some("uint8") => (0, u8::MAX.into()),
        Some("uint16") => (0, u16::MAX.into()),
        Some("uint32") => (0, u32::MAX.into()),
        Some("uint64" | "uint") => (0, u64::MAX.into()),
        Some("int8") => (i8::MIN.into(), i8::MAX.into()),
        Some("int16") => (i16::MIN.into(), i16::MAX.into()),
        Some("int32") => (i32::MIN.into(), i32::MAX.into()),
        _ => (i64::MIN.into(), i64::MAX.into()),
    }
}

impl Shape {
    /// What it takes, in words; `unit` as declared beside it.
    pub fn describe(&self, unit: Option<&str>) -> String {
        let behind = unit.map(|unit| format!(" {unit}")).unwrap_or_default();
        let counted_in = unit.map(|unit| format!(" in {unit}")).unwrap_or_default();
        match self {
            Shape::Number(range) if *range == Range::default() => format!("a number{counted_in}"),
            Shape::Number(range @ Range { min: Some(_), max: Some(_), above_min: false }) => {
                format!("a number from {range}{behind}")
            }
            Shape::Number(range) => format!("a number, {range}{behind}"),
            Shape::Integer { range, .. } if range.to_string() == "a whole number" => format!("{range}{counted_in}"),
            Shape::Integer { range, .. } => format!("{range}{behind}"),
            Shape::Bool => "`true` or `false`".into(),
            Shape::Text(None) => "text in double quotes".into(),
            Shape::Text(Some(_)) => "a path in double quotes".into(),
            Shape::Choice(variants) => {
                let names: Vec<String> = variants.iter().map(|variant| format!("`{}`", variant.name)).collect();
                format!("one of {}", names.join(", "))
            }
            Shape::Tuple(items) => {
                let items: Vec<String> = items.iter().map(|item| item.describe(unit)).collect();
                match &items[..] {
                    [first, rest @ ..] if rest.iter().all(|item| item == first) => {
                        format!("{} values in parentheses, each {first}", items.len())
                    }
                    _ => format!("({})", items.join("; ")),
                }
            }
            Shape::List(item) => format!("a list in brackets, each item {}", item.describe(unit)),
            Shape::Struct(fields) => {
                let names: Vec<&str> = fields.iter().map(|field| field.name.as_str()).collect();
                format!("fields in parentheses: {}", names.join(", "))
            }
            Shape::Optional(inner) => format!("{}, or `None`", inner.describe(unit)),
            Shape::Port(port) => port.describe(),
        }
    }
}

impl PortShape {
    /// Whether a value of this kind may be connected, made by a node of type `maker`.
    pub fn takes(&self, kind: Kind, maker: Option<&str>) -> bool {
        self.kinds.contains(&kind) && (self.maker.is_none() || self.maker.as_deref() == maker)
    }

    /// A port for one connection of a kind.
    pub fn of(kind: Kind) -> Self {
        Self { kinds: vec![kind], arity: Arity::One, windows_only: false, maker: None }
    }

    /// What may be connected, in words.
    pub fn describe(&self) -> String {
        let names: Vec<&str> = self.kinds.iter().map(|kind| kind.name()).collect();
        let kinds = match &names[..] {
            _ if self.kinds.len() == Kind::OWN.len() => "any kind".to_owned(),
            [first @ .., last] if !first.is_empty() => format!("{} or {last}", first.join(", ")),
            _ => names.concat(),
        };
        let kinds = self.maker.as_ref().map_or(kinds, |maker| format!("the Factor of a {maker}"));
        match self.arity {
            Arity::List => format!("a list of nodes, each giving {kinds}"),
            _ => format!("a node that gives {kinds}"),
        }
    }
}
