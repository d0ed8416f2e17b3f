//! Values of parameters as texts for a graph file, made from their shapes alone.

use serde_json::Value as Json;
use warploom_core::schema::{Access, IntRange, Param, Range, Shape, Variant};

/// A JSON value as a graph file says it.
pub fn text(shape: &Shape, json: &Json) -> String {
    let list = |shapes: &mut dyn Iterator<Item = &Shape>| {
        let items = json.as_array().into_iter().flatten().zip(shapes);
        items.map(|(item, shape)| text(shape, item)).collect::<Vec<_>>().join(", ")
    };
    match shape {
        Shape::Optional(_) if json.is_null() => "None".into(),
        Shape::Optional(inner) => text(inner, json),
        Shape::Tuple(shapes) => format!("({})", list(&mut shapes.iter())),
        Shape::List(item) => format!("[{}]", list(&mut std::iter::repeat(&**item))),
        Shape::Number(_) => number(json.as_f64().expect("a number")),
        Shape::Choice(_) => json.as_str().expect("a choice without content").into(),
        Shape::Struct(fields) => {
            let field = |field: &Param| format!("{}: {}", field.name, text(&field.shape, &json[&field.name]));
            format!("({})", fields.iter().map(field).collect::<Vec<_>>().join(", "))
        }
        _ => json.to_string(),
    }
}

fn number(value: f64) -> String {
    format!("{value:?}")
}

/// A legal value for a parameter that has no default; `which` names the files there are.
pub fn sample(shape: &Shape, which: &str) -> String {
    sample_near(shape, which, 0, WIDE)
}

/// Between numbers of neighbouring seeds.
const WIDE: f64 = 2.0;

/// The same so that lists of lists of points stay within the smallest usual picture.
const NARROW: f64 = 0.0625;

/// The same as [`sample`], with other numbers for other `seed`s.
fn sample_near(shape: &Shape, which: &str, seed: usize, step: f64) -> String {
    let list = |shapes: &mut dyn Iterator<Item = &Shape>| {
        let items = shapes.zip(0..).map(|(shape, item)| sample_near(shape, which, seed * 3 + 7 * item, step));
        items.collect::<Vec<_>>().join(", ")
    };
    match shape {
        Shape::Number(range) => {
            number([3.25 + step * seed as f64, 0.75].into_iter().find(|value| range.holds(*value)).expect("a number"))
        }
        Shape::Integer { range, .. } => (3 + seed as i128).clamp(range.min, range.max).to_string(),
        Shape::Bool => "true".into(),
        // A channel that every colour picture has, or what stands for one.
        Shape::Text(None) => "\"luma\"".into(),
        Shape::Text(Some(Access::Read)) => format!("\"in/{which}.exr\""),
        Shape::Text(Some(Access::Write)) => "\"out/it.exr\"".into(),
        Shape::Choice(variants) => variants[0].name.clone(),
        Shape::Tuple(shapes) => format!("({})", list(&mut shapes.iter())),
        Shape::List(item) => format!("[{}]", list(&mut [&**item; 5].into_iter())),
        Shape::Struct(fields) => {
            let field = |field: &Param| format!("{}: {}", field.name, sample_near(&field.shape, which, seed, step));
            format!("({})", fields.iter().map(field).collect::<Vec<_>>().join(", "))
        }
        Shape::Optional(inner) => sample_near(inner, which, seed, step),
        Shape::Port(_) => unreachable!("ports are connected"),
    }
}

/// Leaves of a parameter's shape, each put into an otherwise usual value.
pub fn each_leaf(param: &Param, leaf: &mut dyn FnMut(&Shape) -> Vec<String>) -> Vec<String> {
    leaves(&param.shape, &param.default, leaf)
}

