//! Action keys: everything that determines a result, and nothing else.

use serde_json::Value as Json;

use crate::graph::plan::PlanNode;
use crate::node::Request;
use crate::schema::{Access, Shape};
use crate::value::{Digest, Hasher};

/// Raised when keys are made differently: old records are then not found.
const FORMAT: i128 = 1;

/// What a pair's result is a function of.
pub(crate) struct Action<'a> {
    pub node: &'a PlanNode,
    pub request: &'a Request,
    /// Parameters at the frame.
    pub params: &'a serde_json::Map<String, Json>,
    /// Per slot, per request made of it: digest of the part the port reads.
    pub inputs: &'a [Vec<Digest>],
    /// Content digest per file that is read, in the order of path parameters.
    pub files: &'a [Digest],
}

impl Action<'_> {
    /// The key. Names and order of nodes, comments and thread counts do not enter; the frame enters only where the
    /// node type itself reads it.
    pub fn key(&self) -> Digest {
        let node_type = &self.node.node_type;
        let mut hasher = Hasher::new("action");
        hasher.int(FORMAT).text(&node_type.name).int(node_type.version.into());
        if node_type.cpu_family {
            hasher.text("cpu").text(cpu_family());
        }
        if node_type.reads_frame {
            hasher.text("frame").int(self.request.frame.map_or(i128::MIN, i128::from));
        }
        hasher.int(self.request.scale.into());
        if let Some(region) = &self.request.region {
            hasher.text("region");
            region.hash_into(&mut hasher);
        }
        let mut files = self.files.iter();
        for param in &node_type.params {
            hasher.text(&param.name);
            match (&param.shape, &self.params[&param.name]) {
                (Shape::Port(_), _) => {
                    let slots = self.node.slots.iter().zip(self.inputs).filter(|(slot, _)| slot.port == param.name);
                    for (_, answers) in slots {
                        hasher.int(answers.len() as i128);
                        answers.iter().for_each(|digest| {
                            hasher.digest(digest);
                        });
                    }
                }
                (Shape::Text(Some(Access::Read)), _) => {
                    hasher.digest(files.next().expect("one digest per path"));
                }
                (_, value) => hash_json(&mut hasher, value),
            }
        }
        hasher.finish()
    }
}

fn hash_json(hasher: &mut Hasher, value: &Json) {
    match value {
        Json::Null => _ = hasher.text("null"),
        Json::Bool(flag) => _ = hasher.text("bool").int((*flag).into()),
        Json::String(text) => _ = hasher.text("text").text(text),
        Json::Number(number) => match (number.as_i64(), number.as_u64()) {
            (Some(whole), _) => _ = hasher.int(whole.into()),
            (_, Some(whole)) => _ = hasher.int(whole.into()),
            _ => _ = hasher.number(number.as_f64().unwrap_or_default()),
        },
        Json::Array(items) => {
            hasher.text("list").int(items.len() as i128);
            items.iter().for_each(|item| hash_json(hasher, item));
        }
        Json::Object(fields) => {
            hasher.text("fields").int(fields.len() as i128);
            for (name, value) in fields {
                hasher.text(name);
                hash_json(hasher, value);
            }
        }
    }
}

/// The processor family as far as numeric libraries tell processors apart.
fn cpu_family() -> &'static str {
    #[cfg(target_arch = "x86_64")]
    {
        if is_x86_feature_detected!("avx512f") && is_x86_feature_detected!("avx512vl") {
            "x86_64 avx512"
        } else if is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma") {
            "x86_64 avx2 fma"
        } else {
            "x86_64"
        }
    }
    #[cfg(not(target_arch = "x86_64"))]
    {
        std::env::consts::ARCH
    }
}
