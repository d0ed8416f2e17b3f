//! All pairs of a run: what is asked of which node, and what that asks of others.

use std::collections::{HashMap, HashSet};
use std::ops::Range;

use crate::graph::plan::Plan;
use crate::node::Request;

/// A node and what is asked of it.
#[derive(Debug)]
pub(crate) struct Pair {
    pub node: usize,
    pub request: Request,
    /// Where the ends of its slots stand in `Pairs::ends`.
    slots: Range<usize>,
    /// Where its inputs stand in `Pairs::inputs`: those of its slots, then those of its links.
    inputs: Range<usize>,
    /// Where its consumers stand in `Pairs::consumers`.
    consumers: Range<usize>,
}

/// The pairs of a run.
#[derive(Default)]
pub(crate) struct Pairs {
    pub list: Vec<Pair>,
    inputs: Vec<usize>,
    ends: Vec<usize>,
    consumers: Vec<usize>,
    /// Per frame of the run, in order, the targets that first come up there.
    pub frames: Vec<(Option<i64>, Vec<usize>)>,
    /// Per target, its place in `frames`.
    pub frame_of_target: HashMap<usize, usize>,
    /// All pairs, each after its inputs; of a node, frame by frame.
    pub order: Vec<usize>,
}

impl Pairs {
    /// Follows every request from the targets to the sources. Works through a list, so a graph may be any depth.
    pub fn expand(plan: &Plan) -> Self {
        let mut pairs = Self::default();
        let mut known: HashMap<(usize, Request), usize> = HashMap::new();
        let mut counted = HashSet::new();
        let frames: Vec<Option<i64>> =
            if plan.frames.is_empty() { vec![None] } else { plan.frames.iter().copied().map(Some).collect() };
        for frame in frames {
            let mut next = pairs.list.len();
            let request = Request::whole(frame);
            let mut targets: Vec<usize> =
                plan.targets.iter().map(|&node| pairs.intern(plan, &mut known, node, &request)).collect();
            targets.retain(|&target| counted.insert(target));
            while next < pairs.list.len() {
                pairs.connect(plan, &mut known, next);
                next += 1;
            }
            if !targets.is_empty() {
                pairs.frame_of_target.extend(targets.iter().map(|&target| (target, pairs.frames.len())));
                pairs.frames.push((frame, targets));
            }
        }
        pairs.find_consumers();
        pairs.order = pairs.in_order(plan);
        pairs
    }

    /// Everything a pair waits for, once per edge.
    pub fn inputs(&self, at: usize) -> &[usize] {
        &self.inputs[self.list[at].inputs.clone()]
    }

    /// Per slot of its node, the pairs that answer the requests made of it.
    pub fn slots(&self, at: usize) -> impl Iterator<Item = &[usize]> {
        let pair = &self.list[at];
        let mut start = pair.inputs.start;
        self.ends[pair.slots.clone()].iter().map(move |&end| &self.inputs[std::mem::replace(&mut start, end)..end])
    }

    /// The pairs that give its links.
    pub fn links(&self, at: usize) -> &[usize] {
        let pair = &self.list[at];
        let start = self.ends[pair.slots.clone()].last().copied().unwrap_or(pair.inputs.start);
        &self.inputs[start..pair.inputs.end]
    }

    /// Pairs that have this one among their inputs, once per edge.
    pub fn consumers(&self, at: usize) -> &[usize] {
        &self.consumers[self.list[at].consumers.clone()]
    }

    fn find_consumers(&mut self) {
        let mut counts = vec![0; self.list.len()];
        self.inputs.iter().for_each(|&input| counts[input] += 1);
        let mut end = 0;
        for (pair, count) in self.list.iter_mut().zip(counts) {
            pair.consumers = end..end;
            end += count;
        }
        self.consumers = vec![0; end];
        for at in 0..self.list.len() {
            for edge in self.list[at].inputs.clone() {
                let consumers = &mut self.list[self.inputs[edge]].consumers;
                self.consumers[consumers.end] = at;
                consumers.end += 1;
            }
        }
    }

    fn in_order(&self, plan: &Plan) -> Vec<usize> {
        let mut rank = vec![0; plan.nodes.len()];
        plan.order.iter().enumerate().for_each(|(at, &node)| rank[node] = at);
        let mut order: Vec<usize> = (0..self.list.len()).collect();
        order.sort_by_key(|&at| (rank[self.list[at].node], self.list[at].request.frame));
        order
    }

    fn intern(
        &mut self,
        plan: &Plan,
        known: &mut HashMap<(usize, Request), usize>,
        node: usize,
        request: &Request,
    ) -> usize {
        let request = plan.canonical(node, request);
        *known.entry((node, request.clone())).or_insert_with(|| {
            self.list.push(Pair { node, request, slots: 0..0, inputs: 0..0, consumers: 0..0 });
            self.list.len() - 1
        })
    }

    fn connect(&mut self, plan: &Plan, known: &mut HashMap<(usize, Request), usize>, at: usize) {
        let node = &plan.nodes[self.list[at].node];
        let request = self.list[at].request.clone();
        let (first_end, first_input) = (self.ends.len(), self.inputs.len());
        for slot in &node.slots {
            for need in node.prototype.needs(&slot.port, &request, &plan.frames) {
                let input = self.intern(plan, known, slot.source, &need);
                self.inputs.push(input);
            }
            self.ends.push(self.inputs.len());
        }
        for &(source, _) in &node.links {
            let input = self.intern(plan, known, source, &request);
            self.inputs.push(input);
        }
        self.list[at].slots = first_end..self.ends.len();
        self.list[at].inputs = first_input..self.inputs.len();
    }
}