fn leaves(shape: &Shape, usual: &Json, leaf: &mut dyn FnMut(&Shape) -> Vec<String>) -> Vec<String> {
    let usual_text = |shape: &Shape, json: Option<&Json>| match json {
        Some(json) if !json.is_null() => text(shape, json),
        _ => sample_near(shape, "Plain", 0, NARROW),
    };
    match shape {
        Shape::Optional(inner) => leaves(inner, &Json::Null, leaf),
        Shape::Tuple(shapes) => {
            let whole: Vec<String> =
                shapes.iter().enumerate().map(|(index, shape)| usual_text(shape, usual.get(index))).collect();
            let mut found = Vec::new();
            for (index, shape) in shapes.iter().enumerate() {
                for item in leaves(shape, usual.get(index).unwrap_or(&Json::Null), leaf) {
                    let mut items = whole.clone();
                    items[index] = item;
                    found.push(format!("({})", items.join(", ")));
                }
            }
            found
        }
        Shape::List(item) => {
            let others = [1, 2].map(|seed| sample_near(item, "Plain", seed, NARROW)).join(", ");
            leaves(item, &Json::Null, leaf).into_iter().map(|item| format!("[{others}, {item}]")).collect()
        }
        Shape::Struct(fields) => fields
            .iter()
            .flat_map(|field| {
                let values = leaves(&field.shape, &usual[&field.name], leaf);
                let needed = fields.iter().filter(|other| other.required && other.name != field.name);
                let needed: String =
                    needed.map(|other| format!(", {}: {}", other.name, usual_text(&other.shape, None))).collect();
                values.into_iter().map(|value| format!("({}: {value}{needed})", field.name)).collect::<Vec<_>>()
            })
            .collect(),
        leaf_shape => leaf(leaf_shape),
    }
}

/// Legal values near the usual ones.
pub fn others(shape: &Shape) -> Vec<String> {
    match shape {
        Shape::Number(range) => {
            let usual = legal(range, &[0.5, 2.75, 11.0, -1.5]);
            if usual.is_empty() { legal(range, &[0.05, 1e3]) } else { usual }
        }
        Shape::Integer { range, .. } => whole(range, &[1, 2, 5, 40]),
        Shape::Bool => vec!["true".into(), "false".into()],
        Shape::Text(None) => ["\"luma\"", "\"R\"", "\"A\"", "\"nobody\"", "\"\""].map(str::to_owned).into(),
        Shape::Text(Some(Access::Read)) => {
            ["\"in/Odd.exr\"", "\"in/Copy.exr\"", "\"in/Plain.png\""].map(str::to_owned).into()
        }
        Shape::Text(Some(Access::Write)) => {
            warploom_nodes::io::codec::EXTENSIONS.map(|extension| format!("\"out/other.{extension}\"")).into()
        }
        Shape::Choice(variants) => variants.iter().map(|variant: &Variant| variant.name.clone()).collect(),
        other => unreachable!("{other:?} is not a leaf"),
    }
}

/// Legal values as far out as they go.
pub fn extremes(shape: &Shape) -> Vec<String> {
    match shape {
        Shape::Number(range) => {
            let ends = [range.min.unwrap_or(-1e300), range.max.unwrap_or(1e300)];
            let nearly = range.min.filter(|_| range.above_min).map_or(0.0, |min| min + 1e-300);
            legal(range, &[ends[0], ends[1], nearly, -1e9, 1e9, 0.0])
        }
        Shape::Integer { range, .. } => whole(range, &[range.min, range.max]),
        _ => Vec::new(),
    }
}

/// Values outside the hard range.
pub fn beyond(shape: &Shape) -> Vec<String> {
    match shape {
        Shape::Number(Range { min, max, above_min }) => {
            let below = min.map(|min| if *above_min { min } else { min - (min.abs() * 1e-9).max(1e-9) });
            let above = max.map(|max| max + (max.abs() * 1e-9).max(1e-9));
            below.into_iter().chain(above).map(number).collect()
        }
        // Beyond these, a graph file cannot say a whole number at all.
        Shape::Integer { range, .. } => [range.min - 1, range.max + 1]
            .iter()
            .filter(|value| (i64::MIN.into()..=u64::MAX.into()).contains(*value))
            .map(|value| value.to_string())
            .collect(),
        _ => Vec::new(),
    }
}

fn legal(range: &Range, values: &[f64]) -> Vec<String> {
    values.iter().filter(|value| range.holds(**value)).map(|value| number(*value)).collect()
}

fn whole(range: &IntRange, values: &[i128]) -> Vec<String> {
    let legal = values.iter().filter(|value| (range.min..=range.max).contains(value));
    legal.map(|value| value.to_string()).collect()
}
