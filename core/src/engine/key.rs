//! Action keys: everything that determines a result, and nothing else.

use serde_json::Value as Json;

use super::resolve::Params;
use crate::graph::plan::PlanNode;
use crate::node::Request;
use crate::schema::{Access, Shape};
use crate::value::{Digest, Hasher};

/// Raised when keys are made differently: old records are then not found.
const FORMAT: i128 = 2;

/// Digest of what a node is without its inputs: type, version, parameters, which ports are connected, and, if its type
/// heeds that, what is wanted of it. Names and order of nodes, comments and thread counts do not enter.
pub(crate) fn recipe(node: &PlanNode, params: &Params) -> Digest {
    let node_type = &node.node_type;
    let mut hasher = Hasher::new("recipe");
    hasher.int(FORMAT).text(&node_type.name).int(node_type.version.into());
    if node_type.cpu_family {
        hasher.text("cpu").text(cpu_family());
    }
    if node_type.heeds_wanted {
        for wanted in &node.wanted {
            match wanted.channels() {
                None => _ = hasher.text("all"),
                Some(names) => {
                    hasher.text("channels").int(names.len() as i128);
                    names.iter().for_each(|name| _ = hasher.text(name));
                }
            }
        }
    }
    for param in &node_type.params {
        hasher.text(&param.name);
        match &param.shape {
            Shape::Port(_) => {
                hasher.int(node.slots.iter().filter(|slot| slot.port == param.name).count() as i128);
            }
            // Its content enters the key.
            Shape::Text(Some(Access::Read)) => {}
            _ => hash_json(&mut hasher, &params[&param.name]),
        }
    }
    hasher.finish()
}

/// The action key of a pair in the making: its node's recipe, what is asked, and digests of what its ports and files
/// give. The frame enters only where the node type itself reads it.
pub(crate) struct Key<'a>(&'a mut Vec<u8>);

impl<'a> Key<'a> {
    /// `scratch` is for speed alone: thousands of keys are made one after another.
    pub fn new(node: &PlanNode, recipe: &Digest, request: &Request, scratch: &'a mut Vec<u8>) -> Self {
        scratch.clear();
        scratch.extend_from_slice(&recipe.0);
        let frame = request.frame.filter(|_| node.node_type.reads_frame);
        scratch.push(u8::from(frame.is_some()) + 2 * u8::from(request.region.is_some()));
        scratch.extend_from_slice(&frame.unwrap_or_default().to_le_bytes());
        scratch.extend_from_slice(&request.scale.to_le_bytes());
        let mut key = Self(scratch);
        if let Some(region) = &request.region {
            let mut hasher = Hasher::new("region");
            region.hash_into(&mut hasher);
            key.digest(&hasher.finish());
        }
        key
    }

    /// How many answers come next.
    pub fn count(&mut self, count: usize) {
        self.0.extend_from_slice(&(count as u64).to_le_bytes());
    }

    /// What an answer or a file is known by.
    pub fn digest(&mut self, digest: &Digest) {
        self.0.extend_from_slice(&digest.0);
    }

    pub fn finish(self) -> Digest {
        Digest::of_bytes(self.0)
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
