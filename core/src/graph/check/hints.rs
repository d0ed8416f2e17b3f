//! Words for values: what was found, and what to write instead.

use crate::diag::{closest, suggestion};
use crate::graph::read::{Ron, Spanned};
use crate::schema::{Arity, IntRange, Param, Shape, Variant, shown};

/// What stands there, in words.
pub(super) fn found(value: &Ron) -> String {
    match value {
        Ron::Unit => "`()`".into(),
        Ron::Bool(flag) => format!("`{flag}`"),
        Ron::Int(int) => format!("`{int}`"),
        Ron::Float(float) => format!("`{float:?}`"),
        Ron::Char(c) => format!("the character `{c}`"),
        Ron::Text(text) if text.chars().count() <= 40 => format!("the text \"{text}\""),
        Ron::Text(_) => "text".into(),
        Ron::Bytes(_) => "bytes".into(),
        Ron::Range => "a range".into(),
        Ron::Name(name) => format!("`{name}`"),
        Ron::List(items) => format!("a list of {}", items.len()),
        Ron::Map(_) => "a map".into(),
        Ron::Struct { name: Some(name), .. } | Ron::Tuple { name: Some(name), .. } => format!("`{}(..)`", name.value),
        Ron::Struct { .. } => "values with names in parentheses".into(),
        Ron::Tuple { items, .. } if items.len() == 1 => "one value in parentheses".into(),
        Ron::Tuple { items, .. } => format!("{} values in parentheses", items.len()),
        Ron::Broken => "something unreadable".into(),
    }
}

/// What to write instead of a value of the wrong type, if that can be told from the value.
pub(super) fn instead(value: &Ron, shape: &Shape) -> Option<String> {
    if let Shape::Optional(inner) = shape {
        return instead(value, inner);
    }
    Some(match (shape, value) {
        (_, Ron::Tuple { name: Some(name), .. }) if name.value == "Some" => {
            "write the value itself, without `Some`".into()
        }
        (Shape::Number(_), Ron::Tuple { name: Some(name), .. }) if closest(&name.value, ["Keys"]).is_some() => {
            "did you mean `Keys`?".into()
        }
        (Shape::Number(_) | Shape::Integer { .. }, Ron::Tuple { name: None, items }) if items.len() == 1 => {
            "write the number without parentheses".into()
        }
        (Shape::Number(_) | Shape::Integer { .. }, Ron::List(items)) if items.len() == 1 => {
            "write the number without brackets".into()
        }
        (Shape::Number(_), Ron::List(items)) if items.iter().any(|item| matches!(item.value, Ron::Tuple { .. })) => {
            "what changes over frames is written Keys([(1001, 0.0), (1012, 60.0)])".into()
        }
        (Shape::Tuple(items), Ron::Struct { name: None, .. }) => {
            format!("leave the names out: ({})", places(items.len()))
        }
        (Shape::Tuple(items), Ron::List(_)) => format!("use parentheses: ({})", places(items.len())),
        (Shape::Tuple(items), Ron::Tuple { .. }) => format!("write ({})", places(items.len())),
        (Shape::List(_), Ron::Tuple { .. }) => format!("use brackets: {}", example(shape)),
        (Shape::Text(_), Ron::Name(name)) => format!("put it in double quotes: \"{name}\""),
        (Shape::Text(_), Ron::Char(c)) => format!("use double quotes: \"{c}\""),
        (Shape::Choice(variants), Ron::Text(text)) if variants.iter().any(|variant| variant.name == *text) => {
            format!("without quotes: {text}")
        }
        (Shape::Choice(variants), Ron::Text(text)) => of_variants(text, variants)?,
        (Shape::Choice(variants), Ron::Struct { name: Some(name), .. } | Ron::Tuple { name: Some(name), .. })
            if variants.iter().any(|variant| variant.name == name.value && variant.content.is_none()) =>
        {
            format!("without parentheses: {}", name.value)
        }
        (
            Shape::Choice(variants),
            Ron::Name(name)
            | Ron::Struct { name: Some(Spanned { value: name, .. }), .. }
            | Ron::Tuple { name: Some(Spanned { value: name, .. }), .. },
        ) => {
            let variant = variants.iter().find(|variant| variant.name == *name)?;
            format!("write {name}({})", example(variant.content.as_ref()?).trim_matches(['(', ')']))
        }
        (Shape::Port(_), Ron::Name(name)) if name == "None" => {
            "a node must stand here: \"node\" or \"node.port\"".into()
        }
        (Shape::Port(_), Ron::Name(name)) => format!("nodes are named in double quotes: \"{name}\""),
        (Shape::Port(port), Ron::List(_)) if port.arity != Arity::List => "connect one node, without brackets".into(),
        (Shape::Port(port), Ron::Tuple { .. }) if port.arity == Arity::List => "use brackets: [\"a\", \"b\"]".into(),
        (Shape::Port(_), _) => "name the node in double quotes: \"node\" or \"node.port\"".into(),
        (Shape::Integer { range, .. }, Ron::Float(float)) if is_whole_in(*float, range) => format!("write {float}"),
        (Shape::Integer { .. }, Ron::Float(_)) => "give a whole number, without a point".into(),
        (Shape::Number(_) | Shape::Integer { .. }, Ron::Text(text)) if text.parse::<f64>().is_ok() => {
            "a number stands without quotes".into()
        }
        (Shape::Number(_) | Shape::Integer { .. }, Ron::Char(c)) if c.is_ascii_digit() => {
            "a number stands without quotes".into()
        }
        (Shape::Number(_), Ron::Text(_)) => "the values of Keys are numbers; none of them can be linked".into(),
        (Shape::Integer { animatable: false, .. }, Ron::Text(_)) => "this number cannot be linked".into(),
        (Shape::Number(_), Ron::Name(name)) if name != "None" => {
            format!("to link a node, name it in double quotes: \"{name}\"")
        }
        (Shape::Bool, Ron::Name(name)) if closest(name, ["true", "false"]).is_some() => {
            suggestion(name, ["true", "false"])?
        }
        (Shape::Bool, Ron::Text(text)) if ["true", "false"].contains(&text.as_str()) => {
            format!("without quotes: {text}")
        }
        (Shape::Bool, _) => "write true or false".into(),
        _ => return None,
    })
}

