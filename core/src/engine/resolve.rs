//! What a pair is made of: its parameters at its frame, the files it reads, and the key of all that.

use std::borrow::Cow;
use std::path::PathBuf;

use serde_json::Value as Json;

use super::key::{Key, recipe};
use super::pairs::Pairs;
use super::store::Record;
use crate::diag::Fault;
use crate::graph::plan::{Plan, PlanNode};
use crate::schema::Access;
use crate::value::Digest;

/// Checked parameters by name.
pub(crate) type Params = serde_json::Map<String, Json>;

/// The pairs of a plan, with what is known of them.
pub(crate) struct Resolver<'a, R> {
    pub plan: &'a Plan,
    pub pairs: &'a Pairs,
    /// The record of a pair that is resolved.
    pub record: R,
}

impl<'a, R: Fn(usize) -> &'a Record> Resolver<'a, R> {
    fn node(&self, at: usize) -> &'a PlanNode {
        &self.plan.nodes[self.pairs.list[at].node]
    }

    /// Parameters at the pair's frame.
    pub fn params(&self, at: usize) -> Result<Params, Fault> {
        let (pair, node) = (&self.pairs.list[at], self.node(at));
        let number = |(&from, &(_, output)): (&usize, &(usize, usize))| (self.record)(from).outputs[output].number;
        let links = self.pairs.links(at).iter().zip(&node.links).map(|link| Some(number(link).unwrap_or(f64::NAN)));
        self.plan.params_at(pair.node, pair.request.frame, &links.collect::<Vec<_>>())
    }

    /// The action key; `files` are the digests of the files it reads, in the order of its parameters.
    pub fn key(&self, at: usize, files: &[(PathBuf, Digest)], scratch: &mut Vec<u8>) -> Result<Digest, Fault> {
        let (pair, node) = (&self.pairs.list[at], self.node(at));
        let recipe = self.recipe(at)?;
        let mut key = Key::new(node, &recipe, &pair.request, scratch);
        for (slot, from) in node.slots.iter().zip(self.pairs.slots(at)) {
            key.count(from.len());
            from.iter().for_each(|&from| key.digest(&(self.record)(from).outputs[slot.output].part(&slot.reads)));
        }
        files.iter().for_each(|(_, digest)| key.digest(digest));
        Ok(key.finish())
    }

    fn recipe(&self, at: usize) -> Result<Cow<'a, Digest>, Fault> {
        let node = self.node(at);
        let is_constant = node.params.holes.is_empty() && node.params.paths.iter().all(|(_, a)| *a == Access::Read);
        Ok(match is_constant {
            true => Cow::Borrowed(node.recipe.get_or_init(|| recipe(node, &node.params.json))),
            false => Cow::Owned(recipe(node, &self.params(at)?)),
        })
    }
}