/// The closest of the names, or all.
pub(super) fn of_variants(written: &str, variants: &[Variant]) -> Option<String> {
    suggestion(written, variants.iter().map(|variant| variant.name.as_str()))
}

pub(super) fn is_whole_in(float: f64, range: &IntRange) -> bool {
    float.fract() == 0.0 && float.abs() < 1e15 && (range.min..=range.max).contains(&(float as i128))
}

fn places(count: usize) -> String {
    vec![".."; count].join(", ")
}

/// What always helps: leaving the parameter out, where it has a default, or else an example.
pub(super) fn mend(param: &Param) -> String {
    let is_row = matches!(&param.shape, Shape::Tuple(_));
    if !param.required && is_row {
        let default = param.default_as_written();
        return format!("for example {}: {default}, the default", param.name);
    }
    if !param.required && !matches!(param.shape, Shape::Port(_) | Shape::Struct(_)) {
        return format!("left out, `{}` is {}", param.name, param.default_as_written());
    }
    format!("write {}: {}", param.name, example(&param.shape))
}

fn example(shape: &Shape) -> String {
    match shape {
        Shape::Number(range) => shown(range.min.unwrap_or(0.0).max(1.0).min(range.max.unwrap_or(f64::MAX))),
        Shape::Integer { range, .. } => 1.clamp(range.min, range.max).to_string(),
        Shape::Bool => "true".into(),
        Shape::Text(None) => "\"..\"".into(),
        Shape::Text(Some(_)) => "\"folder/name.####.exr\"".into(),
        Shape::Choice(variants) => variants.first().map(|variant| variant.name.clone()).unwrap_or_default(),
        Shape::Tuple(items) => format!("({})", items.iter().map(example).collect::<Vec<_>>().join(", ")),
        Shape::List(item) => format!("[{}, ..]", example(item)),
        Shape::Struct(fields) => {
            let fields = fields.iter().map(|field| format!("{}: {}", field.name, example(&field.shape)));
            format!("({})", fields.collect::<Vec<_>>().join(", "))
        }
        Shape::Optional(_) => "None".into(),
        Shape::Port(port) if port.arity == Arity::List => "[\"node\", ..]".into(),
        Shape::Port(_) => "\"node\"".into(),
    }
}
